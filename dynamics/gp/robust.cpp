// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/robust.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dynamics/gp/leave_out.h"
#include "dynamics/gp/posterior.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

// E-step: weight = (nu + 1) / (nu + E[(y - f)^2] / sigma^2). M-step: sigma^2 = mean of
// weight * E[(y - f)^2], with one sigma for each noise parameter.
Eigen::MatrixXd reweigh(const FittedGp& fitted, Workers& workers, double nu,
                        Eigen::VectorXd& log_noise, bool estimate_scale) {
  const Moments moments = fitted.posterior->at_training(workers);
  const Eigen::VectorXd square = moments.mean.array().square() + moments.variance.array();
  const Index outputs = fitted.model.kernel.outputs();
  Eigen::VectorXd weight(square.size());
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(log_noise.size());
  Eigen::VectorXd count = Eigen::VectorXd::Zero(log_noise.size());
  for (Index i = 0; i < square.size(); ++i) {
    const Index parameter = i % log_noise.size();
    weight[i] = (nu + 1.0) / (nu + square[i] * std::exp(-log_noise[parameter]));
    sum[parameter] += weight[i] * square[i];
    count[parameter] += 1.0;
  }
  if (estimate_scale) log_noise = (sum.array() / count.array()).log();
  return Eigen::Map<const Eigen::MatrixXd>(weight.data(), outputs, weight.size() / outputs)
      .transpose();
}

}  // namespace

RobustFit fit_student(const GpModel& model, const Dataset& dataset, const StudentOptions& options) {
  if (!(options.degrees_of_freedom > 0.0)) {
    throw bad_request("degrees_of_freedom", "not positive", "give 3 to 10 as a rule");
  }
  Workers workers(options.fit.threads);
  Eigen::VectorXd log_noise = log_noise_values(model);
  GpModel current = model;
  Dataset weighted = dataset;
  const Eigen::MatrixXd own =
      dataset.noise_scale.size() > 0
          ? dataset.noise_scale
          : Eigen::MatrixXd::Ones(dataset.samples(), dataset.targets.cols());
  RobustFit out{fit(current, dataset, options.fit), Eigen::MatrixXd::Ones(own.rows(), own.cols()),
                0, false};
  while (out.iterations < options.max_iterations && !out.converged) {
    ++out.iterations;
    const Eigen::MatrixXd weight =
        reweigh(out.fitted, workers, options.degrees_of_freedom, log_noise, options.estimate_scale);
    const double change = (weight - out.weight).cwiseAbs().maxCoeff();
    out.converged = change < options.tolerance;
    out.weight = weight;
    for (std::size_t k = 0; k < current.noise_variance.size(); ++k) {
      current.noise_variance[k].value = std::exp(log_noise[static_cast<Index>(k)]);
    }
    weighted.noise_scale = own.cwiseQuotient(out.weight);
    out.fitted = fit(current, weighted, options.fit);
  }
  return out;
}

Kernel widened(const Kernel& kernel, double factor) {
  std::vector<Parameter> parameters = kernel.parameters();
  for (Parameter& parameter : parameters) {
    if (parameter.name.find("length scale") != std::string::npos) parameter.value *= factor;
  }
  return kernel.with_parameters(std::move(parameters));
}

TrimmedFit fit_trimmed(const GpModel& model, const Dataset& dataset, const TrimOptions& options) {
  if (!(options.share >= 0.0 && options.share < 1.0)) {
    throw bad_request("share", "not between 0 and 1", "give the share of samples to leave out");
  }
  GpModel wide = model;
  wide.kernel = widened(model.kernel, options.widen);
  const FittedGp first = fit(wide, dataset, options.fit);
  const LeaveOut left = leave_one_out(first, dataset, options.fit.threads);
  const Eigen::VectorXd misfit = left.z.cwiseAbs().rowwise().maxCoeff();
  std::vector<Index> order(static_cast<std::size_t>(dataset.samples()));
  std::iota(order.begin(), order.end(), Index{0});
  std::ranges::stable_sort(order, [&](Index a, Index b) { return misfit[a] > misfit[b]; });
  const auto count = static_cast<std::ptrdiff_t>(
      std::floor(options.share * static_cast<double>(dataset.samples())));
  std::vector<Index> removed(order.begin(), order.begin() + count);
  std::vector<Index> kept(order.begin() + count, order.end());
  std::ranges::sort(removed);
  std::ranges::sort(kept);
  return {fit(model, subset(dataset, kept), options.fit), std::move(removed)};
}

}  // namespace kinescope::gp
