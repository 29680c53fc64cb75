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
constexpr double kSpikeOfNoise = 40.0;  // times the median distance from the neighbours
constexpr double kSpikeOfRange = 0.2;   // of the range between the 1st and the 99th percentile
constexpr double kSpikeOfSteps = 20.0;  // times the usual change from row to row
constexpr double kMostSpikes = 0.02;    // of the rows
// Of the rows, where they are of any size: as many as kinematics/log/readings_apart takes.
constexpr double kMostWild = 0.1;
constexpr int kWildPasses = 3;          // of one in twenty, some stand three in five
constexpr std::size_t kNeighbours = 2;  // on either side

/// One channel without the samples that were rejected.
struct Series {
  std::vector<double> values;
  std::vector<int> trajectory;
  std::vector<Eigen::Index> rows;  ///< in the log

  [[nodiscard]] std::size_t size() const { return rows.size(); }
};

Series series_of(const TorqueLog& log, const Eigen::Ref<const Eigen::VectorXd>& x) {
  Series out{.values = to_vector(x), .trajectory = {}, .rows = {}};
  for (Eigen::Index row = 0; row < x.size(); ++row) {
    out.trajectory.push_back(log.trajectory(row));
    out.rows.push_back(row);
  }
  return out;
}

Series without(const Series& series, const std::vector<std::size_t>& rejected) {
  Series out;
  std::size_t next = 0;
  for (std::size_t k = 0; k < series.size(); ++k) {
    if (next < rejected.size() && rejected[next] == k) {
      ++next;
      continue;
    }
    out.values.push_back(series.values[k]);
    out.trajectory.push_back(series.trajectory[k]);
    out.rows.push_back(series.rows[k]);
  }
  return out;
}

/// Distance of every sample from the median of itself and its neighbours (Hampel's identifier).
std::vector<double> from_neighbours(const Series& series) {
  std::vector<double> out(series.size(), 0.0);
  const auto is_near = [&](std::size_t k, std::size_t other) {
    return series.trajectory[k] == series.trajectory[other];
  };
  for (std::size_t k = 0; k < out.size(); ++k) {
    std::size_t first = k;
    std::size_t last = k;
    while (k - first < kNeighbours && first > 0 && is_near(k, first - 1)) --first;
    while (last - k < kNeighbours && last + 1 < out.size() && is_near(k, last + 1)) ++last;
    const auto begin = series.values.begin();
    out[k] =
        std::abs(series.values[k] - median_of({begin + static_cast<std::ptrdiff_t>(first),
                                               begin + static_cast<std::ptrdiff_t>(last) + 1}));
  }
  return out;
}

/// Median of the changes that are not zero: at least a step of a quantised signal.
double usual_change(const Series& series) {
  std::vector<double> changes;
  for (std::size_t k = 1; k < series.size(); ++k) {
    const double change = std::abs(series.values[k] - series.values[k - 1]);
    if (change > 0.0 && series.trajectory[k] == series.trajectory[k - 1]) changes.push_back(change);
  }
  return median_of(std::move(changes));
}

/// Distances of one channel's samples, sorted.
class Distances {
 public:
  explicit Distances(std::vector<double> values) : sorted_(std::move(values)) {
    std::ranges::sort(sorted_);
  }
  [[nodiscard]] double median() const { return sorted_[sorted_.size() / 2]; }
  [[nodiscard]] double count(double low, double high) const {
    return static_cast<double>(std::ranges::upper_bound(sorted_, high) -
                               std::ranges::upper_bound(sorted_, low));
  }
  /// Samples a unit of distance up to `high`; of few at the far end, their reach is uncertain.
  [[nodiscard]] double density(double low, double high) const {
    const double reach = std::min(high, sorted_.back()) - low;
    const double own = count(low, high) - (high > sorted_.back() ? 1.0 : 0.0);
    return reach > 0.0 && own > 0.0 ? own / reach : 0.0;
  }
  /// The smallest one above `floor` from which on at least half of those below `limit` are as dense
  /// as told.
  [[nodiscard]] double least_of(double density, double floor, double limit) const {
    double out = limit;
    const auto begin = std::ranges::upper_bound(sorted_, floor);
    for (auto at = begin; at != sorted_.end() && *at < limit; ++at) {
      if (count(*at, limit) + 1.0 <= 2.0 * density * (limit - *at)) return std::min(out, *at);
    }
    return out;
  }

 private:
  std::vector<double> sorted_;
};

/// Wild readings are of any size, about as dense at half a distance as at the whole; what a signal
/// does by itself is the denser the smaller it is. From `limit` down, octave by octave, as long as
/// at least half of an octave's samples are as dense as those above it (local false discovery rate,
/// Efron 2004).
double least_spike(const Distances& distances, double limit) {
  const double top = 2.0 * limit;
  const double floor = std::max(distances.median(), 1e-9 * limit);
  double least = limit;
  double density = distances.density(least, top);
  while (least > floor && density > 0.0) {
    const double lower = 0.5 * least;
    if (distances.count(lower, least) > 2.0 * density * lower) break;
    density = std::max(distances.density(lower, top), distances.count(lower, least) / lower);
    least = lower;
  }
  return least < limit ? distances.least_of(density, floor, least) : limit;
}

struct SpikeLimits {
  double clear = 0.0;  ///< a distance beyond it is a spike's; 0: the channel has no scale
  double least = 0.0;  ///< less where readings are wild

  [[nodiscard]] bool wild() const { return least < clear; }
};

SpikeLimits spike_limits(const Series& series) {
  const double range = quantile(series.values, 0.99) - quantile(series.values, 0.01);
  const std::vector<double> distance = from_neighbours(series);
  const double clear = std::max({kSpikeOfNoise * median_of(distance), kSpikeOfRange * range,
                                 kSpikeOfSteps * usual_change(series)});
  return {.clear = clear, .least = clear > 0.0 ? least_spike(Distances(distance), clear) : clear};
}

std::vector<std::size_t> spikes_beyond(const Series& series, double limit) {
  const std::vector<double> distance = from_neighbours(series);
  std::vector<std::size_t> out;
  for (std::size_t k = 0; k < distance.size(); ++k) {
    if (distance[k] > limit) out.push_back(k);
  }
  return out;
}

/// Of one channel, rows of the log.
using Spikes = std::vector<Eigen::Index>;

/// Where wild readings stand together, the first of them hide others.
/// `clear_only`: of velocities, which the positions tell better where many are wild.
Spikes spikes_of(Series series, bool clear_only) {
  SpikeLimits limits = spike_limits(series);
  if (clear_only) limits.least = limits.clear;
  Spikes out;
  if (!(limits.clear > 0.0)) return out;
  // What happens often is how the signal is, unless it is as often large as small.
  const double most =
      (limits.wild() ? kMostWild : kMostSpikes) * static_cast<double>(series.size());
  for (int pass = 0; pass < (limits.wild() ? kWildPasses : 1); ++pass) {
    const std::vector<std::size_t> found = spikes_beyond(series, limits.least);
    for (const std::size_t k : found) out.push_back(series.rows[k]);
    series = without(series, found);
  }
  if (static_cast<double>(out.size()) > most) return {};
  std::ranges::sort(out);
  return out;
}

bool jumps_near(const Spikes& spikes, Eigen::Index row) {
  constexpr auto kNear = static_cast<Eigen::Index>(kNeighbours);
  const auto near = std::ranges::lower_bound(spikes, row - kNear);
  return near != spikes.end() && *near <= row + kNear;
}

/// A blow moves the torques of several joints in a few rows, each in its own way, and no position
/// (`moved`: of every row). What is wrong with a reading is wrong with one column, or all of them
/// read the same; what a trajectory begins with may be that of drives that are switched on.
void spare_blows(const TorqueLog& log, const std::vector<char>& moved,
                 std::vector<Spikes>& torques) {
  const auto begins = [&](Eigen::Index row) {
    const Eigen::Index before = row - static_cast<Eigen::Index>(kNeighbours);
    return before < 0 || log.trajectory(before) != log.trajectory(row);
  };
  const auto differ = [&](Eigen::Index row, std::size_t a, std::size_t b) {
    return log.torque(row, static_cast<Eigen::Index>(a)) !=
           log.torque(row, static_cast<Eigen::Index>(b));
  };
  const std::vector<Spikes> all = torques;
  for (std::size_t c = 0; c < all.size(); ++c) {
    const auto is_of_blow = [&](Eigen::Index row) {
      if (moved[static_cast<std::size_t>(row)] != 0 || begins(row)) return false;
      for (std::size_t o = 0; o < all.size(); ++o)
        if (o != c && jumps_near(all[o], row) && differ(row, o, c)) return true;
      return false;
    };
    // Wild readings of several columns meet by chance, blows as a rule.
    if (2 * std::ranges::count_if(all[c], is_of_blow) < std::ssize(all[c])) continue;
    std::erase_if(torques[c], is_of_blow);
  }
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
  const auto look = [&](const Eigen::MatrixXd& signal, bool clear_only) {
    std::vector<Spikes> spikes;
    for (Eigen::Index c = 0; c < signal.cols(); ++c)
      spikes.push_back(spikes_of(series_of(log, signal.col(c)), clear_only));
    return spikes;
  };
  const auto leave_out = [&](const Eigen::MatrixXd& signal, const std::vector<std::string>& names,
                             const std::vector<Spikes>& spikes) {
    for (std::size_t c = 0; c < spikes.size(); ++c) {
      const Spikes& rows = spikes[c];
      if (rows.empty()) continue;
      for (const Eigen::Index row : rows) keep[static_cast<std::size_t>(row)] = 0;
      out.findings.push_back(
          {LogFault::kSpike, FaultWeight::kWarning, names[c],
           share_of(std::ssize(rows), log.rows()), static_cast<double>(rows.size()),
           log.place(rows.front()),
           fmt::format("column '{}' jumps and comes back in {} rows ({:g} in the first)", names[c],
                       rows.size(), signal(rows.front(), static_cast<Eigen::Index>(c))),
           "the rows were left out"});
    }
  };
  const std::vector<Spikes> positions = look(log.q, false);
  std::vector<char> moved(keep.size(), 0);
  for (const Spikes& rows : positions)
    for (const Eigen::Index row : rows) moved[static_cast<std::size_t>(row)] = 1;
  leave_out(log.q, log.q_columns, positions);
  leave_out(log.dq, log.dq_columns, look(log.dq, true));
  std::vector<Spikes> torques = look(log.torque, false);
  spare_blows(log, moved, torques);
  leave_out(log.torque, log.torque_columns, torques);
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
