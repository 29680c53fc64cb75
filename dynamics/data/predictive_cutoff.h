// SPDX-License-Identifier: Apache-2.0
//
// The cut-off whose motion predicts torques best that were left out.
//
// Spectra tell motion from noise where the motion ends in a steep fall. A slow log has no such end:
// friction turns round at every reversal, and its harmonics carry no frequency of the motion. There
// the torque itself says how fast the motion is to be followed: of a cut-off too low the turns are
// smeared, of one too high the noise of speed and acceleration enters the prediction.
#pragma once

#include <vector>

#include "dynamics/data/motion.h"
#include "dynamics/data/torque_log.h"

namespace kinescope {

/// How the motion filtered at a cut-off predicts the torque.
struct CutoffTrial {
  double cutoff_hz = 0.0;
  /// Mean over blocks of the log of half the change of the squared error, each joint's in units of
  /// its own at the cut-off to compare with, times samples: a difference of predictive log
  /// likelihoods (Gneiting and Raftery 2007). Positive: better.
  double gain = 0.0;
  double standard_error = 0.0;  ///< of the gain, from its scatter over the blocks
};

/// Half octaves about `cutoff_hz`, from a quarter of it to 0.4 times the sampling rate. At each, a
/// rough model (rough_torque.h, and accelerations of all joints) is fitted to torques filtered
/// alike and predicts the torques as logged of contiguous blocks that are left out. Empty where the
/// log is too short for that, or has no torques.
[[nodiscard]] std::vector<CutoffTrial> try_cutoffs(const TorqueLog& log, double step_s,
                                                   MotionSource source, double cutoff_hz);

/// The trial with the largest gain where that is significant (one-sided t test at 1 % over the
/// blocks), else `cutoff_hz`: what the spectra say stands unless the torque contradicts.
[[nodiscard]] double best_predicting_cutoff(const std::vector<CutoffTrial>& trials,
                                            double cutoff_hz);

}  // namespace kinescope
