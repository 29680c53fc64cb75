// SPDX-License-Identifier: Apache-2.0
//
// Takes   a robot and one of its links.
// Gives   the joints on the way to that link as a Denavit-Hartenberg table: constant transforms
// before
//         the first and behind the last joint, and between every joint and the next
//         Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta), z along the joint's axis.
// Frames  m and rad; the value of a joint adds to its theta (revolute) or d (prismatic).
// Method  common normals (Denavit and Hartenberg 1955); standard rows after Paul 1981, modified
// ones
//         after Craig 1986. Of nearly parallel axes the normal is ill-conditioned: there d = 0 and
//         the further angle beta takes its place (Hayati and Mirmirani 1985). beta = 0 elsewhere.
// Not here: uncertainties (calib/quality/dh_uncertainty.h).
#pragma once

#include <vector>

#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

/// How an axis is reached from the one before it.
enum class DhNormal {
  kNone,       ///< the last one: no axis follows
  kCommon,     ///< along their common normal
  kParallel,   ///< nearly parallel: in the plane across the first one
  kOneLine,    ///< nearly one line: theta and a, which say where across, are ill-conditioned
  kDirection,  ///< parallel to a joint that slides, which has a direction, but no place
};

/// Behind a joint, up to the axis of the next one: Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta).
struct DhStep {
  double theta = 0.0;  ///< rad; the joint's value adds to it where it turns
  double d = 0.0;      ///< m; the joint's value adds to it where it slides
  double a = 0.0;      ///< m
  double alpha = 0.0;  ///< rad
  double beta = 0.0;   ///< rad
  DhNormal normal = DhNormal::kNone;
};

/// T_base_tip = base * step(joints[0]) * .. * step(joints[n-1]) * tool. theta and d of the first
/// step are 0, and so is all of the last one: base and tool hold what is free there.
struct DhChain {
  LinkId tip;
  std::vector<JointId> joints;  ///< that move, from the root on
  Pose base;                    ///< T_base_0: z along the first axis
  std::vector<DhStep> steps;    ///< one a joint
  Pose tool;                    ///< T_n_tip
};

/// Ends of the robot's chains that a joint moves: links that carry no other, in the tree's order.
[[nodiscard]] std::vector<LinkId> chain_tips(const KinematicTree& tree);

[[nodiscard]] DhChain dh_chain(const KinematicTree& tree, LinkId tip);
/// The same described as `like` is, of the same robot with slightly other numbers.
[[nodiscard]] DhChain dh_chain(const KinematicTree& tree, const DhChain& like);

/// Which numbers of a step stand in one row.
enum class DhConvention {
  kStandard,  ///< T_i-1_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i) Ry(beta_i)
  kModified   ///< T_i-1_i = Tx(a_i-1) Rx(alpha_i-1) Ry(beta_i-1) Rz(theta_i) Tz(d_i)
};

/// One row a joint. Standard: the steps. Modified: theta and d of a joint's step with a, alpha,
/// beta (and normal) of the one before it.
[[nodiscard]] std::vector<DhStep> dh_rows(const std::vector<DhStep>& steps,
                                          DhConvention convention);

}  // namespace kinescope
