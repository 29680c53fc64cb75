// SPDX-License-Identifier: Apache-2.0
//
// All products of contact detection on one log, gathered for its report.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/run_summary.h"
#include "dynamics/contact/contact.h"
#include "dynamics/data/log_findings.h"
#include "dynamics/data/one_clock.h"

namespace kinescope {

/// When and where in a log, of trajectories that contact detection looked at one behind the other.
struct LogClock {
  OneClock clock;
  std::vector<std::string> names;  ///< of the trajectories

  [[nodiscard]] double time_s(double clock_s) const { return clock.moment(clock_s).t_s; }
  [[nodiscard]] std::string trajectory(double clock_s) const {
    return names[static_cast<std::size_t>(clock.moment(clock_s).trajectory)];
  }
};

/// The momentum balance on the same logs, beside a torque model.
struct MomentumComparison {
  std::string model;   ///< where its masses come from, in words
  std::string reason;  ///< why it says nothing; empty: it does
  LogClock clock;      ///< of its events
  std::vector<ContactEvent> events;
  LogClock learn_clock;            ///< of `excluded`
  std::vector<TimeSpan> excluded;  ///< taken for contacts in the log to learn from
};

struct ContactSummary {
  std::string robot;
  std::string log;      ///< what was looked at, in words
  std::string learned;  ///< what the noise was learned from, in words
  std::string model;    ///< where the masses, or the predicted torques, come from, in words
  std::string method = "momentum";  ///< or the kind of the torque model
  std::string version;
  std::string command;
  std::vector<InputFile> inputs;
  std::vector<LogFinding> findings;
  std::vector<std::string> new_motion;  ///< where the torque model has not been, in sentences
  std::optional<MomentumComparison> momentum;  ///< beside a torque model
  /// Joints whose torque never changes, or of which a constant would leave less than the model:
  /// contacts there are neither found nor excluded.
  std::vector<std::string> unfit;
  std::vector<std::string> unmeasured;  ///< of them, those whose torque never changes

  std::vector<std::string> joints;
  std::vector<JointType> types;    ///< beside joints
  std::vector<std::string> links;  ///< the link that each joint moves
  std::string torque_unit = "Nm";
  LogClock clock;        ///< of events, t_s
  LogClock learn_clock;  ///< of the calibration's spans
  ContactCalibration calibration;
  FalseAlarmCheck check;  ///< on what was looked at, outside the contacts found
  std::vector<ContactEvent> events;
  Eigen::VectorXd t_s;              ///< of every sample looked at
  Eigen::MatrixXd external_torque;  ///< joints x samples, as the momentum observer follows it
};

/// onset_s,end_s,alarm_s,link,probability,open,trajectory, then the torque of each joint and its
/// sigma.
[[nodiscard]] std::string contacts_csv(const ContactSummary& summary);

/// contacts.json: schema "kinescope.contact". Torques in `unit`, times in s on the clock of
/// the trajectory (the log's name, where it is one).
///
///   robot, version, unit, joints, links, learned, method, model, inputs, findings, new_motion,
///   unfit
///   calibration  declared_per_hour, thresholds, exposure_s, excluded [trajectory, begin_s, end_s],
///   noise
///                {velocity_sigma, torque_sigma, model_sigma, model_time_s}
///   check        hours, extrapolated_per_hour
///   contacts     [trajectory, onset_s, end_s, alarm_s, link, probability, open, torque,
///                torque_sigma, statistic]
///   momentum     null, or model, reason, contacts: the momentum balance beside a torque model
[[nodiscard]] nlohmann::json contact_json(const ContactSummary& summary);

/// Beside each contact the one of the momentum balance that overlaps it (within the guard), if any:
/// index of MomentumComparison::events.
[[nodiscard]] std::vector<std::optional<std::size_t>> same_contacts(const ContactSummary& summary);

/// What was found, in one or two sentences.
[[nodiscard]] std::string contact_verdict(const ContactSummary& summary);

[[nodiscard]] std::string contact_report_html(const ContactSummary& summary);

}  // namespace kinescope
