// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/calibrate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "calib/bundle/folds.h"
#include "calib/bundle/make_spec.h"
#include "calib/bundle/read_back.h"
#include "calib/bundle/solve.h"
#include "calib/bundle/uncertainty.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"
#include "kinematics/core/parallel_for.h"

namespace kinescope {
namespace {

using bundle::BuildOptions;
using bundle::Readings;
using bundle::RobustSolution;
using bundle::Sighting;
using bundle::Spec;
using bundle::State;

// What a model says about one sighting, in the sighting's own units.
struct Prediction {
  std::vector<Eigen::Vector2d> corners_px;
  Vector6d displacement = Vector6d::Zero();
};

// Displacement of the marker (right perturbation) that would explain the residual, least squares;
// turned to the camera's axes for corners.
std::optional<Prediction> predict_residual(const Spec& spec, const State& state,
                                           const Readings& readings, const Sighting& sighting) {
  const auto error = bundle::error_of(spec, state, readings, sighting);
  if (!error) return std::nullopt;
  Prediction out;
  if (sighting.kind == MeasurementKind::kPoint) {
    out.displacement.tail<3>() = error->residual * sighting.sigma;
    return out;
  }
  const Matrix6d normal = error->d_marker.transpose() * error->d_marker;
  const Vector6d right = error->d_marker.transpose() * error->residual;
  out.displacement = -solve_symmetric(normal, right);
  if (sighting.kind == MeasurementKind::kCorners) {
    const Eigen::Matrix3d R = bundle::predict(spec, state, readings, sighting).matrix3();
    out.displacement.head<3>() = R * out.displacement.head<3>();
    out.displacement.tail<3>() = R * out.displacement.tail<3>();
    for (Eigen::Index i = 0; i < error->residual.size(); i += 2) {
      out.corners_px.emplace_back(error->residual.segment<2>(i) * sighting.sigma);
    }
  }
  return out;
}

// Root mean square distance over sightings: corner to corner, point to point; and of the angle
// between poses.
struct Rms {
  double sum = 0.0;
  double sum_rotation = 0.0;
  int count = 0;
  int count_rotation = 0;
  void add(MeasurementKind kind, const Prediction& prediction) {
    if (kind == MeasurementKind::kCorners) {
      for (const auto& r : prediction.corners_px) sum += r.squaredNorm();
      count += static_cast<int>(prediction.corners_px.size());
      return;
    }
    sum += prediction.displacement.tail<3>().squaredNorm();
    ++count;
    if (kind == MeasurementKind::kPose) {
      sum_rotation += prediction.displacement.head<3>().squaredNorm();
      ++count_rotation;
    }
  }
  [[nodiscard]] double value() const { return count > 0 ? std::sqrt(sum / count) : 0.0; }
  [[nodiscard]] double rotation() const {
    return count_rotation > 0 ? std::sqrt(sum_rotation / count_rotation) : 0.0;
  }
};

std::vector<std::optional<Prediction>> predict_all(const Spec& spec, const State& state,
                                                   const std::vector<int>& indices) {
  const Readings readings(spec, state);
  std::vector<std::optional<Prediction>> out;
  for (const int index : indices) {
    out.push_back(
        predict_residual(spec, state, readings, spec.sightings[static_cast<std::size_t>(index)]));
  }
  return out;
}

// Sockets that only the held-out frames know stand where those frames put them on average.
void place_unseen_targets(const Spec& spec, const std::vector<int>& seen,
                          const std::vector<int>& unseen, State& state) {
  std::vector<bool> known(spec.targets.size(), false);
  for (const int index : seen) {
    const int target = spec.sightings[static_cast<std::size_t>(index)].target;
    if (target >= 0) known[static_cast<std::size_t>(target)] = true;
  }
  if (std::ranges::all_of(known, [](bool k) { return k; })) return;
  const State solved = state;
  bundle::guess_targets(spec, unseen, state);
  for (std::size_t t = 0; t < known.size(); ++t) {
    if (known[t]) state.targets[t] = solved.targets[t];
  }
}

// The sightings of one fold, and those that its model is made from.
struct Split {
  std::vector<int> seen;      // used, in other folds
  std::vector<int> unseen;    // used, in this fold
  std::vector<int> rejected;  // outliers in this fold
};

Split split_at(int fold, const RobustSolution& robust, const std::map<int, std::size_t>& slot,
               const Calibration& out) {
  Split split;
  for (const int index : robust.used) {
    const bool left_out = out.residuals[slot.at(index)].fold == fold;
    (left_out ? split.unseen : split.seen).push_back(index);
  }
  for (const int index : robust.rejected) {
    if (out.residuals[slot.at(index)].fold == fold) split.rejected.push_back(index);
  }
  return split;
}

// The model that has not seen a fold.
State solve_without(const Spec& spec, const State& solution, const Split& split,
                    int max_iterations) {
  State state = solution;
  static_cast<void>(bundle::solve(spec, state, split.seen, {}, max_iterations));
  if (spec.carried || std::ranges::any_of(spec.free_value, [](bool f) { return f; })) {
    static_cast<void>(
        bundle::solve(spec, state, split.unseen, {std::nullopt, true}, max_iterations));
  }
  place_unseen_targets(spec, split.seen, split.unseen, state);
  return state;
}

// A fold starts at the whole's solution. Where the whole had none, every fold would creep on to the
// limit of the fit, for an answer that is refused. Chosen, not measured.
constexpr int kStepsWithoutMinimum = 10;

// Cross-validation: each fold's frames are predicted by a model that has not seen them. Outliers
// are predicted too, and counted nowhere.
void validate(const Spec& spec, const State& solution, const RobustSolution& robust, int folds,
              const std::map<int, std::size_t>& slot, Calibration& out, int max_iterations,
              const Progress& progress) {
  Rms training;
  Rms held_out;
  const auto keep = [&](const std::vector<int>& indices,
                        const std::vector<std::optional<Prediction>>& predictions, Rms* rms) {
    for (std::size_t i = 0; i < indices.size(); ++i) {
      if (!predictions[i]) continue;
      SightingResidual& residual = out.residuals[slot.at(indices[i])];
      residual.held_out_px = predictions[i]->corners_px;
      residual.held_out_displacement = predictions[i]->displacement;
      if (rms != nullptr) rms->add(spec.kind, *predictions[i]);
    }
  };
  struct Fold {
    Split split;
    std::vector<std::optional<Prediction>> seen, unseen, rejected;
  };
  report_progress(progress, "validate", 0, folds);
  std::vector<Fold> all(static_cast<std::size_t>(folds));
  parallel_for(all.size(), [&](std::size_t i) {
    const Split split = split_at(static_cast<int>(i), robust, slot, out);
    if (split.seen.empty() || split.unseen.empty()) return;
    const State state = solve_without(spec, solution, split, max_iterations);
    all[i] = {split, predict_all(spec, state, split.seen), predict_all(spec, state, split.unseen),
              predict_all(spec, state, split.rejected)};
  });
  for (const Fold& fold : all) {
    for (const auto& prediction : fold.seen) {
      if (prediction) training.add(spec.kind, *prediction);
    }
    keep(fold.split.unseen, fold.unseen, &held_out);
    keep(fold.split.rejected, fold.rejected, nullptr);
  }
  report_progress(progress, "validate", folds, folds);
  out.folds = folds;
  out.training_rms = training.value();
  out.held_out_rms = held_out.value();
  out.training_rotation_rms_rad = training.rotation();
  out.held_out_rotation_rms_rad = held_out.rotation();
}

// A fold for every frame: by posture, or by time where joint values are unknown; or by lot.
std::vector<int> folds_of(const Spec& spec, const State& state, const std::vector<int>& usable,
                          int folds, bool by_lot) {
  const Readings readings(spec, state);
  std::vector<int> frames;
  for (const int index : usable) {
    const int frame = spec.sightings[static_cast<std::size_t>(index)].frame;
    if (frames.empty() || frames.back() != frame) frames.push_back(frame);
  }
  std::vector<int> driven;
  for (std::size_t j = 0; j < spec.channel.size(); ++j) {
    if (spec.channel[j] >= 0) driven.push_back(static_cast<int>(j));
  }
  Eigen::MatrixXd features(static_cast<Eigen::Index>(frames.size()),
                           static_cast<Eigen::Index>(driven.size()));
  for (std::size_t f = 0; f < frames.size(); ++f) {
    for (std::size_t d = 0; d < driven.size(); ++d) {
      features(static_cast<Eigen::Index>(f), static_cast<Eigen::Index>(d)) =
          readings.value(frames[f], driven[d]);
    }
  }
  const std::vector<int> fold =
      by_lot ? bundle::deal_folds(frames.size(), folds) : bundle::assign_folds(features, folds);
  std::vector<int> by_frame(spec.times_s.size(), -1);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    by_frame[static_cast<std::size_t>(frames[f])] = fold[f];
  }
  return by_frame;
}

// Parameters and state that the start stands for: the nominal robot is compared once it is placed.
State start_state(Spec& spec, const CalibrationStart& start, const CalibrateOptions& options) {
  State state = bundle::initial_state(spec, start);
  bundle::guess_targets(spec, bundle::usable_sightings(spec, state), state);
  if (!start.nominal) return state;
  Spec placement = spec;
  for (auto& mask : placement.free_joint) mask.fill(false);
  placement.free_offset.assign(placement.free_offset.size(), false);
  placement.free_scale.assign(placement.free_scale.size(), false);
  placement.prior.reset();
  State placed = state;
  static_cast<void>(bundle::solve_robustly(placement, placed,
                                           bundle::usable_sightings(placement, placed),
                                           options.reject_sigma, options.max_iterations));
  return placed;
}

// A joint with no sighting behind it while its channel has a reading cannot be calibrated; of a
// nominal robot it stays as it is.
void require_every_joint_seen(const Spec& spec, const std::vector<int>& usable, bool nominal) {
  std::vector<bool> seen(spec.tree.joints.size(), false);
  for (const int index : usable) {
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(index)];
    const Marker& marker = spec.tree.markers[static_cast<std::size_t>(sighting.marker)];
    for (const int joint : spec.path[marker.link.index()]) {
      seen[static_cast<std::size_t>(joint)] = true;
    }
  }
  std::string missing;
  for (std::size_t j = 0; j < seen.size(); ++j) {
    const bool fixed = spec.tree.joints[j].type == JointType::kFixed;
    const bool free = std::ranges::any_of(spec.free_joint[j], [](bool f) { return f; });
    if (seen[j] || fixed || nominal || (!free && !spec.free_offset[j])) continue;
    missing += (missing.empty() ? "" : ", ") + spec.tree.joints[j].name;
  }
  if (missing.empty() && !usable.empty()) return;
  throw undetermined(
      "calibration",
      missing.empty()
          ? std::string("no marker was seen while the joint log ran")
          : fmt::format("no marker behind {} was seen while the joint log ran", missing),
      "check that joints.csv and what was seen cover the same time");
}

// The markers of links none of whose markers is where the robot says, mostly.
std::string links_not_described(const Calibration& calibration) {
  constexpr int kFewest = 10;  // sightings
  std::map<LinkId, std::pair<int, int>> used_and_rejected;
  const auto& markers = calibration.tree.markers;
  for (std::size_t m = 0; m < markers.size(); ++m) {
    auto& [used, rejected] = used_and_rejected[markers[m].link];
    used += calibration.markers[m].used;
    rejected += calibration.markers[m].rejected;
  }
  std::string out;
  for (const Marker& marker : markers) {
    const auto& [used, rejected] = used_and_rejected.at(marker.link);
    if (rejected <= used || used + rejected < kFewest) continue;
    out += (out.empty() ? "" : ", ") + fmt::format("tag_{}", marker.id.value);
  }
  return out;
}

void set_status(Calibration& out, const RobustSolution& robust) {
  out.status =
      robust.summary.converged ? CalibrationStatus::kConverged : CalibrationStatus::kNotConverged;
  out.status_reason = robust.summary.message;
  // An axis that may point anywhere, or lie anywhere, has not been determined.
  constexpr double kMaxTilt = 0.2;    // rad
  constexpr double kMaxShift = 0.25;  // m
  std::string undetermined_joints;
  for (std::size_t j = 0; j < out.joints.size(); ++j) {
    const JointEstimate& joint = out.joints[j];
    // Of a base that hardly shows the robot is determined nevertheless.
    const Sigma& tilt = joint.among_direction_sigma_rad ? joint.among_direction_sigma_rad
                                                        : joint.direction_sigma_rad;
    const Sigma& shift =
        joint.among_position_sigma_m ? joint.among_position_sigma_m : joint.position_sigma_m;
    const bool tilt_unknown = tilt && *tilt > kMaxTilt;
    const bool place_unknown = shift && *shift > kMaxShift;
    if (!tilt_unknown && !place_unknown) continue;
    undetermined_joints += (undetermined_joints.empty() ? "" : ", ") + out.tree.joints[j].name;
  }
  if (!undetermined_joints.empty()) {
    out.status = CalibrationStatus::kUndetermined;
    out.status_reason = fmt::format("the axis of {} is not determined", undetermined_joints);
    out.status_remedy = "record more travel of that joint, with its marker well in view";
  }
  const std::string contradicting = links_not_described(out);
  if (contradicting.empty()) return;
  out.status = CalibrationStatus::kUndetermined;
  out.status_reason = "most sightings of " + contradicting + " contradict the robot";
  out.status_remedy =
      "check the axes, units and channels of the joints that move it, and that it sits firmly";
}

}  // namespace

Calibration calibrate(const Measurements& measurements, const MarkerSet& markers,
                      const JointLog& log, const CalibrationStart& start,
                      const CalibrateOptions& options, const Progress& progress) {
  Spec spec = bundle::make_spec(measurements, markers, log, start, options);
  State state = start_state(spec, start, options);
  const State before = state;
  const std::vector<int> usable = bundle::usable_sightings(spec, state);
  require_every_joint_seen(spec, usable, start.nominal);
  report_progress(progress, "calibrate", 0, 1);
  const RobustSolution robust =
      bundle::solve_robustly(spec, state, usable, options.reject_sigma, options.max_iterations);
  report_progress(progress, "calibrate", 1, 1);

  Calibration out;
  out.kind = spec.kind;
  out.iterations = robust.summary.iterations;
  out.initial_cost = robust.summary.initial_cost;
  out.final_cost = robust.summary.final_cost;
  out.sigma_scale = robust.sigma_scale;

  const int frames_used = bundle::count_frames(spec, robust.used);
  const bool folds_given = !options.fold_of_frame.empty();
  const int most_folds = folds_given ? options.folds : std::min(options.folds, frames_used);
  const int folds = options.folds < 2 || frames_used < 4 ? 0 : most_folds;
  const std::vector<int> fold_of_frame =
      folds > 0 && folds_given
          ? options.fold_of_frame
          : folds_of(spec, state, usable, std::max(1, folds), options.folds_by_lot);
  KINESCOPE_CHECK(fold_of_frame.size() == spec.times_s.size(), "a fold for every frame");
  std::map<int, std::size_t> slot;
  const auto now = predict_all(spec, state, usable);
  const auto then = predict_all(spec, before, usable);
  Rms rms_now;
  Rms rms_before;
  for (std::size_t i = 0; i < usable.size(); ++i) {
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(usable[i])];
    SightingResidual residual;
    residual.frame = sighting.frame;
    residual.id = spec.tree.markers[static_cast<std::size_t>(sighting.marker)].id;
    residual.used = std::ranges::binary_search(robust.used, usable[i]);
    residual.fold = fold_of_frame[static_cast<std::size_t>(sighting.frame)];
    if (now[i]) {
      residual.corners_px = now[i]->corners_px;
      residual.displacement = now[i]->displacement;
      if (residual.used) rms_now.add(spec.kind, *now[i]);
    }
    if (then[i]) {
      residual.before_px = then[i]->corners_px;
      residual.before_displacement = then[i]->displacement;
      if (residual.used) rms_before.add(spec.kind, *then[i]);
    }
    slot[usable[i]] = out.residuals.size();
    out.residuals.push_back(std::move(residual));
  }
  out.final_rms = rms_now.value();
  out.training_rms = out.final_rms;
  out.before_rms = rms_before.value();
  out.training_rotation_rms_rad = rms_now.rotation();
  out.before_rotation_rms_rad = rms_before.rotation();
  if (folds > 0) {
    const int most_steps = robust.summary.converged
                               ? options.max_iterations
                               : std::min(options.max_iterations, kStepsWithoutMinimum);
    validate(spec, state, robust, folds, slot, out, most_steps, progress);
  }
  bundle::read_back(spec, state, robust, bundle::estimate_uncertainty(spec, state, robust.used),
                    out);
  set_status(out, robust);
  return out;
}

}  // namespace kinescope
