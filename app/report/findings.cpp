// SPDX-License-Identifier: Apache-2.0
#include "app/report/findings.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/report/answer.h"
#include "app/report/facts.h"
#include "app/report/numbers.h"
#include "app/report/verdict_words.h"
#include "calib/quality/lone_posture.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope::report {
namespace {

// Weights: what spoils the answer stands before what widens it, before what could be better.
constexpr double kFailure = 100.0;
constexpr double kDoubt = 90.0;
constexpr double kNoCheck = 70.0;
constexpr double kUnseen = 60.0;
constexpr double kModelError = 50.0;
constexpr double kAdvice = 10.0;

constexpr double kFewIndependentFrames = 30.0;
constexpr double kSmallTurn = 0.35;     ///< rad: below, an axis is poorly placed by its own motion
constexpr double kWholeTurn = 5.2;      ///< rad: from here on further motion shows nothing new
constexpr double kMovedLess = 0.7;      // of what the other joints of its type move
constexpr double kRarelySeen = 0.3;     ///< share of the frames
constexpr double kSmallMarker = 25.0;   ///< px: below, tilt and depth are poorly seen
constexpr double kOftenRejected = 0.1;  ///< share of the sightings of one marker

void add_failure(const RunSummary& run, std::vector<Finding>& findings) {
  const Answer answer = judge(run);
  if (answer.given) return;
  findings.push_back(
      {kFailure, sentence("This is no answer: " + answer.what), sentence(answer.remedy)});
}

bool is_told(const std::string& what, const std::vector<Finding>& findings) {
  return std::ranges::find(findings, what, &Finding::what) != findings.end();
}

void add_structure_doubts(const RunSummary& run, std::vector<Finding>& findings) {
  if (!run.structure) return;
  double weight = run.structure->status == StructureStatus::kDetermined ? kUnseen : kDoubt;
  const bool traced = run.trace && !run.trace->accepted.empty();
  for (const StructureDoubt& doubt : run.structure->doubts) {
    if (doubt.of_model && traced) continue;  // the section on effects names the cause
    if (is_told(sentence("This is no answer: " + doubt.what), findings)) continue;
    findings.push_back({weight, sentence(doubt.what), sentence(doubt.remedy)});
    weight -= 0.1;
  }
}

// Joints that the log tells in steps only, where that was traced.
std::vector<std::string> read_in_steps(const RunSummary& run) {
  std::vector<std::string> out;
  if (!run.trace) return out;
  for (const TracedEffect& effect : run.trace->accepted)
    if (effect.id.effect == "quantisation") out.push_back(effect.id.place);
  return out;
}

std::string words_of(const LonePosture& alone, const RunSummary& run) {
  const auto error = [&](const ErrorRow& row) {
    return run.calibration.kind == MeasurementKind::kCorners
               ? text_with_unit(row.held_out_px.rms, Quantity::kPixels)
               : text_with_unit(row.held_out_m.rms, Quantity::kLength);
  };
  return fmt::format(
      "At t = {:.6g} the error is {} where the fit has not seen it, and {} at all others together: "
      "it alone shows something of the robot, or a value there is wrong, and the fit has bent to "
      "it.",
      alone.time_s, error(alone.of_it), error(alone.of_others));
}

void add_held_out(const RunSummary& run, std::vector<Finding>& findings) {
  const double ratio = held_out_ratio(run.calibration);
  if (ratio == 0.0) {
    findings.push_back({kNoCheck, "The error on unseen data is not known: nothing was held out.",
                        "Record more postures, so that some can be held out.", true});
  } else if (const auto alone =
                 ratio > kRatioLimit ? lone_posture(run.calibration) : std::nullopt) {
    findings.push_back({kUnseen, words_of(*alone, run),
                        "Check what was read and measured there, leave it out, or record more "
                        "postures like it."});
  } else if (const auto joints = read_in_steps(run); ratio > kRatioLimit && !joints.empty()) {
    const std::string names = fmt::format("{}", fmt::join(joints, ", "));
    findings.push_back(
        {kModelError + std::min(ratio, 10.0),
         fmt::format("In frames not seen the error is {:.2f} times that of the fit: between the "
                     "steps of its reading the log does not say where {} is.",
                     ratio, names),
         fmt::format("Log {} with more digits, or with an encoder of more counts.", names)});
  } else if (ratio > kRatioLimit) {
    findings.push_back(
        {kModelError + std::min(ratio, 10.0),
         fmt::format("On unseen postures the error is {:.2f} times that of the fit: model and "
                     "postures, not the measuring noise, limit the accuracy.",
                     ratio),
         "Record postures spread over the whole range of every joint, several of them moving at "
         "once.",
         true});
  }
}

// Tracing asked of the same residual what is beyond chance, and has its answer.
bool is_answered(const RunSummary& run) {
  if (!run.trace) return false;
  const TraceVerdict verdict = run.trace->verdict;
  return verdict == TraceVerdict::kClean || verdict == TraceVerdict::kEffects ||
         verdict == TraceVerdict::kAmbiguous;
}

void add_dependence(const RunSummary& run, const Analysis& analysis,
                    std::vector<Finding>& findings) {
  const auto strongest = std::ranges::find_if(
      analysis.dependence, [](const Dependence& one) { return one.explained >= kDependenceLimit; });
  if (strongest == analysis.dependence.end()) return;
  const bool by_chance = is_answered(run);
  const double weight = (by_chance ? 1.0 : 2.0) * kAdvice + kModelError * strongest->explained;
  constexpr const char* kByChance =
      "; tracing finds nothing there beyond chance and the sensor's own errors";
  const std::string share = fmt::format("{:.0f} %", 100.0 * strongest->explained);
  if (strongest->time) {
    const bool corners = run.calibration.kind == MeasurementKind::kCorners;
    findings.push_back(
        {weight,
         fmt::format("{} of the residual drifts with time (up to ±{} for one marker){}.", share,
                     fmt::format("{} {}",
                                 uncertainty_text(strongest->half_range,
                                                  corners ? Quantity::kPixels : Quantity::kLength),
                                 corners ? "px" : "mm"),
                     by_chance ? kByChance : ": something moved or changed during the recording"),
         by_chance ? "Record longer, through the same postures again and again."
                   : "Check that camera, base and markers sit firmly, and record again."});
    return;
  }
  const Joint& joint = run.calibration.tree.joints.at(static_cast<std::size_t>(strongest->joint));
  const bool slides = joint.type == JointType::kPrismatic;
  const Quantity quantity = slides ? Quantity::kLength : Quantity::kAngle;
  findings.push_back(
      {weight,
       fmt::format(
           "{} of what is left along the motion of {} repeats with its value (as an error of "
           "{} in this joint){}.",
           share, joint.name,
           fmt::format("±{}{}{}", uncertainty_text(strongest->half_range, quantity),
                       slides ? " " : "", display_unit(quantity).text),
           by_chance ? kByChance : ": an effect that the model lacks"),
       fmt::format("Record slow sweeps of {} alone over its whole range, in both directions, to "
                   "show the effect by itself.",
                   joint.name)});
}

void add_noise(const RunSummary& run, const Analysis& analysis, std::vector<Finding>& findings) {
  const Calibration& calibration = run.calibration;
  if (calibration.sigma_scale > kNoiseLimit) {
    findings.push_back(
        {kModelError * 0.3 + std::min(calibration.sigma_scale, 10.0),
         fmt::format("The residuals are {:.1f} times the expected noise of the measurement; the "
                     "uncertainties are widened accordingly.",
                     calibration.sigma_scale),
         ""});
  }
  const int frames = analysis.independent_frames;
  if (frames > 0 && frames < kFewIndependentFrames) {
    std::string what = fmt::format("The frames count as about {} independent ones", frames);
    if (calibration.correlation_time_s > 0.0) {
      what += fmt::format(" (residuals are correlated over {})",
                          text_with_unit(calibration.correlation_time_s, Quantity::kTime));
    }
    findings.push_back(
        {kModelError * 0.25, what + ".", "Record longer, with more different postures.", true});
  }
}

void add_weak_directions(const RunSummary& run, std::vector<Finding>& findings) {
  for (const WeakDirection& weak : run.calibration.observability.weak) {
    if (weak.words.empty()) continue;
    constexpr double kLost = 1e-6;  ///< of the largest singular value: nothing is known there
    findings.push_back(
        {weak.relative_singular_value < kLost ? kUnseen : kAdvice + 1.0, sentence(weak.words), ""});
    break;
  }
}

// Median over the joints of this type.
double typical_travel(const Calibration& calibration, JointType type) {
  std::vector<double> travels;
  for (std::size_t j = 0; j < calibration.joints.size() && j < calibration.tree.joints.size();
       ++j) {
    if (calibration.tree.joints[j].type != type) continue;
    const JointLimits& range = calibration.joints[j].range;
    travels.push_back(range.upper - range.lower);
  }
  return median_of(std::move(travels));
}

void add_small_travel(const RunSummary& run, const Analysis& analysis,
                      std::vector<Finding>& findings) {
  const Calibration& calibration = run.calibration;
  const int joint = least_certain_axis(calibration);
  if (joint < 0) return;
  const auto j = static_cast<std::size_t>(joint);
  const Joint* const weakest = &calibration.tree.joints[j];
  const JointLimits& range = calibration.joints[j].range;
  const double travel = range.upper - range.lower;
  const auto moving = std::ranges::count_if(calibration.tree.joints, is_movable);
  const bool slides = weakest->type == JointType::kPrismatic;
  const std::string moved = text_with_unit(travel, slides ? Quantity::kLength : Quantity::kAngle);
  const bool small = !slides && travel < kSmallTurn;
  if (moving == 1 && !small) return;  // the accuracy's sentence is about it
  // An axis at the end of the chain is the least certain however far it moves.
  const bool moved_less = travel < kMovedLess * typical_travel(calibration, weakest->type) &&
                          (slides || travel < kWholeTurn);
  const std::string what = fmt::format("The axis of {} is {}; it moved through {}.", weakest->name,
                                       moving == 1 ? "uncertain" : "the least certain", moved);
  std::string remedy = fmt::format("Move {} further than the {} seen here.", weakest->name, moved);
  if (!small && !moved_less) {
    remedy = fmt::format(
        "More postures, all over the range of every joint: uncertainties fall with the root of the "
        "number of independent frames ({} now).",
        analysis.independent_frames);
  }
  findings.push_back({small ? kModelError * 0.5 : kAdvice, what, remedy, true});
}

void add_poor_markers(const RunSummary& run, std::vector<Finding>& findings) {
  const MarkerSummary* rare = nullptr;
  const MarkerSummary* small = nullptr;
  for (const MarkerSummary& marker : run.markers) {
    if (run.calibration.tree.marker(marker.id) == nullptr) continue;
    if (marker.frames_seen < kRarelySeen * run.frames &&
        (rare == nullptr || marker.frames_seen < rare->frames_seen)) {
      rare = &marker;
    }
    if (marker.median_edge_px > 0.0 && marker.median_edge_px < kSmallMarker &&
        (small == nullptr || marker.median_edge_px < small->median_edge_px)) {
      small = &marker;
    }
  }
  if (rare != nullptr) {
    findings.push_back(
        {kAdvice + 3.0,
         fmt::format("{} was seen in {} of {} frames only.", marker_name(rare->id),
                     rare->frames_seen, run.frames),
         fmt::format("Place the camera or the marker so that {} faces it more often.",
                     marker_name(rare->id))});
  }
  if (small != nullptr) {
    findings.push_back({kAdvice + 2.0,
                        fmt::format("{} is only {} across in the image.", marker_name(small->id),
                                    text_with_unit(small->median_edge_px, Quantity::kPixels)),
                        "Bring the camera closer, or use larger markers or more pixels."});
  }
  for (std::size_t m = 0; m < run.calibration.markers.size(); ++m) {
    const MarkerEstimate& estimate = run.calibration.markers[m];
    const int seen = estimate.used + estimate.rejected;
    if (seen == 0 || estimate.rejected <= kOftenRejected * seen) continue;
    const TagId id = run.calibration.tree.markers[m].id;
    findings.push_back(
        {kAdvice + 4.0,
         fmt::format("{} of {} sightings of {} were left out as outliers.", estimate.rejected, seen,
                     marker_name(id)),
         fmt::format("Check that {} is flat, firmly fixed and fully in view.", marker_name(id))});
  }
}

void add_camera(const RunSummary& run, std::vector<Finding>& findings) {
  if (run.calibration.kind != MeasurementKind::kCorners || run.camera_declared) return;
  findings.push_back(
      {kAdvice + 5.0,
       "The camera was not declared: its intrinsics are estimated from the same markers.",
       "Calibrate the camera from a board (`kinescope camera`)."});
}

void add_noise_floor(const RunSummary& run, std::vector<Finding>& findings) {
  const double ratio = held_out_ratio(run.calibration);
  const bool spoiled = std::ranges::any_of(
      findings, [](const Finding& finding) { return finding.weight > kAdvice + 6.0; });
  if (spoiled || ratio == 0.0) return;
  if (run.trace && run.trace->verdict == TraceVerdict::kUnknown) {
    findings.push_back({kAdvice + 6.0,
                        "What tracing found and no known effect explains limits the accuracy: the "
                        "error on unseen data is that of the fit, and neither is noise alone.",
                        ""});
    return;
  }
  const double change = 100.0 * (ratio - 1.0);
  findings.push_back(
      {kAdvice + 6.0,
       fmt::format("The noise of the measurement limits the accuracy: the error on unseen "
                   "data is within {:.0f} % of that of the fit, and no structure of the residual "
                   "stands out.",
                   std::max(1.0, std::ceil(std::abs(change) - 1e-9))),
       ""});
}

/// "x", "-z", or the three numbers of a direction that is no axis of the frame.
std::string direction_words(const Eigen::Vector3d& direction) {
  constexpr double kAligned = 1e-3;
  constexpr std::array<std::string_view, 3> kNames = {"x", "y", "z"};
  for (std::size_t k = 0; k < kNames.size(); ++k) {
    const double along = direction(static_cast<Eigen::Index>(k));
    if (std::abs(std::abs(along) - 1.0) > kAligned) continue;
    return fmt::format("{}{}", along < 0.0 ? "-" : "", kNames[k]);
  }
  return fmt::format("({:.3f} {:.3f} {:.3f})", direction.x(), direction.y(), direction.z());
}

std::string error_words(const TypicalError& error) {
  std::string text;
  const auto add = [&](double value, Quantity quantity) {
    if (value <= 0.0) return;
    text += (text.empty() ? "" : ", ") + text_with_unit(value, quantity);
  };
  add(error.px, Quantity::kPixels);
  add(error.m, Quantity::kLength);
  add(error.rad, Quantity::kAngle);
  return text;
}

}  // namespace

std::string sentence(std::string text) {
  if (text.empty()) return text;
  const char first = text.front();
  // Names of joints, markers and effects stay as they are.
  const std::string word = text.substr(0, text.find_first_of(" :,"));
  const bool is_name = word.find_first_of("_0123456789") != std::string::npos;
  if (!is_name && first >= 'a' && first <= 'z') text.front() = static_cast<char>(first - 'a' + 'A');
  const char last = text.back();
  if (last != '.' && last != '!' && last != '?') text += '.';
  return text;
}

std::vector<std::string> fault_sentences(const KinematicTree& nominal,
                                         const std::vector<NominalFault>& faults) {
  const auto joint_of = [&](int joint) -> const Joint& {
    return nominal.joints[static_cast<std::size_t>(joint)];
  };
  const auto taken_so = [](const std::string& what, const NominalFault& fault) {
    return sentence(fmt::format("{}; taken so (typical error of {} in a first fit {} → {})", what,
                                marker_name(fault.marker), error_words(fault.before),
                                error_words(fault.after)));
  };
  std::vector<std::string> out;
  for (const JointType type : {JointType::kRevolute, JointType::kPrismatic}) {
    std::vector<std::string> names;
    const NominalFault* worst = nullptr;
    for (const NominalFault& fault : faults) {
      if (!fault.unit || joint_of(fault.joint).type != type) continue;
      names.push_back(joint_of(fault.joint).name);
      if (worst == nullptr || fault.before.px + fault.before.m > worst->before.px + worst->before.m)
        worst = &fault;
    }
    if (worst == nullptr) continue;
    out.push_back(taken_so(fmt::format("The column{} of {} {} in {}", names.size() == 1 ? "" : "s",
                                       joined(names), names.size() == 1 ? "is" : "are",
                                       type == JointType::kRevolute ? "degrees" : "mm"),
                           *worst));
  }
  for (const NominalFault& fault : faults) {
    const Joint& joint = joint_of(fault.joint);
    if (fault.axis) {
      out.push_back(
          taken_so(fmt::format("{} of the nominal robot moves {} {} of its joint frame, not {}",
                               joint.name, joint.type == JointType::kRevolute ? "about" : "along",
                               direction_words(*fault.axis), direction_words(joint.axis)),
                   fault));
    } else if (fault.zero) {
      out.push_back(taken_so(fmt::format("The zero of {} is {} from where the nominal robot has it",
                                         joint.name, text_with_unit(*fault.zero, Quantity::kAngle)),
                             fault));
    } else if (fault.exchanged_with) {
      out.push_back(taken_so(fmt::format("The channels of {} and {} are exchanged", joint.name,
                                         joint_of(*fault.exchanged_with).name),
                             fault));
    }
  }
  return out;
}

std::vector<Finding> find_limits(const RunSummary& run, const Analysis& analysis) {
  std::vector<Finding> findings;
  add_failure(run, findings);
  add_structure_doubts(run, findings);
  add_held_out(run, findings);
  add_dependence(run, analysis, findings);
  add_noise(run, analysis, findings);
  add_weak_directions(run, findings);
  add_small_travel(run, analysis, findings);
  add_poor_markers(run, findings);
  add_camera(run, findings);
  add_noise_floor(run, findings);
  std::ranges::stable_sort(findings, std::greater{}, &Finding::weight);
  if (findings.empty()) findings.push_back({0.0, "Nothing was fitted.", ""});
  return findings;
}

}  // namespace kinescope::report
