// SPDX-License-Identifier: Apache-2.0
#include "app/commands/compared_runs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "app/io/calibration_file.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

// An effect that would have been found in 95 of 100 recordings at that size is smaller by that
// probability: two standard deviations of where it may be.
constexpr double kUnseenSigma = 0.5;
constexpr std::string_view kRatioEffect = "encoder_scale";

// By effect and the joint's name in the first run.
using EffectAt = std::pair<std::string, std::string>;

std::string recording_of(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_regular_file(folder / "run.json", error)) return {};
  const auto document = nlohmann::json::parse(read_text_file(folder / "run.json"), nullptr, false);
  if (!document.is_object()) return {};
  const auto name = document.value("recording", nlohmann::json());
  return name.is_string() ? name.get<std::string>() : std::string();
}

std::string joints_in_words(const KinematicTree& tree) {
  std::vector<std::string> words;
  for (const Joint& joint : tree.joints) {
    if (joint.type == JointType::kFixed) continue;
    words.push_back(fmt::format("{} ({})", joint.channel.empty() ? joint.name : joint.channel,
                                joint.type == JointType::kRevolute ? "R" : "P"));
  }
  return fmt::format("{}", fmt::join(words, " "));
}

// What a run says of an effect: how large, how well known; nothing, and why.
struct EffectSize {
  std::optional<double> size;
  double sigma = 0.0;
  std::string unit;
  std::string why_not;
};

// The joint of the first run in another one; empty: a place that is no joint.
std::string name_in(const StoredRun& first, const StoredRun& other, const RobotMatch& match,
                    const std::string& joint) {
  const auto own = first.calibration.tree.joint(joint);
  if (!own) return {};
  const int there = match.joint_of[own->index()];
  return there < 0 ? std::string()
                   : other.calibration.tree.joints[static_cast<std::size_t>(there)].name;
}

EffectSize size_of(const StoredRun& run, const std::string& effect, const std::string& joint) {
  if (!run.trace) return {{}, 0.0, {}, "the run looked for no effects"};
  for (const StoredEffect& found : run.trace->found)
    if (found.effect == effect && found.place == joint)
      return {found.size, found.sigma, found.unit, {}};
  for (const StoredAbsence& absent : run.trace->absent) {
    if (absent.effect != effect || absent.place != joint) continue;
    if (!absent.smallest_size) return {{}, 0.0, absent.unit, "the recording cannot show it"};
    return {0.0, kUnseenSigma * *absent.smallest_size, absent.unit, {}};
  }
  return {{}, 0.0, {}, "it was not looked for"};
}

// Effects of joints that either found. Those of the ratio are in the robot's numbers.
std::set<EffectAt> effects_of(const StoredRun& first, const StoredRun& other,
                              const RobotMatch& match) {
  std::map<std::string, std::string> first_name;
  for (const Joint& joint : first.calibration.tree.joints)
    first_name[name_in(first, other, match, joint.name)] = joint.name;
  first_name.erase("");
  std::set<EffectAt> out;
  if (first.trace)
    for (const StoredEffect& found : first.trace->found)
      if (first.calibration.tree.joint(found.place)) out.emplace(found.effect, found.place);
  if (other.trace)
    for (const StoredEffect& found : other.trace->found)
      if (first_name.contains(found.place)) out.emplace(found.effect, first_name[found.place]);
  std::erase_if(out, [](const EffectAt& at) { return at.first == kRatioEffect; });
  return out;
}

QuantityDifference effect_difference(const StoredRun& first, const StoredRun& other,
                                     const RobotMatch& match, const EffectAt& at) {
  const EffectSize one = size_of(first, at.first, at.second);
  const EffectSize two = size_of(other, at.first, name_in(first, other, match, at.second));
  QuantityDifference out;
  out.of = {fmt::format("{} of {}", at.first, at.second), one.unit.empty() ? two.unit : one.unit,
            at.second};
  out.first = one.size.value_or(0.0);
  out.second = two.size.value_or(0.0);
  out.difference = out.second - out.first;
  out.not_compared = one.size ? two.why_not : one.why_not;
  if (one.size && two.size) out.sigma = std::hypot(one.sigma, two.sigma);
  return out;
}

// A ratio that only one of them estimated stands against what the other would have found.
void take_unseen_ratio(const RobotLayout& layout, const StoredRun& run, const RobotMatch& match,
                       const RobotNumbers& other, RobotNumbers& numbers) {
  const std::size_t first = layout.quantities.size() - layout.joints.size();
  for (std::size_t k = 0; k < layout.joints.size(); ++k) {
    const std::size_t i = first + k;
    if (numbers.states[i] != NumberState::kHeld || other.states[i] != NumberState::kEstimated)
      continue;
    const int joint = match.joint_of[static_cast<std::size_t>(layout.joints[k])];
    const EffectSize unseen =
        size_of(run, std::string(kRatioEffect),
                run.calibration.tree.joints[static_cast<std::size_t>(joint)].name);
    if (!unseen.size) continue;
    const auto at = static_cast<Eigen::Index>(i);
    numbers.states[i] = NumberState::kEstimated;
    numbers.covariance(at, at) = unseen.sigma * unseen.sigma;
  }
}

// Effects that only one has may stand in the other's geometry.
std::string uneven_words(const StoredRun& first, const StoredRun& other, const RobotMatch& match) {
  std::vector<std::string> names;
  for (const EffectAt& at : effects_of(first, other, match)) {
    const auto has = [&](const StoredRun& run, const std::string& joint) {
      return run.trace && std::ranges::any_of(run.trace->found, [&](const StoredEffect& found) {
               return found.effect == at.first && found.place == joint;
             });
    };
    const bool one = has(first, at.second);
    if (one != has(other, name_in(first, other, match, at.second)))
      names.push_back(fmt::format("{} of {}", at.first, at.second));
  }
  if (names.empty()) return {};
  return fmt::format("Found in one of them only: {}; the other's geometry may have taken it up.",
                     fmt::join(names, ", "));
}

void sort_worst_first(std::vector<QuantityDifference>& quantities) {
  std::ranges::stable_sort(quantities, [](const auto& a, const auto& b) {
    const auto clarity = [](const QuantityDifference& one) {
      return one.sigma && *one.sigma > 0.0 ? std::abs(one.difference) / *one.sigma : -1.0;
    };
    return clarity(a) > clarity(b);
  });
}

// Logs of one robot in different units: nothing of the robot.
void note_units(const StoredRun& first, const StoredRun& other, const RobotMatch& match,
                std::vector<std::string>& notes) {
  std::vector<std::string> known, own;
  for (std::size_t j = 0; j < match.reading_ratio.size(); ++j) {
    if (match.reading_ratio[j] == 1.0) continue;
    const std::string& name = first.calibration.tree.joints[j].name;
    if (match.own_unit[j]) {
      own.push_back(name);
    } else {
      known.push_back(fmt::format("{} {:.6g}", name, match.reading_ratio[j]));
    }
  }
  if (!known.empty()) {
    notes.push_back(fmt::format(
        "The logs are in other units (readings of {} by those of {}: {}): compared in rad and m.",
        other.name, first.name, fmt::join(known, ", ")));
  }
  if (!own.empty()) {
    notes.push_back(
        fmt::format("The logs count {} in other units, from zeros of their own: their zeros and "
                    "ratios are not compared.",
                    fmt::join(own, ", ")));
  }
}

RunDifference difference_of(const RobotLayout& layout, const StoredRun& first,
                            RobotNumbers first_numbers, const StoredRun& other,
                            RobotNumbers numbers, const RobotMatch& match, const RobotMatch& own) {
  RunDifference out;
  out.by_order = match.by_order;
  if (match.by_order)
    out.notes.emplace_back("The channels have other names: joints are matched by their order.");
  note_units(first, other, match, out.notes);
  const RobotNumbers before = first_numbers;
  take_unseen_ratio(layout, first, own, numbers, first_numbers);
  take_unseen_ratio(layout, other, match, before, numbers);
  out.quantities = robot_differences(layout, first_numbers, numbers);
  for (const EffectAt& at : effects_of(first, other, match))
    out.quantities.push_back(effect_difference(first, other, match, at));
  fill_p_values(out.quantities);
  if (std::string words = uneven_words(first, other, match); !words.empty())
    out.notes.push_back(std::move(words));
  for (const StoredRun* run : {&first, &other}) {
    if (!run->trace || !run->trace->unexplained) continue;
    out.notes.push_back(fmt::format(
        "{} has errors that no known effect has the shape of: where another recording weighs them "
        "otherwise, its numbers move by more than their intervals.",
        run->name));
  }
  return out;
}

}  // namespace

StoredRun read_stored_run(const fs::path& folder) {
  std::error_code error;
  const fs::path file = folder / "calibration.json";
  if (!fs::exists(folder, error))
    throw bad_input(folder.string(), "no such folder", "give the folder of a finished run");
  if (!fs::is_regular_file(file, error)) {
    throw bad_input(folder.string(), "holds no calibration.json",
                    "give the folder of a finished run");
  }
  StoredRun out;
  out.folder = folder;
  out.name = folder.lexically_normal().string();
  while (out.name.size() > 1 && out.name.back() == '/') out.name.pop_back();
  out.recording = recording_of(folder);
  out.calibration = read_calibration(file);
  if (out.calibration.status != CalibrationStatus::kConverged) {
    throw undetermined(file.string(),
                       fmt::format("the calibration is {}: {}", to_string(out.calibration.status),
                                   out.calibration.status_reason),
                       "give a run that has an answer");
  }
  out.effects = read_effects(file);
  out.trace = read_trace(folder / "trace.json");
  return out;
}

std::vector<RobotMatch> match_runs(std::span<const StoredRun> runs) {
  const KinematicTree& first = runs.front().calibration.tree;
  std::vector<RobotMatch> out;
  for (const StoredRun& run : runs) {
    out.push_back(match_robots(first, run.calibration.tree));
    if (!out.back().joint_of.empty()) continue;
    throw bad_input(run.folder.string(),
                    fmt::format("is another robot's: joints {}, not {} as in {}",
                                joints_in_words(run.calibration.tree), joints_in_words(first),
                                runs.front().name),
                    "compare runs of one robot");
  }
  return out;
}

std::vector<RunDifference> run_differences(std::span<const StoredRun> runs,
                                           std::span<const RobotMatch> matches, double level) {
  std::vector<Calibration> same;
  std::vector<RobotMatch> same_matches;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    if (!matches[k].differences.empty()) continue;
    same.push_back(runs[k].calibration);
    same_matches.push_back(matches[k]);
  }
  const RobotLayout layout = robot_layout(same, same_matches);
  const RobotNumbers first = robot_numbers(layout, runs.front().calibration, matches.front());
  std::vector<RunDifference> out;
  for (std::size_t k = 1; k < runs.size(); ++k) {
    if (!matches[k].differences.empty()) {
      out.push_back({.structure = matches[k].differences,
                     .by_order = matches[k].by_order,
                     .quantities = {},
                     .notes = {}});
      continue;
    }
    const RobotNumbers numbers = robot_numbers(layout, runs[k].calibration, matches[k]);
    out.push_back(
        difference_of(layout, runs.front(), first, runs[k], numbers, matches[k], matches.front()));
  }
  std::vector<QuantityDifference*> all;
  for (RunDifference& difference : out)
    for (QuantityDifference& one : difference.quantities) all.push_back(&one);
  judge_together(all, level);
  for (RunDifference& difference : out) sort_worst_first(difference.quantities);
  return out;
}

}  // namespace kinescope
