// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/torque_log.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "dynamics/data/log_columns.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

/// The entry for a joint of a list with one for all, one a joint, or none.
template <typename Value>
Value entry(const std::vector<Value>& list, std::size_t joint, std::size_t joints,
            const Value& fallback, std::string_view name) {
  if (list.empty()) return fallback;
  if (list.size() == 1) return list[0];
  if (list.size() != joints) {
    throw bad_request(fmt::format("dynamics.{}", name),
                      fmt::format("{} entries for {} joints", list.size(), joints),
                      "give one for all joints or one a joint");
  }
  return list[joint];
}

double known_factor(const std::string& unit, std::string_view option) {
  if (const std::optional<double> factor = unit_factor(unit)) return *factor;
  throw bad_request(
      fmt::format("dynamics.{}", option), fmt::format("unknown unit '{}'", unit),
      "known are rad, deg, m, mm (also /s, /s^2), s, ms, us, ns, Nm, N, mNm, kNm, A, mA, %");
}

/// One signal of all joints in SI: values, and what was said about its unit.
struct Signal {
  Eigen::MatrixXd values;
  std::vector<std::string> names;
  bool unit_declared = false;
  bool ampere = false;
  bool percent = false;  ///< of a rated torque or current
};

struct SignalRequest {
  SignalColumns columns;
  std::vector<std::size_t> order;  ///< of the wanted joints among the columns
  const std::vector<std::string>* units = nullptr;
  const std::vector<double>* factors = nullptr;
  std::string_view option;
};

Signal read_signal(const ChannelTable& table, const SignalRequest& request) {
  Signal out;
  const std::size_t joints = request.order.size();
  out.values.resize(table.rows(), static_cast<Eigen::Index>(joints));
  out.unit_declared = !request.units->empty();
  for (std::size_t j = 0; j < joints; ++j) {
    const std::size_t at = request.order[j];
    const std::string& said = request.columns.units[at];
    const std::string unit =
        entry(*request.units, j, joints, said, fmt::format("{}_unit", request.option));
    out.unit_declared = out.unit_declared || !said.empty();
    out.ampere = out.ampere || unit == "A" || unit == "mA" ||
                 (unit.empty() && request.columns.quantity == LoggedQuantity::kCurrent);
    out.percent = out.percent || unit == "%";
    const double factor =
        (unit.empty() ? 1.0 : known_factor(unit, fmt::format("{}_unit", request.option))) *
        entry(*request.factors, j, joints, 1.0, fmt::format("{}_factor", request.option));
    out.values.col(static_cast<Eigen::Index>(j)) =
        factor * table.values.col(request.columns.columns[at]);
    out.names.push_back(table.names[static_cast<std::size_t>(request.columns.columns[at])]);
  }
  return out;
}

std::optional<Eigen::Index> time_column(const ChannelTable& table, const LogMapping& mapping) {
  if (!mapping.time.empty()) {
    if (const auto column = table.column(mapping.time)) return column;
    throw bad_request(fmt::format("{}:{}", table.source, table.header_line),
                      fmt::format("no column '{}' for the time", mapping.time),
                      fmt::format("the columns are {}", fmt::join(table.names, ", ")));
  }
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    const auto meaning = read_column_name(table.names[c]);
    if (meaning && meaning->quantity == LoggedQuantity::kTime) return static_cast<Eigen::Index>(c);
  }
  return std::nullopt;
}

void read_clock(const ChannelTable& table, const LogMapping& mapping, TorqueLog& log) {
  const auto column = mapping.rate_hz > 0.0 ? std::nullopt : time_column(table, mapping);
  if (!column) {
    log.stamped = false;
    log.time_unit_declared = mapping.rate_hz > 0.0;
    const double step = mapping.rate_hz > 0.0 ? 1.0 / mapping.rate_hz : 1.0;
    log.t_s =
        step * Eigen::VectorXd::LinSpaced(table.rows(), 0.0, static_cast<double>(table.rows() - 1));
    return;
  }
  std::string unit = mapping.time_unit;
  if (unit.empty()) {
    const auto meaning = read_column_name(table.names[static_cast<std::size_t>(*column)]);
    if (meaning) unit = meaning->unit;
  }
  log.time_unit_declared = !unit.empty();
  log.t_s = table.values.col(*column) * (unit.empty() ? 1.0 : known_factor(unit, "time_unit"));
}

/// The column of trajectories as text, or nothing.
std::optional<std::vector<std::string>> trajectory_labels(const ChannelTable& table,
                                                          const LogMapping& mapping) {
  std::string name = mapping.trajectory;
  const auto is_trajectory = [](const std::string& column) {
    const auto meaning = read_column_name(column);
    return meaning && meaning->quantity == LoggedQuantity::kTrajectory;
  };
  for (std::size_t c = 0; name.empty() && c < table.names.size(); ++c) {
    if (is_trajectory(table.names[c])) name = table.names[c];
  }
  for (const auto& [column, unused] : table.labels) {
    if (name.empty() && is_trajectory(column)) name = column;
  }
  if (name.empty()) return std::nullopt;
  if (const auto labels = table.labels.find(name); labels != table.labels.end()) {
    return labels->second;
  }
  const auto column = table.column(name);
  if (!column) {
    throw bad_request(fmt::format("{}:{}", table.source, table.header_line),
                      fmt::format("no column '{}' for the trajectory", name),
                      fmt::format("the columns are {}", fmt::join(table.names, ", ")));
  }
  std::vector<std::string> labels;
  for (const double value : table.values.col(*column)) labels.push_back(fmt::format("{}", value));
  return labels;
}

/// A new number wherever the label changes; a label that comes back later is another trajectory.
void read_trajectories(const ChannelTable& table, const LogMapping& mapping, TorqueLog& log) {
  log.trajectory = Eigen::VectorXi::Zero(table.rows());
  const auto labels = trajectory_labels(table, mapping);
  if (!labels) {
    log.trajectory_names = {std::filesystem::path(table.source).filename().string()};
    return;
  }
  int number = 0;
  log.trajectory_names = {labels->front()};
  for (std::size_t row = 1; row < labels->size(); ++row) {
    if ((*labels)[row] != (*labels)[row - 1]) {
      ++number;
      log.trajectory_names.push_back((*labels)[row]);
    }
    log.trajectory(static_cast<Eigen::Index>(row)) = number;
  }
}

/// Torque if it was measured, else current, else what was commanded.
SignalColumns find_torque(const ChannelTable& table, const LogMapping& mapping) {
  using enum LoggedQuantity;
  SignalColumns torque = find_signal(table, mapping.torque, kTorque, LoggedOrigin::kPlain);
  if (torque.empty()) torque = find_signal(table, {}, kCurrent, LoggedOrigin::kPlain);
  if (torque.empty()) torque = find_signal(table, {}, kTorque, LoggedOrigin::kCommanded);
  return torque;
}

std::vector<WantedJoint> joints_of_log(const SignalColumns& position) {
  std::vector<WantedJoint> out;
  for (std::size_t j = 0; j < position.keys.size(); ++j) {
    std::string name = key_text(position.keys[j]);
    if (name.find_first_not_of("0123456789") == std::string::npos) name.insert(0, "joint");
    const bool metric = position.units[j] == "m" || position.units[j] == "mm";
    out.push_back({name, metric});
  }
  return out;
}

class Reader {
 public:
  Reader(const ChannelTable& table, const LogMapping& mapping) : table_(table), mapping_(mapping) {}

  ReadTorqueLog read(std::vector<WantedJoint> wanted, bool torque_required) {
    TorqueLog& log = out_.log;
    const SignalColumns position =
        find_signal(table_, mapping_.position, LoggedQuantity::kPosition, LoggedOrigin::kPlain);
    if (position.empty()) {
      refuse("no joint positions", "name them in recording.yaml, dynamics: {position: [..]}");
    }
    if (wanted.empty()) wanted = joints_of_log(position);
    position_ = position;
    log.joints = wanted;
    log.sources = {table_.source};
    log.lines = table_.lines;
    log.source.assign(static_cast<std::size_t>(table_.rows()), 0);
    read_clock(table_, mapping_, log);
    read_trajectories(table_, mapping_, log);
    read_motion();
    read_torque(torque_required);
    return std::move(out_);
  }

 private:
  [[noreturn]] void refuse(std::string_view what, std::string_view remedy) const {
    throw bad_input(fmt::format("{}:{}", table_.source, table_.header_line),
                    fmt::format("{} among the columns {}", what, fmt::join(table_.names, ", ")),
                    remedy);
  }

  /// A named signal comes in the wanted order; otherwise the names say whose it is.
  std::vector<std::size_t> order_of(const SignalColumns& signal, bool& by_order) const {
    const std::size_t joints = out_.log.joints.size();
    if (signal.named && signal.columns.size() == joints) {
      std::vector<std::size_t> order(joints);
      for (std::size_t j = 0; j < joints; ++j) order[j] = j;
      return order;
    }
    const JointMatch match = match_joints(signal.keys, out_.log.joints, mapping_,
                                          fmt::format("{}:{}", table_.source, table_.header_line));
    by_order = match.by_order;
    return match.order;
  }

  /// Velocities and accelerations that are not there for every joint are derived instead.
  std::optional<std::vector<std::size_t>> order_or_none(const SignalColumns& signal) {
    if (signal.empty()) return std::nullopt;
    bool by_order = false;
    if (signal.named) return order_of(signal, by_order);
    try {
      return order_of(signal, by_order);
    } catch (const Error&) {
      out_.findings.push_back(
          {LogFault::kAssignment, FaultWeight::kNote, "", 0.0, 0.0, table_.source,
           fmt::format("no {} for some of the joints", to_string(signal.quantity)),
           "derived from the position instead"});
      return std::nullopt;
    }
  }

  void read_motion() {
    TorqueLog& log = out_.log;
    bool by_order = false;
    const auto order = order_of(position_, by_order);
    if (by_order) {
      std::vector<std::string> pairs;
      pairs.reserve(order.size());
      for (std::size_t j = 0; j < order.size(); ++j) {
        pairs.push_back(fmt::format("{} = {}", log.joints[j].name, key_text(position_.keys[j])));
      }
      out_.findings.push_back(
          {LogFault::kAssignment, FaultWeight::kNote, "", 0.0, 0.0, table_.source,
           fmt::format("joints taken in their order: {}", fmt::join(pairs, ", ")),
           "say otherwise in recording.yaml, dynamics: {joints: {..}}"});
    }
    note_other_joints(order);
    Signal q = read_signal(
        table_, {position_, order, &mapping_.position_unit, &mapping_.position_factor, "position"});
    log.q = std::move(q.values);
    log.q_columns = std::move(q.names);
    log.position_unit_declared = q.unit_declared;
    const SignalColumns dq =
        find_signal(table_, mapping_.velocity, LoggedQuantity::kVelocity, LoggedOrigin::kPlain);
    if (const auto dq_order = order_or_none(dq)) {
      Signal signal = read_signal(
          table_, {dq, *dq_order, &mapping_.velocity_unit, &mapping_.position_factor, "velocity"});
      log.dq = std::move(signal.values);
      log.dq_columns = std::move(signal.names);
      log.velocity_unit_declared = signal.unit_declared;
    }
    const SignalColumns ddq = find_signal(table_, mapping_.acceleration,
                                          LoggedQuantity::kAcceleration, LoggedOrigin::kPlain);
    if (const auto ddq_order = order_or_none(ddq)) {
      Signal signal = read_signal(table_, {ddq, *ddq_order, &mapping_.acceleration_unit,
                                           &mapping_.position_factor, "acceleration"});
      log.ddq = std::move(signal.values);
      log.ddq_columns = std::move(signal.names);
    }
    read_commands();
  }

  /// Joints of the log that nobody asked for: another robot's log, or more than one robot in it.
  void note_other_joints(const std::vector<std::size_t>& order) {
    std::vector<std::string> others;
    for (std::size_t k = 0; k < position_.keys.size(); ++k) {
      if (std::ranges::find(order, k) != order.end()) continue;
      others.push_back(
          fmt::format("'{}'", table_.names[static_cast<std::size_t>(position_.columns[k])]));
    }
    if (others.empty()) return;
    out_.findings.push_back(
        {LogFault::kAssignment, FaultWeight::kNote, "", 0.0, 0.0, table_.source,
         fmt::format("{} joints are wanted, the log has {}: {} left out", order.size(),
                     position_.keys.size(), fmt::join(others, ", ")),
         "check that the log is this robot's"});
  }

  void read_commands() {
    const SignalColumns command = find_position_commands(table_);
    if (command.columns.size() < out_.log.joints.size()) return;
    if (const auto order = order_or_none(command)) {
      out_.log.q_command = read_signal(table_, {command, *order, &mapping_.position_unit,
                                                &mapping_.position_factor, "position"})
                               .values;
    }
  }

  void read_torque(bool required) {
    const SignalColumns torque = find_torque(table_, mapping_);
    if (torque.empty()) {
      if (required) {
        refuse("no joint torques or currents",
               "name them in recording.yaml, dynamics: {torque: [..]}");
      }
      return;
    }
    bool by_order = false;
    Signal signal = read_signal(table_, {torque, order_of(torque, by_order), &mapping_.torque_unit,
                                         &mapping_.torque_factor, "torque"});
    out_.log.torque = std::move(signal.values);
    out_.log.torque_columns = std::move(signal.names);
    out_.log.torque_unit = signal.ampere && mapping_.torque_factor.empty() ? "A" : "Nm";
    if (signal.percent && mapping_.torque_factor.empty()) {
      out_.findings.push_back(
          {LogFault::kUnit, FaultWeight::kRefusal, out_.log.torque_columns.front(), 1.0, 0.0,
           table_.source,
           fmt::format("the torques ({}) are in percent of a rated torque",
                       fmt::join(out_.log.torque_columns, ", ")),
           "say in recording.yaml, dynamics: {torque_factor: [..]}, or with --torque-factor, a "
           "hundredth of each joint's rated torque in Nm"});
    }
    if (torque.origin == LoggedOrigin::kCommanded && !torque.named) {
      out_.findings.push_back(
          {LogFault::kCommanded, FaultWeight::kWarning, out_.log.torque_columns.front(), 1.0, 0.0,
           table_.source,
           fmt::format("the torques ({}) are the controller's command, not a measurement",
                       fmt::join(out_.log.torque_columns, ", ")),
           "log the measured torque or current; friction seen here is what the controller gave"});
    }
  }

  const ChannelTable& table_;
  const LogMapping& mapping_;
  SignalColumns position_;
  ReadTorqueLog out_;
};

}  // namespace

ReadTorqueLog to_torque_log(const ChannelTable& table, const LogMapping& mapping,
                            const std::vector<WantedJoint>& wanted, bool torque_required) {
  return Reader(table, mapping).read(wanted, torque_required);
}

}  // namespace kinescope
