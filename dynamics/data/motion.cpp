// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "dynamics/data/acceleration_share.h"
#include "dynamics/data/log_checks.h"
#include "dynamics/data/predictive_cutoff.h"
#include "dynamics/data/statistics.h"
#include "dynamics/data/zero_phase_filter.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"
#include "kinematics/log/smoothing_spline.h"

namespace kinescope {
namespace {

constexpr int kSplineOrder = 3;
constexpr int kButterworthOrder = 4;
constexpr double kSamplesPerPeriod =
    10.0;  // of the cut-off: smooth to the eye, no longer independent
constexpr Eigen::Index kFewestSamples = 4;

int order_of(LowPass filter) {
  return filter == LowPass::kButterworth ? kButterworthOrder : kSplineOrder;
}

/// Values at evenly spaced times by straight lines between the rows [begin, end).
Eigen::MatrixXd on_even_grid(const TorqueLog& log, const Eigen::MatrixXd& x, Eigen::Index begin,
                             Eigen::Index end, double step_s) {
  const double start_s = log.t_s(begin);
  // A millionth of a step keeps rounding from losing the last sample.
  const auto count =
      1 + static_cast<Eigen::Index>(std::floor((log.t_s(end - 1) - start_s) / step_s + 1e-6));
  Eigen::MatrixXd out(count, x.cols());
  Eigen::Index row = begin;
  for (Eigen::Index k = 0; k < count; ++k) {
    const double t = start_s + static_cast<double>(k) * step_s;
    while (row + 2 < end && log.t_s(row + 1) <= t) ++row;
    const double u = std::clamp((t - log.t_s(row)) / (log.t_s(row + 1) - log.t_s(row)), 0.0, 1.0);
    out.row(k) = (1.0 - u) * x.row(row) + u * x.row(row + 1);
  }
  return out;
}

/// One trajectory, filtered: at even times.
struct Filtered {
  Eigen::VectorXd t_s;
  Eigen::MatrixXd q, dq, ddq, torque;
  MissingTorque missing;
};

class MotionDeriver {
 public:
  MotionDeriver(const TorqueLog& log, const MotionOptions& options)
      : log_(log), options_(options), step_s_(median_of(steps_of(log.t_s, log.trajectory))) {
    bounds_ = log.bounds();
  }

  Motion derive() {
    check_options();
    out_.filter = options_.filter;
    if (options_.filter == LowPass::kNone) return as_logged();
    choose();
    const double rate_hz =
        options_.rate_hz > 0.0 ? options_.rate_hz : kSamplesPerPeriod * out_.cutoff.cutoff_hz;
    const double stride = std::max(1.0, std::floor(1.0 / (rate_hz * step_s_) + 1e-9));
    sample_step_s_ = stride * step_s_;
    out_.rate_hz = 1.0 / sample_step_s_;
    std::vector<Filtered> parts;
    for (std::size_t b = 0; b + 1 < bounds_.size(); ++b) add_trajectory(b, parts);
    if (parts.empty()) {
      throw undetermined(log_.sources.front(),
                         fmt::format("no trajectory is long enough for a cut-off of {:.3g} Hz",
                                     out_.cutoff.cutoff_hz),
                         "record longer, or state a higher cut-off (cutoff_hz)");
    }
    stack(parts);
    return std::move(out_);
  }

 private:
  void check_options() const {
    const bool bad = options_.cutoff_hz < 0.0 || options_.rate_hz < 0.0 ||
                     options_.edge_periods < 0.0 ||
                     !std::isfinite(options_.cutoff_hz + options_.rate_hz + options_.edge_periods);
    if (bad) {
      throw bad_request("dynamics", "cutoff_hz, rate_hz and edge_periods must not be negative",
                        "leave them out for the defaults");
    }
    const double highest_hz = step_s_ > 0.0 ? 0.5 / step_s_ : 0.0;
    if (options_.filter != LowPass::kNone && options_.cutoff_hz >= highest_hz) {
      throw bad_request("dynamics.cutoff_hz",
                        fmt::format("{:.4g} Hz is not below half the log's rate ({:.4g} Hz)",
                                    options_.cutoff_hz, highest_hz),
                        "state a lower one, or none to have it chosen");
    }
    const bool velocity = options_.source == MotionSource::kVelocity && log_.dq.cols() == 0;
    const bool logged =
        options_.source == MotionSource::kLogged && (log_.dq.cols() == 0 || log_.ddq.cols() == 0);
    if (velocity || logged) {
      throw bad_request("dynamics.source", "the log has no usable velocities or accelerations",
                        "choose position, or none to have it chosen");
    }
  }

  Motion as_logged() {
    if (log_.dq.cols() == 0 || log_.ddq.cols() == 0) {
      throw bad_request("dynamics.filter", "without a filter the log must hold accelerations",
                        "choose spline or butterworth");
    }
    TorqueSamples& samples = out_.samples;
    samples = {log_.t_s, log_.q, log_.dq, log_.ddq, log_.torque, log_.trajectory, {}, {}, {}};
    samples.trajectory_names = log_.trajectory_names;
    samples.torque_missing = log_.torque_missing;
    name_samples();
    out_.source = MotionSource::kLogged;
    out_.rate_hz = step_s_ > 0.0 ? 1.0 / step_s_ : 0.0;
    return std::move(out_);
  }

  std::vector<Spectrum> spectra_of(const Eigen::MatrixXd& signal, int differences) const {
    std::vector<Spectrum> spectra;
    for (Eigen::Index c = 0; c < signal.cols(); ++c) {
      EvenSeries series{step_s_, {}};
      for (std::size_t b = 0; b + 1 < bounds_.size(); ++b) {
        if (bounds_[b + 1] - bounds_[b] < kFewestFilteredRows) continue;
        series.pieces.emplace_back(
            on_even_grid(log_, signal.col(c), bounds_[b], bounds_[b + 1], step_s_));
      }
      spectra.push_back(power_spectrum(series, differences));
    }
    return spectra;
  }

  /// From the begin to the end of the trajectories, by the time they take: noise is next to
  /// nothing.
  Eigen::VectorXd travel_speed() const {
    Eigen::VectorXd way = Eigen::VectorXd::Zero(log_.q.cols());
    double time_s = 0.0;
    for (std::size_t b = 0; b + 1 < bounds_.size(); ++b) {
      const Eigen::Index last = bounds_[b + 1] - 1;
      way += (log_.q.row(last) - log_.q.row(bounds_[b])).cwiseAbs().transpose();
      time_s += log_.t_s(last) - log_.t_s(bounds_[b]);
    }
    return time_s > 0.0 ? Eigen::VectorXd(way / time_s) : way;
  }

  double mean_duration_s() const {
    double time_s = 0.0;
    for (std::size_t b = 0; b + 1 < bounds_.size(); ++b) {
      time_s += log_.t_s(bounds_[b + 1] - 1) - log_.t_s(bounds_[b]);
    }
    return time_s / std::max(1.0, static_cast<double>(bounds_.size()) - 1.0);
  }

  /// The source and cut-off with the smallest expected error of the accelerations.
  void choose() {
    struct Candidate {
      MotionSource source;
      const Eigen::MatrixXd* signal;
      int derivatives;
    };
    const std::vector<Candidate> candidates = {{MotionSource::kPosition, &log_.q, 2},
                                               {MotionSource::kVelocity, &log_.dq, 1},
                                               {MotionSource::kLogged, &log_.ddq, 0}};
    const bool torque = log_.torque.cols() > 0;
    const std::vector<Spectrum> torques =
        torque ? spectra_of(log_.torque, 1) : std::vector<Spectrum>();
    const Eigen::VectorXd shares = acceleration_shares(log_, step_s_);
    double best = std::numeric_limits<double>::infinity();
    CutoffEvidence used;
    for (const Candidate& candidate : candidates) {
      const bool wanted =
          options_.source == MotionSource::kBest || options_.source == candidate.source;
      const bool there = candidate.signal->cols() > 0 &&
                         (candidate.source == MotionSource::kPosition || log_.dq.cols() > 0);
      if (!wanted || !there) continue;
      const CutoffEvidence evidence{
          spectra_of(*candidate.signal, std::max(0, candidate.derivatives - 1)),
          candidate.derivatives,
          torques,
          shares,
          travel_speed(),
          mean_duration_s()};
      const CutoffChoice choice =
          choose_cutoff(evidence, order_of(options_.filter), options_.cutoff_hz);
      const double error = sum_of_squares(choice.expected_error);
      if (choice.cutoff_hz <= 0.0 || (std::isfinite(best) && error >= best)) continue;
      best = error;
      out_.cutoff = choice;
      out_.source = candidate.source;
      used = evidence;
    }
    if (out_.cutoff.cutoff_hz <= 0.0) {
      throw undetermined(log_.sources.front(), "no joint moves clear of the noise",
                         "record a motion, or state a cut-off (cutoff_hz)");
    }
    if (out_.cutoff.chosen) follow_the_torque(used);
  }

  /// Another cut-off where the torque asks for one.
  void follow_the_torque(const CutoffEvidence& evidence) {
    const double spectral_hz = out_.cutoff.cutoff_hz;
    const double cutoff_hz =
        best_predicting_cutoff(try_cutoffs(log_, step_s_, out_.source, spectral_hz), spectral_hz);
    if (cutoff_hz == spectral_hz) return;
    out_.cutoff.expected_error =
        choose_cutoff(evidence, order_of(options_.filter), cutoff_hz).expected_error;
    out_.cutoff.cutoff_hz = cutoff_hz;
    out_.cutoff.at_edge = false;
  }

  static double sum_of_squares(const Eigen::VectorXd& errors) {
    double sum = 0.0;
    for (const double error : errors) sum += std::isfinite(error) ? error * error : 0.0;
    return sum;
  }

  void add_trajectory(std::size_t b, std::vector<Filtered>& parts) {
    const Eigen::Index begin = bounds_[b];
    const Eigen::Index end = bounds_[b + 1];
    const double edge_s = options_.edge_periods / out_.cutoff.cutoff_hz;
    const double usable_s = log_.t_s(end - 1) - log_.t_s(begin) - 2.0 * edge_s;
    const auto count = static_cast<Eigen::Index>(std::floor(usable_s / sample_step_s_ + 1e-6)) + 1;
    const std::string& name =
        log_.trajectory_names[static_cast<std::size_t>(log_.trajectory(begin))];
    if (end - begin < kFewestFilteredRows || count < kFewestSamples) {
      out_.findings.push_back(
          {LogFault::kTooShort, FaultWeight::kWarning, "",
           static_cast<double>(end - begin) / static_cast<double>(log_.rows()),
           log_.t_s(end - 1) - log_.t_s(begin), log_.place(begin),
           fmt::format("trajectory '{}' of {} rows is too short for a cut-off of {:.3g} Hz", name,
                       end - begin, out_.cutoff.cutoff_hz),
           "left out"});
      return;
    }
    // The edge is rounded up to whole rows, so that samples of an evenly stamped log fall on its
    // rows.
    const double first_s = log_.t_s(begin) + std::ceil(edge_s / step_s_ - 1e-6) * step_s_;
    Filtered part;
    part.t_s = first_s + sample_step_s_ *
                             Eigen::ArrayXd::LinSpaced(count, 0.0, static_cast<double>(count - 1));
    while (part.t_s.size() > kFewestSamples &&
           part.t_s(part.t_s.size() - 1) > log_.t_s(end - 1) - edge_s + 1e-9) {
      part.t_s.conservativeResize(part.t_s.size() - 1);
    }
    if (options_.filter == LowPass::kButterworth)
      filter_butterworth(begin, end, part);
    else
      filter_spline(begin, end, part);
    hold_still(begin, end, part);
    mark_missing(begin, end, edge_s, part);
    out_.samples.trajectory_names.push_back(name);
    parts.push_back(std::move(part));
  }

  /// Beside what was not measured the low-pass knows as little as beyond the ends.
  void mark_missing(Eigen::Index begin, Eigen::Index end, double edge_s, Filtered& part) const {
    if (log_.torque_missing.size() == 0) return;
    const double reach_s = std::max(edge_s, step_s_) * (1.0 - 1e-9);
    part.missing = MissingTorque::Constant(part.t_s.size(), log_.torque.cols(), false);
    for (Eigen::Index j = 0; j < log_.torque.cols(); ++j) {
      Eigen::Index next = 0;
      for (Eigen::Index row = begin; row < end; ++row) {
        if (!log_.torque_missing(row, j)) continue;
        while (next < part.t_s.size() && part.t_s(next) < log_.t_s(row) - reach_s) ++next;
        for (Eigen::Index k = next; k < part.t_s.size() && part.t_s(k) <= log_.t_s(row) + reach_s;
             ++k)
          part.missing(k, j) = true;
      }
    }
  }

  /// A joint that holds its position is at rest exactly: rounding is no motion.
  void hold_still(Eigen::Index begin, Eigen::Index end, Filtered& part) const {
    for (Eigen::Index j = 0; j < log_.q.cols(); ++j) {
      const auto q = log_.q.col(j).segment(begin, end - begin);
      if (q.minCoeff() != q.maxCoeff()) continue;
      part.q.col(j).setConstant(q[0]);
      part.dq.col(j).setZero();
      part.ddq.col(j).setZero();
    }
  }

  /// One factorisation for all signals.
  void filter_spline(Eigen::Index begin, Eigen::Index end, Filtered& part) const {
    const Eigen::Index n = end - begin;
    const Eigen::Index joints = log_.q.cols();
    const bool velocity = out_.source != MotionSource::kPosition;
    const bool acceleration = out_.source == MotionSource::kLogged;
    Eigen::MatrixXd all(
        n, joints * (1 + (velocity ? 1 : 0) + (acceleration ? 1 : 0)) + log_.torque.cols());
    all.leftCols(joints) = log_.q.middleRows(begin, n);
    if (velocity) all.middleCols(joints, joints) = log_.dq.middleRows(begin, n);
    if (acceleration) all.middleCols(2 * joints, joints) = log_.ddq.middleRows(begin, n);
    all.rightCols(log_.torque.cols()) = log_.torque.middleRows(begin, n);
    const SmoothingSpline spline(log_.t_s.segment(begin, n), all, out_.cutoff.cutoff_hz);
    const Eigen::MatrixXd value = spline.evaluate(part.t_s);
    const Eigen::MatrixXd rate = spline.evaluate(part.t_s, 1);
    part.q = value.leftCols(joints);
    part.dq = rate.leftCols(joints);
    if (velocity) {
      part.dq = value.middleCols(joints, joints);
      part.ddq = rate.middleCols(joints, joints);
    } else {
      part.ddq = spline.evaluate(part.t_s, 2).leftCols(joints);
    }
    if (acceleration) part.ddq = value.middleCols(2 * joints, joints);
    part.torque = value.rightCols(log_.torque.cols());
  }

  void filter_butterworth(Eigen::Index begin, Eigen::Index end, Filtered& part) const {
    const auto filtered = [&](const Eigen::MatrixXd& x) {
      return filter_zero_phase(on_even_grid(log_, x, begin, end, step_s_), kButterworthOrder,
                               out_.cutoff.cutoff_hz, 1.0 / step_s_);
    };
    std::vector<Eigen::Index> rows;
    for (const double t : part.t_s) {
      rows.push_back(static_cast<Eigen::Index>(std::lround((t - log_.t_s(begin)) / step_s_)));
    }
    const Eigen::MatrixXd q = filtered(log_.q);
    for (Eigen::Index& row : rows) row = std::min(row, q.rows() - 1);
    part.q = q(rows, Eigen::all);
    Eigen::MatrixXd dq, ddq;
    if (out_.source == MotionSource::kPosition) {
      dq = central_differences(q, step_s_);
      ddq = central_differences(dq, step_s_);
    } else {
      dq = filtered(log_.dq);
      ddq = out_.source == MotionSource::kVelocity ? central_differences(dq, step_s_)
                                                   : filtered(log_.ddq);
    }
    part.dq = dq(rows, Eigen::all);
    part.ddq = ddq(rows, Eigen::all);
    if (log_.torque.cols() > 0) part.torque = filtered(log_.torque)(rows, Eigen::all);
  }

  void stack(const std::vector<Filtered>& parts) {
    Eigen::Index count = 0;
    for (const Filtered& part : parts) count += part.t_s.size();
    TorqueSamples& samples = out_.samples;
    samples.t_s.resize(count);
    samples.q.resize(count, log_.q.cols());
    samples.dq.resize(count, log_.q.cols());
    samples.ddq.resize(count, log_.q.cols());
    samples.torque.resize(count, log_.torque.cols());
    samples.trajectory.resize(count);
    if (log_.torque_missing.size() > 0) samples.torque_missing.resize(count, log_.torque.cols());
    Eigen::Index at = 0;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      const Eigen::Index n = parts[p].t_s.size();
      samples.t_s.segment(at, n) = parts[p].t_s;
      samples.q.middleRows(at, n) = parts[p].q;
      samples.dq.middleRows(at, n) = parts[p].dq;
      samples.ddq.middleRows(at, n) = parts[p].ddq;
      if (log_.torque.cols() > 0) samples.torque.middleRows(at, n) = parts[p].torque;
      samples.trajectory.segment(at, n).setConstant(static_cast<int>(p));
      if (parts[p].missing.size() > 0) samples.torque_missing.middleRows(at, n) = parts[p].missing;
      at += n;
    }
    name_samples();
  }

  void name_samples() {
    for (const WantedJoint& joint : log_.joints) out_.samples.joint_names.push_back(joint.name);
    out_.samples.torque_unit = log_.torque_unit;
    out_.samples.torque_step.resize(log_.torque.cols());
    for (Eigen::Index j = 0; j < log_.torque.cols(); ++j)
      out_.samples.torque_step[j] = grid_step(measured_torques(log_, j)).value_or(0.0);
  }

  const TorqueLog& log_;
  MotionOptions options_;
  double step_s_;
  double sample_step_s_ = 0.0;
  std::vector<Eigen::Index> bounds_;
  Motion out_;
};

}  // namespace

std::string_view to_string(LowPass filter) {
  switch (filter) {
    case LowPass::kSmoothingSpline:
      return "spline";
    case LowPass::kButterworth:
      return "butterworth";
    case LowPass::kNone:
      return "none";
  }
  return "unknown";
}

std::string_view to_string(MotionSource source) {
  switch (source) {
    case MotionSource::kBest:
      return "best";
    case MotionSource::kPosition:
      return "position";
    case MotionSource::kVelocity:
      return "velocity";
    case MotionSource::kLogged:
      return "logged";
  }
  return "unknown";
}

Motion derive_motion(const TorqueLog& log, const MotionOptions& options) {
  return MotionDeriver(log, options).derive();
}

}  // namespace kinescope
