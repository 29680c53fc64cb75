// SPDX-License-Identifier: Apache-2.0
//
// The corrections that bear on one sighting, summed, and what the sighting's error owes to each.
#pragma once

#include <vector>

#include "calib/bundle/problem.h"

namespace kinescope::bundle {

/// Corrections that bear on a sighting, in its frame: indices into Spec::corrections, increasing.
[[nodiscard]] std::vector<int> corrections_of(const Spec& spec, const Sighting& sighting);

/// Corrections side by side that bear on the same sightings: one block of unknowns. An iteration
/// with more than 90 unknowns took 1.8 times as long in blocks of one (`undeclared`, 13049).
struct CorrectionBlock {
  int first = 0;  ///< index into Spec::corrections
  int count = 0;
};
[[nodiscard]] std::vector<CorrectionBlock> correction_blocks(const Spec& spec);
/// Of `blocks`, all of the spec's, those with a correction that bears on the sighting.
[[nodiscard]] std::vector<CorrectionBlock> correction_blocks_of(
    const Spec& spec, const std::vector<CorrectionBlock>& blocks, const Sighting& sighting);

/// Rotation, then translation, of a correction whose value is 1, in a frame.
[[nodiscard]] Vector6d twist_at(const Correction& correction, int frame);

struct CorrectedSighting {
  Vector6d camera = Vector6d::Zero();
  std::vector<Vector6d> joints;  ///< beside the path
  Vector6d marker = Vector6d::Zero();
  Growth growth;
  MarkerShape shape;
  std::array<double, kMaxIntrinsics> intrinsics{};  ///< changes
  double bloom_px = 0.0;
  double line_delay_s = 0.0;
};

/// `values`: one each of `which`.
[[nodiscard]] CorrectedSighting sum_corrections(const Spec& spec, const Sighting& sighting,
                                                const std::vector<int>& which,
                                                const std::vector<double>& values);

/// Chain and error of a sighting with its corrections.
struct CorrectedError {
  CorrectedSighting corrected;
  ChainDerivatives chain;
  Pose T_camera_base;  ///< with what corrections move the camera by
  SightingError error;
  Eigen::VectorXd d_bloom;    ///< of the residual by bloom_px; of corners only
  std::vector<double> rates;  ///< of the joints on the path, rad/s or m/s
  Eigen::VectorXd d_time;     ///< of the residual by the log's time, per s
};

/// `joints` as without corrections but for those of the clock, `rates` the rate of each (rad/s,
/// m/s). Nothing when a corner lies behind the camera.
[[nodiscard]] std::optional<CorrectedError> corrected_error(
    const Spec& spec, const Sighting& sighting, const CorrectedSighting& corrected,
    const Pose& T_camera_base, std::vector<ChainJoint> joints, std::vector<double> rates,
    const Pose& T_link_marker, const CameraModel& camera, const Eigen::Vector3d* target_m);

/// Its residual alone: the same but for rounding.
[[nodiscard]] std::optional<Eigen::VectorXd> corrected_residual(
    const Spec& spec, const Sighting& sighting, const CorrectedSighting& corrected,
    const Pose& T_camera_base, std::vector<ChainJoint> joints, std::vector<double> rates,
    const Pose& T_link_marker, const CameraModel& camera, const Eigen::Vector3d* target_m);

/// Of corrected_error() at a state.
[[nodiscard]] std::optional<CorrectedError> corrected_error_of(const Spec& spec, const State& state,
                                                               const Readings& readings,
                                                               const Sighting& sighting);

/// Derivative of the residual by one correction's value.
[[nodiscard]] Eigen::VectorXd d_correction(const Spec& spec, const Sighting& sighting,
                                           const Correction& correction, const CorrectedError& at);

}  // namespace kinescope::bundle
