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

/// A time over which the reading stays on one step: the value may be anywhere within it.
struct Hold {
  double first_s = 0.0;
  double last_s = 0.0;
  /// Within this time of an edge, where the value is known, the motion is bound to it; 0 at an end
  /// of the log.
  double after_first_s = 0.0;
  double before_last_s = 0.0;

  /// How much of the error in the middle of the hold there is at a time, 0 to 1.
  [[nodiscard]] double share(double t_s) const;
};

struct UnsteadyReading {
  std::vector<double> times_s;  ///< of the samples
  bool in_steps = false;
  double size = 0.0;        ///< distance of the steps, or standard deviation of the noise
  double error = 0.0;       ///< rms by which a reading is off
  Eigen::VectorXd motion;   ///< samples, in the unit of the reading
  std::vector<Hold> holds;  ///< longer than the motion's own changes take
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
