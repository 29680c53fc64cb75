// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/momentum_observer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

std::vector<double> statistic(const ObserverCalibration& calibration,
                              const Eigen::MatrixXd& observed) {
  std::vector<double> out(static_cast<std::size_t>(observed.cols()));
  for (std::size_t k = 0; k < out.size(); ++k) {
    const Eigen::VectorXd r = observed.col(static_cast<Eigen::Index>(k));
    if (calibration.test == ObserverTest::kAllJoints) {
      out[k] = r.dot(calibration.spread * r);
    } else {
      out[k] = r.cwiseAbs2().cwiseProduct(calibration.spread.diagonal()).maxCoeff();
    }
  }
  return out;
}

}  // namespace

/// r = gain * low-passed derivative of the imbalance, with the exact solution of the low-pass over
/// a step in which the external torque is constant.
Eigen::MatrixXd observe_momentum(const std::vector<BalanceSample>& samples, double gain_per_s) {
  if (!(gain_per_s > 0.0) || !std::isfinite(gain_per_s)) {
    throw bad_request("momentum observer", "a gain that is not positive", "give 5 to 500 per s");
  }
  const Eigen::Index n = samples.empty() ? 0 : samples[0].drive.size();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, static_cast<Eigen::Index>(samples.size()));
  if (samples.size() < 2) return out;
  const double longest_step = kGapSteps * median_step_s(samples);
  std::size_t last = 0;
  for (std::size_t k = 1; k < samples.size(); ++k) {
    if (!is_finite(samples[k])) continue;
    const BalanceSample& a = samples[last];
    const BalanceSample& b = samples[k];
    const double step = b.stamp_s - a.stamp_s;
    const auto column = static_cast<Eigen::Index>(k);
    if (step > 0.0 && step < longest_step) {
      const Eigen::VectorXd torque = (b.momentum - a.momentum) / step - 0.5 * (a.drive + b.drive);
      const double kept = std::exp(-gain_per_s * step);
      out.col(column) = kept * out.col(static_cast<Eigen::Index>(last)) + (1.0 - kept) * torque;
    }
    last = k;
  }
  return out;
}

ObserverCalibration calibrate_observer(const std::vector<BalanceSample>& samples,
                                       const std::vector<char>& use, double gain_per_s,
                                       double false_alarms_per_hour, ObserverTest test) {
  const Eigen::MatrixXd observed = observe_momentum(samples, gain_per_s);
  ObserverCalibration calibration;
  calibration.gain_per_s = gain_per_s;
  calibration.test = test;
  calibration.step_s = median_step_s(samples);
  const Eigen::Index n = observed.rows();
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
  double count = 0.0;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    if (!use.empty() && use[k] == 0) continue;
    const Eigen::VectorXd r = observed.col(static_cast<Eigen::Index>(k));
    covariance += r * r.transpose();
    count += 1.0;
  }
  covariance /= count;
  if (test == ObserverTest::kAllJoints) {
    calibration.spread = CholeskyFactor(covariance).inverse();
  } else {
    calibration.spread = Eigen::MatrixXd(covariance.diagonal().cwiseInverse().asDiagonal());
  }
  StatisticRecord record{.values = statistic(calibration, observed), .step_s = calibration.step_s};
  for (std::size_t k = 0; k < record.values.size(); ++k) {
    if (!use.empty() && use[k] == 0) record.values[k] = std::numeric_limits<double>::quiet_NaN();
  }
  calibration.tail = fit_tail(record);
  calibration.threshold = calibration.tail.quantile(false_alarms_per_hour / 3600.0);
  return calibration;
}

std::vector<TimeSpan> observer_alarms(const ObserverCalibration& calibration,
                                      const std::vector<BalanceSample>& samples, double merge_s) {
  const std::vector<double> values =
      statistic(calibration, observe_momentum(samples, calibration.gain_per_s));
  std::vector<TimeSpan> spans;
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (values[k] < calibration.threshold) continue;
    const double t = samples[k].stamp_s;
    if (spans.empty() || t - spans.back().end_s > merge_s) {
      spans.push_back({.begin_s = t, .end_s = t});
    } else {
      spans.back().end_s = t;
    }
  }
  return spans;
}

}  // namespace kinescope
