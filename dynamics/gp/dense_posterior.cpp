// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "dynamics/gp/posterior.h"
#include "dynamics/gp/tiled_cholesky.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

class DensePosterior : public Posterior {
 public:
  DensePosterior(Covariance covariance, Prepared training, Eigen::VectorXd noise,
                 Eigen::MatrixXd factor, Eigen::VectorXd targets, Eigen::VectorXd alpha)
      : covariance_(std::move(covariance)),
        training_(std::move(training)),
        noise_(std::move(noise)),
        factor_(std::move(factor)),
        targets_(std::move(targets)),
        alpha_(std::move(alpha)) {}

  [[nodiscard]] Moments predict(Workers& workers, const Inputs& inputs,
                                bool variance) const override {
    const Index m = covariance_.outputs();
    const Prepared at = covariance_.prepare(inputs);
    Moments out;
    out.mean.resize(at.samples * m);
    if (variance) out.variance = covariance_.diagonal(workers, at);
    covariance_.cross_panels(workers, training_, at, {}, [&](Index begin, Index size, Block cross) {
      transposed_product(1.0, cross, alpha_, 0.0, out.mean.segment(begin * m, size * m));
      if (!variance) return;
      solve_lower(factor_, cross);
      auto own = out.variance.segment(begin * m, size * m);
      own = (own - cross.colwise().squaredNorm().transpose()).cwiseMax(0.0).eval();
    });
    return out;
  }

  void mean_of_one(OneSample& work) const override {
    gp::mean_of_one(covariance_, training_, alpha_, work);
  }

  void variance_of_one(OneSample& work) const override {
    const Index m = covariance_.outputs();
    work.prior.resize(m, m);
    covariance_.tile({work.prepared, 0, 1}, {work.prepared, 0, 1}, work.scratch, work.prior);
    solve_lower(factor_, work.cross);
    work.variance.resize(m);
    for (Index o = 0; o < m; ++o) {
      work.variance[o] = std::max(0.0, work.prior(o, o) - work.cross.col(o).squaredNorm());
    }
  }

  // With B = K^-1: y_b - E[y_b | others] = B_bb^-1 alpha_b, var = B_bb^-1 (Rasmussen and Williams
  // 2006, eq. 5.12, for blocks).
  [[nodiscard]] LeftOut leave_out(Workers& workers,
                                  const std::vector<std::vector<Index>>& folds) const override {
    const Index m = covariance_.outputs();
    const Eigen::MatrixXd inverse = inverse_factor(workers);
    LeftOut out{targets_, Eigen::VectorXd::Zero(targets_.size()), 0.0};
    std::vector<double> densities(folds.size());
    workers.run(static_cast<Index>(folds.size()), [&](Index fold, Scratch& scratch) {
      std::vector<Index> rows;
      for (const Index sample : folds[static_cast<std::size_t>(fold)]) {
        for (Index o = 0; o < m; ++o) rows.push_back(sample * m + o);
      }
      if (rows.empty()) return;
      const Scratch::Frame frame(scratch);
      const auto size = static_cast<Index>(rows.size());
      const Index first = *std::ranges::min_element(rows);
      Eigen::Map<Eigen::MatrixXd> columns = scratch.take(size, inverse.rows() - first);
      for (Index k = 0; k < size; ++k) {
        columns.row(k) = inverse.col(rows[static_cast<std::size_t>(k)]).tail(columns.cols());
      }
      Eigen::Map<Eigen::MatrixXd> block = scratch.take(size, size);
      add_square(1.0, columns, 0.0, block);
      KINESCOPE_CHECK(cholesky(block) == 0, "a block of an inverse is positive definite");
      Eigen::VectorXd residual = alpha_(rows);
      solve_lower(block, residual);
      // log det of the predictive covariance is minus that of B_bb.
      double log_density = block.diagonal().array().log().sum() - 0.5 * residual.squaredNorm();
      log_density -= 0.5 * static_cast<double>(size) * std::log(2.0 * std::numbers::pi);
      densities[static_cast<std::size_t>(fold)] = log_density;
      solve_lower_transposed(block, residual);
      block.triangularView<Eigen::StrictlyUpper>().setZero();
      invert_lower(block);
      for (Index k = 0; k < size; ++k) {
        const Index row = rows[static_cast<std::size_t>(k)];
        out.mean[row] = targets_[row] - residual[k];
        out.variance[row] = block.col(k).squaredNorm();
      }
    });
    for (const double density : densities) out.log_density += density;
    return out;
  }

  [[nodiscard]] Eigen::VectorXd kernel_weights() const override { return alpha_; }

  // y - f = noise * alpha, var = noise - noise^2 B_ii.
  [[nodiscard]] Moments at_training(Workers& workers) const override {
    const Eigen::MatrixXd inverse = inverse_factor(workers);
    const Eigen::VectorXd diagonal = inverse.colwise().squaredNorm();
    return {noise_.cwiseProduct(alpha_),
            (noise_.array() - noise_.array().square() * diagonal.array()).max(0.0)};
  }

 private:
  [[nodiscard]] Eigen::MatrixXd inverse_factor(Workers& workers) const {
    check_memory(training_.samples, covariance_.outputs(), 1.0, 0);
    Eigen::MatrixXd inverse = factor_;
    tiled_invert_lower(workers, inverse);
    return inverse;
  }

  Covariance covariance_;
  Prepared training_;
  Eigen::VectorXd noise_;
  Eigen::MatrixXd factor_;
  Eigen::VectorXd targets_;
  Eigen::VectorXd alpha_;
};

}  // namespace

void mean_of_one(const Covariance& covariance, const Prepared& training,
                 const Eigen::VectorXd& weights, OneSample& work) {
  const Index m = covariance.outputs();
  covariance.prepare(work.input, work.prepared);
  work.cross.resize(weights.size(), m);
  covariance.tile({training, 0, training.samples}, {work.prepared, 0, 1}, work.scratch, work.cross);
  work.mean.resize(m);
  transposed_product(1.0, work.cross, weights, 0.0, work.mean);
}

double with_jitter(const Covariance& covariance, Index samples, double max_jitter,
                   const std::function<Attempt(double)>& attempt) {
  double relative = 0.0;
  while (true) {
    const Attempt now = attempt(relative);
    if (now.failed == 0) return now.jitter;
    constexpr double kFirstJitter = 1e-14;
    relative = relative == 0.0 ? kFirstJitter : 10.0 * relative;
    if (relative > max_jitter) {
      throw undetermined(
          "kernel matrix",
          fmt::format("not positive definite at sample {} of {}, even with {:.1e} of its mean "
                      "diagonal added",
                      (now.failed - 1) / covariance.outputs(), samples, std::max(0.0, max_jitter)),
          "the same input twice without noise, or more samples than the kernel has features: raise "
          "the noise variance");
    }
  }
}

Fit fit_dense(Workers& workers, const Kernel& kernel, const Eigen::VectorXd& log_noise,
              Problem problem, const FitOptions& options) {
  check_memory(problem.samples, problem.outputs, 1.0, options.memory_limit_bytes);
  Covariance covariance(kernel);
  Prepared training = covariance.prepare(problem.inputs);
  const Eigen::VectorXd noise = noise_of_rows(problem, log_noise);
  // The one matrix of this size: kernel, then its factor.
  Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(noise.size(), noise.size());
  Fit out;
  out.jitter = with_jitter(covariance, problem.samples, options.max_jitter, [&](double relative) {
    covariance.lower(workers, training, factor);
    factor.diagonal() += noise;
    const double jitter = relative * factor.diagonal().mean();
    factor.diagonal().array() += jitter;
    return Attempt{jitter, tiled_cholesky(workers, factor)};
  });
  Eigen::VectorXd alpha = problem.targets;
  solve_lower(factor, alpha);
  out.log_likelihood = -0.5 * alpha.squaredNorm() - factor.diagonal().array().log().sum() -
                       0.5 * static_cast<double>(alpha.size()) * std::log(2.0 * std::numbers::pi);
  solve_lower_transposed(factor, alpha);
  const Eigen::VectorXd total_noise = noise.array() + out.jitter;
  out.posterior = std::make_shared<DensePosterior>(std::move(covariance), std::move(training),
                                                   total_noise, std::move(factor),
                                                   std::move(problem.targets), std::move(alpha));
  return out;
}

}  // namespace kinescope::gp
