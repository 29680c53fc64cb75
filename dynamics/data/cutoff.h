// SPDX-License-Identifier: Apache-2.0
//
// The cut-off frequency at which the expected error of the filtered accelerations is smallest.
//
// With S the spectrum of the motion, N that of noise and vibration and H the filter, a signal is
// wrong by
//     J(cutoff) = integral of w^2k [ (1 - H)^2 S + H^2 N ] dw
// relative to the integral of w^2k S: motion that was cut away plus noise that was let through; k
// derivatives lie between the logged signal and the acceleration (2 from position, 1 from
// velocity), none for the torque. This is Wiener's criterion (1949) for a filter of given form. All
// joints and the torques must be filtered alike, so the cut-off minimises the expected error of the
// torque equation: the sum over the joints of J of the torque and J of the acceleration times the
// share of the torque that goes with it.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "dynamics/data/spectrum.h"

namespace kinescope {

/// Range of the cut-offs that are tried; the highest of the sampling rate.
inline constexpr double kHighestCutoff = 0.4;
inline constexpr double kLowestCutoffHz = 0.05;

/// The response of the filters of this room: 1 / (1 + (sqrt 2 - 1) (f / cutoff)^2n), -3 dB at the
/// cut-off.
[[nodiscard]] double filter_response(double frequency_hz, double cutoff_hz, int order);

/// The spectra that the choice weighs, one a joint.
struct CutoffEvidence {
  std::vector<Spectrum> motion;
  int derivatives = 2;           ///< between the motion's signal and the acceleration
  std::vector<Spectrum> torque;  ///< may be empty
  Eigen::VectorXd shares;        ///< of the torque that goes with the acceleration; 0: at rest
  /// Mean speed of what a trajectory travels from its begin to its end, and how long it takes: the
  /// motion of a joint whose spectrum shows none. Empty: not known.
  Eigen::VectorXd travel_speed = {};
  double travel_s = 0.0;
};

struct CutoffChoice {
  double cutoff_hz = 0.0;
  /// sqrt(J) of each joint's acceleration at the cut-off; NaN of a joint that does not move.
  Eigen::VectorXd expected_error;
  Eigen::VectorXd motion_end_hz;  ///< of each joint; 0 where it does not move
  bool at_edge = false;           ///< the criterion still falls at the highest frequency looked at
  bool chosen = false;            ///< false: stated by the caller, or nothing moves
};

/// The cut-off with the smallest sum between the median of the joints' ends of motion and 0.4 times
/// the sampling rate. With `stated_hz` > 0 the errors at that cut-off.
[[nodiscard]] CutoffChoice choose_cutoff(const CutoffEvidence& evidence, int order,
                                         double stated_hz = 0.0);

}  // namespace kinescope
