// SPDX-License-Identifier: Apache-2.0
//
// Readings that jump about a motion that does not: in steps (a log of few digits, an encoder of few
// counts) or by noise (a potentiometer).
// Method  a smoothing spline, its cut-off by cross-validation over every other sample (Craven and
//         Wahba 1979; Stone 1974). A reading that rests on its steps is known best where it goes on
//         to the next one: there it passes the edge between the two (level crossings, Mark and Todd
//         1981). What is found stays within the step that is read.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "kinematics/log/joint_log.h"

namespace kinescope {

/// A time over which the motion may stand apart from the truth.
struct Doubt {
  double first_s = 0.0;
  double last_s = 0.0;
  /// After the beginning and before the end: over that time it grows and goes. 0 at an end of the
  /// log.
  double rise_s = 0.0;
  double fall_s = 0.0;
  double sigma = 0.0;  ///< in the unit of the reading

  /// How much of it there is at a time, 0 to 1.
  [[nodiscard]] double share(double t_s) const;
};

struct UnsteadyReading {
  std::vector<double> times_s;  ///< of the samples
  bool in_steps = false;
  double size = 0.0;       ///< distance of the steps, or standard deviation of the noise
  double error = 0.0;      ///< rms by which a reading is off
  Eigen::VectorXd motion;  ///< samples, in the unit of the reading
  /// Of readings in steps: as closely as the motion changes, and of each step on which the reading
  /// rests for longer than that as a whole.
  std::vector<Doubt> doubts;

  /// Drops doubts that are less than what somebody sees of the value: `information` of it, one over
  /// its variance, at times in any order.
  void keep_visible(const Eigen::VectorXd& seen_s, const Eigen::VectorXd& information);
};

/// Distance of the steps that `values` come in. Nothing for values that lie on no grid, or on one
/// that is finer than a share of 1e-4 of their range.
[[nodiscard]] std::optional<double> step_of(const Eigen::VectorXd& values);

/// Of postures, in any order, which show steps only; without a motion.
[[nodiscard]] std::optional<UnsteadyReading> reading_in_steps(Eigen::VectorXd values);

/// `times_s` increasing. Nothing where the samples are too few, do not move, or are unsteady by
/// less than that share. A constant is not seen: a reading that is cut off has another zero than
/// one that is rounded.
[[nodiscard]] std::optional<UnsteadyReading> unsteady_reading(const std::vector<double>& times_s,
                                                              const Eigen::VectorXd& values);

/// The log with the motion in place of readings that are unsteady.
[[nodiscard]] JointLog steadied(JointLog log);

}  // namespace kinescope
