// SPDX-License-Identifier: Apache-2.0
#include "app/explain/across_recordings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// Only, or all but, the sightings of one recording.
Measurements sightings_of_one(const Measurements& all, std::size_t recording, bool only) {
  Measurements out = all;
  const auto is_away = [&](const auto& seen) {
    const bool own =
        all.camera_of_frame[static_cast<std::size_t>(seen.frame)] == static_cast<int>(recording);
    return own != only;
  };
  std::erase_if(out.corners, is_away);
  std::erase_if(out.points.observations, is_away);
  for (PoseTrack& track : out.poses.tracks) std::erase_if(track.samples, is_away);
  return out;
}

// Of its own camera: what others know nothing of.
bool is_of_camera(const Correction& correction) {
  switch (correction.part) {
    case CorrectedPart::kCamera:
    case CorrectedPart::kIntrinsic:
    case CorrectedPart::kFocalLength:
    case CorrectedPart::kBloom:
    case CorrectedPart::kReadout:
      return true;
    default:
      return false;
  }
}

// Whether it does anything in frames of the others.
bool acts_in_others(const Correction& correction, const std::vector<int>& recording_of_frame,
                    std::size_t recording) {
  if (correction.share.size() == 0 && correction.twists.rows() == 0) return true;
  for (std::size_t f = 0; f < recording_of_frame.size(); ++f) {
    if (recording_of_frame[f] == static_cast<int>(recording)) continue;
    const auto row = static_cast<Eigen::Index>(f);
    const bool acts = correction.twists.rows() > 0 ? !correction.twists.row(row).isZero(0.0)
                                                   : correction.share[row] != 0.0;
    if (acts) return true;
  }
  return false;
}

// From where the fit of all ended; a nominal robot stays the start, since its prior is around it.
CalibrationStart near_end(const Explanation& of) {
  const Calibration& end = of.fitted->calibration;
  CalibrationStart out = of.start;
  out.corrections = of.fitted->corrections;
  if (out.nominal) {
    out.tree.markers = end.tree.markers;
  } else {
    out.tree = end.tree;
  }
  out.T_camera_base = end.T_camera_base;
  out.camera = end.camera;
  out.time_offset_s = end.time_offset_s;
  for (std::size_t c = 0; c < out.further_cameras.size(); ++c) {
    const CameraEstimate& found = end.further_cameras[c];
    out.further_cameras[c].T_camera_base = found.T_camera_base;
    out.further_cameras[c].camera = found.camera;
    out.further_cameras[c].lag_s = found.lag_s;
  }
  return out;
}

// The effects as a fit had them.
void take_effects(const Calibration& fitted, std::vector<Correction>& corrections) {
  auto next = corrections.begin();
  const auto skip_local = [&] {
    next = std::find_if(next, corrections.end(),
                        [](const Correction& correction) { return !correction.is_local; });
  };
  skip_local();
  for (const Parameter& parameter : fitted.parameters) {
    if (parameter.block != "effects" || next == corrections.end()) continue;
    next++->value = parameter.value;
    skip_local();
  }
  KINESCOPE_CHECK(next == corrections.end(), "a value for each correction");
}

// Of the reference recording's offset, and what a further one's clock lags it.
Sigma sigma_of_clock(const Calibration& of, std::size_t recording) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(of.covariance.rows());
  const std::string lag = fmt::format("clock {} lag", of.name_of_camera(recording));
  for (std::size_t p = 0; p < of.parameters.size(); ++p) {
    const Parameter& parameter = of.parameters[p];
    if (parameter.block == "clock" || (recording > 0 && parameter.name == lag))
      sum[static_cast<Eigen::Index>(p)] = 1.0;
  }
  const double variance = sum.dot(of.covariance * sum);
  if (sum.isZero(0.0) || !std::isfinite(variance) || variance < 0.0) return std::nullopt;
  return std::sqrt(variance);
}

// Over the sightings that the model of all uses.
using Used = std::map<std::pair<int, TagId>, bool>;

Used used_sightings(const Calibration& of) {
  Used out;
  for (const SightingResidual& residual : of.residuals)
    if (residual.used) out[{residual.frame, residual.id}] = true;
  return out;
}

// Of held-out sightings of one recording, px or m.
double held_out_rms(const Calibration& of, const Used& used, std::size_t recording) {
  double sum = 0.0;
  double count = 0.0;
  for (const SightingResidual& residual : of.residuals) {
    if (of.camera_at(residual.frame) != recording || !used.contains({residual.frame, residual.id}))
      continue;
    for (const Eigen::Vector2d& corner : residual.held_out_px) {
      sum += corner.squaredNorm();
      count += 1.0;
    }
    if (of.kind == MeasurementKind::kCorners || residual.held_out_displacement.isZero(0.0))
      continue;
    sum += residual.held_out_displacement.tail<3>().squaredNorm();
    count += 1.0;
  }
  return count > 0.0 ? std::sqrt(sum / count) : 0.0;
}

std::vector<int> folds_of_frames(const Calibration& of) {
  std::vector<int> out(of.times_s.size(), 0);
  for (const SightingResidual& residual : of.residuals)
    out[static_cast<std::size_t>(residual.frame)] = std::max(0, residual.fold);
  return out;
}

// Nothing where the other recordings do not determine the robot.
std::optional<double> by_others(const Evidence& evidence, const Explanation& of,
                                const CalibrateOptions& options, const Used& used,
                                std::size_t recording) {
  const Measurements& all = evidence.observed.measurements;
  const Recording& whole = evidence.recording;
  CalibrationStart start = near_end(of);
  for (Correction& correction : start.corrections)
    if (!is_of_camera(correction) && !acts_in_others(correction, all.camera_of_frame, recording))
      correction.value = 0.0;
  CalibrateOptions train = options;
  train.folds = 0;
  try {
    const Calibration robot =
        calibrate(sightings_of_one(all, recording, false), whole.markers, of.log, start, train);
    if (robot.status == CalibrationStatus::kUndetermined) return std::nullopt;
    std::vector<Correction> own = start.corrections;
    take_effects(robot, own);
    for (std::size_t k = 0; k < own.size(); ++k)
      if (!acts_in_others(own[k], all.camera_of_frame, recording))
        own[k].value = start.corrections[k].value;
    CalibrationStart held = near_end(of);
    held.corrections = std::move(own);
    const std::vector<Marker> mounts = held.tree.markers;
    held.tree = robot.tree;
    held.tree.markers = mounts;
    held.nominal = true;
    CalibrateOptions place = options;
    place.hold_robot = true;
    place.folds = of.fitted->calibration.folds;
    place.fold_of_frame = folds_of_frames(of.fitted->calibration);
    const Calibration placed =
        calibrate(sightings_of_one(all, recording, true), whole.markers, of.log, held, place);
    return held_out_rms(placed, used, recording);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    return std::nullopt;
  }
}

// Rows of the parameters of a marker's mount in the covariance; -1: held, or not of a turn.
std::array<int, 6> rows_of_mount(const Calibration& of, TagId id) {
  constexpr std::array kNames{"turn x", "turn y", "turn z", "shift x", "shift y", "shift z"};
  std::array<int, 6> out{};
  out.fill(-1);
  const std::string block = fmt::format("tag_{}", id.value);
  for (std::size_t p = 0; p < of.parameters.size(); ++p)
    for (std::size_t i = 0; i < kNames.size(); ++i)
      if (of.parameters[p].name == fmt::format("{} {}", block, kNames[i]))
        out[i] = static_cast<int>(p);
  return out;
}

// Covariance of the pose of one marker in another one's frame, of a right perturbation.
Matrix6d covariance_between(const Calibration& of, TagId first, TagId second,
                            const Pose& T_first_second) {
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, of.covariance.rows());
  const Matrix6d of_first = -adjoint(T_first_second.inverse());
  const std::array<int, 6> rows_first = rows_of_mount(of, first);
  const std::array<int, 6> rows_second = rows_of_mount(of, second);
  for (std::size_t i = 0; i < 6; ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    if (rows_first[i] >= 0) J.col(rows_first[i]) += of_first.col(at);
    if (rows_second[i] >= 0) J.col(rows_second[i]) += Vector6d::Unit(at);
  }
  return J * of.covariance * J.transpose();
}

// Of a length along where it points.
Sigma sigma_along(const Eigen::Vector3d& vector, const Eigen::Matrix3d& covariance) {
  const Eigen::Vector3d u = vector.normalized();
  const double variance = u.dot(covariance * u);
  if (!std::isfinite(variance) || variance < 0.0) return std::nullopt;
  return std::sqrt(variance);
}

MarkerAnew compared_mounts(const Calibration& of, const StuckAnew& anew) {
  MarkerAnew out{anew.id, anew.renamed, {}, {}, {}, {}};
  const Marker* before = of.tree.marker(anew.id);
  const Marker* here = of.tree.marker(anew.renamed);
  if (before == nullptr || here == nullptr || before->link != here->link) return out;
  const Pose T = before->T_link_marker.inverse() * here->T_link_marker;
  const Matrix6d C = covariance_between(of, anew.id, anew.renamed, T);
  const Eigen::Vector3d turn = log_rotation(T.rotation);
  out.shift_m = T.translation.norm();
  out.shift_sigma_m =
      sigma_along(T.rotation.conjugate() * T.translation, C.bottomRightCorner<3, 3>());
  if (of.kind == MeasurementKind::kPoint) return out;
  out.turn_rad = turn.norm();
  out.turn_sigma_rad = sigma_along(turn, C.topLeftCorner<3, 3>());
  return out;
}

}  // namespace

std::vector<RecordingSummary> across_recordings(const Evidence& evidence, const Explanation& of,
                                                CalibrateOptions options) {
  const Observed& observed = evidence.observed;
  const Calibration& all = of.fitted->calibration;
  if (!all.of_recordings()) return {};
  const Used used = used_sightings(all);
  std::vector<RecordingSummary> out;
  for (std::size_t k = 0; k < observed.cameras.size(); ++k) {
    const ObservedCamera& camera = observed.cameras[k];
    RecordingSummary& one = out.emplace_back();
    one.name = camera.name;
    const CameraEstimate* further = k == 0 ? nullptr : &all.further_cameras[k - 1];
    one.time_offset_s = all.time_offset_s + (further != nullptr ? further->lag_s : 0.0) +
                        (camera.ahead_s - camera.log_ahead_s.value_or(camera.ahead_s));
    one.time_offset_sigma_s = sigma_of_clock(all, k);
    for (const auto& [sighting, is_used] : used)
      one.used += all.camera_at(sighting.first) == k && is_used ? 1 : 0;
    one.held_out_rms = held_out_rms(all, used, k);
    if (all.folds > 1) one.by_others_rms = by_others(evidence, of, options, used, k);
    for (const StuckAnew& anew : camera.anew) one.anew.push_back(compared_mounts(all, anew));
  }
  return out;
}

}  // namespace kinescope
