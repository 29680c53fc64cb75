// SPDX-License-Identifier: Apache-2.0
//
// How much of a signal is motion and how much is noise, by frequency.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace kinescope {

/// Pieces of evenly spaced samples of one signal.
struct EvenSeries {
  double step_s = 0.0;
  std::vector<Eigen::VectorXd> pieces;
};

/// One-sided power density.
struct Spectrum {
  Eigen::VectorXd frequency_hz;
  Eigen::VectorXd power;      ///< unit^2 / Hz
  Eigen::Index averaged = 0;  ///< windows
};

/// Welch's averaged periodogram (1967; Hann windows, half overlapping). The signal is differenced
/// `differences` times before and the response of that undone after, so that the steep spectrum of
/// a position does not leak into its floor. Pieces shorter than 32 samples are passed over; empty
/// when there is none longer.
[[nodiscard]] Spectrum power_spectrum(const EvenSeries& series, int differences);

/// A spectrum in two parts that add up to it, unit^2 / Hz at its frequencies.
struct MotionAndNoise {
  Eigen::VectorXd motion;
  Eigen::VectorXd noise;
  double end_hz = 0.0;  ///< where the motion ends; 0 where there is none
};

/// A planned motion has a spectrum that falls steeply from its lowest frequencies to the level of
/// noise and vibration, which is flat or rises in velocity. The motion ends where the velocity's
/// power (`to_velocity` derivatives of the signal) no longer stands 2.5 times above the median of
/// the two octaves over it; a peak behind that valley is vibration. Below the end the noise is
/// continued at the level it has above.
[[nodiscard]] MotionAndNoise separate(const Spectrum& spectrum, int to_velocity);

/// The same of a joint that travels at a steady speed, whose spectrum shows nothing but noise:
/// begin and end of the travel are steps of the velocity (power 4 speed^2 / (w^2 duration)), seen
/// up to where they no longer stand 2.5 times above that noise.
[[nodiscard]] MotionAndNoise steady_travel(const Spectrum& spectrum, int to_velocity, double speed,
                                           double duration_s);

}  // namespace kinescope
