// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/statistic_log.h"

#include <cmath>
#include <limits>

#include "dynamics/contact/detector.h"

namespace kinescope::contact {

StatisticLog log_statistics(const ContactCalibration& calibration,
                            const std::vector<BalanceSample>& samples,
                            const std::vector<TimeSpan>& loaded) {
  ContactDetector detector(calibration, loaded);
  StatisticLog out;
  const Eigen::Index octaves = calibration.thresholds.size();
  out.octaves = Eigen::MatrixXd::Constant(octaves, static_cast<Eigen::Index>(samples.size()),
                                          std::numeric_limits<double>::quiet_NaN());
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const ContactDecision decision = detector.update(samples[k]);
    if (decision.resumed) out.events.pop_back();
    if (decision.ended) out.events.push_back(detector.event());
    const bool free = !decision.contact || decision.alarm;
    if (!free || decision.fault != SampleFault::kNone) continue;
    for (Eigen::Index o = 0; o < octaves; ++o) {
      const OctaveBest& best = detector.octave(static_cast<int>(o));
      if (best.age > 0) out.octaves(o, static_cast<Eigen::Index>(k)) = best.statistic;
    }
  }
  if (detector.finish()) out.events.push_back(detector.event());
  return out;
}

std::vector<char> outside(const std::vector<BalanceSample>& samples,
                          const std::vector<TimeSpan>& spans, double guard_s) {
  std::vector<char> use(samples.size(), 1);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    for (const TimeSpan& span : spans) {
      const double t = samples[k].stamp_s;
      if (t >= span.begin_s - guard_s && t <= span.end_s + guard_s) use[k] = 0;
    }
  }
  return use;
}

std::vector<double> largest_ratio(const StatisticLog& log, const Eigen::VectorXd& thresholds,
                                  const std::vector<char>& use) {
  std::vector<double> out(use.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t k = 0; k < use.size(); ++k) {
    if (use[k] == 0) continue;
    for (Eigen::Index o = 0; o < thresholds.size(); ++o) {
      const double ratio = log.octaves(o, static_cast<Eigen::Index>(k)) / thresholds[o];
      if (!(ratio <= out[k])) out[k] = std::isnan(ratio) ? out[k] : ratio;
    }
  }
  return out;
}

}  // namespace kinescope::contact
