// SPDX-License-Identifier: Apache-2.0
//
// Contact detection on a running robot: one sample in, one decision out. Allocates at
// alarms and ends only.
#pragma once

#include <vector>

#include "dynamics/contact/balance_filter.h"
#include "dynamics/contact/contact.h"
#include "dynamics/contact/imbalance_record.h"
#include "dynamics/contact/link_evidence.h"
#include "dynamics/contact/onset_bank.h"

namespace kinescope {

enum class SampleFault {
  kNone,
  kNotFinite,  ///< a NaN or infinity: passed over
  kNotLater,   ///< stamp not after the one before: passed over
  kAfterGap    ///< more than ten steps since the last sample: detection begins anew here
};

struct ContactDecision {
  double stamp_s = 0.0;
  bool contact = false;  ///< there is contact now
  bool alarm = false;    ///< it became known with this sample
  bool ended = false;    ///< event() was completed with this sample
  /// The alarm is of the last event(): it began before that one's end, or that end was not seen.
  bool resumed = false;
  double statistic = 0.0;  ///< in units of its threshold; of a free robot, alarm from 1
  SampleFault fault = SampleFault::kNone;
};

class ContactDetector {
 public:
  /// `loaded`: spans in which a load is known to last (lasting_load.h). A contact that is found in
  /// one began with it at the latest, and is not over before it.
  explicit ContactDetector(ContactCalibration calibration, std::vector<TimeSpan> loaded = {});

  /// Throws bad_request for a sample of another number of joints.
  ContactDecision update(const BalanceSample& sample);

  /// The contact under way, or the last one. At the alarm it holds onset, statistic, and torque and
  /// link as far as known then; at the end all of it.
  [[nodiscard]] const ContactEvent& event() const { return event_; }
  /// Completes a contact that is under way, as cut off; false when there is none.
  bool finish();

  /// The largest statistic of each octave of window lengths, at the last sample of a free robot.
  [[nodiscard]] const contact::OctaveBest& octave(int k) const { return bank_.octave(k); }
  [[nodiscard]] const ContactCalibration& calibration() const { return calibration_; }

 private:
  void begin(const BalanceSample& sample);
  void watch_onset(const BalanceSample& sample, ContactDecision& decision);
  [[nodiscard]] double look_for_onset(int age);
  void raise_alarm(double onset_s);
  void watch_end(const BalanceSample& sample, ContactDecision& decision);
  [[nodiscard]] std::size_t quiet_window() const;
  [[nodiscard]] bool is_quiet();
  void watch_sliding(const BalanceSample& sample);
  [[nodiscard]] bool goes_on(double onset_s) const;
  [[nodiscard]] const TimeSpan* load_at(double stamp_s) const;
  [[nodiscard]] double end_of_contact();
  void close(double end_s);
  void estimate(std::size_t end);
  void look_at_segment();
  void mean_torque(const contact::RecordEntry& from, const contact::RecordEntry& to);
  void expect_error(const contact::RecordEntry& at);

  ContactCalibration calibration_;
  std::vector<TimeSpan> loaded_;
  contact::BalanceFilter filter_;
  contact::OnsetBank bank_;
  contact::ImbalanceRecord record_;
  ContactEvent event_;
  contact::RecordEntry onset_;                   ///< of the contact under way
  contact::RecordEntry segment_;                 ///< begin of the segment under way
  JointAnswers segments_;                        ///< of the contact's segments
  Eigen::VectorXd error_mean_, error_variance_;  ///< work space of expect_error()
  Eigen::VectorXd mean_;                         ///< work space: mean torque of a window,
  Eigen::MatrixXd covariance_;                   ///< and its covariance
  std::vector<double> bend_t_, bend_y_;
  double quiet_level_ = 0.0;
  double shown_s_ = 0.0;            ///< the longest that the contact under way took to show
  Eigen::VectorXd slides_since_s_;  ///< of each joint; NaN: it may stick
  Eigen::VectorXi carried_;         ///< 1: the joint's torque was part of the last contact
  double end_seen_s_ = 0.0;  ///< the joints that carried the last contact have slid without it
  bool in_contact_ = false;
};

}  // namespace kinescope
