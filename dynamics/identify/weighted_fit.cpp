// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/weighted_fit.h"

#include <algorithm>
#include <cmath>

#include "dynamics/gp/blas.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope::identify {
namespace {

constexpr double kHuber = 1.345;
constexpr double kTukey = 4.685;
constexpr double kStudentFreedom = 4.0;

/// Rows are scaled a stretch at a time, so that the copy stays in the cache.
constexpr Eigen::Index kStretch = 512;

/// psi(r) / r of the loss.
double robust_weight(double ratio, RobustLoss loss) {
  const double r = std::abs(ratio);
  switch (loss) {
    case RobustLoss::kNone:
      return 1.0;
    case RobustLoss::kHuber:
      return r <= kHuber ? 1.0 : kHuber / r;
    case RobustLoss::kTukey: {
      const double u = r / kTukey;
      return u >= 1.0 ? 0.0 : (1.0 - u * u) * (1.0 - u * u);
    }
    case RobustLoss::kStudent:
      return (kStudentFreedom + 1.0) / (kStudentFreedom + r * r);
  }
  return 1.0;
}

/// psi'(r).
double robust_curvature(double ratio, RobustLoss loss) {
  const double r = std::abs(ratio);
  switch (loss) {
    case RobustLoss::kNone:
      return 1.0;
    case RobustLoss::kHuber:
      return r <= kHuber ? 1.0 : 0.0;
    case RobustLoss::kTukey: {
      const double u = r / kTukey;
      return u >= 1.0 ? 0.0 : (1.0 - u * u) * (1.0 - 5.0 * u * u);
    }
    case RobustLoss::kStudent: {
      const double d = kStudentFreedom + r * r;
      return (kStudentFreedom + 1.0) * (kStudentFreedom - r * r) / (d * d);
    }
  }
  return 1.0;
}

/// Median of |x| over entries of positive weight, as a sigma.
double median_sigma(const Eigen::VectorXd& whitened, const Eigen::VectorXd& weights) {
  std::vector<double> sizes;
  sizes.reserve(static_cast<std::size_t>(whitened.size()));
  for (Eigen::Index t = 0; t < whitened.size(); ++t) {
    if (weights[t] > 0.0) sizes.push_back(std::abs(whitened[t]));
  }
  return kSigmaOverMedian * median_of(std::move(sizes));
}

class Fitter {
 public:
  Fitter(const StackedSystem& system, const WeightedFitOptions& options)
      : system_(system), options_(options) {
    const Eigen::Index joints = system.torque.cols();
    fit_.robust_weights = Eigen::MatrixXd::Ones(system.torque.rows(), joints);
    fit_.residuals = system.torque;
    fit_.sigma.resize(joints);
    size_.resize(joints);
    for (Eigen::Index j = 0; j < joints; ++j) {
      const double size = std::sqrt(weighted_mean_square(j));
      size_[j] = size > 0.0 ? size : 1.0;
    }
    fit_.sigma = size_;
  }

  void run(RobustLoss loss) {
    loss_ = loss;
    reweight();
    fit_.converged = false;
    // A median of residuals and its weights can chase each other; then the noise level stays.
    constexpr int kScaleSteps = 15;
    const int first = fit_.iterations;
    while (!fit_.converged && fit_.iterations < options_.max_iterations) {
      ++fit_.iterations;
      const Eigen::VectorXd sigma = fit_.sigma;
      const Eigen::MatrixXd residuals = fit_.residuals;
      solve();
      if (fit_.iterations - first <= kScaleSteps) find_sigma();
      fit_.converged = settled(sigma, residuals);
      reweight();
    }
  }

  [[nodiscard]] WeightedFit take() {
    solve();
    const Eigen::MatrixXd ratio = whitened() * fit_.sigma.cwiseInverse().asDiagonal();
    fit_.curvature = ratio.unaryExpr([&](double r) { return robust_curvature(r, loss_); });
    fit_.curvature = fit_.curvature.cwiseProduct(system_.weights) *
                     fit_.sigma.array().square().inverse().matrix().asDiagonal();
    return std::move(fit_);
  }

 private:
  [[nodiscard]] double weighted_mean_square(Eigen::Index j) const {
    const double total = system_.weights.col(j).sum();
    if (total == 0.0) return 0.0;
    return (system_.weights.col(j).array() * fit_.robust_weights.col(j).array() *
            fit_.residuals.col(j).array().square())
               .sum() /
           total;
  }

  [[nodiscard]] Eigen::MatrixXd whitened() const {
    return fit_.residuals.cwiseProduct(system_.weights.cwiseSqrt());
  }

  /// Predictions and noise levels move by less than this share of the noise, or by rounding.
  [[nodiscard]] bool settled(const Eigen::VectorXd& sigma, const Eigen::MatrixXd& residuals) const {
    constexpr double kShare = 1e-5;
    constexpr double kRounding = 1e-10;
    const auto rows = static_cast<double>(std::max<Eigen::Index>(1, residuals.rows()));
    for (Eigen::Index j = 0; j < sigma.size(); ++j) {
      const double allowed = std::max(kShare * sigma[j], kRounding * size_[j]);
      const double moved = (residuals.col(j) - fit_.residuals.col(j)).norm() / std::sqrt(rows);
      if (moved > allowed || std::abs(sigma[j] - fit_.sigma[j]) > allowed) return false;
    }
    return true;
  }

  /// Normal equations, and once more for what their rounding and the ridge left.
  void solve() {
    fit_.final_weights = system_.weights.cwiseProduct(fit_.robust_weights) *
                         fit_.sigma.array().square().inverse().matrix().asDiagonal();
    const Eigen::Index rows = system_.torque.rows();
    const ScaledSolver solver(gram(system_, fit_.final_weights, 0, rows), options_.ridge);
    fit_.parameters =
        options_.prior.size() > 0 ? options_.prior : Eigen::VectorXd::Zero(system_.parameters);
    for (int pass = 0; pass < 2; ++pass) {
      find_residuals();
      fit_.parameters +=
          solver.solve(gradient(system_, fit_.final_weights.cwiseProduct(fit_.residuals), 0, rows));
    }
    find_residuals();
  }

  void find_residuals() {
    fit_.residuals = system_.torque;
    for (std::size_t j = 0; j < system_.joints.size(); ++j) {
      fit_.residuals.col(static_cast<Eigen::Index>(j)) -= system_.joints[j].times(fit_.parameters);
    }
  }

  void find_sigma() {
    const Eigen::MatrixXd white = whitened();
    const auto joints = static_cast<double>(system_.torque.cols());
    const double spent = static_cast<double>(system_.parameters) / joints;
    const bool median = loss_ == RobustLoss::kHuber || loss_ == RobustLoss::kTukey;
    for (Eigen::Index j = 0; j < system_.torque.cols(); ++j) {
      const auto used = static_cast<double>((system_.weights.col(j).array() > 0.0).count());
      const double freedom = used > spent ? used / (used - spent) : 1.0;
      const double sigma = median ? median_sigma(white.col(j), system_.weights.col(j))
                                  : std::sqrt(weighted_mean_square(j) * freedom);
      constexpr double kSmallest = 1e-12;
      fit_.sigma[j] = std::max(sigma, kSmallest * size_[j]);
    }
  }

  void reweight() {
    const Eigen::MatrixXd ratio = whitened() * fit_.sigma.cwiseInverse().asDiagonal();
    fit_.robust_weights = ratio.unaryExpr([&](double r) { return robust_weight(r, loss_); });
  }

  const StackedSystem& system_;
  const WeightedFitOptions& options_;
  RobustLoss loss_ = RobustLoss::kNone;
  WeightedFit fit_;
  Eigen::VectorXd size_;  ///< rms torque of each joint
};

}  // namespace

JointColumns compact_columns(const Eigen::MatrixXd& all) {
  JointColumns out;
  for (Eigen::Index c = 0; c < all.cols(); ++c) {
    if (!all.col(c).isZero(0.0)) out.parameters.push_back(static_cast<int>(c));
  }
  out.W = all(Eigen::all, out.parameters);
  return out;
}

Eigen::MatrixXd gram(const StackedSystem& system, const Eigen::MatrixXd& weights,
                     Eigen::Index first, Eigen::Index rows) {
  const SingleThreadedBlas guard;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(system.parameters, system.parameters);
  for (std::size_t j = 0; j < system.joints.size(); ++j) {
    const JointColumns& joint = system.joints[j];
    const Eigen::Index p = joint.W.cols();
    Eigen::MatrixXd own = Eigen::MatrixXd::Zero(p, p);
    Eigen::MatrixXd scaled;
    for (Eigen::Index at = first; at < first + rows; at += kStretch) {
      const Eigen::Index count = std::min(kStretch, first + rows - at);
      scaled = weights.col(static_cast<Eigen::Index>(j)).segment(at, count).asDiagonal() *
               joint.W.middleRows(at, count);
      gp::transposed_product(1.0, scaled, joint.W.middleRows(at, count), 1.0, own);
    }
    H(joint.parameters, joint.parameters) += 0.5 * (own + own.transpose());
  }
  return H;
}

Eigen::VectorXd gradient(const StackedSystem& system, const Eigen::MatrixXd& values,
                         Eigen::Index first, Eigen::Index rows) {
  Eigen::VectorXd g = Eigen::VectorXd::Zero(system.parameters);
  for (std::size_t j = 0; j < system.joints.size(); ++j) {
    const JointColumns& joint = system.joints[j];
    g(joint.parameters) += joint.W.middleRows(first, rows).transpose() *
                           values.col(static_cast<Eigen::Index>(j)).segment(first, rows);
  }
  return g;
}

ScaledSolver::ScaledSolver(const Eigen::MatrixXd& H, double ridge) {
  const Eigen::VectorXd diagonal = H.diagonal();
  inverse_length_ = (diagonal.array() > 0.0).select(diagonal.cwiseSqrt().cwiseInverse(), 1.0);
  Eigen::MatrixXd scaled = inverse_length_.asDiagonal() * H * inverse_length_.asDiagonal();
  scaled.diagonal().array() += ridge;
  factor_ = LdltFactor(scaled);
}

Eigen::MatrixXd ScaledSolver::solve(const Eigen::MatrixXd& g) const {
  const Eigen::MatrixXd x = factor_.solve(Eigen::MatrixXd(inverse_length_.asDiagonal() * g));
  return inverse_length_.asDiagonal() * x;
}

WeightedFit weighted_fit(const StackedSystem& system, const WeightedFitOptions& options) {
  KINESCOPE_CHECK(static_cast<Eigen::Index>(system.joints.size()) == system.torque.cols() &&
                      system.weights.rows() == system.torque.rows() &&
                      system.weights.cols() == system.torque.cols(),
                  "one set of columns a joint, one weight a torque");
  Fitter fitter(system, options);
  fitter.run(RobustLoss::kNone);
  if (options.loss != RobustLoss::kNone) {
    fitter.run(options.loss == RobustLoss::kTukey ? RobustLoss::kHuber : options.loss);
  }
  if (options.loss == RobustLoss::kTukey) fitter.run(RobustLoss::kTukey);
  return fitter.take();
}

}  // namespace kinescope::identify
