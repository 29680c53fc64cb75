// SPDX-License-Identifier: Apache-2.0
//
// Detected contacts against labels.
#pragma once

#include <optional>
#include <vector>

#include "dynamics/contact/contact.h"

namespace kinescope {

/// What is known of a true contact.
struct ContactLabel {
  double begin_s = 0.0;
  double end_s = 0.0;
  int link = -1;  ///< as ContactEvent::link; -1 where not known
};

/// An alarm as any detector gives it.
struct DetectedContact {
  double alarm_s = 0.0;
  double end_s = 0.0;
  double onset_s = 0.0;
  int link = -1;
};

struct LabelOutcome {
  int detection = -1;    ///< index of the first that overlaps; -1: missed
  double delay_s = 0.0;  ///< alarm after the label's begin
  double onset_error_s = 0.0;
  double end_error_s = 0.0;  ///< of the last that overlaps
  bool link_right = false;
};

struct ContactScore {
  std::vector<LabelOutcome> labels;  ///< one a label
  int found = 0;
  int missed = 0;
  int invented = 0;  ///< detections that overlap no label
  int repeated = 0;  ///< further detections of a label that was found
  int link_right = 0;
  double median_delay_s = 0.0;  ///< of those found; NaN of none
  double mean_delay_s = 0.0;
  double worst_delay_s = 0.0;
  double median_end_error_s = 0.0;  ///< of absolute values
};

/// A detection belongs to the first label that it overlaps, from alarm to end, with `slack_s` after
/// the label's end. An alarm before a label's begin is not its detection.
[[nodiscard]] ContactScore score_contacts(const std::vector<ContactLabel>& labels,
                                          const std::vector<DetectedContact>& detections,
                                          double slack_s = 0.05);

[[nodiscard]] std::vector<DetectedContact> detections_of(const std::vector<ContactEvent>& events);
[[nodiscard]] std::vector<DetectedContact> detections_of(const std::vector<TimeSpan>& alarms);

}  // namespace kinescope
