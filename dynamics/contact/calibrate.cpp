// SPDX-License-Identifier: Apache-2.0
//
// Noise, then thresholds, then which spans pass them: contacts, left out of the next round, until
// nothing changes.
#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/contact/contact.h"
#include "dynamics/contact/onset_bank.h"
#include "dynamics/contact/statistic_log.h"
#include "kinematics/core/chi_square.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr int kMaxRounds = 8;
constexpr double kSecondsPerHour = 3600.0;
/// Thresholds of the first round, where nothing is left out yet: this many medians of the
/// statistic.
constexpr double kFirstMedians = 12.0;

double median_of_finite(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  return median_of(std::move(values));
}

std::vector<double> octave_values(const contact::StatisticLog& log, Eigen::Index octave,
                                  const std::vector<char>& use) {
  std::vector<double> out(use.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t k = 0; k < use.size(); ++k) {
    if (use[k] != 0) out[k] = log.octaves(octave, static_cast<Eigen::Index>(k));
  }
  return out;
}

Eigen::Index octaves_of(const ContactCalibration& calibration) {
  const double steps = calibration.options.longest_window_s / calibration.step_s;
  return contact::OnsetBank(1, std::max(1, static_cast<int>(std::lround(steps)))).octaves();
}

/// Each octave its own threshold, then one factor for all so that together they pass as declared.
void set_thresholds(const contact::StatisticLog& log, const std::vector<char>& use,
                    ContactCalibration& calibration) {
  const double rate_per_s = calibration.options.false_alarms_per_hour / kSecondsPerHour;
  calibration.tails.clear();
  double shape = 0.0;
  for (Eigen::Index o = 0; o < calibration.thresholds.size(); ++o) {
    calibration.tails.push_back(
        fit_tail({.values = octave_values(log, o, use), .step_s = calibration.step_s}));
    shape +=
        calibration.tails.back().own_shape / static_cast<double>(calibration.thresholds.size());
  }
  // One shape for all: extrapolation is sensitive to it, and a single tail says little of it.
  for (Eigen::Index o = 0; o < calibration.thresholds.size(); ++o) {
    TailFit& tail = calibration.tails[static_cast<std::size_t>(o)];
    tail.set_shape(shape);
    calibration.thresholds[o] = tail.quantile(rate_per_s);
  }
  calibration.joint_tail =
      fit_tail({.values = contact::largest_ratio(log, calibration.thresholds, use),
                .step_s = calibration.step_s});
  calibration.thresholds *= calibration.joint_tail.quantile(rate_per_s);
  calibration.exposure_s = calibration.joint_tail.exposure_s;
}

/// From the bulk of the statistics, whatever contacts the log may hold.
void set_first_thresholds(const std::vector<BalanceSample>& samples,
                          ContactCalibration& calibration) {
  calibration.thresholds.setConstant(std::numeric_limits<double>::max());
  const contact::StatisticLog log = contact::log_statistics(calibration, samples);
  const std::vector<char> all(samples.size(), 1);
  const double least = 3.0 * chi_square_quantile(static_cast<double>(calibration.joints()), 5.2);
  for (Eigen::Index o = 0; o < calibration.thresholds.size(); ++o) {
    calibration.thresholds[o] =
        std::max(least, kFirstMedians * median_of_finite(octave_values(log, o, all)));
  }
}

bool same(const std::vector<TimeSpan>& a, const std::vector<TimeSpan>& b, double tolerance_s) {
  return std::ranges::equal(a, b, [&](const TimeSpan& x, const TimeSpan& y) {
    return std::abs(x.begin_s - y.begin_s) < tolerance_s &&
           std::abs(x.end_s - y.end_s) < tolerance_s;
  });
}

std::vector<TimeSpan> spans_of(const std::vector<ContactEvent>& events) {
  std::vector<TimeSpan> out;
  out.reserve(events.size());
  for (const ContactEvent& event : events) {
    out.push_back({.begin_s = std::min(event.onset_s, event.alarm_s), .end_s = event.end_s});
  }
  return out;
}

void check_samples(const std::vector<BalanceSample>& samples) {
  if (samples.empty()) {
    throw undetermined("contact", "no samples to calibrate with", "record free motion");
  }
  for (const BalanceSample& sample : samples) {
    if (sample.drive.size() != samples[0].drive.size() || sample.drive.size() == 0) {
      throw bad_request("contact", "samples of different numbers of joints",
                        "calibrate with logs of one robot");
    }
  }
}

}  // namespace

ContactCalibration calibrate_contacts(const std::vector<BalanceSample>& samples,
                                      const ContactOptions& options) {
  validate(options);
  check_samples(samples);
  ContactCalibration calibration;
  calibration.options = options;
  calibration.step_s = median_step_s(samples);
  calibration.thresholds = Eigen::VectorXd::Zero(octaves_of(calibration));
  calibration.noise = estimate_noise(samples);
  if (!options.may_contain_contacts) {
    calibration.thresholds.setConstant(std::numeric_limits<double>::max());
    const std::vector<char> all(samples.size(), 1);
    set_thresholds(contact::log_statistics(calibration, samples), all, calibration);
    calibration.iterations = 1;
    calibration.status = ContactCalibrationStatus::kSettled;
    return calibration;
  }
  set_first_thresholds(samples, calibration);
  calibration.status = ContactCalibrationStatus::kIterationLimit;
  for (calibration.iterations = 1; calibration.iterations <= kMaxRounds; ++calibration.iterations) {
    const contact::StatisticLog log = contact::log_statistics(calibration, samples);
    const std::vector<TimeSpan> spans = spans_of(log.events);
    const bool settled =
        calibration.iterations > 1 && same(spans, calibration.excluded, options.guard_s);
    calibration.excluded = spans;
    const std::vector<char> use = contact::outside(samples, spans, options.guard_s);
    if (settled) {
      set_thresholds(log, use, calibration);
      calibration.status = ContactCalibrationStatus::kSettled;
      break;
    }
    calibration.noise = estimate_noise(samples, use);
    set_thresholds(log, use, calibration);
  }
  calibration.iterations = std::min(calibration.iterations, kMaxRounds);
  return calibration;
}

}  // namespace kinescope
