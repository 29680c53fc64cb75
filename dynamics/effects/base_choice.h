// SPDX-License-Identifier: Apache-2.0
//
// Which rigid bodies a log's torques are measured against, and how much each joint's torque
// scatters. Internal to this room.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "dynamics/effects/traced_torque.h"

namespace kinescope::effects {

/// Directions of parameters below this share of the largest one's square, columns of length 1, are
/// not observable.
inline constexpr double kUnobservable = 1e-10;

/// The log at the instants, ready for regressions.
struct BaseData {
  Eigen::MatrixXd q, dq, ddq, torque;   ///< instants x joints
  Eigen::MatrixXd declared;             ///< torque of the model as declared, friction and all
  std::vector<Eigen::MatrixXd> rigid;   ///< regressor of each joint, instants x 10 bodies
  std::vector<Eigen::MatrixXd> drives;  ///< columns that a joint's drive may add
  Eigen::MatrixXd way;                  ///< of friction, -1 to 1, instants x joints
  Eigen::MatrixXd load;                 ///< that bodies put on a joint, instants x joints
  std::vector<Eigen::MatrixXd> common;  ///< of each joint: a payload and gravity, shared parameters
  std::vector<int> fold;
};

/// Every joint's columns, each joint alone: residuals and noise (by their median size).
struct WidestFit {
  Eigen::MatrixXd residual;  ///< instants x joints, whitened
  Eigen::VectorXd sigma;
};
[[nodiscard]] WidestFit widest_fit(const BaseData& data);

/// The instants whose whitened residuals are all within a few sigmas: contacts and outliers must
/// not decide about masses.
[[nodiscard]] BaseData without_outliers(const BaseData& data, const Eigen::MatrixXd& whitened);

/// Identified masses bend to what a short or slow log shows: that they predict better must be
/// clear, by this Student's t. Chosen: true gains, payloads and cross talk gave up to 0.5, wrong
/// masses 4.5 and more (17 logs of nine robots).
inline constexpr double kClearlyBetter = 3.0;

/// Student's t of what held-out squares of the same folds (or stretches) differ by.
[[nodiscard]] double paired_t(const Eigen::VectorXd& worse, const Eigen::VectorXd& better);

/// Held-out error of rigid bodies as declared and identified, drives and common terms free for
/// both: root mean square, whitened; Student's t of the folds' squares, declared less identified.
struct BaseErrors {
  double declared = 0.0;
  double identified = 0.0;
  double t = 0.0;
};
[[nodiscard]] BaseErrors compare_bases(const BaseData& data, const Eigen::VectorXd& sigma);

/// Parameters of the bodies that explain the torque best beside the drives (least squares,
/// whitened, directions that the log does not show left at zero), 10 bodies. The load that rubs is
/// that of these bodies themselves, from data.load on; a load of other bodies as a column of its
/// own would take a part of theirs.
[[nodiscard]] Eigen::VectorXd identified_bodies(const BaseData& data, const Eigen::VectorXd& sigma);

}  // namespace kinescope::effects
