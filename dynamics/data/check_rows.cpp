// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "dynamics/data/log_checks.h"
#include "dynamics/data/statistics.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr double kMostlyBroken = 0.5;  // of the rows
constexpr double kDisordered = 0.05;   // of the rows; a few late packets are less
constexpr Eigen::Index kRestartRows =
    10;                                // rows in order after a step back: the clock started again
constexpr Eigen::Index kShortRun = 5;  // rows; longer runs without change may be a robot at rest
constexpr double kJumpOfStale = 5.0;   // times the median change from row to row
constexpr double kFewStale = 0.01;
constexpr double kManyStale = 0.1;          // of the rows
constexpr Eigen::Index kLongestStale = 50;  // rows; beyond, the robot rests

/// Rows of one column that are no finite number, and rows that are too large.
struct BadCells {
  Eigen::Index missing = 0, infinite = 0, first_missing = -1, first_infinite = -1;
};

BadCells find_bad_cells(const Eigen::Ref<const Eigen::VectorXd>& values, std::vector<char>& keep) {
  BadCells bad;
  for (Eigen::Index row = 0; row < values.size(); ++row) {
    const double value = values(row);
    if (std::abs(value) <= kAbsurdValue) continue;
    keep[static_cast<std::size_t>(row)] = 0;
    if (std::isnan(value)) {
      if (bad.missing++ == 0) bad.first_missing = row;
    } else if (bad.infinite++ == 0) {
      bad.first_infinite = row;
    }
  }
  return bad;
}

void name_bad_cells(const TorqueLog& log, const std::string& column, const BadCells& bad,
                    std::vector<LogFinding>& findings) {
  if (bad.missing > 0) {
    findings.push_back({LogFault::kNotANumber, FaultWeight::kWarning, column,
                        share_of(bad.missing, log.rows()), static_cast<double>(bad.missing),
                        log.place(bad.first_missing),
                        fmt::format("column '{}' holds no number in {} rows", column, bad.missing),
                        "the rows were left out; repair the recorder"});
  }
  if (bad.infinite > 0) {
    findings.push_back({LogFault::kInfinite, FaultWeight::kWarning, column,
                        share_of(bad.infinite, log.rows()), static_cast<double>(bad.infinite),
                        log.place(bad.first_infinite),
                        fmt::format("column '{}' is infinite or over {:g} in {} rows", column,
                                    kAbsurdValue, bad.infinite),
                        "the rows were left out; is the file cut or corrupt there?"});
  }
}

bool same_signals(const TorqueLog& log, Eigen::Index a, Eigen::Index b, bool positions_only) {
  if (positions_only) return log.q.row(a) == log.q.row(b);
  return log.q.row(a) == log.q.row(b) && (log.dq.cols() == 0 || log.dq.row(a) == log.dq.row(b)) &&
         (log.torque.cols() == 0 || log.torque.row(a) == log.torque.row(b));
}

/// A run of equal rows [begin, end) of one trajectory.
struct Run {
  Eigen::Index begin = 0, end = 0;
  double jump = 0.0;  ///< largest change of position at its end
};

std::vector<Run> runs_of_equal_rows(const TorqueLog& log, bool positions_only) {
  std::vector<Run> runs;
  for (Eigen::Index row = 0; row < log.rows(); ++row) {
    const bool same_trajectory = row > 0 && log.trajectory(row) == log.trajectory(row - 1);
    if (same_trajectory && same_signals(log, row, row - 1, positions_only)) {
      runs.back().end = row + 1;
      continue;
    }
    if (same_trajectory) {
      runs.back().jump = (log.q.row(row) - log.q.row(row - 1)).cwiseAbs().maxCoeff();
    }
    runs.push_back({row, row + 1, 0.0});
  }
  return runs;
}

double median_change(const std::vector<Run>& runs) {
  std::vector<double> jumps;
  for (const Run& run : runs) {
    if (run.jump > 0.0) jumps.push_back(run.jump);
  }
  return median_of(std::move(jumps));
}

/// Positions that repeat although velocity or torque are new: the encoder is read less often, or
/// steps coarsely. Nothing to leave out, but differences of such positions mean little.
std::optional<LogFinding> stale_positions(const TorqueLog& log) {
  Eigen::Index stale = 0, first = -1, longest = 0;
  for (const Run& run : runs_of_equal_rows(log, true)) {
    const Eigen::Index length = run.end - run.begin;
    if (length == 1 || length > kLongestStale || run.jump == 0.0) continue;
    if (stale == 0) first = run.begin + 1;
    stale += length - 1;
    longest = std::max(longest, length);
  }
  const double share = share_of(stale, log.rows());
  if (share < kManyStale) return std::nullopt;
  return LogFinding{
      LogFault::kStaleRows,
      FaultWeight::kWarning,
      log.q_columns.front(),
      share,
      static_cast<double>(longest),
      log.place(first),
      fmt::format("{:.0f} % of the rows repeat the positions of the row before (at most "
                  "{} alike in a run)",
                  100.0 * share, longest),
      "positions are read too seldom or too coarsely for these rows; the low-pass bridges "
      "it"};
}

}  // namespace

CheckedLog check_numbers(TorqueLog log) {
  CheckedLog out;
  std::vector<char> keep(static_cast<std::size_t>(log.rows()), 1);
  const auto look = [&](const Eigen::MatrixXd& signal, const std::vector<std::string>& names) {
    for (Eigen::Index c = 0; c < signal.cols(); ++c) {
      const BadCells bad = find_bad_cells(signal.col(c), keep);
      name_bad_cells(log, names[static_cast<std::size_t>(c)], bad, out.findings);
    }
  };
  look(log.q, log.q_columns);
  look(log.dq, log.dq_columns);
  look(log.ddq, log.ddq_columns);
  look(log.torque, log.torque_columns);
  for (Eigen::Index row = 0; row < log.rows(); ++row) {
    if (std::isfinite(log.t_s(row))) continue;
    if (keep[static_cast<std::size_t>(row)] != 0) {
      out.findings.push_back({LogFault::kNotANumber, FaultWeight::kWarning, "", 0.0, 1.0,
                              log.place(row), "the stamp is no number", "the row was left out"});
    }
    keep[static_cast<std::size_t>(row)] = 0;
  }
  const Eigen::Index kept = std::ranges::count(keep, 1);
  if (share_of(log.rows() - kept, log.rows()) > kMostlyBroken) {
    out.findings.push_back(
        {LogFault::kNotANumber, FaultWeight::kRefusal, "", share_of(log.rows() - kept, log.rows()),
         0.0, log.sources.front(),
         fmt::format("only {} of {} rows hold numbers in all columns", kept, log.rows()),
         "name the columns that were recorded, or record again"});
  }
  out.log = kept == log.rows() ? std::move(log) : keep_rows(log, keep);
  return out;
}

CheckedLog check_stamps(TorqueLog log) {
  CheckedLog out;
  if (!log.stamped || log.rows() == 0) return {std::move(log), {}};
  std::vector<char> keep(static_cast<std::size_t>(log.rows()), 1);
  Eigen::VectorXi trajectory = log.trajectory;
  std::vector<std::string> names = {
      log.trajectory_names[static_cast<std::size_t>(log.trajectory(0))]};
  Eigen::Index repeated = 0, first_repeated = -1, late = 0, first_late = -1, restarts = 0,
               first_restart = -1, last = 0;
  trajectory(0) = 0;
  for (Eigen::Index row = 1; row < log.rows(); ++row) {
    const bool new_trajectory = log.trajectory(row) != log.trajectory(row - 1);
    const double step = log.t_s(row) - log.t_s(last);
    bool restart = false;
    if (!new_trajectory && step <= 0.0) {
      Eigen::Index ahead = row;
      while (ahead + 1 < log.rows() && ahead - row < kRestartRows &&
             log.t_s(ahead + 1) > log.t_s(ahead) && log.t_s(ahead + 1) < log.t_s(last)) {
        ++ahead;
      }
      restart = step < 0.0 && ahead - row >= kRestartRows;
      if (!restart) {
        keep[static_cast<std::size_t>(row)] = 0;
        trajectory(row) = trajectory(last);
        if (step == 0.0 && repeated++ == 0) first_repeated = row;
        if (step < 0.0 && late++ == 0) first_late = row;
        continue;
      }
      if (restarts++ == 0) first_restart = row;
    }
    trajectory(row) = trajectory(last) + (new_trajectory || restart ? 1 : 0);
    if (new_trajectory || restart) {
      const auto& base = log.trajectory_names[static_cast<std::size_t>(log.trajectory(row))];
      names.push_back(restart ? fmt::format("{} ({})", base, log.place(row)) : base);
    }
    last = row;
  }
  const auto add = [&](LogFault fault, FaultWeight weight, Eigen::Index count, Eigen::Index first,
                       std::string what, std::string remedy) {
    if (count == 0) return;
    out.findings.push_back({fault, weight, "", share_of(count, log.rows()),
                            static_cast<double>(count), log.place(first), std::move(what),
                            std::move(remedy)});
  };
  const bool disordered = share_of(late, log.rows()) > kDisordered;
  add(LogFault::kRepeatedStamps, FaultWeight::kWarning, repeated, first_repeated,
      fmt::format("{} rows repeat the stamp of the row before", repeated),
      "the later rows were left out");
  add(LogFault::kStampsGoBack, disordered ? FaultWeight::kRefusal : FaultWeight::kWarning, late,
      first_late, fmt::format("{} rows are stamped earlier than the row before", late),
      disordered ? "sort the rows by time" : "they were left out");
  add(LogFault::kStampsGoBack, FaultWeight::kNote, restarts, first_restart,
      fmt::format("the clock starts again {} times", restarts),
      "each time begins another trajectory");
  log.trajectory = trajectory;
  log.trajectory_names = std::move(names);
  out.log = repeated + late > 0 ? keep_rows(log, keep) : std::move(log);
  return out;
}

CheckedLog check_stale_rows(TorqueLog log) {
  const std::vector<Run> runs = runs_of_equal_rows(log, false);
  const double change = median_change(runs);
  std::vector<char> keep(static_cast<std::size_t>(log.rows()), 1);
  Eigen::Index stale = 0, first = -1;
  std::vector<double> lengths;
  for (const Run& run : runs) {
    const Eigen::Index length = run.end - run.begin;
    const bool rest = length > kShortRun && run.jump <= kJumpOfStale * change;
    lengths.push_back(static_cast<double>(length));
    if (length == 1 || rest || change == 0.0) continue;
    if (stale == 0) first = run.begin + 1;
    stale += length - 1;
    std::fill(keep.begin() + run.begin + 1, keep.begin() + run.end, char{0});
  }
  CheckedLog out;
  if (stale == 0) {
    if (auto finding = stale_positions(log)) out.findings.push_back(std::move(*finding));
    out.log = std::move(log);
    return out;
  }
  const double share = share_of(stale, log.rows());
  const double step = median_of(steps_of(log.t_s, log.trajectory));
  const bool timed = step > 0.0 && (log.stamped || log.time_unit_declared);
  const std::string often =
      timed ? fmt::format(", about {:.0f} times a second here", (1.0 - share) / step) : "";
  out.findings.push_back(
      {LogFault::kStaleRows, share > kFewStale ? FaultWeight::kWarning : FaultWeight::kNote, "",
       share, quantile(lengths, 1.0), log.place(first),
       fmt::format("{:.0f} % of the rows repeat the row before (at most {:.0f} alike in a run)",
                   100.0 * share, quantile(lengths, 1.0)),
       fmt::format("the repeats were left out; log when values are renewed{}", often)});
  out.log = keep_rows(log, keep);
  return out;
}

}  // namespace kinescope
