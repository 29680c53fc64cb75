// SPDX-License-Identifier: Apache-2.0
#include "app/io/policy_system_file.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "app/io/nearest_name.h"
#include "app/io/program_system.h"
#include "app/io/yaml_value.h"
#include "dynamics/policy/systems/smoothing.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using policy::CostError;
using policy::CostTerm;
using policy::PolicyProblem;
using policy::Sensing;

constexpr double kDefaultStartSigma = 0.01;  // rad or m, and per s
constexpr double kLongestStep_s = 10.0;
constexpr double kMostSteps = 10000;

/// What the file says of one position or one speed.
struct StateWords {
  std::vector<double> starts = {0.0};  ///< one, or one a mode
  double start_sigma = kDefaultStartSigma;
  double noise = 0.0;
  std::optional<CostTerm> cost;
};

struct PositionWords {
  std::string name;
  bool is_angle = false;
  double tolerance = std::numeric_limits<double>::infinity();
  StateWords position, speed;
};

double not_negative(const YamlValue& value) {
  const double number = value.number();
  if (number >= 0.0) return number;
  throw value.error(fmt::format("is {}, below zero", number), "give 0 or more");
}

/// A name that can head a column.
void require_column_name(const YamlValue& value, const std::string& name) {
  const auto good = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  };
  if (!name.empty() && std::ranges::all_of(name, good)) return;
  throw value.error("names no column", "take letters, digits and _ alone");
}

CostError error_of(const YamlValue& value, bool is_angle) {
  const std::string word = value.text();
  if (word == "difference") return CostError::kDifference;
  if (word == "absolute") return CostError::kAbsolute;
  if (word == "circular" && is_angle) return CostError::kCircular;
  if (word == "circular") {
    throw value.error("is 'circular' of what is no angle", "write difference, or angle: true");
  }
  static const std::vector<std::string> kWords{"difference", "absolute", "circular"};
  throw value.error(fmt::format("is '{}'", word), did_you_mean(word, kWords));
}

StateWords read_state(const YamlValue& entry, Eigen::Index state, bool is_angle) {
  StateWords out;
  if (const auto start = entry.find("start")) {
    out.starts.clear();
    if (start->is_list()) {
      for (const YamlValue& item : start->items()) out.starts.push_back(item.number());
      if (out.starts.empty()) throw start->error("is empty", "give a number");
    } else {
      out.starts.push_back(start->number());
    }
  }
  if (const auto sigma = entry.find("start_sigma")) out.start_sigma = not_negative(*sigma);
  if (const auto noise = entry.find("noise")) out.noise = not_negative(*noise);
  const auto target = entry.find("target");
  const auto scale = entry.find("length_scale");
  const auto error = entry.find("error");
  if (target.has_value() != scale.has_value() || (error && !target)) {
    throw entry.error("has half a cost", "state target and length_scale together, or neither");
  }
  if (!target) return out;
  const double length = scale->positive("give how far off costs 0.63 of the most");
  out.cost = CostTerm{state, target->number(), length,
                      is_angle ? CostError::kCircular : CostError::kDifference};
  if (error) out.cost->error = error_of(*error, is_angle);
  return out;
}

std::vector<PositionWords> read_positions(const YamlValue& root) {
  const auto entries = root.require("positions").entries();
  if (entries.empty()) throw root.require("positions").error("is empty", "name a position");
  std::vector<PositionWords> out;
  for (const auto& [name, entry] : entries) {
    require_column_name(entry, name);
    entry.only_keys({"angle", "start", "start_sigma", "noise", "target", "length_scale", "error",
                     "tolerance", "speed"});
    PositionWords words;
    words.name = name;
    if (const auto angle = entry.find("angle")) words.is_angle = angle->flag();
    const auto index = static_cast<Eigen::Index>(out.size());
    words.position = read_state(entry, index, words.is_angle);
    if (const auto tolerance = entry.find("tolerance")) {
      words.tolerance = tolerance->positive("give one above 0, or none");
      if (!words.position.cost) {
        throw tolerance->error("is about no target", "add target and length_scale");
      }
    }
    if (const auto speed = entry.find("speed")) {
      speed->only_keys({"start", "start_sigma", "noise", "target", "length_scale", "error"});
      words.speed = read_state(*speed, index + std::ssize(entries), false);
    }
    out.push_back(std::move(words));
  }
  return out;
}

policy::StateLayout read_layout(const YamlValue& root, const std::vector<PositionWords>& words) {
  policy::StateLayout out;
  for (const PositionWords& word : words) {
    out.positions.push_back(word.name);
    out.is_angle.push_back(word.is_angle);
  }
  std::vector<double> limits;
  for (const auto& [name, entry] : root.require("inputs").entries()) {
    require_column_name(entry, name);
    entry.only_keys({"limit"});
    out.inputs.push_back(name);
    limits.push_back(entry.require("limit").positive(
        "give the largest absolute value, which holds on both sides of zero"));
  }
  if (limits.empty()) throw root.require("inputs").error("is empty", "name an input");
  out.input_limit = Eigen::Map<const Eigen::VectorXd>(limits.data(), std::ssize(limits));
  const YamlValue step = root.require("step");
  out.step_s = step.positive("give it in s");
  if (out.step_s > kLongestStep_s) {
    throw step.error(fmt::format("is {} s", out.step_s), "give it in s, not in ms");
  }
  return out;
}

int read_steps(const YamlValue& root, double step_s) {
  const YamlValue horizon = root.require("horizon");
  const double steps = std::round(horizon.positive("give it in s") / step_s);
  if (steps < 2.0 || steps > kMostSteps) {
    throw horizon.error(fmt::format("holds {:g} steps of {:g} s", steps, step_s),
                        fmt::format("give 2 to {:g} of them", kMostSteps));
  }
  return static_cast<int>(steps);
}

policy::StartDistribution read_start(const YamlValue& root,
                                     const std::vector<PositionWords>& words) {
  const auto count = std::ssize(words);
  std::size_t modes = 1;
  for (const PositionWords& word : words) {
    modes = std::max({modes, word.position.starts.size(), word.speed.starts.size()});
  }
  policy::StartDistribution out{Eigen::MatrixXd(static_cast<Eigen::Index>(modes), 2 * count),
                                Eigen::VectorXd(2 * count)};
  for (Eigen::Index p = 0; p < count; ++p) {
    const PositionWords& word = words[static_cast<std::size_t>(p)];
    const std::pair<Eigen::Index, const StateWords*> both[] = {{p, &word.position},
                                                               {count + p, &word.speed}};
    for (const auto& [state, own] : both) {
      if (own->starts.size() != 1 && own->starts.size() != modes) {
        throw root.require("positions")
            .error(fmt::format("{} has {} starts, another position {}", word.name,
                               own->starts.size(), modes),
                   "give every list of starts the same length");
      }
      out.sigma[state] = own->start_sigma;
      for (std::size_t m = 0; m < modes; ++m) {
        out.means(static_cast<Eigen::Index>(m), state) =
            own->starts[own->starts.size() == 1 ? 0 : m];
      }
    }
  }
  return out;
}

double read_cutoff(const YamlValue& root, const char* key, double step_s, double usual) {
  const auto value = root.find(key);
  if (!value) return usual;
  const double cutoff_hz = value->positive("give it in Hz");
  if (cutoff_hz < 0.5 / step_s) return cutoff_hz;
  throw value->error(fmt::format("is {} Hz", cutoff_hz),
                     fmt::format("stay below half the rate, {:g} Hz", 0.5 / step_s));
}

policy::SensingOptions read_sensing(const YamlValue& root, const std::vector<PositionWords>& words,
                                    double step_s) {
  policy::SensingOptions out;
  const auto count = std::ssize(words);
  out.noise_sigma.resize(2 * count);
  for (Eigen::Index p = 0; p < count; ++p) {
    out.noise_sigma[p] = words[static_cast<std::size_t>(p)].position.noise;
    out.noise_sigma[count + p] = words[static_cast<std::size_t>(p)].speed.noise;
  }
  const auto sensing = root.find("sensing");
  if (!sensing || sensing->text() == "full") return out;
  if (sensing->text() != "positions") {
    throw sensing->error(fmt::format("is '{}'", sensing->text()), "write full or positions");
  }
  out.sensing = Sensing::kPositionsOnly;
  out.speed_cutoff_hz =
      read_cutoff(root, "speed_cutoff_hz", step_s, policy::kSpeedCutoffShare / step_s);
  out.position_cutoff_hz = read_cutoff(root, "position_cutoff_hz", step_s, 0.0);
  return out;
}

ProgramCall read_call(const YamlValue& root, const fs::path& folder, double step_s) {
  ProgramCall out;
  const YamlValue program = root.require("program");
  if (program.is_list()) {
    for (const YamlValue& word : program.items()) out.words.push_back(word.text());
  } else {
    out.words.push_back(program.text());
  }
  if (out.words.empty()) throw program.error("is empty", "name the program");
  out.folder = folder;
  if (const auto timeout = root.find("timeout")) {
    out.timeout_s = timeout->positive("give it in s");
  }
  out.smoothing_cutoff_hz =
      read_cutoff(root, "smoothing_cutoff_hz", step_s, policy::kSpeedCutoffShare / step_s);
  return out;
}

}  // namespace

PolicyProblem read_policy_problem(const fs::path& path) {
  const YamlValue root = YamlValue::read(path);
  root.only_keys({"name", "program", "timeout", "step", "horizon", "trials", "sensing",
                  "speed_cutoff_hz", "position_cutoff_hz", "smoothing_cutoff_hz", "positions",
                  "inputs"});
  const std::vector<PositionWords> words = read_positions(root);
  const policy::StateLayout layout = read_layout(root, words);
  PolicyProblem out;
  const auto name = root.find("name");
  out.name = name ? name->text() : path.stem().string();
  out.task.steps = read_steps(root, layout.step_s);
  out.task.start = read_start(root, words);
  out.task.sensing = read_sensing(root, words, layout.step_s);
  out.tolerance.resize(std::ssize(words));
  for (std::size_t p = 0; p < words.size(); ++p) {
    if (words[p].position.cost) out.task.cost.terms.push_back(*words[p].position.cost);
    if (words[p].speed.cost) out.task.cost.terms.push_back(*words[p].speed.cost);
    out.tolerance[static_cast<Eigen::Index>(p)] = words[p].tolerance;
  }
  if (out.task.cost.terms.empty()) {
    throw root.require("positions")
        .error("say no cost", "give one of them a target and a length_scale");
  }
  if (const auto trials = root.find("trials")) out.learner.trials = trials->whole(1);
  const fs::path folder = fs::absolute(path).parent_path();
  out.system = std::make_shared<const ProgramSystem>(layout, out.task.sensing,
                                                     read_call(root, folder, layout.step_s));
  return out;
}

}  // namespace kinescope
