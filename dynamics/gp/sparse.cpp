// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/sparse.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "dynamics/gp/posterior.h"
#include "dynamics/gp/sparse_system.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

class SparsePosterior : public Posterior {
 public:
  SparsePosterior(SparseSystem system, Problem problem)
      : system_(std::move(system)), problem_(std::move(problem)) {}

  [[nodiscard]] Moments predict(Workers& workers, const Inputs& inputs,
                                bool variance) const override {
    const Prepared at = system_.covariance.prepare(inputs);
    Moments out;
    out.mean.resize(at.samples);
    if (variance) out.variance = system_.covariance.diagonal(workers, at);
    constexpr Index kChunk = 1024;
    workers.run((at.samples + kChunk - 1) / kChunk, [&](Index task, Scratch& scratch) {
      const Scratch::Frame frame(scratch);
      const Index begin = task * kChunk;
      const Index size = std::min(kChunk, at.samples - begin);
      Eigen::Map<Eigen::MatrixXd> phi = scratch.take(size, system_.count());
      system_.features(at, begin, scratch, phi);
      product(1.0, phi, system_.solution.weights, 0.0, out.mean.segment(begin, size));
      if (!variance) return;
      // k - q + phi' A^-1 phi.
      auto own = out.variance.segment(begin, size);
      own = (own - phi.rowwise().squaredNorm()).cwiseMax(0.0).eval();
      solve_lower_transposed_right(system_.solution.lower, phi);
      own += phi.rowwise().squaredNorm();
    });
    return out;
  }

  void mean_of_one(OneSample& work) const override {
    system_.covariance.prepare(work.input, work.prepared);
    work.cross.resize(1, system_.count());
    system_.features(work.prepared, 0, work.scratch, work.cross);
    work.mean.resize(1);
    work.mean[0] = work.cross.row(0).dot(system_.solution.weights);
  }

  void variance_of_one(OneSample& work) const override {
    work.prior.resize(1, 1);
    system_.covariance.tile({work.prepared, 0, 1}, {work.prepared, 0, 1}, work.scratch, work.prior);
    work.variance.resize(1);
    work.variance[0] = std::max(0.0, work.prior(0, 0) - work.cross.squaredNorm());
    solve_lower_transposed_right(system_.solution.lower, work.cross);
    work.variance[0] += work.cross.squaredNorm();
  }

  [[nodiscard]] LeftOut leave_out(Workers&, const std::vector<std::vector<Index>>&) const override {
    throw bad_request("leave_out", "not for inducing points",
                      "use fit() on a subset of the samples");
  }

  [[nodiscard]] Eigen::VectorXd kernel_weights() const override {
    Eigen::VectorXd out = system_.solution.weights;
    solve_lower_transposed(system_.factor, out);
    return out;
  }

  [[nodiscard]] Moments at_training(Workers& workers) const override {
    Moments out = predict(workers, problem_.inputs, true);
    out.mean = problem_.targets - out.mean;
    return out;
  }

 private:
  SparseSystem system_;
  Problem problem_;
};

void check_sparse(const GpModel& model, const Dataset& dataset, const Eigen::MatrixXd& inducing,
                  const FitOptions& options) {
  if (model.kernel.outputs() != 1) {
    throw bad_request("kernel", "several outputs", "inducing points are for one output");
  }
  if (inducing.rows() == 0 || inducing.cols() != dataset.inputs.cols()) {
    throw bad_request("inducing", fmt::format("{} x {}", inducing.rows(), inducing.cols()),
                      "give at least one, with the columns of the inputs");
  }
  // About eight matrices of m x m, and the inputs once more.
  check_memory(inducing.rows(), 1, 8.0, options.memory_limit_bytes);
}

// The first samples in the order of a seeded hash of their values.
std::vector<Index> candidates_of(const Eigen::MatrixXd& inputs, const InducingOptions& options) {
  std::vector<std::pair<std::uint64_t, Index>> hashed;
  Eigen::VectorXd row(inputs.cols() + 1);
  row[inputs.cols()] = static_cast<double>(options.seed);
  for (Index i = 0; i < inputs.rows(); ++i) {
    row.head(inputs.cols()) = inputs.row(i);
    const auto bytes = static_cast<std::size_t>(row.size()) * sizeof(double);
    hashed.emplace_back(stable_hash({reinterpret_cast<const char*>(row.data()), bytes}), i);
  }
  std::ranges::sort(hashed);
  std::vector<Index> out;
  for (const auto& [hash, index] : hashed) {
    if (static_cast<Index>(out.size()) == options.candidates) break;
    out.push_back(index);
  }
  return out;
}

}  // namespace

// Pivoted Cholesky: the pivot is the candidate whose variance, given the pivots before, is largest.
Eigen::MatrixXd choose_inducing(const GpModel& model, const Dataset& dataset,
                                const InducingOptions& options) {
  if (options.count < 1) throw bad_request("count", "not positive", "give at least 1");
  const Problem problem = make_problem(model, dataset);
  const std::vector<Index> indices = candidates_of(problem.inputs, options);
  const Covariance covariance(model.kernel);
  if (covariance.outputs() != 1) {
    throw bad_request("kernel", "several outputs", "inducing points are for one output");
  }
  Workers workers(1);
  const Prepared at = covariance.prepare(problem.inputs(indices, Eigen::all));
  Eigen::VectorXd left = covariance.diagonal(workers, at);
  const double floor = options.relative_tolerance * left.maxCoeff();
  const Index count = std::min<Index>(options.count, at.samples);
  Eigen::MatrixXd rows(at.samples, count);
  std::vector<Index> chosen;
  Eigen::MatrixXd column(at.samples, 1);
  for (Index k = 0; k < count; ++k) {
    Index pivot = 0;
    const double largest = left.maxCoeff(&pivot);
    if (!(largest > floor)) break;
    covariance.tile({at, 0, at.samples}, {at, pivot, 1}, workers.scratch(), column);
    if (k > 0) {
      const Eigen::VectorXd own = rows.row(pivot).head(k);
      product(-1.0, rows.leftCols(k), own, 1.0, column);
    }
    rows.col(k) = column / std::sqrt(largest);
    left = (left - rows.col(k).cwiseAbs2()).cwiseMax(0.0).eval();
    left[pivot] = 0.0;
    chosen.push_back(indices[static_cast<std::size_t>(pivot)]);
  }
  if (chosen.empty()) {
    throw undetermined("kernel", "zero at every sample", "give a kernel with some variance");
  }
  return dataset.inputs(chosen, Eigen::all);
}

FittedGp fit_sparse(const GpModel& model, const Dataset& dataset, const Eigen::MatrixXd& inducing,
                    const FitOptions& options) {
  check_sparse(model, dataset, inducing, options);
  Problem problem = make_problem(model, dataset);
  Workers workers(options.threads);
  auto system =
      make_sparse_system(workers, model.kernel, log_noise_values(model), problem,
                         model.normalisation.normalised_inputs(inducing), options.max_jitter);
  if (!system) {
    throw undetermined("inducing points", "their kernel matrix is not positive definite",
                       "choose fewer, or with choose_inducing()");
  }
  FittedGp out{model,           Route::kSparse,  system->bound, system->jitter,
               problem.samples, system->count(), nullptr};
  out.posterior = std::make_shared<SparsePosterior>(*std::move(system), std::move(problem));
  return out;
}

}  // namespace kinescope::gp
