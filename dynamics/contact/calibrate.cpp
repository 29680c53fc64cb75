// SPDX-License-Identifier: Apache-2.0
//
// Noise, then thresholds, then which spans pass them: contacts, left out of the next round, until
// nothing changes.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "dynamics/contact/contact.h"
#include "dynamics/contact/onset_bank.h"
#include "dynamics/contact/statistic_log.h"
#include "kinematics/core/chi_square.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr int kMaxRounds = 8;
/// Thresholds of the first round, where nothing is left out yet: this many medians of the
/// statistic.
constexpr double kFirstMedians = 12.0;
/// Of free motion, to learn a tail from; thresholds of few are high (TailFit::shape).
constexpr int kFewestPeaks = 5;
/// Peaks that may hide each other: begin and end of three contacts.
constexpr int kMostSetAside = 6;

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

/// What a standard normal variable exceeds with the probability.
double normal_quantile(double probability) {
  double low = 0.0;
  double high = 40.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(middle / std::numbers::sqrt2) > probability ? low : high) = middle;
  }
  return low;
}

/// No lower than what white innovations would pass as declared: a noise that is put too high where
/// most samples are makes the statistic small there, and says nothing of the few others.
void keep_above_white(ContactCalibration& calibration) {
  const double rate_per_s = calibration.options.false_alarms_per_hour / kSecondsPerHour;
  double look_s = calibration.step_s;
  for (double& threshold : calibration.thresholds) {
    const double z = normal_quantile(std::min(0.5, rate_per_s * look_s));
    threshold =
        std::max(threshold, chi_square_quantile(static_cast<double>(calibration.joints()), z));
    look_s *= 2.0;
  }
}

/// Each octave its own threshold, then one factor for all so that together they pass as declared.
void set_thresholds(const contact::StatisticLog& log, const std::vector<char>& use,
                    ContactCalibration& calibration) {
  const double rate_per_s = calibration.options.false_alarms_per_hour / kSecondsPerHour;
  calibration.tails.clear();
  double shape = 0.0;
  for (Eigen::Index o = 0; o < calibration.thresholds.size(); ++o) {
    calibration.tails.push_back(fit_tail({.values = octave_values(log, o, use),
                                          .step_s = calibration.step_s,
                                          .fewest_peaks = kFewestPeaks}));
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
                .step_s = calibration.step_s,
                .fewest_peaks = kFewestPeaks});
  calibration.thresholds *= calibration.joint_tail.quantile(rate_per_s);
  keep_above_white(calibration);
  calibration.exposure_s = calibration.joint_tail.exposure_s;
}

/// The samples of the largest ratio and its neighbours that belong to it, left out of `use`; the
/// ratio.
double set_aside_largest(const std::vector<BalanceSample>& samples,
                         const std::vector<double>& ratio, double level, double guard_s,
                         std::vector<char>& use) {
  std::size_t top = use.size();
  for (std::size_t k = 0; k < use.size(); ++k) {
    if (use[k] == 0 || std::isnan(ratio[k])) continue;
    if (top == use.size() || ratio[k] > ratio[top]) top = k;
  }
  if (top == use.size()) return 0.0;
  // As far as it stays above the level of the tail's peaks.
  std::size_t first = top;
  std::size_t last = top;
  while (first > 0 && ratio[first - 1] > level) --first;
  while (last + 1 < use.size() && ratio[last + 1] > level) ++last;
  const double begin_s = samples[first].stamp_s - guard_s;
  const double end_s = samples[last].stamp_s + guard_s;
  for (std::size_t k = 0; k < use.size(); ++k) {
    if (samples[k].stamp_s >= begin_s && samples[k].stamp_s <= end_s) use[k] = 0;
  }
  return ratio[top];
}

/// Contacts that pass no threshold yet still bend the tail to hide behind it: the largest peaks are
/// set aside one after another, and stay so where the rest calls them alarms (generalised extreme
/// Studentised deviate, Rosner 1983).
void set_thresholds_robustly(const std::vector<BalanceSample>& samples,
                             const contact::StatisticLog& log, const std::vector<char>& use,
                             ContactCalibration& calibration) {
  set_thresholds(log, use, calibration);
  ContactCalibration trial = calibration;
  std::vector<char> kept = use;
  for (int aside = 0; aside < kMostSetAside; ++aside) {
    const std::vector<double> ratio = contact::largest_ratio(log, trial.thresholds, kept);
    const Eigen::VectorXd before = trial.thresholds;
    std::vector<char> without = kept;
    const double level =
        trial.joint_tail.level /
        trial.joint_tail.quantile(calibration.options.false_alarms_per_hour / kSecondsPerHour);
    const std::vector<char> inside = kept;
    if (set_aside_largest(samples, ratio, level, calibration.options.guard_s, without) <= 0.0)
      return;
    try {
      set_thresholds(log, without, trial);
    } catch (const Error&) {
      return;  // nothing is left to learn from
    }
    // Of what was set aside just now.
    std::vector<char> last(use.size(), 0);
    for (std::size_t k = 0; k < last.size(); ++k)
      last[k] = inside[k] != 0 && without[k] == 0 ? 1 : 0;
    double peak = 0.0;
    for (const double value : contact::largest_ratio(log, trial.thresholds, last)) {
      if (value > peak) peak = value;
    }
    kept = std::move(without);
    if (peak >= 1.0) calibration = trial;
  }
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

void learn_from_all(const std::vector<BalanceSample>& samples, ContactCalibration& calibration) {
  calibration.thresholds.setConstant(std::numeric_limits<double>::max());
  const std::vector<char> all(samples.size(), 1);
  set_thresholds(contact::log_statistics(calibration, samples), all, calibration);
  calibration.iterations = 1;
  calibration.status = ContactCalibrationStatus::kSettled;
}

/// Samples that noise is learned from; those of the log that is looked at begin at `second`.
struct CalibrationLogs {
  std::vector<BalanceSample> samples;
  std::size_t second = 0;

  [[nodiscard]] BalanceNoise noise(const std::vector<char>& use = {}) const {
    return second < samples.size() ? estimate_noise_of_both(samples, use, second)
                                   : estimate_noise(samples, use);
  }
};

void leave_contacts_out(const CalibrationLogs& logs, ContactCalibration& calibration) {
  const std::vector<BalanceSample>& samples = logs.samples;
  const ContactOptions& options = calibration.options;
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
      set_thresholds_robustly(samples, log, use, calibration);
      calibration.status = ContactCalibrationStatus::kSettled;
      break;
    }
    calibration.noise = logs.noise(use);
    set_thresholds_robustly(samples, log, use, calibration);
  }
  calibration.iterations = std::min(calibration.iterations, kMaxRounds);
}

ContactCalibration calibrate(const CalibrationLogs& logs, const ContactOptions& options) {
  const std::vector<BalanceSample>& samples = logs.samples;
  validate(options);
  check_samples(samples);
  ContactCalibration calibration;
  calibration.options = options;
  calibration.step_s = median_step_s(samples);
  calibration.thresholds = Eigen::VectorXd::Zero(octaves_of(calibration));
  const std::vector<char> all(samples.size(), 1);
  calibration.noise = logs.noise(options.may_contain_contacts ? std::vector<char>{} : all);
  if (!options.may_contain_contacts) {
    learn_from_all(samples, calibration);
    return calibration;
  }
  const ContactCalibration begun = calibration;
  try {
    leave_contacts_out(logs, calibration);
  } catch (const Error& error) {
    // Too little is left: with all of it, contacts included, thresholds are high, not wrong.
    if (error.code() != ExitCode::kUndetermined) throw;
    calibration = begun;
    calibration.noise = logs.noise(all);
    learn_from_all(samples, calibration);
    calibration.status = ContactCalibrationStatus::kIterationLimit;
  }
  return calibration;
}

/// Both logs one behind the other, far enough apart that detection begins anew.
CalibrationLogs one_behind_the_other(const std::vector<BalanceSample>& learned,
                                     const std::vector<BalanceSample>& looked_at,
                                     const ContactOptions& options) {
  CalibrationLogs out{.samples = learned, .second = learned.size()};
  if (learned.empty() || looked_at.empty()) return out;
  const double gap_s = 1.0 + 2.0 * options.guard_s;
  const double shift_s = learned.back().stamp_s + gap_s - looked_at.front().stamp_s;
  for (const BalanceSample& sample : looked_at) {
    out.samples.push_back(sample);
    out.samples.back().stamp_s += shift_s;
  }
  return out;
}

}  // namespace

ContactCalibration calibrate_contacts(const std::vector<BalanceSample>& samples,
                                      const ContactOptions& options) {
  return calibrate({.samples = samples, .second = samples.size()}, options);
}

ContactCalibration calibrate_contacts(const std::vector<BalanceSample>& learned,
                                      const std::vector<BalanceSample>& looked_at,
                                      const ContactOptions& options) {
  ContactCalibration out = calibrate(one_behind_the_other(learned, looked_at, options), options);
  std::erase_if(out.excluded,
                [&](const TimeSpan& span) { return span.begin_s > learned.back().stamp_s; });
  return out;
}

}  // namespace kinescope
