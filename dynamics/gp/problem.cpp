// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/problem.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "dynamics/gp/kernel_node.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

void check_finite(const Eigen::MatrixXd& matrix, const char* name) {
  if (matrix.allFinite()) return;
  for (Index i = 0; i < matrix.rows(); ++i) {
    for (Index j = 0; j < matrix.cols(); ++j) {
      if (std::isfinite(matrix(i, j))) continue;
      throw bad_request(fmt::format("{} row {} column {}", name, i, j),
                        fmt::format("the value is {}", matrix(i, j)),
                        "leave the sample out or repair it");
    }
  }
}

void check_shape(const Eigen::MatrixXd& matrix, const char* name, Index rows, Index cols) {
  if (matrix.rows() == rows && matrix.cols() == cols) return;
  throw bad_request(
      name, fmt::format("{} x {} instead of {} x {}", matrix.rows(), matrix.cols(), rows, cols),
      "give one row for each sample and one column for each output");
}

void check(const GpModel& model, const Dataset& dataset) {
  const Index samples = dataset.samples();
  const Index outputs = model.kernel.outputs();
  if (samples == 0) throw bad_request("dataset", "no samples", "give at least one");
  if (dataset.inputs.cols() < model.kernel.input_columns()) {
    throw bad_request("inputs",
                      fmt::format("{} columns, but the kernel reads {}", dataset.inputs.cols(),
                                  model.kernel.input_columns()),
                      "give the columns that the kernel was made for");
  }
  check_shape(dataset.targets, "targets", samples, outputs);
  check_finite(dataset.inputs, "inputs");
  check_finite(dataset.targets, "targets");
  if (dataset.prior_mean.size() > 0) {
    check_shape(dataset.prior_mean, "prior_mean", samples, outputs);
    check_finite(dataset.prior_mean, "prior_mean");
  }
  if (dataset.noise_scale.size() > 0) {
    check_shape(dataset.noise_scale, "noise_scale", samples, outputs);
    check_finite(dataset.noise_scale, "noise_scale");
    if (!(dataset.noise_scale.minCoeff() > 0.0)) {
      throw bad_request("noise_scale", "a value that is not positive", "give variances above 0");
    }
  }
  const auto noises = static_cast<Index>(model.noise_variance.size());
  if (noises != 1 && noises != outputs) {
    throw bad_request("noise_variance", fmt::format("{} values for {} outputs", noises, outputs),
                      "give one for all or one for each");
  }
}

Eigen::VectorXd sample_major(const Eigen::MatrixXd& matrix) {
  const Eigen::MatrixXd turned = matrix.transpose();
  return Eigen::Map<const Eigen::VectorXd>(turned.data(), turned.size());
}

}  // namespace

Problem make_problem(const GpModel& model, const Dataset& dataset) {
  check(model, dataset);
  Problem out;
  out.samples = dataset.samples();
  out.outputs = model.kernel.outputs();
  out.inputs = model.normalisation.normalised_inputs(dataset.inputs);
  Eigen::MatrixXd targets = dataset.targets;
  if (dataset.prior_mean.size() > 0) targets -= dataset.prior_mean;
  const Normalisation& normalisation = model.normalisation;
  if (normalisation.target_shift.size() > 0) {
    targets = ((targets.rowwise() - normalisation.target_shift).array().rowwise() /
               normalisation.target_scale.array())
                  .eval();
  }
  out.targets = sample_major(targets);
  out.noise_scale = dataset.noise_scale.size() > 0
                        ? sample_major(dataset.noise_scale)
                        : Eigen::VectorXd(Eigen::VectorXd::Ones(out.rows()));
  return out;
}

Eigen::VectorXd log_noise_values(const GpModel& model) {
  Eigen::VectorXd out(static_cast<Index>(model.noise_variance.size()));
  for (Index k = 0; k < out.size(); ++k) {
    out[k] = std::log(model.noise_variance[static_cast<std::size_t>(k)].value);
  }
  return out;
}

Eigen::VectorXd noise_of_rows(const Problem& problem,
                              const Eigen::Ref<const Eigen::VectorXd>& log_noise) {
  Eigen::VectorXd out = problem.noise_scale;
  for (Index i = 0; i < out.size(); ++i) out[i] *= std::exp(log_noise[i % log_noise.size()]);
  return out;
}

// Row i is of output i % outputs; with one parameter for all, i % 1 is 0.
Eigen::VectorXd noise_gradient(const Problem&, const Eigen::Ref<const Eigen::VectorXd>& row_share,
                               Index noise_parameters) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(noise_parameters);
  for (Index i = 0; i < row_share.size(); ++i) out[i % noise_parameters] += row_share[i];
  return out;
}

Route choose_route(const Kernel& kernel, const Problem& problem, Route wanted) {
  const std::optional<double> features = kernel.node().feature_count();
  if (wanted == Route::kSparse) {
    throw bad_request("route", "inducing points have a function of their own", "call fit_sparse()");
  }
  if (wanted == Route::kFeatures && !features) {
    throw bad_request("route", "the kernel has infinitely many features", "use the dense route");
  }
  if (wanted != Route::kAuto) return wanted;
  // A QR of d features costs about 4 d^3 and 2 N d^2, the dense route N^3 / 3 and N^3 more for a
  // gradient.
  constexpr double kClearlyFewer = 0.5;
  const bool few = features && *features <= kClearlyFewer * static_cast<double>(problem.samples);
  return few ? Route::kFeatures : Route::kDense;
}

void check_memory(Index samples, Index outputs, double matrices, std::size_t limit_bytes) {
  const auto shortage = memory_shortage(samples, outputs, matrices, limit_bytes);
  if (!shortage) return;
  throw bad_request(
      "kernel matrix",
      fmt::format("N = {}{} needs {:.1f} GB, {:.1f} GB are available", samples,
                  outputs > 1 ? fmt::format(" x {} outputs", outputs) : "", shortage->needed_gb,
                  shortage->available_gb),
      outputs > 1 ? fmt::format("use a subset of at most {} samples", shortage->fitting_samples)
                  : fmt::format("use fit_sparse with at most {} inducing points, or a subset of "
                                "at most {} samples",
                                shortage->fitting_inducing, shortage->fitting_samples));
}

}  // namespace kinescope::gp
