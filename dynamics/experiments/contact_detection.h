// SPDX-License-Identifier: Apache-2.0
//
// Takes   options of simulated contacts, and a seed.
// Gives   what the contact detector and momentum observers make of them: found, delay, link, false
//         alarms.
// Units   s, N, N m, rates an hour.
// Method  the detector of dynamics/contact and observers of several gains (De Luca and Mattone
//         2005; Haddadin, De Luca, Albu-Schaeffer 2017), learned from the same motion without
//         contact, with thresholds for the same declared rate.
// Not here: errors of the model: masses, geometry and friction are the simulated arm's own.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "dynamics/contact/momentum_observer.h"
#include "dynamics/experiments/contact_world.h"
#include "kinematics/core/progress.h"

namespace kinescope::experiments {

struct ContactKind {
  std::string_view name;
  ContactShape shape = ContactShape::kTrapezoid;
  double contact_s = 0.0;
  std::vector<double> forces_n;
};
/// "soft": trapezoids of 200 ms; "hard": half-sines of 30 ms.
[[nodiscard]] std::vector<ContactKind> usual_contact_kinds();

/// Of the seven-joint arm's controller.
inline constexpr double kContactRate_hz = 1000.0;
inline constexpr int kContactJoints = 7;

struct ContactDetectionOptions {
  std::vector<ContactKind> kinds = usual_contact_kinds();
  int runs = 5;           ///< logs of each kind and force
  double seconds = 30.0;  ///< of each log, a contact a second
  int samples = 60000;    ///< of motion without contact, that the detectors learn from
  /// White noise of the torques, share of each joint's spread; none: ContactWorldOptions' own.
  std::optional<double> noise;
  double declared_per_hour = 1.0;
  std::vector<double> rates_per_hour{1.0, 10.0, 100.0, 1000.0};  ///< declared for the free motion
  int free_logs = 6;  ///< of unseen motion without contact, for each of `runs`
  std::uint64_t seed = 1;
};

struct ObserverSetting {
  double gain_per_s = 0.0;
  ObserverTest test = ObserverTest::kLargestJoint;
};

/// Of one contact.
struct ContactOutcome {
  bool found = false;
  double delay_s = 0.0;     ///< alarm after the contact's begin; NaN where not found
  bool link_right = false;  ///< of the detector; an observer names none
};

struct ContactTrial {
  int link = -1;
  double begin_s = 0.0;
  double torque_nm = 0.0;  ///< peak of the norm of the external joint torque
  ContactOutcome detector;
  std::vector<ContactOutcome> observers;  ///< as ContactDetection::observers
};

/// One log.
struct ContactRun {
  std::size_t kind = 0;  ///< of ContactDetection::kinds
  double force_n = 0.0;
  int run = 0;
  double hours = 0.0;
  int detector_invented = 0;  ///< alarms at no contact
  std::vector<int> observers_invented;
  std::vector<ContactTrial> trials;
};

/// Alarms in all free motion together.
struct FalseAlarmPoint {
  double declared_per_hour = 0.0;
  double hours = 0.0;
  int detector = 0;
  std::vector<int> observers;  ///< as ContactDetection::free_observers
};

struct ContactDetection {
  std::vector<ContactKind> kinds;
  std::vector<ObserverSetting> observers;
  std::vector<ContactRun> runs;  ///< in the order of kinds, forces, runs
  /// One a kind: the observer that found most, the fastest of these; chosen on the very contacts
  /// that it is judged on, which is in its favour.
  std::vector<std::size_t> chosen;
  std::vector<std::size_t> free_observers;  ///< those chosen, each once
  std::vector<FalseAlarmPoint> free;
};

/// Deterministic at any number of threads. Throws undetermined where the motion learned from is
/// too short.
[[nodiscard]] ContactDetection run_contact_detection(const ContactDetectionOptions& options,
                                                     int threads, const Progress& progress = {});

}  // namespace kinescope::experiments
