// SPDX-License-Identifier: Apache-2.0
//
// Velocity against position in the integrated form: the change of q over a window against the
// integral of dq over it. That needs no derivative, so neither quantisation nor noise of the
// position matters.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "dynamics/data/log_checks.h"
#include "dynamics/data/statistics.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr double kWindowS = 0.1;           // long against noise, short against the motion
constexpr double kMostOfWindow = 2.0;      // of its usual length: a longer one holds a gap
constexpr Eigen::Index kWindowRows = 5;    // at least
constexpr double kFits = 0.9;              // of the change of q explained by the integral of dq
constexpr double kFactorTolerance = 0.03;  // of a wrong factor worth naming
constexpr double kUnitTolerance = 0.1;     // around 57.3, 1000, ..
constexpr double kStillChange =
    1e-3;  // rad or m: change of q over a window that is no motion (rms)
constexpr double kLargestLagSteps = 40.0;
constexpr double kLagStep = 0.25;         // of a row, of the scan
constexpr double kLagWorthNaming = 0.5;   // rows
constexpr double kVelocityLagGain = 0.7;  // of the residual left when the lag is undone

constexpr double kSlowestStepS = 0.05;  // accelerations change too fast for trapezoids beyond

/// The integral of `rate` from each trajectory's start (trapezoids).
Eigen::VectorXd integral(const TorqueLog& log, const Eigen::Ref<const Eigen::VectorXd>& rate) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(rate.size());
  for (Eigen::Index row = 1; row < rate.size(); ++row) {
    if (log.trajectory(row) != log.trajectory(row - 1)) continue;
    out(row) = out(row - 1) + 0.5 * (rate(row) + rate(row - 1)) * (log.t_s(row) - log.t_s(row - 1));
  }
  return out;
}

/// Values of `x` between the rows [begin, end) at a time inside them, linear.
double at_time(const TorqueLog& log, const Eigen::VectorXd& x, Eigen::Index begin, Eigen::Index end,
               double t) {
  const double* first = log.t_s.data() + begin;
  const double* last = log.t_s.data() + end - 1;
  const double* after = std::clamp(std::upper_bound(first, last, t), first + 1, last);
  const Eigen::Index row = after - log.t_s.data();
  const double u = (t - log.t_s(row - 1)) / (log.t_s(row) - log.t_s(row - 1));
  return x(row - 1) + u * (x(row) - x(row - 1));
}

struct Windows {
  std::vector<Eigen::Index> begin, end;  ///< rows
  std::vector<Eigen::Index> from, to;    ///< rows of the trajectory, [from, to)
};

Windows make_windows(const TorqueLog& log, double step_s, double margin_s) {
  const auto rows = std::max(
      kWindowRows, static_cast<Eigen::Index>(
                       std::lround(log.stamped && step_s > 0.0 ? kWindowS / step_s : 0.0)));
  const Eigen::Index length = std::min<Eigen::Index>(rows, 1000);
  Windows out;
  const std::vector<Eigen::Index> bounds = log.bounds();
  for (std::size_t b = 0; b + 1 < bounds.size(); ++b) {
    const double first = log.t_s(bounds[b]) + margin_s;
    const double last = log.t_s(bounds[b + 1] - 1) - margin_s;
    for (Eigen::Index row = bounds[b]; row + length < bounds[b + 1]; row += length) {
      if (log.t_s(row) < first || log.t_s(row + length) > last) continue;
      const double usual_s = step_s * static_cast<double>(length);
      if (log.t_s(row + length) - log.t_s(row) > kMostOfWindow * usual_s) continue;  // a gap
      out.begin.push_back(row);
      out.end.push_back(row + length);
      out.from.push_back(bounds[b]);
      out.to.push_back(bounds[b + 1]);
    }
  }
  return out;
}

/// How well the change of x fits the integral of its rate, taken `lag_s` later.
struct Comparison {
  Slope slope;
  double change_rms = 0.0;
  double residual = 0.0;  ///< sum of squares
};

Comparison compare(const TorqueLog& log, const Windows& windows, const Eigen::VectorXd& x,
                   const Eigen::VectorXd& summed, double lag_s) {
  std::vector<double> change, integrated;
  double square = 0.0;
  for (std::size_t w = 0; w < windows.begin.size(); ++w) {
    const Eigen::Index a = windows.begin[w];
    const Eigen::Index b = windows.end[w];
    change.push_back(x(b) - x(a));
    square += change.back() * change.back();
    const auto later = [&](Eigen::Index row) {
      if (lag_s == 0.0) return summed(row);
      return at_time(log, summed, windows.from[w], windows.to[w], log.t_s(row) + lag_s);
    };
    integrated.push_back(later(b) - later(a));
  }
  Comparison out;
  out.slope = slope_through_origin(integrated, change);
  out.residual = square * (1.0 - out.slope.explained);
  out.change_rms = change.empty() ? 0.0 : std::sqrt(square / static_cast<double>(change.size()));
  return out;
}

struct Lag {
  double seconds = 0.0;
  double gain = 1.0;  ///< residual with it / residual without
};

Lag find_lag(const TorqueLog& log, const Windows& windows, const Eigen::VectorXd& x,
             const Eigen::VectorXd& summed, double step_s) {
  const int reach = static_cast<int>(kLargestLagSteps / kLagStep);
  std::vector<double> residuals;
  for (int k = -reach; k <= reach; ++k) {
    residuals.push_back(compare(log, windows, x, summed, k * kLagStep * step_s).residual);
  }
  const auto best = std::ranges::min_element(residuals) - residuals.begin();
  if (best == 0 || best + 1 == std::ssize(residuals)) return {};
  const auto zero = static_cast<std::size_t>(reach);
  Lag lag{
      static_cast<double>(best - reach) * kLagStep * step_s,
      residuals[zero] > 0.0 ? residuals[static_cast<std::size_t>(best)] / residuals[zero] : 1.0};
  const auto b = static_cast<std::size_t>(best);
  const double curvature = residuals[b - 1] - 2.0 * residuals[b] + residuals[b + 1];
  if (curvature > 0.0) {
    lag.seconds += 0.5 * (residuals[b - 1] - residuals[b + 1]) / curvature * kLagStep * step_s;
  }
  return lag;
}

bool near(double value, double target, double tolerance) {
  return std::abs(value / target - 1.0) < tolerance;
}

/// What a factor between the change of q and the integral of dq says about units; nothing when it
/// is not one of theirs.
std::optional<LogFinding> unit_suspicion(const TorqueLog& log, Eigen::Index joint, double factor) {
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  const auto at = static_cast<std::size_t>(joint);
  const auto refusal = [&](std::string what, std::string remedy) {
    return LogFinding{LogFault::kUnit, FaultWeight::kRefusal, log.q_columns[at], 1.0,
                      factor,          log.sources.front(),   std::move(what),   std::move(remedy)};
  };
  const std::string names = fmt::format("'{}' and '{}'", log.q_columns[at], log.dq_columns[at]);
  if (near(factor, kDegrees, kUnitTolerance)) {
    return refusal(fmt::format("{} differ by 57.3: degrees against rad/s", names),
                   "say so in recording.yaml, dynamics: {position_unit: [deg]}");
  }
  if (near(factor, 1.0 / kDegrees, kUnitTolerance)) {
    return refusal(fmt::format("{} differ by 1/57.3: rad against degrees/s", names),
                   "say so in recording.yaml, dynamics: {velocity_unit: [deg/s]}");
  }
  const bool prismatic = log.joints[at].prismatic;
  if (prismatic && near(factor, 1e3, kUnitTolerance)) {
    return refusal(fmt::format("{} differ by 1000: mm against m/s", names),
                   "say so in recording.yaml, dynamics: {position_unit: [.., mm, ..]}");
  }
  return std::nullopt;
}

/// ms, us or ns read as s: every moving joint shows the same factor.
std::optional<LogFinding> clock_suspicion(const TorqueLog& log,
                                          const std::vector<double>& factors) {
  if (factors.empty() || log.time_unit_declared) return std::nullopt;
  for (const auto& [factor, unit] : {std::pair{1e-3, "ms"}, {1e-6, "us"}, {1e-9, "ns"}}) {
    const bool all = std::ranges::all_of(
        factors, [&](double found) { return near(std::abs(found), factor, kUnitTolerance); });
    if (!all) continue;
    return LogFinding{
        LogFault::kUnit,
        FaultWeight::kRefusal,
        "t",
        1.0,
        factor,
        log.sources.front(),
        fmt::format("positions change {:g} times faster than the velocities say: are the "
                    "stamps in {}?",
                    1.0 / factor, unit),
        fmt::format("say so in recording.yaml, dynamics: {{time_unit: {}}}", unit)};
  }
  return std::nullopt;
}

class MotionCheck {
 public:
  explicit MotionCheck(TorqueLog log) : log_(std::move(log)) {
    step_s_ = median_of(steps_of(log_.t_s, log_.trajectory));
    windows_ = make_windows(log_, step_s_, (kLargestLagSteps + 1.0) * step_s_);
  }

  CheckedLog run() {
    if (log_.dq.cols() > 0 && !windows_.begin.empty()) {
      compare_all();
      if (!log_.stamped && !log_.time_unit_declared) {
        take_rate();
      } else if (const auto clock = clock_suspicion(log_, factors_)) {
        findings_.push_back(*clock);
      } else {
        for (const Eigen::Index joint : moving_) judge(joint);
      }
    } else if (!log_.stamped && !log_.time_unit_declared) {
      refuse_clock();
    }
    if (drop_velocity_) {
      log_.dq.resize(log_.rows(), 0);
      log_.dq_columns.clear();
    }
    return {std::move(log_), std::move(findings_)};
  }

 private:
  void compare_all() {
    for (Eigen::Index joint = 0; joint < log_.q.cols(); ++joint) {
      summed_.push_back(integral(log_, log_.dq.col(joint)));
      found_.push_back(compare(log_, windows_, log_.q.col(joint), summed_.back(), 0.0));
      if (found_.back().change_rms < kStillChange) continue;
      moving_.push_back(joint);
      if (found_.back().slope.explained > kFits) factors_.push_back(found_.back().slope.value);
    }
  }

  void refuse_clock() {
    findings_.push_back({LogFault::kNoClock, FaultWeight::kRefusal, "", 1.0, 0.0,
                         log_.sources.front(),
                         "no column of stamps, and no velocity that tells the rate",
                         "state it in recording.yaml, dynamics: {rate_hz: ..}"});
  }

  /// Rows count the time, so the factor is the step. Joints must agree.
  void take_rate() {
    const double step = median_of(factors_);
    const bool agree = !factors_.empty() && step > 0.0 &&
                       quantile(factors_, 0.75) - quantile(factors_, 0.25) < 0.1 * step;
    if (!agree) return refuse_clock();
    log_.t_s *= step;
    log_.time_unit_declared = true;
    findings_.push_back(
        {LogFault::kNoClock, FaultWeight::kWarning, "", 1.0, 1.0 / step, log_.sources.front(),
         fmt::format("no column of stamps; velocity against position says {:.4g} Hz", 1.0 / step),
         "state it in recording.yaml, dynamics: {rate_hz: ..}"});
  }

  void judge(Eigen::Index joint) {
    const auto at = static_cast<std::size_t>(joint);
    const Comparison& found = found_[at];
    const std::string& name = log_.dq_columns[at];
    const auto add = [&](LogFault fault, FaultWeight weight, double share, double value,
                         std::string what, std::string remedy) {
      findings_.push_back({fault, weight, name, share, value, log_.sources.front(), std::move(what),
                           std::move(remedy)});
    };
    const double factor = found.slope.value;
    const Lag lag = find_lag(log_, windows_, log_.q.col(joint), summed_[at], step_s_);
    const double explained = 1.0 - lag.gain * (1.0 - found.slope.explained);
    if (explained < kFits) {
      drop_velocity_ = true;
      return add(LogFault::kVelocityMismatch, FaultWeight::kWarning, 1.0 - explained, explained,
                 fmt::format("column '{}' explains {:.0f} % of the change of '{}'", name,
                             100.0 * explained, log_.q_columns[at]),
                 "velocities are derived from positions instead; are the columns of one joint?");
    }
    if (const auto unit = unit_suspicion(log_, joint, factor)) return findings_.push_back(*unit);
    if (std::abs(lag.seconds) > kLagWorthNaming * step_s_ && lag.gain < kVelocityLagGain) {
      drop_velocity_ = drop_velocity_ || std::abs(lag.seconds) > step_s_;
      add(LogFault::kVelocityLag, FaultWeight::kWarning, 1.0, lag.seconds,
          fmt::format("column '{}' comes {:.3g} ms {} the change of '{}'", name,
                      1e3 * std::abs(lag.seconds), lag.seconds > 0.0 ? "after" : "before",
                      log_.q_columns[at]),
          std::abs(lag.seconds) > step_s_ ? "velocities are derived from positions instead"
                                          : "the drive filters it; below one step, kept");
    }
    if (std::abs(factor - 1.0) > kFactorTolerance) {
      drop_velocity_ = true;
      add(LogFault::kVelocityScale, FaultWeight::kWarning, 1.0, factor,
          fmt::format("column '{}' times {:.4g} is the derivative of '{}'", name, factor,
                      log_.q_columns[at]),
          "velocities are derived from positions instead; a gear, a sign or the rate is wrong");
    }
  }

  TorqueLog log_;
  double step_s_ = 0.0;
  Windows windows_;
  std::vector<Eigen::VectorXd> summed_;
  std::vector<Comparison> found_;
  std::vector<Eigen::Index> moving_;
  std::vector<double> factors_;
  std::vector<LogFinding> findings_;
  bool drop_velocity_ = false;
};

/// Accelerations given by the log must be the change of its velocity; they are dropped where not.
void judge_acceleration(CheckedLog& checked) {
  TorqueLog& log = checked.log;
  if (log.ddq.cols() == 0 || log.dq.cols() == 0) return;
  const double step_s = median_of(steps_of(log.t_s, log.trajectory));
  if (step_s > kSlowestStepS) return;
  const Windows windows = make_windows(log, step_s, 0.0);
  bool drop = false;
  for (Eigen::Index joint = 0; joint < log.q.cols(); ++joint) {
    if (log.ddq.col(joint).minCoeff() == log.ddq.col(joint).maxCoeff()) continue;  // check_channels
    const Eigen::VectorXd summed = integral(log, log.ddq.col(joint));
    const Comparison found = compare(log, windows, log.dq.col(joint), summed, 0.0);
    if (found.change_rms < 10.0 * kStillChange) continue;
    if (found.slope.explained > kFits && near(found.slope.value, 1.0, 0.1)) continue;
    drop = true;
    const auto at = static_cast<std::size_t>(joint);
    checked.findings.push_back(
        {LogFault::kAcceleration, FaultWeight::kWarning, log.ddq_columns[at],
         1.0 - found.slope.explained, found.slope.value, log.sources.front(),
         fmt::format("column '{}' explains {:.0f} % of the change of '{}' (factor {:.3g})",
                     log.ddq_columns[at], 100.0 * found.slope.explained, log.dq_columns[at],
                     found.slope.value),
         "accelerations are derived instead"});
  }
  if (!drop) return;
  log.ddq.resize(log.rows(), 0);
  log.ddq_columns.clear();
}

}  // namespace

CheckedLog check_motion(TorqueLog log) {
  CheckedLog checked = MotionCheck(std::move(log)).run();
  judge_acceleration(checked);
  return checked;
}

}  // namespace kinescope
