// SPDX-License-Identifier: Apache-2.0
//
// Takes   the motion of one body in the frame of another, instant by instant, and channel readings.
// Gives   ChainModel: none (rest), one or several joints in series that explain it, and how well.
// Frames  pose(t) = prod_k [F_k exp(z theta_k(t)) F_k^-1] M, all in the frame of the first body;
//         theta_k = sum over terms of scale * reading, readings centred and scaled to unit RMS.
// Method  robust Gauss-Newton (Levenberg-Marquardt damping) on whitened pose residuals. The
//         residual is split into the part along the joint, where a channel may be inexact
//         (backlash, coupling), and the rest; each part has its own noise scale, at least that of
//         the sightings.
#pragma once

#include <optional>
#include <vector>

#include "kinematics/model/kinematic_tree.h"
#include "kinematics/structure/pose_tracks.h"
#include "kinematics/structure/residual_scale.h"

namespace kinescope::structure_search {

/// The child in the parent's frame at one instant.
struct MotionSample {
  int instant = 0;
  Pose pose;
  Matrix6d whitening = Matrix6d::Identity();
  std::optional<Pose> alternative;
  Matrix6d alternative_whitening = Matrix6d::Identity();
  double alternative_cost = 0.0;
};

using Motion = std::vector<MotionSample>;

struct ChainTerm {
  int channel = 0;     ///< column of the readings
  double scale = 0.0;  ///< rad or m per RMS of the channel
};

struct ChainJoint {
  JointType type = JointType::kRevolute;
  Pose frame;                    ///< z = axis; in the first body's frame, all coordinates zero
  std::vector<ChainTerm> terms;  ///< empty: the coordinate of every instant is free
};

struct ChainModel {
  std::vector<ChainJoint> joints;
  Pose mount;
  std::vector<double> coordinates;  ///< one a sample, for a single joint without terms
};

/// How well a chain explains a motion. Costs are -2 ln likelihood, up to a constant of the data.
struct ChainFit {
  ChainModel model;
  int samples = 0;
  int parameters = 0;
  double cost = 0.0;      ///< without any penalty for parameters
  double variance = 1.0;  ///< of the residual across the joint, over the declared one; at least 1
  double axis_variance = 1.0;  ///< the same along the joint
  double raw_variance = 1.0;   ///< as variance, may be below 1
  double correlation =
      1.0;  ///< number of neighbouring samples that err alike (integrated autocorrelation)
  double rotation_rms = 0.0;  ///< rad, m: robust size of what is left (across the joint)
  double translation_rms = 0.0;
  std::vector<double> scale_sigma;  ///< of every term in order, per RMS of the channel
  Eigen::MatrixXd covariance;  ///< of the parameters in the order of ChainKinematics::jacobian(),
                               ///< as if the samples erred independently
  std::vector<Vector6d> residuals;  ///< whitened, one a sample
};

struct ChainFitOptions {
  int max_iterations = 8;
  double axis_weight =
      1.0;  ///< weight of the residual along the joint, 1: channels are exact, 0: not used
  /// Of a sample, which is an outlier beyond; none: outliers cost by their size (tailed_cost).
  std::optional<double> most_cost = {};
  bool with_residuals = false;
};

/// Pose of the last body for one row of readings.
[[nodiscard]] Pose chain_pose(const ChainModel& model, const Eigen::MatrixXd& readings,
                              int instant);
/// The same with the coordinates given, one a joint.
[[nodiscard]] Pose chain_pose_at(const ChainModel& model, const std::vector<double>& coordinates);
/// Coordinate of joint k.
[[nodiscard]] double chain_coordinate(const ChainJoint& joint, const Eigen::MatrixXd& readings,
                                      int instant);

/// Refines `start`. `readings`: instants x channels.
[[nodiscard]] ChainFit fit_chain(const Motion& motion, const Eigen::MatrixXd& readings,
                                 ChainModel start, const ChainFitOptions& options = {});

/// The axis of the (last) joint as a body twist of the child, unit rotation or translation; the
/// joint's own motion leaves it where it is.
[[nodiscard]] Vector6d axis_in_child(const ChainModel& model);

}  // namespace kinescope::structure_search
