// SPDX-License-Identifier: Apache-2.0
//
// Which link was touched: a force on link k moves joints 1..k and none beyond.
#pragma once

#include <span>

#include <Eigen/Core>

namespace kinescope {

/// What the joints answered: for each joint the sum of squares of `count` numbers that are
/// independent and standard normal without external torque.
struct JointAnswers {
  Eigen::VectorXd squares;
  int count = 0;
};

struct LinkEvidence {
  int link = -1;  ///< smallest index from which on all beyond_p_value are at least the level
  Eigen::VectorXd probability;     ///< sums to 1
  Eigen::VectorXd beyond_p_value;  ///< of "the joints beyond answer nothing"
};

/// The part of each joint's torque that is independent of the joints beyond, in sigmas, from an
/// estimate of the external torque and its covariance (joints in series, base first).
[[nodiscard]] Eigen::VectorXd joint_answers(const Eigen::VectorXd& torque,
                                            const Eigen::MatrixXd& covariance);

/// From several looks at the same contact: its mean torque, which shows weak torques, and the
/// torques of short segments, which show one that changes its sign. p-values are the smallest of
/// the looks times their number; the evidence is their mean. Without external torque an answer is
/// standard normal; with one its size is anything (log-uniform from 1/2 to 1000 sigma).
/// Probabilities start equal.
[[nodiscard]] LinkEvidence link_evidence(std::span<const JointAnswers> looks, double level);

}  // namespace kinescope
