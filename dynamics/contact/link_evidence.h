// SPDX-License-Identifier: Apache-2.0
//
// Which link was touched: a force on link k is answered by the joints between base and k and by
// no other, be it beyond or on another branch.
#pragma once

#include <span>

#include <Eigen/Core>

namespace kinescope {

/// What the joints answered: for each joint (column) the sum of squares of `count` numbers that are
/// independent and standard normal without external torque. One row a touched link that is asked
/// about; a single row does for all links of joints in series.
struct JointAnswers {
  Eigen::MatrixXd squares;
  int count = 0;
};

struct LinkEvidence {
  /// Nearest to the base such that its beyond_p_value and those of all links it carries are at
  /// least the level; -1 where there is none: joints of several branches answer.
  int link = -1;
  Eigen::VectorXd probability;     ///< sums to 1
  Eigen::VectorXd beyond_p_value;  ///< of "no joint answers but those between base and link"
};

/// `parents`: the joint that carries each joint, -1 for the base, smaller than its own number
/// (RigidBody::parent); empty: joints in series.
[[nodiscard]] bool is_series(std::span<const int> parents);

/// In sigmas, from an estimate of the external torque and its covariance: the part of each joint's
/// torque that is independent of the joints that cannot answer (first) and those nearer to the
/// link. Rows as in JointAnswers.
[[nodiscard]] Eigen::MatrixXd joint_answers(const Eigen::VectorXd& torque,
                                            const Eigen::MatrixXd& covariance,
                                            std::span<const int> parents = {});

/// From several looks at the same contact: its mean torque, which shows weak torques, and the
/// torques of short segments, which show one that changes its sign. p-values are the smallest of
/// the looks times their number; the evidence is their mean. Without external torque an answer is
/// standard normal; with one its size is anything (log-uniform from 1/2 to 1000 sigma).
/// Probabilities start equal.
[[nodiscard]] LinkEvidence link_evidence(std::span<const JointAnswers> looks, double level,
                                         std::span<const int> parents = {});

}  // namespace kinescope
