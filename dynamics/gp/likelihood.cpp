// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/likelihood.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "dynamics/gp/feature_system.h"
#include "dynamics/gp/gram.h"
#include "dynamics/gp/tiled_cholesky.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

class DenseObjective : public Objective {
 public:
  DenseObjective(Kernel kernel, Problem problem, int threads, Score score)
      : kernel_(std::move(kernel)),
        problem_(std::move(problem)),
        workers_(threads),
        score_(score),
        prepared_(Covariance(kernel_).prepare(problem_.inputs)),
        matrix_(Eigen::MatrixXd::Zero(problem_.rows(), problem_.rows())) {}

  [[nodiscard]] std::optional<Likelihood> evaluate(const Eigen::VectorXd& log_values) override {
    const Index kernel_count = static_cast<Index>(kernel_.parameters().size());
    const Covariance covariance(kernel_.with_log_values(log_values.head(kernel_count)));
    const auto log_noise = log_values.tail(log_values.size() - kernel_count);
    covariance.rescale(prepared_);
    const Eigen::VectorXd noise = noise_of_rows(problem_, log_noise);
    covariance.lower(workers_, prepared_, matrix_);
    matrix_.diagonal() += noise;
    if (!matrix_.diagonal().allFinite() || tiled_cholesky(workers_, matrix_) != 0) {
      return std::nullopt;
    }
    Likelihood out;
    Eigen::VectorXd alpha = problem_.targets;
    solve_lower(matrix_, alpha);
    const double rows = static_cast<double>(alpha.size());
    out.value = -0.5 * alpha.squaredNorm() - matrix_.diagonal().array().log().sum() -
                0.5 * rows * std::log(2.0 * std::numbers::pi);
    solve_lower_transposed(matrix_, alpha);
    tiled_invert_lower(workers_, matrix_);
    const Eigen::VectorXd inverse_diagonal = matrix_.colwise().squaredNorm();
    out.gradient.resize(log_values.size());
    if (score_ == Score::kLeaveOneOut) {
      leave_one_out(covariance, noise, alpha, inverse_diagonal, out);
      return out;
    }
    // d L = 1/2 tr((alpha alpha' - K^-1) dK) (Rasmussen and Williams 2006, eq. 5.9).
    out.gradient.head(kernel_count) = covariance.contract_lower(
        workers_, prepared_, [&](Index row, Index col, Scratch&, Block q) {
          inverse_tile(row, col, -0.5, q);
          q.noalias() +=
              0.5 * alpha.segment(row, q.rows()) * alpha.segment(col, q.cols()).transpose();
        });
    out.gradient.tail(log_noise.size()) = noise_gradient(
        problem_, 0.5 * noise.array() * (alpha.array().square() - inverse_diagonal.array()).array(),
        log_noise.size());
    return out;
  }

 private:
  // scale * (K^-1)(row.., col..) from W = L^-1, for row >= col: rows of W above `row` are zero
  // there.
  void inverse_tile(Index row, Index col, double scale, const Block& out) const {
    const Index below = matrix_.rows() - row;
    transposed_product(scale, matrix_.block(row, row, below, out.rows()),
                       matrix_.block(row, col, below, out.cols()), 0.0, out);
  }

  // Sundararajan and Keerthi 2001. With B = K^-1, b_i = B_ii and e_i = alpha_i / b_i:
  // d score = e' B dK alpha - tr(B C B dK), C_ii = (1 + alpha_i e_i) / (2 b_i).
  void leave_one_out(const Covariance& covariance, const Eigen::VectorXd& noise,
                     const Eigen::VectorXd& alpha, const Eigen::VectorXd& b, Likelihood& out) {
    const Index n = alpha.size();
    const Eigen::VectorXd error = alpha.cwiseQuotient(b);
    out.value = 0.5 * b.array().log().sum() - 0.5 * alpha.dot(error) -
                0.5 * static_cast<double>(n) * std::log(2.0 * std::numbers::pi);
    // B as a full matrix, then B C^1/2.
    Eigen::MatrixXd full(n, n);
    transposed_product(1.0, matrix_, matrix_, 0.0, full);
    const Eigen::VectorXd left = full * error;
    const Eigen::VectorXd root = ((1.0 + alpha.array() * error.array()) / (2.0 * b.array())).sqrt();
    full = full * root.asDiagonal();
    const auto kernel_count = static_cast<Index>(kernel_.parameters().size());
    out.gradient.head(kernel_count) = covariance.contract_lower(
        workers_, prepared_, [&](Index row, Index col, Scratch&, Block q) {
          product_transposed(-1.0, full.middleRows(row, q.rows()), full.middleRows(col, q.cols()),
                             0.0, q);
          q.noalias() +=
              0.5 * left.segment(row, q.rows()) * alpha.segment(col, q.cols()).transpose();
          q.noalias() +=
              0.5 * alpha.segment(row, q.rows()) * left.segment(col, q.cols()).transpose();
        });
    const Eigen::VectorXd share =
        noise.array() * (left.array() * alpha.array() - full.rowwise().squaredNorm().array());
    const Index noises = out.gradient.size() - kernel_count;
    out.gradient.tail(noises) = noise_gradient(problem_, share, noises);
  }

  Kernel kernel_;
  Problem problem_;
  Workers workers_;
  Score score_;
  Prepared prepared_;
  Eigen::MatrixXd matrix_;
};

class FeatureObjective : public Objective {
 public:
  FeatureObjective(const Kernel& kernel, const Problem& problem, int threads) {
    Workers workers(threads);
    system_ = press(workers, kernel.node(), problem);
  }

  [[nodiscard]] std::optional<Likelihood> evaluate(const Eigen::VectorXd& log_values) override {
    const SingleThreadedBlas guard;
    const Index kernel_count = system_.exponents.cols();
    const Eigen::VectorXd log_noise = log_values.tail(log_values.size() - kernel_count);
    const FeatureSolution solution = solve(system_, log_values.head(kernel_count), log_noise);
    if (!std::isfinite(solution.log_likelihood)) return std::nullopt;
    return Likelihood{solution.log_likelihood, likelihood_gradient(system_, solution, log_noise)};
  }

 private:
  FeatureSystem system_;
};

}  // namespace

std::unique_ptr<Objective> make_objective(const GpModel& model, const Dataset& dataset,
                                          const FitOptions& options, Score score) {
  Problem problem = make_problem(model, dataset);
  if (score == Score::kLeaveOneOut) {
    KINESCOPE_CHECK(problem.outputs == 1, "leave-one-out is for one output");
    check_memory(problem.samples, problem.outputs, 2.0, options.memory_limit_bytes);
    return std::make_unique<DenseObjective>(model.kernel, std::move(problem), options.threads,
                                            score);
  }
  if (choose_route(model.kernel, problem, options.route) == Route::kFeatures) {
    return std::make_unique<FeatureObjective>(model.kernel, problem, options.threads);
  }
  check_memory(problem.samples, problem.outputs, 1.0, options.memory_limit_bytes);
  return std::make_unique<DenseObjective>(model.kernel, std::move(problem), options.threads, score);
}

std::vector<Parameter> parameters_of(const GpModel& model) {
  std::vector<Parameter> out = model.kernel.parameters();
  out.insert(out.end(), model.noise_variance.begin(), model.noise_variance.end());
  return out;
}

Eigen::VectorXd log_values_of(const GpModel& model) {
  const Eigen::VectorXd noise = log_noise_values(model);
  Eigen::VectorXd out(model.kernel.log_values().size() + noise.size());
  out << model.kernel.log_values(), noise;
  return out;
}

GpModel with_log_values(const GpModel& model, const Eigen::VectorXd& log_values) {
  const Index kernel_count = static_cast<Index>(model.kernel.parameters().size());
  GpModel out = model;
  out.kernel = model.kernel.with_log_values(log_values.head(kernel_count));
  for (std::size_t k = 0; k < out.noise_variance.size(); ++k) {
    out.noise_variance[k].value = std::exp(log_values[kernel_count + static_cast<Index>(k)]);
  }
  return out;
}

Likelihood log_marginal_likelihood(const GpModel& model, const Dataset& dataset,
                                   const FitOptions& options) {
  const auto objective = make_objective(model, dataset, options);
  std::optional<Likelihood> out = objective->evaluate(log_values_of(model));
  if (!out) {
    throw undetermined("kernel matrix", "not positive definite",
                       "raise the noise variance or leave out repeated inputs");
  }
  return *std::move(out);
}

}  // namespace kinescope::gp
