// SPDX-License-Identifier: Apache-2.0
//
// Takes   a robot's tree, the ranges of its joints, how fast they may go.
// Gives   postures, and motions from rest to rest through them that keep to all of it.
// Units   readings in the units of the tree's channels; joint values rad or m.
// Method  minimum-jerk segments (Flash and Hogan 1985), all channels in step: on a segment every
//         joint moves monotonously between its values at the ends, so that ranges hold between
//         postures, too, and its highest speed and acceleration are known in closed form.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "kinematics/core/rng.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope::design {

/// What each joint of the tree may do; entries of fixed joints are not looked at.
struct MotionLimits {
  std::vector<JointLimits> range;
  Eigen::VectorXd velocity;      ///< rad/s or m/s, above 0
  Eigen::VectorXd acceleration;  ///< rad/s^2 or m/s^2, above 0
};

class JointSpace {
 public:
  /// Throws bad_input: a joint that moves and has no channel, a range that is none.
  JointSpace(KinematicTree tree, MotionLimits limits);

  [[nodiscard]] const KinematicTree& tree() const { return tree_; }
  [[nodiscard]] const MotionLimits& limits() const { return limits_; }
  /// One a channel that drives a joint, in the order of the joints.
  [[nodiscard]] const std::vector<std::string>& channels() const { return channels_; }
  /// Joint values of the tree, for channels that read this.
  [[nodiscard]] Eigen::VectorXd values(const Eigen::VectorXd& readings) const;
  /// Readings of a posture within all ranges, nothing where a draw is not. Ends of a range are
  /// drawn more often than its middle: by the arcsine law, the limit of D-optimal designs for
  /// polynomials (Pukelsheim 2006, section 9.5).
  [[nodiscard]] std::optional<Eigen::VectorXd> draw(Rng& rng) const;
  /// Every joint that a channel is drawn for in the middle of its range.
  [[nodiscard]] Eigen::VectorXd middle() const;
  /// s that the fastest allowed motion takes from rest to rest.
  [[nodiscard]] double shortest_s(const Eigen::VectorXd& from, const Eigen::VectorXd& to) const;

 private:
  [[nodiscard]] double reading_for(std::size_t channel, double value,
                                   const Eigen::VectorXd& readings) const;
  template <typename Share>
  [[nodiscard]] Eigen::VectorXd readings_at(Share share) const;
  [[nodiscard]] bool within(const Eigen::VectorXd& values) const;

  KinematicTree tree_;
  MotionLimits limits_;
  std::vector<std::string> channels_;
  std::vector<std::size_t> leaders_;     // the joint that each channel is drawn for
  std::vector<std::size_t> draw_order_;  // of channels: those that others depend on first
  Eigen::MatrixXd by_reading_;           // joints x channels: d value / d reading
  Eigen::VectorXd at_zero_;              // joint values where all channels read 0
};

/// A motion through postures, from rest to rest between any two.
class RestToRestPath {
 public:
  /// `postures`: readings, one or more; in order. The motion takes `duration_s`, which its shortest
  /// one is not longer than: segments are slowed down alike.
  RestToRestPath(const JointSpace& space, std::vector<Eigen::VectorXd> postures, double duration_s);
  /// Of the fastest motion that the limits allow.
  [[nodiscard]] static double shortest_s(const JointSpace& space,
                                         const std::vector<Eigen::VectorXd>& postures);
  [[nodiscard]] double duration_s() const { return ends_s_.back(); }
  /// Before the beginning and after the end the first and the last posture.
  [[nodiscard]] Eigen::VectorXd readings(double time_s) const;

 private:
  std::vector<Eigen::VectorXd> postures_;
  std::vector<double> ends_s_;  // when each posture is reached
};

/// The postures in an order in which the motion through them takes little time: nearest neighbour
/// from the first, then 2-opt (Croes 1958). Deterministic; O(n^2) a round.
[[nodiscard]] std::vector<Eigen::VectorXd> in_short_order(const JointSpace& space,
                                                          std::vector<Eigen::VectorXd> postures);

}  // namespace kinescope::design
