// SPDX-License-Identifier: Apache-2.0
//
// Takes   what a servo loop logged, and the robot as its controller believes it to be.
// Gives   LearnedTorque: what the log says of the robot, for the next controller.
// Method  the ways of `kinescope dynamics`, without its files: motion from the encoders
//         (dynamics/data), effects traced (dynamics/effects), models fitted (dynamics/models).
#pragma once

#include "dynamics/control/servo.h"
#include "dynamics/data/motion.h"

namespace kinescope::experiments {

/// Positions and torques as a robot writes them down; velocities are left to the filter.
[[nodiscard]] TorqueLog log_of_run(const ServoLog& run, const DynamicModel& robot);

/// Of log_of_run(): filtered and differentiated. `cutoff_hz` 0: chosen.
[[nodiscard]] Motion motion_of_run(const ServoLog& run, const DynamicModel& robot,
                                   double cutoff_hz = 0.0);

/// The effects beyond the nominal robot, and the parametric model for its doubt. Throws what
/// trace_torque() and fit_torque_model() throw.
[[nodiscard]] LearnedTorque learn_effects(const DynamicModel& nominal, const ServoLog& run,
                                          const Progress& progress = {});

/// A model of this kind through few inducing points. Throws what fit_torque_model() throws.
[[nodiscard]] LearnedTorque learn_model(TorqueModelKind kind, const DynamicModel& nominal,
                                        const ServoLog& run, int threads,
                                        const Progress& progress = {});

}  // namespace kinescope::experiments
