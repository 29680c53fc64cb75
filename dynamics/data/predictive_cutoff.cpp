// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/predictive_cutoff.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "dynamics/data/cutoff.h"
#include "dynamics/data/rough_torque.h"
#include "dynamics/data/statistics.h"
#include "dynamics/data/zero_phase_filter.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/log/smoothing_spline.h"

namespace kinescope {
namespace {

constexpr int kBlocks = 10;
constexpr double kSignificant = 2.821;  // Student's t of 9 degrees of freedom, 1 %, one-sided
constexpr double kTrialsPerOctave = 2.0;
constexpr int kStepsDown = 4;                // to a quarter
constexpr Eigen::Index kMostRows = 60000;    // filtered; of a longer log the middle of each part
constexpr Eigen::Index kMostTargets = 2000;  // torques that are predicted
constexpr Eigen::Index kFewestTargets = 200;
constexpr double kMostEdge = 0.1;  // of a part, dropped at either end
constexpr double kRidge = 1e-6;    // of a feature's power: against collinearity only
// Gravity of a joint that hardly turns is no curve through its torque: its amplitude is taken as
// three times the torque's rms, beside errors of a tenth of that.
constexpr double kGravityRidge = 1e-3;
constexpr double kUsualWidth = 0.01;  // rad/s or m/s: of the models' Coulomb friction

/// Consecutive rows, and those of them whose torques are predicted.
struct Part {
  Eigen::Index begin = 0, rows = 0;
  Eigen::VectorXd target_t_s;
};

struct Targets {
  std::vector<Part> parts;
  Eigen::MatrixXd torque;  ///< as logged: targets x joints
};

std::vector<Part> parts_of(const TorqueLog& log, double edge_s) {
  const std::vector<Eigen::Index> bounds = log.bounds();
  const double kept =
      std::min(1.0, static_cast<double>(kMostRows) / static_cast<double>(log.rows()));
  const Eigen::Index stride =
      std::max<Eigen::Index>(1, std::min(log.rows(), kMostRows) / kMostTargets);
  std::vector<Part> parts;
  for (std::size_t b = 0; b + 1 < bounds.size(); ++b) {
    const Eigen::Index all = bounds[b + 1] - bounds[b];
    const auto rows = static_cast<Eigen::Index>(kept * static_cast<double>(all));
    if (rows < kFewestFilteredRows) continue;
    Part part{bounds[b] + (all - rows) / 2, rows, {}};
    const double begin_s = log.t_s(part.begin);
    const double end_s = log.t_s(part.begin + rows - 1);
    const double edge = std::min(edge_s, kMostEdge * (end_s - begin_s));
    std::vector<double> times;
    for (Eigen::Index row = part.begin; row < part.begin + rows; row += stride) {
      const double t = log.t_s(row);
      if (log.torque_missing.size() > 0 && log.torque_missing.row(row).any()) continue;
      if (t >= begin_s + edge && t <= end_s - edge) times.push_back(t);
    }
    part.target_t_s = Eigen::Map<const Eigen::VectorXd>(times.data(), std::ssize(times));
    if (part.target_t_s.size() > 0) parts.push_back(std::move(part));
  }
  return parts;
}

Targets targets_of(const TorqueLog& log, double edge_s) {
  Targets out{parts_of(log, edge_s), {}};
  Eigen::Index count = 0;
  for (const Part& part : out.parts) count += part.target_t_s.size();
  out.torque.resize(count, log.torque.cols());
  Eigen::Index at = 0;
  for (const Part& part : out.parts) {
    Eigen::Index row = part.begin;
    for (const double t : part.target_t_s) {
      while (log.t_s(row) < t) ++row;
      out.torque.row(at++) = log.torque.row(row);
    }
  }
  return out;
}

struct Motions {
  Eigen::MatrixXd q, dq, ddq, torque;  ///< targets x joints
};

Motions filtered(const TorqueLog& log, const Targets& targets, MotionSource source,
                 double cutoff_hz) {
  const Eigen::Index joints = log.q.cols();
  const Eigen::Index count = targets.torque.rows();
  const bool velocity = source != MotionSource::kPosition;
  const bool acceleration = source == MotionSource::kLogged;
  Motions out{Eigen::MatrixXd(count, joints), Eigen::MatrixXd(count, joints),
              Eigen::MatrixXd(count, joints), Eigen::MatrixXd(count, log.torque.cols())};
  Eigen::Index at = 0;
  for (const Part& part : targets.parts) {
    const Eigen::Index n = part.target_t_s.size();
    Eigen::MatrixXd all(
        part.rows, joints * (1 + (velocity ? 1 : 0) + (acceleration ? 1 : 0)) + out.torque.cols());
    all.leftCols(joints) = log.q.middleRows(part.begin, part.rows);
    if (velocity) all.middleCols(joints, joints) = log.dq.middleRows(part.begin, part.rows);
    if (acceleration)
      all.middleCols(2 * joints, joints) = log.ddq.middleRows(part.begin, part.rows);
    all.rightCols(out.torque.cols()) = log.torque.middleRows(part.begin, part.rows);
    const SmoothingSpline spline(log.t_s.segment(part.begin, part.rows), all, cutoff_hz);
    const Eigen::MatrixXd value = spline.evaluate(part.target_t_s);
    const Eigen::MatrixXd rate = spline.evaluate(part.target_t_s, 1);
    out.q.middleRows(at, n) = value.leftCols(joints);
    out.dq.middleRows(at, n) = velocity ? value.middleCols(joints, joints) : rate.leftCols(joints);
    if (acceleration) {
      out.ddq.middleRows(at, n) = value.middleCols(2 * joints, joints);
    } else if (velocity) {
      out.ddq.middleRows(at, n) = rate.middleCols(joints, joints);
    } else {
      out.ddq.middleRows(at, n) = spline.evaluate(part.target_t_s, 2).leftCols(joints);
    }
    out.torque.middleRows(at, n) = value.rightCols(out.torque.cols());
    at += n;
  }
  return out;
}

Eigen::Index block_begin(Eigen::Index rows, int block) { return rows * block / kBlocks; }

/// Sum over each block of the squared errors of the torque of `joint` as logged, the model fitted
/// to all other blocks.
Eigen::VectorXd block_errors(const Motions& motion, const Eigen::VectorXd& logged,
                             Eigen::Index joint) {
  const Eigen::Index joints = motion.q.cols();
  const double width = std::min(kUsualWidth, narrow_width(motion.dq.col(joint)));
  if (!(width > 0.0)) return Eigen::VectorXd::Zero(kBlocks);
  const Eigen::MatrixXd rough = rough_torque_features(motion.q, motion.dq, joint, width);
  Eigen::MatrixXd features(rough.rows(), rough.cols() + joints);
  features << rough, motion.ddq;
  const auto is_gravity = [&](Eigen::Index c) {
    return c >= rough.cols() - 2 * joints && c < rough.cols();
  };
  for (Eigen::Index c = 0; c < features.cols(); ++c) {
    const double norm = features.col(c).norm();
    if (!is_gravity(c) && norm > 0.0) features.col(c) /= norm;
  }
  const Eigen::Index rows = features.rows();
  std::array<Eigen::MatrixXd, kBlocks> grams;
  std::array<Eigen::VectorXd, kBlocks> rights;
  Eigen::MatrixXd gram = kRidge * Eigen::MatrixXd::Identity(features.cols(), features.cols());
  for (Eigen::Index c = 0; c < features.cols(); ++c) {
    if (is_gravity(c)) gram(c, c) = kGravityRidge * static_cast<double>(rows);
  }
  Eigen::VectorXd right = Eigen::VectorXd::Zero(features.cols());
  for (int b = 0; b < kBlocks; ++b) {
    const Eigen::Index from = block_begin(rows, b);
    const Eigen::Index n = block_begin(rows, b + 1) - from;
    const auto at = static_cast<std::size_t>(b);
    const auto own = features.middleRows(from, n);
    grams[at] = own.transpose() * own;
    rights[at] = own.transpose() * motion.torque.col(joint).segment(from, n);
    gram += grams[at];
    right += rights[at];
  }
  Eigen::VectorXd out(kBlocks);
  for (int b = 0; b < kBlocks; ++b) {
    const Eigen::Index from = block_begin(rows, b);
    const Eigen::Index n = block_begin(rows, b + 1) - from;
    const auto at = static_cast<std::size_t>(b);
    const Eigen::VectorXd found =
        solve_symmetric(Eigen::MatrixXd(gram - grams[at]), Eigen::VectorXd(right - rights[at]));
    out(b) = (logged.segment(from, n) - features.middleRows(from, n) * found).squaredNorm();
  }
  return out;
}

/// Blocks x joints; 0 of a joint that does not move.
Eigen::MatrixXd errors_at(const TorqueLog& log, const Targets& targets, MotionSource source,
                          double cutoff_hz) {
  const Motions motion = filtered(log, targets, source, cutoff_hz);
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(kBlocks, log.q.cols());
  for (Eigen::Index j = 0; j < log.q.cols(); ++j) {
    const Eigen::ArrayXd q = log.q.col(j);
    if ((q - q.mean()).square().mean() < kStillSpread * kStillSpread) continue;
    out.col(j) = block_errors(motion, targets.torque.col(j), j);
  }
  return out;
}

CutoffTrial compare(const Eigen::MatrixXd& errors, const Eigen::MatrixXd& reference,
                    double cutoff_hz) {
  Eigen::VectorXd gains = Eigen::VectorXd::Zero(kBlocks);
  for (Eigen::Index j = 0; j < errors.cols(); ++j) {
    if (!(errors.col(j).minCoeff() > 0.0) || !(reference.col(j).minCoeff() > 0.0)) continue;
    gains += 0.5 * (reference.col(j).array() / errors.col(j).array()).log().matrix();
  }
  const double mean = gains.mean();
  const double variance = (gains.array() - mean).square().sum() / (kBlocks - 1);
  return {cutoff_hz, mean, std::sqrt(variance / kBlocks)};
}

}  // namespace

std::vector<CutoffTrial> try_cutoffs(const TorqueLog& log, double step_s, MotionSource source,
                                     double cutoff_hz) {
  if (log.torque.cols() != log.q.cols() || !(step_s > 0.0) || !(cutoff_hz > 0.0)) return {};
  const double lowest_hz =
      std::max(kLowestCutoffHz, cutoff_hz * std::exp2(-kStepsDown / kTrialsPerOctave));
  const Targets targets = targets_of(log, 1.0 / lowest_hz);
  if (targets.torque.rows() < kFewestTargets) return {};
  const Eigen::MatrixXd reference = errors_at(log, targets, source, cutoff_hz);
  std::vector<CutoffTrial> trials;
  for (int k = -kStepsDown;; ++k) {
    const double trial_hz = cutoff_hz * std::exp2(k / kTrialsPerOctave);
    if (trial_hz > kHighestCutoff / step_s) break;
    if (trial_hz < kLowestCutoffHz || k == 0) continue;
    trials.push_back(compare(errors_at(log, targets, source, trial_hz), reference, trial_hz));
  }
  return trials;
}

double best_predicting_cutoff(const std::vector<CutoffTrial>& trials, double cutoff_hz) {
  const auto best = std::ranges::max_element(trials, {}, &CutoffTrial::gain);
  if (best == trials.end() || !(best->gain > kSignificant * best->standard_error)) return cutoff_hz;
  const auto octaves = [&](const CutoffTrial& trial) {
    return std::abs(std::log2(trial.cutoff_hz / cutoff_hz));
  };
  double nearest_hz = best->cutoff_hz;
  double nearest = octaves(*best);
  for (const CutoffTrial& trial : trials) {
    if (trial.gain < best->gain - best->standard_error || octaves(trial) >= nearest) continue;
    nearest_hz = trial.cutoff_hz;
    nearest = octaves(trial);
  }
  return nearest_hz;
}

}  // namespace kinescope
