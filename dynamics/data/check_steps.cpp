// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "dynamics/data/log_checks.h"
#include "dynamics/data/statistics.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kWrapTolerance = 0.5;  // rad of motion within the step that wraps
constexpr double kMissedSteps = 2.5;    // median steps; jitter of whole ticks stays below
constexpr double kLongGapSteps = 10.0;  // median steps
constexpr double kIrregular = 0.5;      // (95 % - 5 %) / median of the steps
constexpr double kSlowStepS = 0.1;      // a robot's motion has content up to some Hz
constexpr double kImpossibleStepS =
    0.5;  // nobody logs dynamics at 2 Hz; 8 ms read as 8 s is likelier
constexpr double kManyTurns = 4.0 * std::numbers::pi;  // rad; beyond the range of nearly all joints
constexpr double kLongSlide = 10.0;                    // m
constexpr double kNearlyAll = 0.99;                    // of the rows: a spike is no unit
constexpr double kSpikeOfNoise = 40.0;   // times the median distance from the neighbours
constexpr double kSpikeOfRange = 0.2;    // of the range between the 1st and the 99th percentile
constexpr double kSpikeOfSteps = 20.0;   // times the usual change from row to row
constexpr double kMostSpikes = 0.02;     // of the rows
constexpr Eigen::Index kNeighbours = 2;  // on either side

/// Distance of every sample from the median of itself and its neighbours (Hampel's identifier).
Eigen::VectorXd from_neighbours(const TorqueLog& log, const Eigen::Ref<const Eigen::VectorXd>& x) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(x.size());
  const std::vector<Eigen::Index> bounds = log.bounds();
  for (std::size_t b = 0; b + 1 < bounds.size(); ++b) {
    for (Eigen::Index row = bounds[b]; row < bounds[b + 1]; ++row) {
      const Eigen::Index last = std::min(bounds[b + 1], row + kNeighbours + 1);
      const Eigen::Index first = std::max(bounds[b], row - kNeighbours);
      out(row) = std::abs(x(row) - median_of(to_vector(x.segment(first, last - first))));
    }
  }
  return out;
}

/// Median of the changes that are not zero: at least a step of a quantised signal.
double usual_change(const TorqueLog& log, const Eigen::Ref<const Eigen::VectorXd>& x) {
  std::vector<double> changes;
  for (Eigen::Index row = 1; row < x.size(); ++row) {
    const double change = std::abs(x(row) - x(row - 1));
    if (change > 0.0 && log.trajectory(row) == log.trajectory(row - 1)) changes.push_back(change);
  }
  return median_of(std::move(changes));
}

std::vector<Eigen::Index> spikes_of(const TorqueLog& log,
                                    const Eigen::Ref<const Eigen::VectorXd>& x) {
  const std::vector<double> values = to_vector(x);
  const double range = quantile(values, 0.99) - quantile(values, 0.01);
  const Eigen::VectorXd distance = from_neighbours(log, x);
  const double limit = std::max({kSpikeOfNoise * median_of(to_vector(distance)),
                                 kSpikeOfRange * range, kSpikeOfSteps * usual_change(log, x)});
  std::vector<Eigen::Index> rows;
  for (Eigen::Index row = 0; row < x.size(); ++row) {
    if (limit > 0.0 && distance(row) > limit) rows.push_back(row);
  }
  // What happens often is how the signal is.
  if (share_of(static_cast<Eigen::Index>(rows.size()), x.size()) > kMostSpikes) rows.clear();
  return rows;
}

struct StepFacts {
  double median = 0.0, low = 0.0, high = 0.0, longest = 0.0, lost_s = 0.0;
  Eigen::Index missed = 0, longest_row = -1;
};

StepFacts look_at_steps(const TorqueLog& log) {
  const std::vector<double> steps = steps_of(log.t_s, log.trajectory);
  StepFacts facts{
      .median = median_of(steps), .low = quantile(steps, 0.05), .high = quantile(steps, 0.95)};
  for (Eigen::Index row = 1; row < log.rows(); ++row) {
    const double step = log.t_s(row) - log.t_s(row - 1);
    if (log.trajectory(row) != log.trajectory(row - 1) || step <= kMissedSteps * facts.median)
      continue;
    ++facts.missed;
    facts.lost_s += step - facts.median;
    if (step > facts.longest) {
      facts.longest = step;
      facts.longest_row = row;
    }
  }
  return facts;
}

/// Trajectories cut where a step is longer than `max_gap_s`.
Eigen::Index split_at_gaps(TorqueLog& log, double max_gap_s) {
  Eigen::VectorXi trajectory = log.trajectory;
  std::vector<std::string> names;
  Eigen::Index splits = 0;
  for (Eigen::Index row = 0; row < log.rows(); ++row) {
    const bool first = row == 0 || log.trajectory(row) != log.trajectory(row - 1);
    const bool split = !first && log.t_s(row) - log.t_s(row - 1) > max_gap_s;
    const std::string& base = log.trajectory_names[static_cast<std::size_t>(log.trajectory(row))];
    if (first) names.push_back(base);
    if (split) names.push_back(fmt::format("{} ({})", base, log.place(row)));
    splits += split ? 1 : 0;
    trajectory(row) = static_cast<int>(names.size()) - 1;
  }
  log.trajectory = trajectory;
  log.trajectory_names = std::move(names);
  return splits;
}

void name_rate(const TorqueLog& log, const StepFacts& facts, std::vector<LogFinding>& findings) {
  if (facts.median > kImpossibleStepS && log.stamped && !log.time_unit_declared) {
    findings.push_back({LogFault::kUnit, FaultWeight::kRefusal, "t", 1.0, facts.median,
                        log.sources.front(),
                        fmt::format("one row in {:.3g} s: are the stamps in ms?", facts.median),
                        "say so in recording.yaml, dynamics: {time_unit: ms} (or s)"});
  } else if (facts.median > kSlowStepS && (log.stamped || log.time_unit_declared)) {
    findings.push_back({LogFault::kSlow, FaultWeight::kWarning, "", 1.0, facts.median,
                        log.sources.front(),
                        fmt::format("{:.2g} rows a second", 1.0 / facts.median),
                        "too slow to derive accelerations; log at 100 Hz or more, or use what the "
                        "log holds as it is (filter: none)"});
  }
  if (facts.high - facts.low > kIrregular * facts.median) {
    findings.push_back({LogFault::kIrregularSteps, FaultWeight::kNote, "t", 0.0, facts.median,
                        log.sources.front(),
                        fmt::format("steps scatter from {:.3g} to {:.3g} ms (median {:.3g})",
                                    1e3 * facts.low, 1e3 * facts.high, 1e3 * facts.median),
                        "the filter works on the true stamps"});
  }
}

}  // namespace

CheckedLog check_spikes(TorqueLog log) {
  CheckedLog out;
  std::vector<char> keep(static_cast<std::size_t>(log.rows()), 1);
  const auto look = [&](const Eigen::MatrixXd& signal, const std::vector<std::string>& names) {
    for (Eigen::Index c = 0; c < signal.cols(); ++c) {
      const std::vector<Eigen::Index> rows = spikes_of(log, signal.col(c));
      if (rows.empty()) continue;
      for (const Eigen::Index row : rows) keep[static_cast<std::size_t>(row)] = 0;
      const std::string& name = names[static_cast<std::size_t>(c)];
      out.findings.push_back(
          {LogFault::kSpike, FaultWeight::kWarning, name,
           share_of(static_cast<Eigen::Index>(rows.size()), log.rows()),
           static_cast<double>(rows.size()), log.place(rows.front()),
           fmt::format("column '{}' jumps and comes back in {} rows ({:g} in the first)", name,
                       rows.size(), signal(rows.front(), c)),
           "the rows were left out"});
    }
  };
  look(log.q, log.q_columns);
  look(log.dq, log.dq_columns);
  look(log.torque, log.torque_columns);
  out.log = out.findings.empty() ? std::move(log) : keep_rows(log, keep);
  return out;
}

CheckedLog check_steps(TorqueLog log, const LogCheckOptions& options) {
  CheckedLog out;
  const StepFacts facts = look_at_steps(log);
  name_rate(log, facts, out.findings);
  const double max_gap_s =
      options.max_gap_s > 0.0 ? options.max_gap_s : kLongGapSteps * facts.median;
  std::string place;
  if (facts.missed > 0) place = log.place(facts.longest_row);
  const double whole_s = facts.median * static_cast<double>(log.rows()) + facts.lost_s;
  const Eigen::Index splits = facts.median > 0.0 ? split_at_gaps(log, max_gap_s) : 0;
  if (facts.missed > 0) {
    out.findings.push_back(
        {LogFault::kGap, splits > 0 ? FaultWeight::kWarning : FaultWeight::kNote, "t",
         whole_s > 0.0 ? facts.lost_s / whole_s : 0.0, facts.longest, place,
         fmt::format("samples are missing in {} places, {:.3g} ms at most (median step {:.3g} ms)",
                     facts.missed, 1e3 * facts.longest, 1e3 * facts.median),
         splits > 0 ? fmt::format("trajectories were split at {} gaps over {:.3g} ms", splits,
                                  1e3 * max_gap_s)
                    : "bridged by the filter"});
  }
  out.log = std::move(log);
  return out;
}

CheckedLog check_wraps(TorqueLog log) {
  CheckedLog out;
  for (Eigen::Index c = 0; c < log.q.cols(); ++c) {
    if (log.joints[static_cast<std::size_t>(c)].prismatic) continue;
    double turns = 0.0;
    double before = log.rows() > 0 ? log.q(0, c) : 0.0;
    Eigen::Index wraps = 0, first = -1;
    for (Eigen::Index row = 1; row < log.rows(); ++row) {
      const double now = log.q(row, c);
      if (log.trajectory(row) != log.trajectory(row - 1))
        turns = 0.0;
      else if (std::abs(std::abs(now - before) - kTurn) < kWrapTolerance) {
        turns += now < before ? 1.0 : -1.0;
        if (wraps++ == 0) first = row;
      }
      before = now;
      log.q(row, c) += kTurn * turns;
    }
    if (wraps == 0) continue;
    const std::string& name = log.q_columns[static_cast<std::size_t>(c)];
    out.findings.push_back(
        {LogFault::kWrapped, FaultWeight::kNote, name, share_of(wraps, log.rows()),
         static_cast<double>(wraps), log.place(first),
         fmt::format("column '{}' jumps by a whole turn {} times", name, wraps), "unwrapped"});
  }
  out.log = std::move(log);
  return out;
}

std::vector<LogFinding> check_ranges(const TorqueLog& log) {
  std::vector<LogFinding> findings;
  if (log.position_unit_declared) return findings;
  for (Eigen::Index c = 0; c < log.q.cols(); ++c) {
    const bool prismatic = log.joints[static_cast<std::size_t>(c)].prismatic;
    const Eigen::VectorXd sizes = log.q.col(c).cwiseAbs();
    const double largest = quantile(to_vector(sizes), kNearlyAll);
    Eigen::Index row = 0;
    while (row + 1 < sizes.size() && sizes(row) < largest) ++row;
    if (largest <= (prismatic ? kLongSlide : kManyTurns)) continue;
    const std::string& name = log.q_columns[static_cast<std::size_t>(c)];
    findings.push_back(
        {LogFault::kUnit, FaultWeight::kRefusal, name, 1.0, largest, log.place(row),
         fmt::format("column '{}' reaches {:.4g} {}: is it in {}?", name, log.q(row, c),
                     prismatic ? "m" : "rad", prismatic ? "mm" : "degrees"),
         fmt::format("say so in recording.yaml, dynamics: {{position_unit: [{0}]}} (or {1}); for "
                     "motor angles give position_factor",
                     prismatic ? "mm" : "deg", prismatic ? "m" : "rad")});
  }
  return findings;
}

}  // namespace kinescope
