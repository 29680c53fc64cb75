// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/contact_score.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace kinescope {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

double median(std::vector<double> values) {
  if (values.empty()) return kNone;
  std::ranges::sort(values);
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

void summarise(ContactScore& score) {
  std::vector<double> delays;
  std::vector<double> end_errors;
  for (const LabelOutcome& outcome : score.labels) {
    if (outcome.detection < 0) {
      ++score.missed;
      continue;
    }
    ++score.found;
    score.link_right += outcome.link_right ? 1 : 0;
    delays.push_back(outcome.delay_s);
    end_errors.push_back(std::abs(outcome.end_error_s));
  }
  score.median_delay_s = median(delays);
  score.worst_delay_s = delays.empty() ? kNone : *std::ranges::max_element(delays);
  score.mean_delay_s = delays.empty() ? kNone
                                      : std::accumulate(delays.begin(), delays.end(), 0.0) /
                                            static_cast<double>(delays.size());
  score.median_end_error_s = median(std::move(end_errors));
}

}  // namespace

ContactScore score_contacts(const std::vector<ContactLabel>& labels,
                            const std::vector<DetectedContact>& detections, double slack_s) {
  ContactScore score{.labels = std::vector<LabelOutcome>(labels.size())};
  for (std::size_t d = 0; d < detections.size(); ++d) {
    const DetectedContact& detection = detections[d];
    std::size_t label = 0;
    while (label < labels.size() && (detection.alarm_s < labels[label].begin_s ||
                                     detection.alarm_s > labels[label].end_s + slack_s)) {
      ++label;
    }
    if (label == labels.size()) {
      ++score.invented;
      continue;
    }
    LabelOutcome& outcome = score.labels[label];
    outcome.end_error_s = detection.end_s - labels[label].end_s;
    if (outcome.detection >= 0) {
      ++score.repeated;
      continue;
    }
    outcome.detection = static_cast<int>(d);
    outcome.delay_s = detection.alarm_s - labels[label].begin_s;
    outcome.onset_error_s = detection.onset_s - labels[label].begin_s;
    outcome.link_right = labels[label].link >= 0 && detection.link == labels[label].link;
  }
  summarise(score);
  return score;
}

std::vector<DetectedContact> detections_of(const std::vector<ContactEvent>& events) {
  std::vector<DetectedContact> out;
  for (const ContactEvent& event : events) {
    out.push_back({.alarm_s = event.alarm_s,
                   .end_s = event.end_s,
                   .onset_s = event.onset_s,
                   .link = event.link});
  }
  return out;
}

std::vector<DetectedContact> detections_of(const std::vector<TimeSpan>& alarms) {
  std::vector<DetectedContact> out;
  for (const TimeSpan& span : alarms) {
    out.push_back({.alarm_s = span.begin_s, .end_s = span.end_s, .onset_s = span.begin_s});
  }
  return out;
}

}  // namespace kinescope
