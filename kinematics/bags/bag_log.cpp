// SPDX-License-Identifier: Apache-2.0
#include "kinematics/bags/bag_log.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/bags/bag_contents.h"
#include "kinematics/log/commanded.h"
#include "kinematics/log/joint_log.h"

namespace kinescope::bags {
namespace {

/// Something is said in it: a driver without a sensor publishes zeros, or nothing.
bool says_something(const Eigen::MatrixXd& values) {
  return values.size() > 0 && (values.array().isFinite() && values.array() != 0.0).any();
}

/// The values of a series at other times; rows that it does not cover are NaN.
Eigen::MatrixXd at_times(const JointSeries& series, const Eigen::MatrixXd& values,
                         const std::vector<double>& times_s) {
  if (values.size() == 0) return {};
  JointLog log;
  log.times_s = series.times_s;
  log.channels = series.names;
  log.values = values;
  return resample(log, times_s);
}

/// The one series that is the log, with the columns of others.
struct Chosen {
  JointSeries series;
  std::vector<std::string> warnings;
};

/// The part of a series whose joints are not among these names.
JointSeries without_joints(JointSeries series, const std::vector<std::string>& names) {
  std::vector<Eigen::Index> kept;
  std::vector<std::string> kept_names;
  for (std::size_t joint = 0; joint < series.names.size(); ++joint) {
    if (std::ranges::find(names, series.names[joint]) != names.end()) continue;
    kept.push_back(static_cast<Eigen::Index>(joint));
    kept_names.push_back(series.names[joint]);
  }
  series.names = std::move(kept_names);
  for (Eigen::MatrixXd* values : {&series.position, &series.velocity, &series.effort})
    if (values->size() > 0) *values = (*values)(Eigen::all, kept).eval();
  return series;
}

void append_columns(Eigen::MatrixXd& to, const Eigen::MatrixXd& more, Eigen::Index rows,
                    Eigen::Index before, Eigen::Index added) {
  if (to.size() == 0 && more.size() == 0) return;
  const double none = std::nan("");
  if (to.size() == 0) to = Eigen::MatrixXd::Constant(rows, before, none);
  to.conservativeResize(Eigen::NoChange, before + added);
  if (more.size() == 0) {
    to.rightCols(added).setConstant(none);
  } else {
    to.rightCols(added) = more;
  }
}

void keep_rows_where(JointSeries& series, const std::vector<Eigen::Index>& rows) {
  std::vector<double> times_s;
  for (const Eigen::Index row : rows)
    times_s.push_back(series.times_s[static_cast<std::size_t>(row)]);
  series.times_s = std::move(times_s);
  for (Eigen::MatrixXd* values : {&series.position, &series.velocity, &series.effort})
    if (values->size() > 0) *values = (*values)(rows, Eigen::all).eval();
}

/// Adds another publisher's joints; false where it covers too little of the time.
bool add_series(JointSeries& log, const JointSeries& other) {
  constexpr double kLeastCovered = 0.9;  // chosen, not measured
  const Eigen::MatrixXd position = at_times(other, other.position, log.times_s);
  std::vector<Eigen::Index> covered;
  for (Eigen::Index row = 0; row < position.rows(); ++row)
    if (position.row(row).array().isFinite().all()) covered.push_back(row);
  const auto rows = static_cast<Eigen::Index>(log.times_s.size());
  if (static_cast<double>(covered.size()) < kLeastCovered * static_cast<double>(rows)) return false;
  const auto before = static_cast<Eigen::Index>(log.names.size());
  const auto added = static_cast<Eigen::Index>(other.names.size());
  append_columns(log.position, position, rows, before, added);
  append_columns(log.velocity, at_times(other, other.velocity, log.times_s), rows, before, added);
  append_columns(log.effort, at_times(other, other.effort, log.times_s), rows, before, added);
  log.names.insert(log.names.end(), other.names.begin(), other.names.end());
  keep_rows_where(log, covered);
  return true;
}

void warn_of_stamps(const JointSeries& series, const std::string& source,
                    std::vector<std::string>& warnings) {
  if (series.repeated > 0) {
    warnings.push_back(fmt::format("{}: {} messages of {} repeat a stamp and are left out", source,
                                   series.repeated, series.topic));
  }
  if (!series.stamps.of_header) {
    warnings.push_back(
        fmt::format("{}: {} has no stamps of its own: those of the recorder are "
                    "used, which come late and unevenly",
                    source, series.topic));
  } else if (series.stamps.moved_s != 0.0) {
    warnings.push_back(
        fmt::format("{}: the stamps of {} are {:.3f} s from the recorder's clock, "
                    "and are moved to it",
                    source, series.topic, -series.stamps.moved_s));
  }
}

/// What a table needs of a series that is to stand beside another.
enum class Needs { kPositions, kAllThatIsLogged };

bool logs_as_much(const JointSeries& other, const JointSeries& log) {
  return (other.velocity.size() > 0 || log.velocity.size() == 0) &&
         (other.effort.size() > 0 || log.effort.size() == 0);
}

std::string not_used(const Contents& contents, const JointSeries& other,
                     const std::vector<std::string>& names, const std::string& beside) {
  const bool one = other.times_s.size() == 1;
  return fmt::format("{}: {} message{} of {} with {} {} not used beside {}{}", contents.source,
                     other.times_s.size(), one ? "" : "s", other.topic, fmt::join(names, ", "),
                     one ? "is" : "are", beside,
                     other.topic == beside
                         ? ""
                         : fmt::format(" (name {}:{} to use them)", contents.source, other.topic));
}

/// Joints of `all` that stand in the log from elsewhere, or not at all.
std::vector<std::string> unused_names(const JointSeries& all, const JointSeries& added) {
  std::vector<std::string> out;
  for (const std::string& name : all.names)
    if (std::ranges::find(added.names, name) == added.names.end()) out.push_back(name);
  return out;
}

/// Those beside the log: of its own topic first, then those with most messages, whose joints are
/// taken where several publish them.
std::vector<const JointSeries*> beside(const JointSeries& log, const Contents& contents) {
  std::vector<const JointSeries*> out;
  for (const JointSeries& other : contents.joints)
    if (&other != &log) out.push_back(&other);
  std::ranges::stable_sort(out, std::greater{}, [&](const JointSeries* other) {
    return std::pair(other->topic == log.topic, other->times_s.size());
  });
  return out;
}

Chosen choose(const Source& source, Needs needs) {
  const Contents& contents = look_into(source.bag);
  const JointSeries& log = choose_joints(contents, source.topic);
  Chosen out{log, contents.warnings};
  const std::string& topic = log.topic;
  warn_of_stamps(out.series, contents.source, out.warnings);
  constexpr std::size_t kMostNamed = 4;
  std::size_t unused = 0;
  for (const JointSeries* series : beside(log, contents)) {
    const JointSeries& other = *series;
    const bool here = other.topic == topic || (source.topic.empty() && !is_commanded(other.topic));
    const bool enough = needs == Needs::kPositions || logs_as_much(other, log);
    JointSeries added = without_joints(other, out.series.names);
    const bool joins = here && enough && added.position.size() > 0 && add_series(out.series, added);
    if (!joins) added.names.clear();
    const std::vector<std::string> names = unused_names(other, added);
    if (names.empty() || unused++ >= kMostNamed) continue;
    out.warnings.push_back(not_used(contents, other, names, topic));
  }
  if (unused > kMostNamed) {
    out.warnings.push_back(fmt::format("{}: neither are {} more sets of joints", contents.source,
                                       unused - kMostNamed));
  }
  return out;
}

std::string name_of(const Source& source, const JointSeries& series) {
  return fmt::format("{}:{}", source.bag.string(), series.topic);
}

// Names of columns that the readers of logs know (joint_log.h, column_names.h).
const std::string kTorque = "tau_";
const std::string kPosition = "_position";
const std::string kEffort = "_effort";

void add_columns(CsvTable& table, const std::string& before, const std::vector<std::string>& names,
                 const Eigen::MatrixXd& values) {
  for (const std::string& name : names) table.header.push_back(before + name);
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    for (Eigen::Index column = 0; column < values.cols(); ++column)
      table.rows[row].push_back(fmt::format("{}", values(static_cast<Eigen::Index>(row), column)));
  }
}

}  // namespace

LogTable joint_table(const Source& source) {
  Chosen chosen = choose(source, Needs::kPositions);
  const JointSeries& series = chosen.series;
  LogTable out;
  out.warnings = std::move(chosen.warnings);
  out.table.source = name_of(source, series);
  out.table.header = {"t"};
  for (std::size_t row = 0; row < series.times_s.size(); ++row) {
    out.table.rows.push_back({fmt::format("{}", series.times_s[row])});
    out.table.lines.push_back(row + 1);
  }
  add_columns(out.table, "", series.names, series.position);
  if (says_something(series.effort)) add_columns(out.table, kTorque, series.names, series.effort);
  return out;
}

ChannelTable channel_table(const Source& source) {
  const Chosen chosen = choose(source, Needs::kAllThatIsLogged);
  const JointSeries& series = chosen.series;
  ChannelTable out;
  out.source = name_of(source, series);
  out.warnings = chosen.warnings;
  out.names = {"t"};
  const auto rows = static_cast<Eigen::Index>(series.times_s.size());
  out.values = Eigen::Map<const Eigen::VectorXd>(series.times_s.data(), rows);
  const bool velocities = says_something(series.velocity);
  const bool efforts = says_something(series.effort);
  // A joint that lacks what the others have (a wheel, a gripper) would make all rows incomplete.
  std::vector<Eigen::Index> whole;
  for (Eigen::Index joint = 0; joint < series.position.cols(); ++joint) {
    const auto has = [&](const Eigen::MatrixXd& values) {
      return values.col(joint).array().isFinite().any();
    };
    const std::string& name = series.names[static_cast<std::size_t>(joint)];
    if (has(series.position) && (!efforts || has(series.effort))) {
      whole.push_back(joint);
    } else {
      out.warnings.push_back(fmt::format("{}: joint '{}' is left out: it has no {}", out.source,
                                         name, has(series.position) ? "effort" : "position"));
    }
  }
  const auto add = [&](const std::string& quantity, const Eigen::MatrixXd& values) {
    for (const Eigen::Index joint : whole) {
      if (!values.col(joint).array().isFinite().any()) continue;
      out.names.push_back(series.names[static_cast<std::size_t>(joint)] + quantity);
      out.values.conservativeResize(Eigen::NoChange, out.values.cols() + 1);
      out.values.rightCols(1) = values.col(joint);
    }
  };
  add(kPosition, series.position);
  if (velocities) add("_velocity", series.velocity);
  if (efforts) add(kEffort, series.effort);
  for (std::size_t row = 0; row < series.times_s.size(); ++row) out.lines.push_back(row + 1);
  return out;
}

TorqueColumns torque_columns(const std::string& channel, const std::string& torque) {
  return {channel + kPosition, torque.substr(std::min(torque.size(), kTorque.size())) + kEffort};
}

}  // namespace kinescope::bags
