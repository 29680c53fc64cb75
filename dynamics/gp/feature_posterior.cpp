// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "dynamics/gp/posterior.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

constexpr Index kPredictionChunk = 1024;

struct Given {
  std::shared_ptr<const KernelNode> node;
  Eigen::VectorXd theta;
  Eigen::VectorXd log_noise;
  Problem problem;
};

class FeaturePosterior : public Posterior {
 public:
  FeaturePosterior(Given given, FeatureSolution solution)
      : given_(std::move(given)), solution_(std::move(solution)) {}

  [[nodiscard]] Moments predict(Workers& workers, const Inputs& inputs,
                                bool variance) const override {
    return moments(workers, inputs, variance, solution_);
  }

  void mean_of_one(OneSample& work) const override {
    work.cross = scaled_features(work.input, solution_);
    work.mean.resize(work.cross.rows());
    product(1.0, work.cross, solution_.weights, 0.0, work.mean);
  }

  void variance_of_one(OneSample& work) const override {
    solve_lower_transposed_right(solution_.lower, work.cross);
    work.variance = work.cross.rowwise().squaredNorm();
  }

  // K w + noise w = y: what the mean leaves of the targets, over the noise.
  [[nodiscard]] Eigen::VectorXd kernel_weights() const override {
    Workers workers(1);
    const Problem& problem = given_.problem;
    const Eigen::VectorXd mean = moments(workers, problem.inputs, false, solution_).mean;
    return (problem.targets - mean).cwiseQuotient(noise_of_rows(problem, given_.log_noise));
  }

  [[nodiscard]] LeftOut leave_out(Workers& workers,
                                  const std::vector<std::vector<Index>>& folds) const override {
    const Problem& problem = given_.problem;
    LeftOut out{problem.targets, Eigen::VectorXd::Zero(problem.rows()), 0.0};
    std::size_t largest = 0;
    for (const auto& fold : folds) largest = std::max(largest, fold.size());
    const bool small = static_cast<Index>(largest) * problem.outputs <= solution_.weights.size();
    // Large folds: each is pressed, and the rest of them are put together without it.
    std::vector<FeatureSystem> parts;
    if (!small) {
      for (const auto& fold : folds) {
        parts.push_back(press(workers, *given_.node, problem, fold));
      }
      const FeatureSystem unused = unused_samples(workers, folds);
      for (std::size_t f = 0; f < folds.size(); ++f) {
        std::vector<const FeatureSystem*> rest;
        for (std::size_t g = 0; g < folds.size(); ++g) {
          if (g != f) rest.push_back(&parts[g]);
        }
        if (!unused.outputs.empty()) rest.push_back(&unused);
        FeatureSolution without = rest.empty() ? prior() : solve_of(press_together(rest));
        fill_large(workers, folds[f], without, out);
      }
      return out;
    }
    for (const auto& fold : folds) fill_small(fold, out);
    return out;
  }

  [[nodiscard]] Moments at_training(Workers& workers) const override {
    Moments out = moments(workers, given_.problem.inputs, true, solution_);
    out.mean = given_.problem.targets - out.mean;
    return out;
  }

 private:
  // (outputs * samples, sample-major) x features.
  [[nodiscard]] Eigen::MatrixXd scaled_features(const Inputs& inputs,
                                                const FeatureSolution& solution) const {
    const Basis basis = given_.node->basis(inputs);
    const Index m = given_.problem.outputs;
    Eigen::MatrixXd out(basis.values.rows(), basis.values.cols());
    for (Index f = 0; f < out.cols(); ++f) {
      for (Index o = 0; o < m; ++o) {
        for (Index i = 0; i < inputs.rows(); ++i) {
          out(i * m + o, f) = basis.values(o * inputs.rows() + i, f) * solution.root_scale[f];
        }
      }
    }
    return out;
  }

  [[nodiscard]] Moments moments(Workers& workers, const Inputs& inputs, bool variance,
                                const FeatureSolution& solution) const {
    const Index m = given_.problem.outputs;
    Moments out;
    out.mean.resize(inputs.rows() * m);
    if (variance) out.variance.resize(inputs.rows() * m);
    workers.run((inputs.rows() + kPredictionChunk - 1) / kPredictionChunk,
                [&](Index task, Scratch&) {
                  const Index begin = task * kPredictionChunk;
                  const Index size = std::min(kPredictionChunk, inputs.rows() - begin);
                  Eigen::MatrixXd rows = scaled_features(inputs.middleRows(begin, size), solution);
                  product(1.0, rows, solution.weights, 0.0, out.mean.segment(begin * m, size * m));
                  if (!variance) return;
                  solve_lower_transposed_right(solution.lower, rows);
                  out.variance.segment(begin * m, size * m) = rows.rowwise().squaredNorm();
                });
    return out;
  }

  [[nodiscard]] FeatureSolution solve_of(const FeatureSystem& system) const {
    return solve(system, given_.theta, given_.log_noise);
  }

  // Nothing seen.
  [[nodiscard]] FeatureSolution prior() const {
    FeatureSolution out;
    const Index d = solution_.weights.size();
    out.root_scale = solution_.root_scale;
    out.lower = Eigen::MatrixXd::Identity(d, d);
    out.weights = Eigen::VectorXd::Zero(d);
    return out;
  }

  // Samples that no fold leaves out are in every fit.
  [[nodiscard]] FeatureSystem unused_samples(Workers& workers,
                                             const std::vector<std::vector<Index>>& folds) const {
    std::vector<bool> used(static_cast<std::size_t>(given_.problem.samples), false);
    for (const auto& fold : folds) {
      for (const Index sample : fold) used[static_cast<std::size_t>(sample)] = true;
    }
    std::vector<Index> rest;
    for (Index i = 0; i < given_.problem.samples; ++i) {
      if (!used[static_cast<std::size_t>(i)]) rest.push_back(i);
    }
    return rest.empty() ? FeatureSystem{} : press(workers, *given_.node, given_.problem, rest);
  }

  [[nodiscard]] std::vector<Index> rows_of(const std::vector<Index>& samples) const {
    std::vector<Index> rows;
    for (const Index sample : samples) {
      for (Index o = 0; o < given_.problem.outputs; ++o) {
        rows.push_back(sample * given_.problem.outputs + o);
      }
    }
    return rows;
  }

  void fill_large(Workers& workers, const std::vector<Index>& fold, const FeatureSolution& without,
                  LeftOut& out) const {
    const Eigen::MatrixXd inputs = given_.problem.inputs(fold, Eigen::all);
    const Moments moments_without = moments(workers, inputs, true, without);
    const Eigen::VectorXd noise = noise_of_rows(given_.problem, given_.log_noise);
    const std::vector<Index> rows = rows_of(fold);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const auto at = static_cast<Index>(k);
      out.mean[rows[k]] = moments_without.mean[at];
      out.variance[rows[k]] = moments_without.variance[at] + noise[rows[k]];
    }
    // Joint density of the fold by conditioning: log p(all) - log p(the others).
    out.log_density += log_likelihood_of_all() - without.log_likelihood;
  }

  [[nodiscard]] double log_likelihood_of_all() const { return solution_.log_likelihood; }

  // Within a fold, K^-1 restricted to it is N^-1 - N^-1 F A^-1 F' N^-1 with features F.
  void fill_small(const std::vector<Index>& fold, LeftOut& out) const {
    const std::vector<Index> rows = rows_of(fold);
    const auto size = static_cast<Index>(rows.size());
    if (size == 0) return;
    const Eigen::MatrixXd inputs = given_.problem.inputs(fold, Eigen::all);
    const Eigen::VectorXd noise = noise_of_rows(given_.problem, given_.log_noise)(rows);
    Eigen::MatrixXd features = scaled_features(inputs, solution_);
    Eigen::VectorXd alpha = given_.problem.targets(rows);
    product(-1.0, features, solution_.weights, 1.0, alpha);
    solve_lower_transposed_right(solution_.lower, features);
    // In whitened rows I - H, H the leverages.
    const Eigen::VectorXd deviation = noise.cwiseSqrt();
    features = deviation.cwiseInverse().asDiagonal() * features;
    alpha = alpha.cwiseQuotient(deviation);
    Eigen::MatrixXd block = Eigen::MatrixXd::Identity(size, size);
    add_square(-1.0, features, 1.0, block);
    KINESCOPE_CHECK(cholesky(block) == 0, "a block of an inverse is positive definite");
    block.triangularView<Eigen::StrictlyUpper>().setZero();
    solve_lower(block, alpha);
    out.log_density += block.diagonal().array().log().sum() - 0.5 * alpha.squaredNorm() -
                       deviation.array().log().sum() -
                       0.5 * static_cast<double>(size) * std::log(2.0 * std::numbers::pi);
    solve_lower_transposed(block, alpha);
    invert_lower(block);
    for (Index k = 0; k < size; ++k) {
      const Index row = rows[static_cast<std::size_t>(k)];
      out.mean[row] = given_.problem.targets[row] - deviation[k] * alpha[k];
      out.variance[row] = noise[k] * block.col(k).squaredNorm();
    }
  }

  Given given_;
  FeatureSolution solution_;
};

}  // namespace

Fit fit_features(Workers& workers, const Kernel& kernel, const Eigen::VectorXd& log_noise,
                 Problem problem) {
  const FeatureSystem system = press(workers, kernel.node(), problem);
  FeatureSolution solution = solve(system, kernel.log_values(), log_noise);
  Fit out;
  out.log_likelihood = solution.log_likelihood;
  out.features = system.features();
  out.posterior = std::make_shared<FeaturePosterior>(
      Given{kernel.shared_node(), kernel.log_values(), log_noise, std::move(problem)},
      std::move(solution));
  return out;
}

}  // namespace kinescope::gp
