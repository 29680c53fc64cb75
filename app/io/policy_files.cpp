// SPDX-License-Identifier: Apache-2.0
#include "app/io/policy_files.h"

#include <utility>

#include <fmt/format.h>

#include "app/io/json_text.h"
#include "app/io/policy_json.h"
#include "dynamics/models/saved_model_json.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

using Eigen::Index;
using nlohmann::json;
using policy::Sensing;
using policy::StateLayout;

constexpr const char* kPolicySchema = "kinescope.policy";
constexpr const char* kStateSchema = "kinescope.policy_state";
constexpr int kSchemaVersion = 1;
constexpr const char* kBeginAgain = "begin again with --force, or in another folder";

json document_of(const std::filesystem::path& path, const char* schema, const JsonReader& read) {
  json document;
  try {
    document = json::parse(read_text_file(path));
  } catch (const json::exception&) {
    throw read.wrong("is no JSON");
  }
  if (read.word(document, "schema") != schema ||
      read.at(document, "schema_version") != json(kSchemaVersion)) {
    throw read.wrong(fmt::format("is no {} of version {}", schema, kSchemaVersion));
  }
  return document;
}

json sensing_json(const policy::SensingOptions& sensing) {
  return {{"measured", sensing.sensing == Sensing::kFullState ? "full" : "positions"},
          {"noise_sigma", list_json(sensing.noise_sigma)},
          {"position_cutoff_hz", sensing.position_cutoff_hz},
          {"speed_cutoff_hz", sensing.speed_cutoff_hz}};
}

policy::SensingOptions sensing_of(const json& object, const JsonReader& read) {
  policy::SensingOptions out;
  const std::string word = read.word(object, "measured");
  if (word != "full" && word != "positions") throw read.wrong("'measured' is neither");
  out.sensing = word == "full" ? Sensing::kFullState : Sensing::kPositionsOnly;
  out.noise_sigma = read.vector(object, "noise_sigma");
  out.position_cutoff_hz = read.number_at(object, "position_cutoff_hz");
  out.speed_cutoff_hz = read.number_at(object, "speed_cutoff_hz");
  return out;
}

StateLayout layout_of(const json& object, const JsonReader& read) {
  StateLayout out;
  for (const json& position : read.array(object, "positions")) {
    out.positions.push_back(read.word(position, "name"));
    out.is_angle.push_back(read.flag(position, "angle"));
  }
  const json& inputs = read.array(object, "inputs");
  out.input_limit.resize(std::ssize(inputs));
  for (const json& input : inputs) {
    out.input_limit[std::ssize(out.inputs)] = read.number_at(input, "limit");
    out.inputs.push_back(read.word(input, "name"));
  }
  out.step_s = read.number_at(object, "step_s");
  return out;
}

json record_json(const policy::TrialRecord& record) {
  json out{{"promised", record.promised},
           {"promised_sigma", record.promised_sigma},
           {"paid", record.paid},
           {"paid_truth", record.paid_truth ? json(*record.paid_truth) : json()},
           {"search_steps", record.search_steps},
           {"search", word_of(record.search)},
           {"samples", json::array()}};
  for (const Index count : record.samples) out["samples"].push_back(count);
  return out;
}

policy::TrialRecord record_of(const json& object, const JsonReader& read) {
  policy::TrialRecord out;
  out.promised = read.number_at(object, "promised");
  out.promised_sigma = read.number_at(object, "promised_sigma");
  out.paid = read.number_at(object, "paid");
  if (!read.at(object, "paid_truth").is_null()) {
    out.paid_truth = read.number_at(object, "paid_truth");
  }
  out.search_steps = read.integer(read.at(object, "search_steps"), "search_steps");
  out.search = search_status_of(read.word(object, "search"), read);
  for (const int count : read.integers(object, "samples")) out.samples.push_back(count);
  return out;
}

json state_json(const policy::LearnerState& state) {
  json out{{"seed", state.seed},
           {"trials", json::array()},
           {"records", json::array()},
           {"policies", json::array()},
           {"model", state.model ? velocity_model_json(*state.model) : json()},
           {"model_trials", state.model_trials},
           {"starts", json::array()},
           {"search", state.search ? search_json(*state.search) : json()}};
  for (const policy::SearchState& start : state.starts) out["starts"].push_back(search_json(start));
  for (const policy::Trial& trial : state.trials) out["trials"].push_back(trial_json(trial));
  for (const policy::TrialRecord& record : state.records) {
    out["records"].push_back(record_json(record));
  }
  for (const policy::RbfPolicy& policy : state.policies) {
    out["policies"].push_back(rbf_policy_json(policy));
  }
  return out;
}

policy::LearnerState state_of(const json& object, const StateLayout& layout,
                              std::shared_ptr<const policy::PhysicsFeatures> physics,
                              const JsonReader& read) {
  policy::LearnerState out;
  out.seed = seed_of(object, read);
  for (const json& trial : read.array(object, "trials")) {
    out.trials.push_back(trial_of(trial, layout, read));
  }
  for (const json& record : read.array(object, "records")) {
    out.records.push_back(record_of(record, read));
  }
  for (const json& policy : read.array(object, "policies")) {
    out.policies.push_back(rbf_policy_of(policy, layout, read));
  }
  if (out.policies.size() != out.records.size() || out.trials.size() < out.records.size()) {
    throw read.wrong("'policies', 'records' and 'trials' do not fit each other");
  }
  out.model_trials = read.integer(read.at(object, "model_trials"), "model_trials");
  const json& model = read.at(object, "model");
  if (!model.is_null()) out.model = velocity_model_of(model, layout, std::move(physics), read);
  for (const json& start : read.array(object, "starts")) {
    out.starts.push_back(search_of(start, layout, read));
  }
  const json& search = read.at(object, "search");
  if (!search.is_null()) out.search = search_of(search, layout, read);
  return out;
}

json band_json(const std::optional<policy::ParticleBand>& band) {
  if (!band) return nullptr;
  return {{"lower", matrix_json(band->lower)},
          {"median", matrix_json(band->median)},
          {"upper", matrix_json(band->upper)}};
}

std::optional<policy::ParticleBand> band_of(const json& value, const StateLayout& layout,
                                            const JsonReader& read) {
  if (value.is_null()) return std::nullopt;
  const Index count = layout.position_count();
  policy::ParticleBand out{read.matrix(value, "lower", count), read.matrix(value, "median", count),
                           read.matrix(value, "upper", count)};
  if (out.median.rows() != out.lower.rows() || out.upper.rows() != out.lower.rows()) {
    throw read.wrong("a band whose curves are of different lengths");
  }
  return out;
}

void add_names(std::string& head, const StateLayout& layout, const char* after) {
  for (const char* speed : {"", "_speed"}) {
    for (const std::string& name : layout.positions) {
      head += fmt::format(",{}{}{}", name, speed, after);
    }
  }
}

void add_row(std::string& out, const Eigen::MatrixXd& values, Index row, Index columns) {
  for (Index c = 0; c < columns; ++c) {
    out += row < values.rows() ? fmt::format(",{:.17g}", values(row, c)) : ",";
  }
}

}  // namespace

std::string policy_file_text(const PolicyFile& file) {
  const json document{{"schema", kPolicySchema},
                      {"schema_version", kSchemaVersion},
                      {"version", file.version},
                      {"system", file.system},
                      {"layout", layout_json(file.layout)},
                      {"sensing", sensing_json(file.sensing)},
                      {"features", policy::feature_names(file.layout)},
                      {"policy", rbf_policy_json(file.policy)},
                      {"trial", file.trial},
                      {"promised", file.promised},
                      {"paid", file.paid}};
  return json_text(document);
}

PolicyFile read_policy_file(const std::filesystem::path& path) {
  const JsonReader read(path, "give a policy.json of kinescope policy");
  const json document = document_of(path, kPolicySchema, read);
  PolicyFile out;
  out.version = read.word(document, "version");
  out.system = read.word(document, "system");
  out.layout = layout_of(read.at(document, "layout"), read);
  policy::check_layout(out.layout);
  out.sensing = sensing_of(read.at(document, "sensing"), read);
  policy::check_sensing(out.sensing, out.layout);
  out.policy = rbf_policy_of(read.at(document, "policy"), out.layout, read);
  policy::check_policy(out.policy, out.layout);
  out.trial = read.integer(read.at(document, "trial"), "trial");
  out.promised = read.number_at(document, "promised");
  out.paid = read.number_at(document, "paid");
  return out;
}

std::string policy_state_text(const PolicyStateFile& file) {
  json bands = json::array();
  for (const auto& band : file.bands) bands.push_back(band_json(band));
  const json document{{"schema", kStateSchema},          {"schema_version", kSchemaVersion},
                      {"version", file.version},         {"request", file.request},
                      {"state", state_json(file.state)}, {"bands", std::move(bands)}};
  return json_text(document, -1);
}

json read_policy_request(const std::filesystem::path& path) {
  const JsonReader read(path, kBeginAgain);
  const json document = document_of(path, kStateSchema, read);
  const json& request = read.at(document, "request");
  if (!request.is_object()) throw read.wrong("'request' is no object");
  return request;
}

PolicyStateFile read_policy_state(const std::filesystem::path& path, const StateLayout& layout,
                                  std::shared_ptr<const policy::PhysicsFeatures> physics) {
  const JsonReader read(path, kBeginAgain);
  const json document = document_of(path, kStateSchema, read);
  PolicyStateFile out;
  out.version = read.word(document, "version");
  out.request = read.at(document, "request");
  out.state = state_of(read.at(document, "state"), layout, std::move(physics), read);
  for (const json& band : read.array(document, "bands")) {
    out.bands.push_back(band_of(band, layout, read));
  }
  if (out.bands.size() != out.state.trials.size()) throw read.wrong("'bands' is not one a trial");
  return out;
}

std::string velocity_model_text(const policy::VelocityModel& model, const std::string& version,
                                const std::string& system, int trials) {
  std::vector<std::string> columns = policy::feature_names(model.layout);
  columns.insert(columns.end(), model.layout.inputs.begin(), model.layout.inputs.end());
  const json document{{"schema", "kinescope.velocity_model"},
                      {"schema_version", kSchemaVersion},
                      {"version", version},
                      {"system", system},
                      {"layout", layout_json(model.layout)},
                      {"columns", columns},
                      {"trials", trials},
                      {"model", velocity_model_json(model)}};
  return json_text(document);
}

std::string trial_csv(const policy::Trial& trial, const StateLayout& layout,
                      const std::optional<policy::ParticleBand>& band) {
  std::string out = "t";
  add_names(out, layout, "");
  for (const std::string& name : layout.inputs) out += "," + name;
  const bool smoothed = trial.smoothed.size() > 0 && trial.smoothed != trial.seen;
  if (smoothed) add_names(out, layout, "_smoothed");
  if (trial.truth.size() > 0) add_names(out, layout, "_true");
  std::vector<const Eigen::MatrixXd*> curves;
  if (band) curves = {&band->lower, &band->median, &band->upper};
  const char* const quantiles[] = {"_p05", "_p50", "_p95"};
  for (std::size_t c = 0; c < curves.size(); ++c) {
    for (const std::string& name : layout.positions) out += "," + name + quantiles[c];
  }
  out += "\n";
  for (Index k = 0; k < trial.seen.rows(); ++k) {
    out += fmt::format("{:.9g}", static_cast<double>(k) * layout.step_s);
    add_row(out, trial.seen, k, trial.seen.cols());
    add_row(out, trial.inputs, k, layout.input_count());
    if (smoothed) add_row(out, trial.smoothed, k, trial.smoothed.cols());
    if (trial.truth.size() > 0) add_row(out, trial.truth, k, trial.truth.cols());
    for (const Eigen::MatrixXd* curve : curves) add_row(out, *curve, k, curve->cols());
    out += "\n";
  }
  return out;
}

}  // namespace kinescope
