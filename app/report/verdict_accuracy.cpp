// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/facts.h"
#include "app/report/numbers.h"
#include "app/report/recordings_json.h"
#include "app/report/verdict_words.h"

namespace kinescope::report {
namespace {

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

const FreedomLevel* level_of(const std::vector<FreedomLevel>& levels, bool exported) {
  const auto found = std::ranges::find_if(levels, [exported](const FreedomLevel& level) {
    return exported ? level.exported : level.free == FreeGeometry::kPlacement && level.effects == 0;
  });
  return found == levels.end() ? nullptr : &*found;
}

std::string held_out_words(const ErrorRow& errors) {
  return error_words(errors.held_out_px, errors.held_out_m, errors.held_out_rad);
}

/// " Of the nominal robot, only placed: 9.6 mm; joint zeros free: 1.2 mm; .."
std::string level_words(const RunSummary& run) {
  std::string text;
  for (const FreedomLevel& level : run.levels) {
    const std::string error = held_out_words(level.errors);
    if (error.empty()) continue;
    text += fmt::format("{}{}: {}{}", text.empty() ? "" : "; ", words_of(level), error,
                        level.exported ? " (this one)" : "");
  }
  if (text.empty()) return text;
  return fmt::format(" The nominal robot{} at unseen postures: {}.",
                     run.nominal_faults.empty() ? "" : ", mended,", text);
}

/// " By camera: front 0.10 px (1200 sightings), left 0.11 px (800)." Of recordings likewise.
std::string camera_words(const Calibration& calibration) {
  if (calibration.cameras() < 2) return "";
  const std::string_view head = calibration.of_recordings() ? " By recording: " : " By camera: ";
  const Quantity quantity =
      calibration.kind == MeasurementKind::kCorners ? Quantity::kPixels : Quantity::kLength;
  const std::vector<CameraErrors> errors = errors_of_cameras(calibration);
  std::string text;
  for (std::size_t c = 0; c < errors.size(); ++c) {
    const double error = calibration.folds > 0 ? errors[c].held_out_rms : errors[c].final_rms;
    text +=
        fmt::format("{}{} {} ({}{})", c == 0 ? head : ", ", calibration.name_of_camera(c),
                    text_with_unit(error, quantity), errors[c].used, c == 0 ? " sightings" : "");
  }
  return text + ".";
}

/// " A recording that had no part in the robot is predicted to 0.12 px (A 0.11 px, B 0.13 px): ..".
std::string unseen_recording_words(const RunSummary& run) {
  const auto scatter = recording_scatter(run);
  if (!scatter) return "";
  const Quantity quantity =
      run.calibration.kind == MeasurementKind::kCorners ? Quantity::kPixels : Quantity::kLength;
  std::string each;
  for (const RecordingSummary& recording : run.recordings) {
    if (!recording.by_others_rms) continue;
    each += fmt::format("{}{} {}", each.empty() ? "" : ", ", recording.name,
                        text_with_unit(*recording.by_others_rms, quantity));
  }
  return fmt::format(
      " A recording that had no part in the robot, its camera and markers placed by itself, is "
      "predicted to {} ({}): recordings scatter by {} beyond postures not seen.",
      text_with_unit(scatter->unseen_rms, quantity), each,
      text_with_unit(scatter->between_rms, quantity));
}

/// "3.1 ± 0.1 mm".
std::string with_expanded(double value, const Sigma& sigma, Quantity quantity) {
  if (!sigma) return text_with_unit(value, quantity);
  return value_and_uncertainty(value, kCoverageFactor * *sigma, quantity) +
         (quantity == Quantity::kLength ? " mm" : "°");
}

/// " tag_12 sits elsewhere in B (there tag_1012), by 3.10(5) mm and 4.0(2)°."
std::string anew_words(const RunSummary& run) {
  std::string text;
  for (const RecordingSummary& recording : run.recordings) {
    for (const MarkerAnew& anew : recording.anew) {
      text += fmt::format(" tag_{} sits elsewhere in {} (there tag_{})", anew.id.value,
                          recording.name, anew.renamed.value);
      if (!anew.shift_m) {
        text += ", on another link.";
        continue;
      }
      text += ", by " + with_expanded(*anew.shift_m, anew.shift_sigma_m, Quantity::kLength);
      if (anew.turn_rad)
        text += " and " + with_expanded(*anew.turn_rad, anew.turn_sigma_rad, Quantity::kAngle);
      text += '.';
    }
  }
  return text;
}

std::string prediction_words(const RunSummary& run) {
  const ErrorRow& all = run.errors.all;
  const std::string held_out = error_words(all.held_out_px, all.held_out_m, all.held_out_rad);
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
  } else if (const std::string training =
                 error_words(all.training_px, all.training_m, all.training_rad);
             !training.empty()) {
    text = fmt::format("{} are reproduced to {}{} (rms), on the data of the fit itself", what,
                       training, direction);
  } else {
    return "No error can be given: nothing was fitted.";
  }
  return text + "." + camera_words(run.calibration) + unseen_recording_words(run) +
         anew_words(run) + level_words(run);
}

// Standard uncertainties in the base, over those among the rest, from which the base is spoken of.
constexpr double kFarLess = 2.0;

/// "The URDF says where the last link is (tag_9 on link6) to 2.9 mm and 0.19° (..)."
std::string tip_words(const RunSummary& run, const TipUncertainty& tip) {
  const KinematicTree& tree = run.calibration.tree;
  std::string text = fmt::format(
      "The URDF{} says where the last link is ({} on {}) to {} in the frame of {} (expanded "
      "uncertainty, k = 2, over the postures of the recording at exact joint values; {} mm at the "
      "worst).",
      beside_urdf_words(run).empty() ? "" : ", with corrected joint values,",
      marker_name(tip.marker), tree.links[tip.link.index()].name, tip_figures_words(tip.in_base),
      base_words(tree), uncertainty_text(kCoverageFactor * tip.worst_m, Quantity::kLength));
  if (is_base_apart(tip))
    text += fmt::format(
        " Most of that is how {} is turned and placed; with the base placed anew it is {}.",
        base_words(tree), tip_figures_words(*tip.among));
  if (is_model_short(run)) text += " What the model lacks comes on top.";
  return text + " ";
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

// Standard uncertainties of the joints' axes, and which of them is the least certain.
struct AxisFigures {
  std::vector<double> directions, positions;
  double worst = -1.0;
  std::optional<double> worst_position;
  int worst_joint = -1;

  void add(std::size_t joint, const Sigma& direction, const Sigma& position) {
    if (!direction) return;
    directions.push_back(*direction);
    if (position) positions.push_back(*position);
    if (*direction <= worst) return;
    worst = *direction;
    worst_position = position;
    worst_joint = static_cast<int>(joint);
  }

  [[nodiscard]] std::string typical() const {
    std::optional<double> position;
    if (!positions.empty()) position.emplace(median(positions));
    return axis_uncertainty(median(directions), position);
  }
};

struct Axes {
  AxisFigures in_base, among;
  std::vector<std::size_t> unknown;  // joints

  explicit Axes(const Calibration& calibration) {
    for (std::size_t j = 0; j < calibration.joints.size() && j < calibration.tree.joints.size();
         ++j) {
      const JointEstimate& joint = calibration.joints[j];
      if (calibration.tree.joints[j].type == JointType::kFixed) continue;
      if (!joint.direction_sigma_rad) unknown.push_back(j);
      in_base.add(j, joint.direction_sigma_rad, joint.position_sigma_m);
      among.add(j, joint.among_direction_sigma_rad, joint.among_position_sigma_m);
    }
  }

  /// Where the base is far less certain than the axes, it is told apart from them.
  [[nodiscard]] bool is_base_apart() const {
    return in_base.directions.size() > 1 && among.directions.size() == in_base.directions.size() &&
           median(in_base.directions) > kFarLess * median(among.directions);
  }
  [[nodiscard]] const AxisFigures& told() const { return is_base_apart() ? among : in_base; }
};

const FreedomLevel* exported_level(const RunSummary& run) {
  const auto level = std::ranges::find_if(run.levels, &FreedomLevel::exported);
  return level == run.levels.end() ? nullptr : &*level;
}

std::string axis_words(const RunSummary& run) {
  const FreedomLevel* level = exported_level(run);
  if (level != nullptr && level->free != FreeGeometry::kGeometry) {
    return fmt::format(" Its axes{} are held as drawn{}.",
                       level->free == FreeGeometry::kPlacement ? " and joint zeros" : "",
                       run.free_asked ? "" : ": freed, they predict unseen postures worse");
  }
  const Axes axes(run.calibration);
  const auto name_of = [&](std::size_t joint) { return run.calibration.tree.joints[joint].name; };
  std::string text;
  if (const AxisFigures& told = axes.told(); told.directions.size() == 1) {
    text = fmt::format(" The axis of {} is known to {} (expanded uncertainty, k = 2).",
                       name_of(static_cast<std::size_t>(told.worst_joint)), told.typical());
  } else if (!told.directions.empty()) {
    text = fmt::format(
        " Joint axes are known {}to {} (median, expanded uncertainty, k = 2); least certain is {} "
        "with {}.",
        axes.is_base_apart() ? "among one another " : "", told.typical(),
        name_of(static_cast<std::size_t>(told.worst_joint)),
        axis_uncertainty(told.worst, told.worst_position));
    if (axes.is_base_apart()) {
      text += fmt::format(
          " Against the base, which its markers hold less exactly, they are known to {}.",
          axes.in_base.typical());
    }
  }
  std::vector<std::string> unknown;
  for (const std::size_t joint : axes.unknown) unknown.push_back(name_of(joint));
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

int least_certain_axis(const Calibration& calibration) {
  return Axes(calibration).told().worst_joint;
}

std::string nominal_words(const RunSummary& run) {
  const FreedomLevel* declared = level_of(run.levels, false);
  const FreedomLevel* taken = level_of(run.levels, true);
  if (declared == nullptr || taken == nullptr || declared == taken) return "";
  const std::string before = held_out_words(declared->errors);
  const std::string after = held_out_words(taken->errors);
  if (before.empty() || after.empty()) return "";
  return fmt::format(" As declared it misses unseen postures by {}, as calibrated by {}.", before,
                     after);
}

bool is_base_apart(const TipUncertainty& tip) {
  return tip.among && tip.in_base.translation_m > kFarLess * tip.among->translation_m;
}

std::string base_words(const KinematicTree& tree) {
  const auto marker =
      std::ranges::find_if(tree.markers, [](const Marker& one) { return one.link.value == 0; });
  return marker == tree.markers.end() ? "the base" : marker_name(marker->id);
}

std::string tip_figures_words(const TipFigures& figures) {
  std::string text =
      uncertainty_text(kCoverageFactor * figures.translation_m, Quantity::kLength) + " mm";
  if (figures.rotation_rad)
    text += fmt::format(
        " and {}°", uncertainty_text(kCoverageFactor * *figures.rotation_rad, Quantity::kAngle));
  return text;
}

bool is_model_short(const RunSummary& run) {
  return held_out_ratio(run.calibration) > kRatioLimit ||
         (run.trace && run.trace->verdict == TraceVerdict::kUnknown);
}

std::string accuracy_words(const RunSummary& run, const std::optional<TipUncertainty>& tip) {
  return (tip ? tip_words(run, *tip) : "") + prediction_words(run) + axis_words(run) +
         declared_words(run.calibration) + clock_words(run);
}

}  // namespace kinescope::report
