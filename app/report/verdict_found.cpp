// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/facts.h"
#include "app/report/findings.h"
#include "app/report/numbers.h"
#include "app/report/verdict_words.h"
#include "kinematics/core/error.h"

namespace kinescope::report {
namespace {

std::string counted(std::size_t count, std::string_view one) {
  return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s");
}

}  // namespace

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t k = 0; k < words.size(); ++k) {
    if (k > 0) text += k + 1 == words.size() ? " and " : ", ";
    text += words[k];
  }
  return text;
}

namespace {

std::string_view body_word(const RunSummary& run) {
  return run.calibration.kind == MeasurementKind::kPoint ? "point" : "marker";
}

/// "R R P R": the moving joints in the tree's order.
std::string type_letters(const KinematicTree& tree) {
  std::string letters;
  for (const Joint& joint : tree.joints) {
    if (joint.type == JointType::kFixed) continue;
    if (!letters.empty()) letters += ' ';
    letters += joint.type == JointType::kRevolute ? 'R' : 'P';
  }
  return letters;
}

bool is_chain(const KinematicTree& tree) {
  std::vector<int> children(tree.links.size(), 0);
  for (const Joint& joint : tree.joints) {
    if (++children[joint.parent.index()] > 1) return false;
  }
  return true;
}

std::size_t moving_joint_count(const KinematicTree& tree) {
  return static_cast<std::size_t>(std::ranges::count_if(tree.joints, is_movable));
}

/// "q3 drives 2 of them", by channel.
std::vector<std::string> shared_channels(const KinematicTree& tree) {
  std::map<std::string, int> count;
  for (const Joint& joint : tree.joints) {
    if (is_movable(joint)) ++count[joint.channel];
  }
  std::vector<std::string> out;
  for (const auto& [channel, joints] : count) {
    if (joints > 1) out.push_back(fmt::format("{} drives {} of them", channel, joints));
  }
  return out;
}

/// "every one is driven by a logged channel" and its weaker forms.
std::string driving_words(const RunSummary& run) {
  std::vector<std::string> undriven;
  for (const Joint& joint : run.calibration.tree.joints) {
    if (is_movable(joint) && joint.channel.empty()) undriven.push_back(joint.name);
  }
  if (run.log.empty()) return "no joint log: the joint values are estimates from the markers";
  const std::size_t moving = moving_joint_count(run.calibration.tree);
  if (undriven.empty()) {
    const std::vector<std::string> shared = shared_channels(run.calibration.tree);
    if (!shared.empty()) return fmt::format("driven by logged channels, {}", joined(shared));
    return moving == 1 ? "driven by a logged channel" : "each driven by its own logged channel";
  }
  return fmt::format("no logged channel drives {}", joined(undriven));
}

/// " Temp and 7 other channels that move drive nothing.": of channels that stand still nothing is
/// expected, and what is in doubt is said with the limits.
std::string idle_words(const RunSummary& run) {
  constexpr std::size_t kMostNames = 4;
  const Structure structure = value_of(run.structure);
  const auto is_in_doubt = [&](const std::string& name) {
    return std::ranges::any_of(structure.doubts, [&](const StructureDoubt& doubt) {
      return std::ranges::find(doubt.names, name) != doubt.names.end();
    });
  };
  std::vector<std::string> names;
  for (const int channel : structure.idle_channels) {
    const auto column = run.log.values.col(channel);
    const std::string& name = run.log.channels.at(static_cast<std::size_t>(channel));
    if (column.size() > 0 && column.maxCoeff() > column.minCoeff() && !is_in_doubt(name))
      names.push_back(name);
  }
  if (names.empty()) return "";
  if (names.size() == 1) return fmt::format(" The channel {} moves and drives nothing.", names[0]);
  if (names.size() > kMostNames) {
    const std::size_t more = names.size() - kMostNames + 1;
    names.resize(kMostNames - 1);
    names.push_back(fmt::format("{} more", more));
  }
  return fmt::format(" The channels {} move and drive nothing.", joined(names));
}

std::string certainty_words(const Structure& structure) {
  switch (structure.status) {
    case StructureStatus::kDetermined:
      return fmt::format("probability of the whole {}", probability_text(structure.probability));
    case StructureStatus::kAmbiguous:
      if (structure.runner_up_log_odds > StructureOptions{}.min_log_odds) {
        return fmt::format("but the markers contradict it (probability of the whole {})",
                           probability_text(structure.probability));
      }
      return fmt::format("but this recording does not settle it (odds {} against: {})",
                         odds_text(structure.runner_up_log_odds), structure.runner_up);
    case StructureStatus::kUndetermined:
      return "but this recording cannot determine the structure";
    case StructureStatus::kNotRun:
      break;
  }
  return "structure not examined";
}

/// " q3 is coupled: q2 moves it too, -1 times as far as q3 does."
std::string coupling_words(const KinematicTree& tree) {
  std::string text;
  for (const Joint& joint : tree.joints) {
    for (const ChannelShare& share : joint.couplings) {
      text += fmt::format(" {} is coupled: {} moves it too, {:+.4g} times as far as {} does.",
                          joint.name, share.channel, share.ratio, joint.channel);
    }
  }
  return text;
}

bool is_about(double value, double of) {
  constexpr double kTolerance = 0.05;
  return std::abs(value / of - 1.0) < kTolerance;
}

/// " q3 counts in a unit of its own, 0.00153 rad each.": a scale that is no usual unit's. Where the
/// joint slides and the log is in m, markers of another size than declared look like that.
std::string scale_words(const KinematicTree& tree) {
  std::string text;
  for (const Joint& joint : tree.joints) {
    if (joint.type == JointType::kFixed || joint.channel.empty()) continue;
    const double scale = std::abs(joint.scale);
    const bool slides = joint.type == JointType::kPrismatic;
    if (is_about(scale, 1.0) || is_about(scale, slides ? kMetrePerMillimetre : kRadPerDegree))
      continue;
    text += fmt::format(" {} counts in a unit of its own, {:.3g} {} each", joint.channel, scale,
                        slides ? "m" : "rad");
    constexpr double kNotTicks = 0.5;
    if (slides && scale > kNotTicks) {
      text += fmt::format(
          "; if it is logged in m, the tags are declared {:.3g} times as large as they are", scale);
    }
    text += ".";
  }
  return text;
}

/// " The scale of q3 is estimated, too: 0.956 rad a unit of its channel.": near a usual unit, but
/// not held at it.
std::string free_scale_words(const Calibration& calibration) {
  std::vector<std::string> words;
  const std::vector<Joint>& joints = calibration.tree.joints;
  for (std::size_t j = 0; j < joints.size() && j < calibration.joints.size(); ++j) {
    const Joint& joint = joints[j];
    if (joint.type == JointType::kFixed || joint.channel.empty()) continue;
    const bool slides = joint.type == JointType::kPrismatic;
    const double scale = std::abs(joint.scale);
    const bool usual =
        is_about(scale, 1.0) || is_about(scale, slides ? kMetrePerMillimetre : kRadPerDegree);
    if (!usual || !calibration.joints[j].scale_sigma) continue;
    words.push_back(fmt::format("{} ({:.4g} {})", joint.channel, scale, slides ? "m" : "rad"));
  }
  if (words.empty()) return "";
  return fmt::format(" What a unit of {} is was estimated, too.", joined(words));
}

/// " No column is named like these joints: ch3 drives joint1." of a nominal robot.
std::string column_words(const KinematicTree& tree, const JointLog& log) {
  std::vector<std::string> words;
  for (const Joint& joint : tree.joints) {
    if (joint.type == JointType::kFixed || joint.channel.empty() || log.channel(joint.name))
      continue;
    words.push_back(fmt::format("{} drives {}", joint.channel, joint.name));
  }
  return words.empty() ? "" : " No column is named like these joints: " + joined(words) + ".";
}

// " A person carried .. Its pose in every frame is estimated, too, which ..".
std::string camera_motion_words(const RunSummary& run) {
  std::string text = run.camera_motion.empty() ? "" : " " + run.camera_motion;
  const std::optional<MovingCamera>& moving = run.calibration.moving;
  if (!moving) return text;
  if (moving->on_robot()) {
    return text + fmt::format(
                      " It rides on {}, and is camera_link in the URDF; a growth of the robot is "
                      "not looked for.",
                      run.calibration.tree.links[moving->link.index()].name);
  }
  return text +
         " Its pose in every frame is estimated, too, and takes up what would show a rolling "
         "shutter, or a bump or drift of the camera: those are not looked for, nor what depends on "
         "the place in the image.";
}

}  // namespace

std::string joints_words(const RunSummary& run) {
  const KinematicTree& tree = run.calibration.tree;
  const std::size_t moving = moving_joint_count(tree);
  const std::string letters = moving > 0 ? fmt::format(" ({})", type_letters(tree)) : "";
  if (!run.structure)
    return fmt::format("Nominal robot {}: {}{}", tree.name, counted(moving, "joint"), letters);
  if (moving == 0)
    return fmt::format("No joint found among {}", counted(tree.markers.size(), body_word(run)));
  return fmt::format("{} in a {}{}", counted(moving, "joint"), is_chain(tree) ? "chain" : "tree",
                     letters);
}

std::string beside_urdf_words(const RunSummary& run) {
  std::vector<std::string> names;
  for (const EffectId& id : run.shown_by_log) {
    // The clocks' offset is the recording's, not the robot's.
    if (id.place != "clock") names.push_back(fmt::format("{} at {}", id.effect, id.place));
  }
  if (names.empty()) return "";
  return fmt::format(
      "the URDF has no element for {}; `kinescope correct` takes {} out of joint readings",
      joined(names), names.size() == 1 ? "it" : "them");
}

std::string found_words(const RunSummary& run) {
  const KinematicTree& tree = run.calibration.tree;
  const std::string bodies = counted(tree.markers.size(), body_word(run));
  std::string text = joints_words(run);
  if (!run.structure) {
    text += fmt::format(", {} calibrated; {}.", bodies, driving_words(run));
    text += column_words(tree, run.log);
    if (run.nominal) {
      for (const std::string& words : fault_sentences(*run.nominal, run.nominal_faults))
        text += " " + words;
    }
    return text + camera_motion_words(run);
  }
  if (moving_joint_count(tree) > 0)
    text += fmt::format(" carrying {}; {}", bodies, driving_words(run));
  text += "; " + certainty_words(*run.structure) + "." + coupling_words(tree);
  if (!run.structure->free_markers.empty()) {
    std::vector<std::string> names;
    for (const TagId id : run.structure->free_markers) names.push_back(marker_name(id));
    text += fmt::format(" {} move{} with no joint of this robot.", joined(names),
                        names.size() == 1 ? "s" : "");
  }
  text += idle_words(run);
  text += scale_words(tree) + free_scale_words(run.calibration);
  return text + camera_motion_words(run);
}

}  // namespace kinescope::report
