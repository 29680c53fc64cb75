// SPDX-License-Identifier: Apache-2.0
//
// The verdict: sentences that say no more than the numbers do.
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/facts.h"
#include "app/report/findings.h"
#include "app/report/numbers.h"
#include "calib/vision/double_ids.h"
#include "kinematics/core/error.h"

namespace kinescope::report {
namespace {

std::string counted(std::size_t count, std::string_view one) {
  return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s");
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t k = 0; k < words.size(); ++k) {
    if (k > 0) text += k + 1 == words.size() ? " and " : ", ";
    text += words[k];
  }
  return text;
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

std::size_t moving_joints(const KinematicTree& tree) {
  return static_cast<std::size_t>(std::ranges::count_if(
      tree.joints, [](const Joint& joint) { return joint.type != JointType::kFixed; }));
}

/// "q3 drives 2 of them", by channel.
std::vector<std::string> shared_channels(const KinematicTree& tree) {
  std::map<std::string, int> count;
  for (const Joint& joint : tree.joints) {
    if (joint.type != JointType::kFixed) ++count[joint.channel];
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
    if (joint.type != JointType::kFixed && joint.channel.empty()) undriven.push_back(joint.name);
  }
  if (run.log.empty()) return "no joint log: the joint values are estimates from the markers";
  const std::size_t moving = moving_joints(run.calibration.tree);
  if (undriven.empty()) {
    const std::vector<std::string> shared = shared_channels(run.calibration.tree);
    if (!shared.empty()) return fmt::format("driven by logged channels, {}", joined(shared));
    return moving == 1 ? "driven by a logged channel" : "each driven by its own logged channel";
  }
  return fmt::format("no logged channel drives {}", joined(undriven));
}

/// " Temp and 7 other channels that move drive nothing.": of channels that stand still nothing is
/// expected.
std::string idle_words(const RunSummary& run) {
  constexpr std::size_t kMostNames = 4;
  std::vector<std::string> names;
  for (const int channel : value_of(run.structure).idle_channels) {
    const auto column = run.log.values.col(channel);
    if (column.size() > 0 && column.maxCoeff() > column.minCoeff())
      names.push_back(run.log.channels.at(static_cast<std::size_t>(channel)));
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

std::string found_words(const RunSummary& run) {
  const KinematicTree& tree = run.calibration.tree;
  const std::size_t moving = moving_joints(tree);
  const std::string_view what =
      run.calibration.kind == MeasurementKind::kPoint ? "point" : "marker";
  std::string text;
  if (!run.structure) {
    text = fmt::format("Nominal robot {}: {}", tree.name, counted(moving, "joint"));
    if (moving > 0) text += fmt::format(" ({})", type_letters(tree));
    text +=
        fmt::format(", {} calibrated; {}.", counted(tree.markers.size(), what), driving_words(run));
    text += column_words(tree, run.log);
    for (const NominalFault& fault : run.nominal_faults)
      text += " " + fault_words(value_of(run.nominal), fault);
    return text;
  }
  if (moving == 0) {
    text = fmt::format("No joint found among {}", counted(tree.markers.size(), what));
  } else {
    text = fmt::format("{} in a {} ({}) carrying {}; {}", counted(moving, "joint"),
                       is_chain(tree) ? "chain" : "tree", type_letters(tree),
                       counted(tree.markers.size(), what), driving_words(run));
  }
  text += "; " + certainty_words(*run.structure) + "." + coupling_words(tree);
  if (!run.structure->free_markers.empty()) {
    std::vector<std::string> names;
    for (const TagId id : run.structure->free_markers) names.push_back(marker_name(id));
    text += fmt::format(" {} move{} with no joint of this robot.", joined(names),
                        names.size() == 1 ? "s" : "");
  }
  text += idle_words(run);
  text += scale_words(tree) + free_scale_words(run.calibration);
  return text;
}

/// "0.071 px (0.12 mm, 0.02°)": the rms of one state of the model.
std::string error_words(const ErrorStatistics& px, const ErrorStatistics& m,
                        const ErrorStatistics& rad) {
  std::vector<std::string> parts;
  if (px.count > 0) parts.push_back(text_with_unit(px.rms, Quantity::kPixels));
  if (m.count > 0) parts.push_back(text_with_unit(m.rms, Quantity::kLength));
  if (rad.count > 0 && px.count == 0) parts.push_back(text_with_unit(rad.rms, Quantity::kAngle));
  if (parts.empty()) return "";
  std::string text = parts.front();
  for (std::size_t k = 1; k < parts.size(); ++k) text += (px.count > 0 ? ", or " : ", ") + parts[k];
  return text;
}

bool all_of_one_size(const std::vector<Marker>& markers) {
  return std::ranges::all_of(
      markers, [&](const Marker& marker) { return marker.size_m == markers.front().size_m; });
}

/// What no residual shows: the lengths are as right as the declared marker size and lens.
std::string declared_words(const Calibration& calibration) {
  const std::vector<Marker>& markers = calibration.tree.markers;
  if (calibration.kind != MeasurementKind::kCorners || markers.empty()) return "";
  constexpr double kRulerError = 1e-4;  // m: what a ruler leaves
  const double size = markers.front().size_m;
  std::string text;
  if (size > 0.0 && all_of_one_size(markers)) {
    text = fmt::format(
        " All this is for markers of exactly {:.1f} mm: each 0.1 mm changes all lengths by {:.2g} "
        "%",
        1e3 * size, 100.0 * kRulerError / size);
  } else {
    text = " All this is for markers of exactly the declared sizes: lengths change as they do";
  }
  return text + (calibration.intrinsics_estimated
                     ? "."
                     : ", and what the declared intrinsics are wrong by comes on top.");
}

std::string prediction_words(const RunSummary& run) {
  const ErrorRow& all = run.errors.all;
  const std::string held_out = error_words(all.held_out_px, all.held_out_m, all.held_out_rad);
  const std::string training = error_words(all.training_px, all.training_m, all.training_rad);
  const std::string before = error_words(all.before_px, all.before_m, all.before_rad);
  // Depth is seen far worse, and is in no figure in mm.
  const std::string_view direction =
      run.calibration.kind == MeasurementKind::kCorners ? " across the line of sight" : "";
  const std::string_view what =
      run.calibration.kind == MeasurementKind::kPoint ? "Points" : "Markers";
  std::string text;
  if (!held_out.empty()) {
    text = fmt::format("{} {} that the fit has not seen are predicted to {}{} (rms)", what,
                       run.log.empty() ? "in stretches of the recording" : "at postures", held_out,
                       direction);
    if (!training.empty()) text += fmt::format("; those it has seen to {}", training);
  } else if (!training.empty()) {
    text = fmt::format("{} are reproduced to {}{} (rms), on the data of the fit itself", what,
                       training, direction);
  } else {
    return "No error can be given: nothing was fitted.";
  }
  if (run.nominal && !before.empty()) {
    // All but the geometry is fitted for this figure, too.
    text += fmt::format(
        "; with the nominal geometry{}{}, but markers, camera and clock placed anew, it was {}",
        run.nominal_faults.empty() ? "" : ", so mended,",
        run.effects.empty() ? "" : " and the effects found", before);
  }
  return text + ".";
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

/// "0.028° in direction and 0.080 mm in position" of two standard uncertainties.
std::string axis_uncertainty(double direction, std::optional<double> position) {
  std::string text =
      uncertainty_text(kCoverageFactor * direction, Quantity::kAngle) + "° in direction";
  if (position) {
    text += fmt::format(" and {} mm in position",
                        uncertainty_text(kCoverageFactor * *position, Quantity::kLength));
  }
  return text;
}

std::string axis_words(const Calibration& calibration) {
  std::vector<double> directions, positions;
  std::vector<std::string> unknown;
  double worst = -1.0;
  std::optional<double> worst_position;
  std::string worst_name;
  for (std::size_t j = 0; j < calibration.joints.size() && j < calibration.tree.joints.size();
       ++j) {
    const JointEstimate& estimate = calibration.joints[j];
    if (calibration.tree.joints[j].type == JointType::kFixed) continue;
    if (!estimate.direction_sigma_rad) {
      unknown.push_back(calibration.tree.joints[j].name);
      continue;
    }
    const double direction = *estimate.direction_sigma_rad;
    directions.push_back(direction);
    if (estimate.position_sigma_m) positions.push_back(*estimate.position_sigma_m);
    if (direction > worst) {
      worst = direction;
      worst_position = estimate.position_sigma_m;
      worst_name = calibration.tree.joints[j].name;
    }
  }
  std::string text;
  if (directions.size() == 1) {
    text = fmt::format(" The axis of {} is known to {} (expanded uncertainty, k = 2).", worst_name,
                       axis_uncertainty(worst, worst_position));
  } else if (!directions.empty()) {
    std::optional<double> position;
    if (!positions.empty()) position.emplace(median(positions));
    text = fmt::format(
        " Joint axes are known to {} (median, expanded uncertainty, k = 2); least certain is {} "
        "with {}.",
        axis_uncertainty(median(directions), position), worst_name,
        axis_uncertainty(worst, worst_position));
  }
  if (!unknown.empty()) {
    text += fmt::format(
        " No uncertainty can be given for the axis of {}: it was held, or the data do not "
        "determine it.",
        joined(unknown));
  }
  return text;
}

std::string clock_words(const RunSummary& run) {
  const Calibration& calibration = run.calibration;
  if (run.log.empty() || !calibration.time_offset_sigma_s) return "";
  return fmt::format(
      " Joint log time = frame time {} ({}) ms.", calibration.time_offset_s < 0.0 ? "-" : "+",
      value_and_uncertainty(std::abs(calibration.time_offset_s),
                            kCoverageFactor * *calibration.time_offset_sigma_s, Quantity::kDelay));
}

}  // namespace

Verdict make_verdict(const RunSummary& run, const Analysis& analysis) {
  Verdict verdict;
  verdict.found = found_words(run);
  verdict.accurate = prediction_words(run) + axis_words(run.calibration) +
                     declared_words(run.calibration) + clock_words(run);
  constexpr std::size_t kMostFindings = 3;
  std::vector<Finding> findings = find_limits(run, analysis);
  if (findings.size() > kMostFindings) findings.resize(kMostFindings);
  for (const Finding& finding : findings) {
    if (!verdict.limits.empty()) verdict.limits += ' ';
    verdict.limits += finding.what;
    if (finding.remedy.empty() || verdict.next.find(finding.remedy) != std::string::npos) continue;
    if (!verdict.next.empty()) verdict.next += ' ';
    verdict.next += finding.remedy;
  }
  for (std::string warning : run.warnings) {
    if (!warning.starts_with(kTwoMarkers)) continue;
    warning.front() = 'T';
    verdict.limits += fmt::format("{}{}.", verdict.limits.empty() ? "" : " ", warning);
  }
  if (verdict.next.empty()) {
    verdict.next =
        "Nothing in this recording calls for another one; to confirm the figures, record the same "
        "robot again and compare the two results.";
  }
  return verdict;
}

}  // namespace kinescope::report

namespace kinescope {

Verdict make_verdict(const RunSummary& run) {
  return report::make_verdict(run, report::analyse(run));
}

}  // namespace kinescope
