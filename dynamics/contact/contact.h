// SPDX-License-Identifier: Apache-2.0
//
// Takes   the balance of momentum of a log (balance.h: from a rigid-body model, or from a predicted
//         torque with its predictive sigma), without labels; then samples, one at a time or a log.
// Gives   ContactEvents: onset, end, link, external joint torque with covariance; false alarms as
// declared. Units   s, N m, N (A where torques are currents). External torque is what the contact
// exerts on the
//         robot, J' F: measured torque = M ddq + C dq + g + friction - external torque.
// Method  Willsky and Jones 1976 on the innovations of a momentum filter (balance_filter.h);
// thresholds by
//         peaks over threshold (tail.h). Not here: the torque model (rigid, identify, gp).
#pragma once

#include <vector>

#include "dynamics/contact/balance.h"
#include "dynamics/contact/balance_noise.h"
#include "dynamics/contact/tail.h"

namespace kinescope {

struct ContactOptions {
  double false_alarms_per_hour = 1.0;  ///< declared; fewer mean later alarms
  double longest_window_s = 0.25;      ///< a contact that stays hidden for longer is not found
  double end_window_s = 0.04;  ///< that long without external torque, and the contact is over
  /// Level of the hypothesis "joints beyond the link answer nothing": the share of contacts that
  /// are put on too far a link.
  double link_level = 0.001;
  /// The joint that carries each joint's own, as RigidBody::parent; empty: joints in series.
  std::vector<int> parents = {};
  /// The calibration log may itself hold contacts that nobody declared: what stands out is left
  /// out.
  bool may_contain_contacts = true;
  double guard_s = 0.15;  ///< left out before and after such a contact
};

/// Throws bad_request that names the option.
void validate(const ContactOptions& options);

/// A span of time, s.
struct TimeSpan {
  double begin_s = 0.0;
  double end_s = 0.0;
};

enum class ContactCalibrationStatus {
  kNotRun,
  kSettled,
  kIterationLimit  ///< which spans hold contacts still changed; thresholds are usable
};

/// What a detector needs to know of a robot and its model.
struct ContactCalibration {
  ContactCalibrationStatus status = ContactCalibrationStatus::kNotRun;
  ContactOptions options;
  BalanceNoise noise;
  double step_s = 0.0;
  /// One an octave of window lengths (1 step, 2 to 3, 4 to 7, ..): a statistic above it is an
  /// alarm.
  Eigen::VectorXd thresholds;
  std::vector<TailFit> tails;  ///< behind each of them
  TailFit joint_tail;          ///< of the largest ratio of statistic to threshold of all octaves
  std::vector<TimeSpan> excluded;  ///< taken for contacts in the calibration log
  double exposure_s = 0.0;         ///< free motion that was learned from
  int iterations = 0;

  [[nodiscard]] Eigen::Index joints() const { return noise.torque_sigma.size(); }
};

/// Noise and thresholds from a log. Deterministic. Throws bad_request for an option, undetermined
/// for a log that is too short or has no free motion.
[[nodiscard]] ContactCalibration calibrate_contacts(const std::vector<BalanceSample>& samples,
                                                    const ContactOptions& options = {});

/// Learned from a log of its own, for another one. That one is part of what is learned from: its
/// motion may show errors of the model that the first does not (estimate_noise_of_both), and
/// whatever stands out of both is left out as a contact.
[[nodiscard]] ContactCalibration calibrate_contacts(const std::vector<BalanceSample>& learned,
                                                    const std::vector<BalanceSample>& looked_at,
                                                    const ContactOptions& options);

struct ContactEvent {
  double onset_s = 0.0;  ///< when the external torque began, most likely
  double alarm_s = 0.0;  ///< when it was known
  double end_s = 0.0;    ///< when the external torque ended; of an open contact, the last sample
  bool open = true;      ///< not over yet
  bool cut_off = false;  ///< ended by a gap or the end of the samples
  /// Index of the joint whose link was touched, or of one beyond where its joint is in line with
  /// the force: the nearest to the base such that joints that do not carry it are consistent with
  /// no external torque (ContactOptions::link_level). -1: several branches were touched at once.
  int link = -1;
  Eigen::VectorXd link_probability;   ///< one a joint's link
  Eigen::VectorXd beyond_p_value;     ///< of "the joints beyond answer nothing", one a joint's link
  Eigen::VectorXd torque;             ///< external, mean from onset to end
  Eigen::MatrixXd torque_covariance;  ///< noise and the model's error
  double statistic = 0.0;             ///< at the alarm, in units of its threshold
};

/// All contacts of a log: a ContactDetector over its samples, with the spans in which a load lasts.
[[nodiscard]] std::vector<ContactEvent> detect_contacts(const ContactCalibration& calibration,
                                                        const std::vector<BalanceSample>& samples,
                                                        const std::vector<TimeSpan>& loaded = {});

/// Observed rate with the 95 % interval of the rate behind so many alarms (Garwood 1936).
struct AlarmRate {
  double per_hour = 0.0;
  double lower_per_hour = 0.0;
  double upper_per_hour = 0.0;
};
[[nodiscard]] AlarmRate alarm_rate(int alarms, double hours);

/// Declared against observed, on a log without contacts that the calibration has not seen.
struct FalseAlarmCheck {
  double hours = 0.0;
  int alarms = 0;
  double declared_per_hour = 0.0;
  double observed_per_hour = 0.0;
  /// See AlarmRate.
  double lower_per_hour = 0.0;
  double upper_per_hour = 0.0;
  /// From the tail of this log's own statistic: says more than a count of zero in a few seconds.
  double extrapolated_per_hour = 0.0;
};

/// Samples within `contacts` (widened by the guard) do not count.
[[nodiscard]] FalseAlarmCheck check_false_alarms(const ContactCalibration& calibration,
                                                 const std::vector<BalanceSample>& samples,
                                                 const std::vector<TimeSpan>& contacts = {});

}  // namespace kinescope
