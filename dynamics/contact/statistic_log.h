// SPDX-License-Identifier: Apache-2.0
//
// What the detector's statistics were over a whole log.
#pragma once

#include <vector>

#include "dynamics/contact/contact.h"

namespace kinescope::contact {

struct StatisticLog {
  Eigen::MatrixXd octaves;  ///< octaves x samples; NaN in contact, and at samples passed over
  std::vector<ContactEvent> events;
};

[[nodiscard]] StatisticLog log_statistics(const ContactCalibration& calibration,
                                          const std::vector<BalanceSample>& samples,
                                          const std::vector<TimeSpan>& loaded = {});

/// 1 for the samples outside the spans widened by `guard_s`.
[[nodiscard]] std::vector<char> outside(const std::vector<BalanceSample>& samples,
                                        const std::vector<TimeSpan>& spans, double guard_s);

/// The largest ratio of statistic to threshold of each sample; NaN where `use` is 0.
[[nodiscard]] std::vector<double> largest_ratio(const StatisticLog& log,
                                                const Eigen::VectorXd& thresholds,
                                                const std::vector<char>& use);

}  // namespace kinescope::contact
