// SPDX-License-Identifier: Apache-2.0
//
// The products of the run folder as text: observations.csv, tracks.csv, structure.json,
// calibration.json, residuals.csv. Numbers are printed so that they read back the same; the same
// value gives the same bytes.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "calib/bundle/calibration.h"
#include "calib/camera/tag_observations.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/structure/pose_tracks.h"
#include "kinematics/structure/structure.h"

namespace kinescope {

/// t,tag,corner,u,v,sigma,hamming,margin: what read_corners() reads, and more.
[[nodiscard]] std::string observations_csv(const TagObservations& observations);
/// t,body,x,y,z,qx,qy,qz,qw,sigma_m,sigma_rad.
[[nodiscard]] std::string tracks_csv(const PoseTracks& tracks);
/// One row a corner (or sighting): t,tag,corner,used,fold,residuals final, held out, before.
[[nodiscard]] std::string residuals_csv(const Calibration& calibration);
/// t,x,y,z,qx,qy,qz,qw: T_base_camera of a camera that a person carries, in the frames that show
/// it.
[[nodiscard]] std::string camera_path_csv(const Calibration& calibration);
/// For each joint type, parent, child, channel, scale; for each tag its link; the probability of
/// the whole.
[[nodiscard]] nlohmann::json structure_json(const Structure& structure, const JointLog& log);
/// Everything needed to predict: tree, camera, clock; parameters with sigma; covariance.
[[nodiscard]] nlohmann::json calibration_json(const Calibration& calibration);

}  // namespace kinescope
