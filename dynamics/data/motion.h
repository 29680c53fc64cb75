// SPDX-License-Identifier: Apache-2.0
//
// Takes   a checked TorqueLog.
// Gives   TorqueSamples: positions, velocities, accelerations and torques, all through one
// low-pass. Method  quintic smoothing spline, or zero-phase Butterworth filter and central
// differences; the
//         cut-off that promises the smallest error of the accelerations (cutoff.h); torque filtered
//         alike, so that the equation of motion keeps holding; ends dropped; as many samples kept
//         as the cut-off leaves independent.
// Not here: faults of the log (log_checks.h).
#pragma once

#include <vector>

#include "dynamics/data/cutoff.h"
#include "dynamics/data/log_findings.h"
#include "dynamics/data/torque_log.h"
#include "dynamics/data/torque_samples.h"

namespace kinescope {

enum class LowPass {
  kSmoothingSpline,  ///< order 3; uneven stamps as they are
  kButterworth,      ///< order 4; uneven stamps are interpolated first
  kNone              ///< rows as logged; position, velocity and acceleration must all be there
};

/// Which signal the velocities and accelerations come from.
enum class MotionSource {
  kBest,      ///< the one that promises the smallest error
  kPosition,  ///< one and two derivatives of it
  kVelocity,  ///< itself and one derivative
  kLogged     ///< velocity and acceleration as logged, filtered
};

struct MotionOptions {
  LowPass filter = LowPass::kSmoothingSpline;
  MotionSource source = MotionSource::kBest;
  double cutoff_hz = 0.0;     ///< -3 dB; 0: chosen
  double rate_hz = 0.0;       ///< of the samples given; 0: about ten times the cut-off
  double edge_periods = 1.0;  ///< dropped at either end of a trajectory, in periods of the cut-off
};

struct Motion {
  TorqueSamples samples;
  LowPass filter = LowPass::kSmoothingSpline;
  MotionSource source = MotionSource::kPosition;
  CutoffChoice cutoff;
  double rate_hz = 0.0;  ///< of the samples
  std::vector<LogFinding> findings;
};

/// Throws undetermined when no trajectory is long enough, or nothing moves and no cut-off is
/// stated; bad_request for options out of range or a source that the log does not have.
[[nodiscard]] Motion derive_motion(const TorqueLog& log, const MotionOptions& options = {});

[[nodiscard]] std::string_view to_string(LowPass filter);
[[nodiscard]] std::string_view to_string(MotionSource source);

}  // namespace kinescope
