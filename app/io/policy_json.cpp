// SPDX-License-Identifier: Apache-2.0
#include "app/io/policy_json.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "dynamics/models/saved_model_json.h"

namespace kinescope {
namespace {

using Eigen::Index;
using nlohmann::json;
using policy::SearchStatus;
using policy::StateLayout;

constexpr std::array<std::pair<SearchStatus, const char*>, 5> kStatusWords = {
    {{SearchStatus::kNotRun, "not run"},
     {SearchStatus::kConverged, "converged"},
     {SearchStatus::kStepLimit, "step limit"},
     {SearchStatus::kStopped, "stopped"},
     {SearchStatus::kFailed, "failed"}}};

json kernel_json(const policy::KernelValues& kernel) {
  json factors = json::array();
  for (const policy::LinearFactor& factor : kernel.factors) {
    factors.push_back({{"offset", factor.offset}, {"weights", list_json(factor.weights)}});
  }
  return {{"variance", kernel.variance},
          {"length_scales", list_json(kernel.length_scales)},
          {"factors", std::move(factors)},
          {"noise_variance", kernel.noise_variance}};
}

policy::KernelValues kernel_of(const json& object, Index columns, const JsonReader& read) {
  policy::KernelValues out;
  out.variance = read.number_at(object, "variance");
  out.length_scales = read.vector(object, "length_scales", columns);
  for (const json& factor : read.array(object, "factors")) {
    out.factors.push_back({read.number_at(factor, "offset"), read.vector(factor, "weights")});
  }
  out.noise_variance = read.number_at(object, "noise_variance");
  return out;
}

policy::VelocityProcess process_of(const json& object, Index columns, const JsonReader& read) {
  policy::VelocityProcess out;
  out.kernel = kernel_of(read.at(object, "kernel"), columns, read);
  out.target_scale = read.number_at(object, "target_scale");
  out.inputs = read.matrix(object, "inputs", columns);
  out.targets = read.vector(object, "targets", out.inputs.rows());
  out.log_likelihood = read.number_at(object, "log_likelihood");
  out.samples = read.integer(read.at(object, "samples"), "samples");
  out.jitter = read.number_at(object, "jitter");
  return out;
}

}  // namespace

json matrix_json(const Eigen::MatrixXd& values) {
  json out = json::array();
  for (Index row = 0; row < values.rows(); ++row) out.push_back(list_json(values.row(row)));
  return out;
}

json layout_json(const StateLayout& layout) {
  json positions = json::array();
  for (std::size_t p = 0; p < layout.positions.size(); ++p) {
    positions.push_back(
        {{"name", layout.positions[p]}, {"angle", static_cast<bool>(layout.is_angle[p])}});
  }
  json inputs = json::array();
  for (Index u = 0; u < layout.input_count(); ++u) {
    inputs.push_back(
        {{"name", layout.inputs[static_cast<std::size_t>(u)]}, {"limit", layout.input_limit[u]}});
  }
  return {{"positions", std::move(positions)},
          {"inputs", std::move(inputs)},
          {"step_s", layout.step_s}};
}

json rbf_policy_json(const policy::RbfPolicy& policy) {
  return {{"centres", matrix_json(policy.centres)},
          {"length_scales", list_json(policy.length_scales)},
          {"weights", matrix_json(policy.weights)},
          {"input_limit", list_json(policy.input_limit)}};
}

policy::RbfPolicy rbf_policy_of(const json& object, const StateLayout& layout,
                                const JsonReader& read) {
  policy::RbfPolicy out;
  out.centres = read.matrix(object, "centres", policy::feature_count(layout));
  out.length_scales = read.vector(object, "length_scales", out.centres.cols());
  out.weights = read.matrix(object, "weights", layout.input_count());
  out.input_limit = read.vector(object, "input_limit", layout.input_count());
  if (out.weights.rows() != out.centres.rows()) throw read.wrong("'weights' is not one a centre");
  return out;
}

json trial_json(const policy::Trial& trial) {
  return {{"seen", matrix_json(trial.seen)},
          {"smoothed", matrix_json(trial.smoothed)},
          {"truth", trial.truth.size() > 0 ? matrix_json(trial.truth) : json()},
          {"inputs", matrix_json(trial.inputs)}};
}

policy::Trial trial_of(const json& object, const StateLayout& layout, const JsonReader& read) {
  policy::Trial out;
  out.seen = read.matrix(object, "seen", layout.state_count());
  out.smoothed = read.matrix(object, "smoothed", layout.state_count());
  out.inputs = read.matrix(object, "inputs", layout.input_count());
  if (!read.at(object, "truth").is_null()) {
    out.truth = read.matrix(object, "truth", layout.state_count());
  }
  const Index rows = out.seen.rows();
  if (rows < 2 || out.smoothed.rows() != rows || out.inputs.rows() != rows - 1 ||
      (out.truth.size() > 0 && out.truth.rows() != rows)) {
    throw read.wrong("a trial whose signals are of different lengths");
  }
  return out;
}

json velocity_model_json(const policy::VelocityModel& model) {
  json processes = json::array();
  for (const policy::VelocityProcess& process : model.processes) {
    processes.push_back({{"kernel", kernel_json(process.kernel)},
                         {"target_scale", process.target_scale},
                         {"inputs", matrix_json(process.inputs)},
                         {"targets", list_json(process.targets)},
                         {"log_likelihood", process.log_likelihood},
                         {"samples", process.samples},
                         {"jitter", process.jitter}});
  }
  return {{"kernel", policy::name_of(model.kernel)}, {"processes", std::move(processes)}};
}

policy::VelocityModel velocity_model_of(const json& object, const StateLayout& layout,
                                        std::shared_ptr<const policy::PhysicsFeatures> physics,
                                        const JsonReader& read) {
  policy::VelocityModel out;
  out.layout = layout;
  const std::string name = read.word(object, "kernel");
  const std::array kernels{policy::VelocityKernel::kSquaredExponential,
                           policy::VelocityKernel::kPolynomial2,
                           policy::VelocityKernel::kSemiParametric};
  const auto found = std::ranges::find_if(
      kernels, [&](policy::VelocityKernel kernel) { return policy::name_of(kernel) == name; });
  if (found == kernels.end()) throw read.wrong(fmt::format("'{}' is no kernel", name));
  out.kernel = *found;
  if (out.kernel == policy::VelocityKernel::kSemiParametric) out.physics = std::move(physics);
  const Index columns = policy::feature_count(layout) + layout.input_count();
  for (const json& process : read.array(object, "processes")) {
    out.processes.push_back(process_of(process, columns, read));
  }
  if (std::ssize(out.processes) != layout.position_count()) {
    throw read.wrong("'processes' is not one a position");
  }
  return out;
}

json search_json(const policy::SearchState& search) {
  return {{"policy", rbf_policy_json(search.policy)},
          {"first_moment", list_json(search.first_moment)},
          {"second_moment", list_json(search.second_moment)},
          {"seed", search.seed},
          {"step", search.step},
          {"adam_step", search.adam_step},
          {"learning_rate", search.learning_rate},
          {"dropout", search.dropout},
          {"last_cost", search.last_cost},
          {"mean_change", search.mean_change},
          {"change_variance", search.change_variance},
          {"change_steps", search.change_steps},
          {"steps_without_progress", search.steps_without_progress},
          {"gradient_scale", search.gradient_scale},
          {"resamples", search.resamples},
          {"redraws", search.redraws},
          {"costs", search.costs}};
}

policy::SearchState search_of(const json& object, const StateLayout& layout,
                              const JsonReader& read) {
  const auto whole = [&](const char* key) { return read.integer(read.at(object, key), key); };
  policy::SearchState out;
  out.policy = rbf_policy_of(read.at(object, "policy"), layout, read);
  const Index count = policy::parameters_of(out.policy).size();
  out.first_moment = read.vector(object, "first_moment", count);
  out.second_moment = read.vector(object, "second_moment", count);
  out.seed = seed_of(object, read);
  out.step = whole("step");
  out.adam_step = whole("adam_step");
  out.learning_rate = read.number_at(object, "learning_rate");
  out.dropout = read.number_at(object, "dropout");
  out.last_cost = read.number_at(object, "last_cost");
  out.mean_change = read.number_at(object, "mean_change");
  out.change_variance = read.number_at(object, "change_variance");
  out.change_steps = whole("change_steps");
  out.steps_without_progress = whole("steps_without_progress");
  out.gradient_scale = read.number_at(object, "gradient_scale");
  out.resamples = whole("resamples");
  out.redraws = whole("redraws");
  const Eigen::VectorXd costs = read.vector(object, "costs");
  out.costs.assign(costs.begin(), costs.end());
  return out;
}

std::uint64_t seed_of(const json& object, const JsonReader& read) {
  const json& value = read.at(object, "seed");
  if (!value.is_number_unsigned()) throw read.wrong("'seed' is no whole number");
  return value.get<std::uint64_t>();
}

std::string word_of(SearchStatus status) {
  const auto found =
      std::ranges::find(kStatusWords, status, &std::pair<SearchStatus, const char*>::first);
  KINESCOPE_CHECK(found != kStatusWords.end(), "every status has a word");
  return found->second;
}

SearchStatus search_status_of(const std::string& word, const JsonReader& read) {
  const auto found =
      std::ranges::find_if(kStatusWords, [&](const auto& entry) { return word == entry.second; });
  if (found == kStatusWords.end()) throw read.wrong(fmt::format("'{}' is no status", word));
  return found->first;
}

}  // namespace kinescope
