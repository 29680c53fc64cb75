// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "dynamics/data/channel.h"
#include "dynamics/data/log_checks.h"
#include "dynamics/data/statistics.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr double kCoarseStep = 0.02;     // of the standard deviation; finer steps do no harm
constexpr double kGridTolerance = 0.05;  // of a step
constexpr double kOnGrid = 0.98;         // of the values
constexpr std::size_t kFewValues = 8;    // a grid needs that many levels to be one
constexpr double kHeldShare = 0.35;      // of the rows without change
constexpr double kManyLevels = 0.5;      // of the changes: values that hardly ever come back
constexpr double kReachS = 0.1;          // chosen: either way, longer than positions are held
constexpr double kLagReachS = 0.3;
constexpr double kCommandLagGain = 0.8;

LogFinding finding(const TorqueLog& log, LogFault fault, FaultWeight weight, const Channel& channel,
                   double share, double value, std::string what, std::string remedy) {
  return {fault,           weight,           channel.name, share, value, log.sources.front(),
          std::move(what), std::move(remedy)};
}

void name_clipping(const TorqueLog& log, const Channel& channel,
                   std::vector<LogFinding>& findings) {
  for (const auto& [limit, clipping] : clipped_ends(channel)) {
    LogFinding found =
        finding(log, LogFault::kClipped, FaultWeight::kWarning, channel,
                static_cast<double>(clipping.rows) / static_cast<double>(log.rows()), limit,
                fmt::format("column '{}' is cut off at {:g} in {} rows", channel.name, limit,
                            clipping.rows),
                "leave the motion that saturates it out, or record with a larger range");
    found.place = log.place(clipping.first);
    findings.push_back(std::move(found));
  }
}

void name_grid(const TorqueLog& log, const Channel& channel, std::vector<LogFinding>& findings) {
  if (!channel.step || *channel.step < kCoarseStep * channel.sigma) return;
  findings.push_back(
      finding(log, LogFault::kQuantised, FaultWeight::kNote, channel, 1.0, *channel.step,
              fmt::format("column '{}' has steps of {:.3g} ({:.1f} % of its spread)", channel.name,
                          *channel.step, 100.0 * *channel.step / channel.sigma),
              "counts as noise of a third of a step"));
}

/// Of each row whether its joint moves so fast that every row has a new position: what repeats
/// while it rests, or creeps from step to step of its encoder, is no news.
std::vector<char> rows_in_motion(const TorqueLog& log, Eigen::Index joint) {
  double quantum = std::numeric_limits<double>::infinity();
  for (Eigen::Index row = 1; row < log.rows(); ++row) {
    const double change = std::abs(log.q(row, joint) - log.q(row - 1, joint));
    if (change > 0.0) quantum = std::min(quantum, change);
  }
  std::vector<char> out;
  for (const RowWindow& window : windows_around_rows(log, kReachS)) {
    const double moved = std::abs(log.q(window.to, joint) - log.q(window.from, joint));
    out.push_back(moved >= static_cast<double>(window.to - window.from) * quantum ? 1 : 0);
  }
  return out;
}

/// `joint`: the channel's; at rest nothing is renewed.
void name_held(const TorqueLog& log, const Channel& channel, Eigen::Index joint, bool torque,
               std::vector<LogFinding>& findings) {
  const std::vector<char> moves = rows_in_motion(log, joint);
  std::size_t all = 0;
  std::size_t renewed = 0;
  std::set<double> values;
  for (Eigen::Index row = 1; row < log.rows(); ++row) {
    const auto at = static_cast<std::size_t>(row);
    const bool counts = moves[at] != 0 && log.trajectory(row) == log.trajectory(row - 1) &&
                        !(torque && (log.is_missing(row, joint) || log.is_missing(row - 1, joint)));
    if (!counts) continue;
    ++all;
    if (channel.values[at] == channel.values[at - 1]) continue;
    ++renewed;
    values.insert(channel.values[at]);
  }
  if (renewed == 0) return;
  const double still = 1.0 - static_cast<double>(renewed) / static_cast<double>(all);
  // A held signal takes a new value at nearly every change; one of few levels is quantised.
  const bool continuous =
      static_cast<double>(values.size()) > kManyLevels * static_cast<double>(renewed);
  if (still < kHeldShare || !continuous) return;
  const double step_s = median_of(steps_of(log.t_s, log.trajectory));
  findings.push_back(
      finding(log, LogFault::kHeld, FaultWeight::kNote, channel, still, step_s / (1.0 - still),
              fmt::format("column '{}' keeps its value in {:.0f} % of the rows in motion",
                          channel.name, 100.0 * still),
              fmt::format("it is renewed every {:.3g} ms on average: on average half of that late",
                          1e3 * step_s / (1.0 - still))));
}

/// True when all of a signal's channels of moving joints are constant.
bool look_at_signal(const TorqueLog& log, const Eigen::MatrixXd& signal,
                    const std::vector<std::string>& names, std::vector<LogFinding>& findings) {
  bool constant_while_moving = false;
  for (Eigen::Index c = 0; c < signal.cols(); ++c) {
    const Channel channel = look_at(log, signal.col(c), names[static_cast<std::size_t>(c)]);
    const bool joint_moves = standard_deviation(log.q.col(c)) > kStillSpread;
    if (channel.sigma == 0.0) {
      const bool position = &signal == &log.q;
      const bool torque = &signal == &log.torque;
      constant_while_moving = constant_while_moving || (joint_moves && !position && !torque);
      findings.push_back(finding(
          log, LogFault::kConstant,
          joint_moves || torque ? FaultWeight::kWarning : FaultWeight::kNote, channel, 1.0,
          signal(0, c), fmt::format("column '{}' is {:g} throughout", channel.name, signal(0, c)),
          position ? "the joint does not move: only its load on others is seen"
          : torque ? "nothing can be learned of this joint; is it measured at all?"
                   : "derived from the position instead"));
      continue;
    }
    if (!joint_moves && &signal != &log.torque) continue;
    name_grid(log, channel, findings);
    if (&signal == &log.dq) name_clipping(log, channel, findings);  // torques: check_readings
    name_held(log, channel, c, &signal == &log.torque, findings);
  }
  return constant_while_moving;
}

/// Drivers that measure no torque publish zeros.
std::optional<LogFinding> dead_torques(const TorqueLog& log) {
  if (log.torque.cols() == 0) return std::nullopt;
  for (Eigen::Index c = 0; c < log.torque.cols(); ++c) {
    if (look_at(log, log.torque.col(c), log.torque_columns[static_cast<std::size_t>(c)]).sigma >
        0.0) {
      return std::nullopt;
    }
  }
  return LogFinding{LogFault::kConstant,
                    FaultWeight::kRefusal,
                    log.torque_columns.front(),
                    1.0,
                    0.0,
                    log.sources.front(),
                    "no torque changes throughout: nothing was measured",
                    "log measured torques or motor currents; some drivers publish zeros instead"};
}

/// How much later the position is than its command: the shift with the smallest squared difference.
std::optional<LogFinding> command_lag(const TorqueLog& log) {
  const double step_s = median_of(steps_of(log.t_s, log.trajectory));
  if (log.q_command.cols() != log.q.cols() || step_s <= 0.0) return std::nullopt;
  const auto reach = static_cast<Eigen::Index>(std::min(100.0, kLagReachS / step_s));
  const Eigen::Index rows = log.rows();
  if (rows < 10 * reach || reach < 1) return std::nullopt;
  std::vector<double> costs;
  for (Eigen::Index shift = 0; shift <= reach; ++shift) {
    double cost = 0.0;
    for (Eigen::Index c = 0; c < log.q.cols(); ++c) {
      const Eigen::VectorXd error = log.q.col(c).segment(reach, rows - reach) -
                                    log.q_command.col(c).segment(reach - shift, rows - reach);
      const double error_sigma = standard_deviation(error);
      cost += error_sigma * error_sigma;
    }
    costs.push_back(cost);
  }
  const auto best = std::ranges::min_element(costs) - costs.begin();
  if (best == 0 || costs[static_cast<std::size_t>(best)] > kCommandLagGain * costs[0])
    return std::nullopt;
  const double lag_s = static_cast<double>(best) * step_s;
  return LogFinding{LogFault::kLag,
                    FaultWeight::kNote,
                    "q",
                    1.0,
                    lag_s,
                    log.sources.front(),
                    fmt::format("positions follow their command by {:.3g} ms", 1e3 * lag_s),
                    "use measured positions, never commanded ones, for dynamics"};
}

}  // namespace

std::optional<double> grid_step(const std::vector<double>& values) {
  std::vector<double> levels = values;
  std::ranges::sort(levels);
  std::vector<double> gaps;
  const double range = levels.back() - levels.front();
  const double rounding = 1e-9 * std::max(range, std::abs(levels.back()));
  for (std::size_t k = 1; k < levels.size(); ++k) {
    if (levels[k] - levels[k - 1] > rounding) gaps.push_back(levels[k] - levels[k - 1]);
  }
  if (gaps.size() < kFewValues || 2 * gaps.size() > values.size()) return std::nullopt;
  const double step = quantile(gaps, 0.1);
  std::size_t on_grid = 0;
  for (const double gap : gaps) {
    const double multiple = gap / step;
    if (std::abs(multiple - std::round(multiple)) < kGridTolerance * std::max(1.0, multiple))
      ++on_grid;
  }
  if (static_cast<double>(on_grid) < kOnGrid * static_cast<double>(gaps.size()))
    return std::nullopt;
  return step;
}

CheckedLog check_channels(TorqueLog log) {
  CheckedLog out;
  if (log.rows() == 0) return {std::move(log), {}};
  look_at_signal(log, log.q, log.q_columns, out.findings);
  const bool drop_dq = look_at_signal(log, log.dq, log.dq_columns, out.findings);
  const bool drop_ddq = look_at_signal(log, log.ddq, log.ddq_columns, out.findings);
  look_at_signal(log, log.torque, log.torque_columns, out.findings);
  if (auto dead = dead_torques(log)) out.findings.push_back(std::move(*dead));
  if (auto lag = command_lag(log)) out.findings.push_back(std::move(*lag));
  if (drop_dq) log.dq.resize(log.rows(), 0);
  if (drop_ddq) log.ddq.resize(log.rows(), 0);
  out.log = std::move(log);
  return out;
}

CheckedLog check_log(TorqueLog log, const LogCheckOptions& options) {
  CheckedLog out{std::move(log), {}};
  const auto then = [&out](CheckedLog next) {
    out.log = std::move(next.log);
    out.findings.insert(out.findings.end(), next.findings.begin(), next.findings.end());
  };
  then(check_numbers(std::move(out.log)));
  if (out.log.rows() == 0) return out;
  then(check_stamps(std::move(out.log)));
  then(check_stale_rows(std::move(out.log)));
  const std::vector<LogFinding> ranges = check_ranges(out.log);
  out.findings.insert(out.findings.end(), ranges.begin(), ranges.end());
  then(check_wraps(std::move(out.log)));
  then(check_spikes(std::move(out.log)));
  then(check_motion(std::move(out.log)));
  then(check_steps(std::move(out.log), options));
  then(check_readings(std::move(out.log)));
  then(check_channels(std::move(out.log)));
  return out;
}

}  // namespace kinescope
