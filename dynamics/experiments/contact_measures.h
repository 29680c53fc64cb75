// SPDX-License-Identifier: Apache-2.0
//
// What the runs of contact detection come to: shares, delays, invented contacts.
#pragma once

#include <optional>

#include "dynamics/experiments/contact_detection.h"
#include "dynamics/experiments/quartiles.h"

namespace kinescope::experiments {

/// Of several contacts, by one detector.
struct DetectionMeasure {
  int found = 0;
  Quartiles delay_s;   ///< of those found; NaN of none
  int link_right = 0;  ///< of those found; 0 for an observer
};

/// Contacts of one kind with similar torque.
struct TorqueGroup {
  std::size_t kind = 0;
  Quartiles torque_nm;
  int contacts = 0;
  DetectionMeasure detector;
  DetectionMeasure observer;  ///< the one chosen for the kind
};

/// Groups of as many contacts each, by ascending torque; fewer groups where there are few contacts.
[[nodiscard]] std::vector<TorqueGroup> groups_by_torque(const ContactDetection& contacts,
                                                        std::size_t kind);

/// All contacts of a kind, by one detector.
struct KindMeasure {
  int contacts = 0;
  double hours = 0.0;
  DetectionMeasure found;
  int invented = 0;
};
/// `observer`: its index; nothing: the detector.
[[nodiscard]] KindMeasure measure_kind(const ContactDetection& contacts, std::size_t kind,
                                       std::optional<std::size_t> observer);

/// Median delays of the contacts of a kind that detector and chosen observer both found.
struct PairedDelay {
  int contacts = 0;
  double detector_s = 0.0;  ///< NaN of none
  double observer_s = 0.0;
};
[[nodiscard]] PairedDelay paired_delay(const ContactDetection& contacts, std::size_t kind);

/// The observer that found most contacts of a kind; of these, the one with the least median delay.
[[nodiscard]] std::size_t best_observer(const ContactDetection& contacts, std::size_t kind);

}  // namespace kinescope::experiments
