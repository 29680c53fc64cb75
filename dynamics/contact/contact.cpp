// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/contact.h"

#include <cmath>
#include <string>

#include "dynamics/contact/detector.h"
#include "dynamics/contact/statistic_log.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

void require(bool good, const char* option, const char* remedy) {
  if (!good)
    throw bad_request("contact", std::string("option ") + option + " makes no sense", remedy);
}

/// Poisson mean whose probability of at most `count` (or, `above`, at least `count`) is 2.5 %.
double poisson_limit(int count, bool above) {
  if (above && count == 0) return 0.0;
  const auto tail = [&](double mean) {
    // By logarithms: exp(-mean) alone underflows at 745.
    double log_term = -mean;
    double sum = std::exp(log_term);
    for (int k = 1; k <= (above ? count - 1 : count); ++k) {
      log_term += std::log(mean / k);
      sum += std::exp(log_term);
    }
    return above ? 1.0 - sum : sum;
  };
  double low = 0.0;
  double high = 20.0 + 4.0 * count;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    // Fewer become likelier as the mean falls, more as it grows.
    const bool too_high = above ? tail(middle) > 0.025 : tail(middle) < 0.025;
    (too_high ? high : low) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

AlarmRate alarm_rate(int alarms, double hours) {
  return {.per_hour = alarms / hours,
          .lower_per_hour = poisson_limit(alarms, true) / hours,
          .upper_per_hour = poisson_limit(alarms, false) / hours};
}

void validate(const ContactOptions& options) {
  require(options.false_alarms_per_hour > 0.0 && options.false_alarms_per_hour <= 3600.0,
          "false_alarms_per_hour", "give a rate above 0, at most 3600");
  require(options.longest_window_s > 0.0 && options.longest_window_s <= 10.0, "longest_window_s",
          "give a time above 0, at most 10 s");
  require(options.end_window_s > 0.0 && options.end_window_s <= 10.0, "end_window_s",
          "give a time above 0, at most 10 s");
  require(options.link_level > 0.0 && options.link_level < 1.0, "link_level",
          "give a probability between 0 and 1");
  for (std::size_t k = 0; k < options.parents.size(); ++k) {
    require(options.parents[k] >= -1 && options.parents[k] < static_cast<int>(k), "parents",
            "give for each joint the number of the one that carries it, -1 for the base");
  }
  require(options.guard_s >= 0.0 && options.guard_s <= 60.0, "guard_s",
          "give a time of at most 60 s");
}

std::vector<ContactEvent> detect_contacts(const ContactCalibration& calibration,
                                          const std::vector<BalanceSample>& samples,
                                          const std::vector<TimeSpan>& loaded) {
  return contact::log_statistics(calibration, samples, loaded).events;
}

FalseAlarmCheck check_false_alarms(const ContactCalibration& calibration,
                                   const std::vector<BalanceSample>& samples,
                                   const std::vector<TimeSpan>& contacts) {
  const contact::StatisticLog log = contact::log_statistics(calibration, samples);
  const std::vector<char> use = contact::outside(samples, contacts, calibration.options.guard_s);
  FalseAlarmCheck check{.declared_per_hour = calibration.options.false_alarms_per_hour};
  std::size_t counted = 0;
  for (const char c : use) counted += c != 0 ? 1U : 0U;
  check.hours = static_cast<double>(counted) * calibration.step_s / kSecondsPerHour;
  for (const ContactEvent& event : log.events) {
    bool inside = false;
    for (const TimeSpan& span : contacts) {
      inside = inside || (event.alarm_s >= span.begin_s - calibration.options.guard_s &&
                          event.alarm_s <= span.end_s + calibration.options.guard_s);
    }
    check.alarms += inside ? 0 : 1;
  }
  const AlarmRate rate = alarm_rate(check.alarms, check.hours);
  check.observed_per_hour = rate.per_hour;
  check.lower_per_hour = rate.lower_per_hour;
  check.upper_per_hour = rate.upper_per_hour;
  const StatisticRecord record{.values = contact::largest_ratio(log, calibration.thresholds, use),
                               .step_s = calibration.step_s,
                               .fewest_peaks = 1};
  check.extrapolated_per_hour = fit_tail(record).rate_above(1.0) * kSecondsPerHour;
  return check;
}

}  // namespace kinescope
