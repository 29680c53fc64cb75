// SPDX-License-Identifier: Apache-2.0
//
// The generalised-momentum observer, the baseline of contact detection: the external torque through
// a first-order low-pass, r' = gain (external torque - r). De Luca and Mattone 2005; Haddadin,
// De Luca, Albu-Schaeffer 2017, eq. 41. Without a mass matrix it is the low-passed difference of
// measured and predicted torque.
#pragma once

#include <vector>

#include "dynamics/contact/balance.h"
#include "dynamics/contact/contact.h"

namespace kinescope {

/// External torque as the observer follows it, joints x samples. Starts from none, also after
/// samples that are not finite or not later, and after gaps of ten steps. Throws bad_request for a
/// gain that is not positive.
[[nodiscard]] Eigen::MatrixXd observe_momentum(const std::vector<BalanceSample>& samples,
                                               double gain_per_s);

/// How the observer's output becomes one statistic.
enum class ObserverTest {
  kLargestJoint,  ///< largest |r_j| / sigma_j: a threshold a joint, as usual
  kAllJoints      ///< r' S^-1 r
};

/// Spread of the observer's output without contact, and the threshold at a declared rate by the
/// same tail fit as ours.
struct ObserverCalibration {
  double gain_per_s = 0.0;
  ObserverTest test = ObserverTest::kLargestJoint;
  double step_s = 0.0;
  Eigen::MatrixXd spread;  ///< inverse covariance; of the variances alone for kLargestJoint
  double threshold = 0.0;
  TailFit tail;
};

/// `use`: one a sample, 0 leaves it out; empty uses all.
[[nodiscard]] ObserverCalibration calibrate_observer(const std::vector<BalanceSample>& samples,
                                                     const std::vector<char>& use,
                                                     double gain_per_s,
                                                     double false_alarms_per_hour,
                                                     ObserverTest test);

/// Spans with the statistic above the threshold, those that are less than `merge_s` apart as one;
/// begin_s is when the alarm came.
[[nodiscard]] std::vector<TimeSpan> observer_alarms(const ObserverCalibration& calibration,
                                                    const std::vector<BalanceSample>& samples,
                                                    double merge_s = 0.1);

}  // namespace kinescope
