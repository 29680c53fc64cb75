// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/gaussian_process.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynamics/gp/posterior.h"
#include "dynamics/gp/process_group.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {

GpModel make_model(Kernel kernel, double noise_variance, Normalisation normalisation,
                   bool noise_per_output) {
  const int noises = noise_per_output ? kernel.outputs() : 1;
  GpModel out{std::move(kernel), {}, std::move(normalisation)};
  for (int k = 0; k < noises; ++k) {
    out.noise_variance.push_back(
        {.name = noises > 1 ? "noise variance " + std::to_string(k) : "noise variance",
         .value = noise_variance,
         .lower = 1e-8,
         .upper = 1e2});
  }
  return out;
}

bool keeps_kernel_matrix(const Kernel& kernel, Eigen::Index samples) {
  Problem sized;
  sized.samples = samples;
  return choose_route(kernel, sized, Route::kAuto) == Route::kDense;
}

FittedGp fit(const GpModel& model, const Dataset& dataset, const FitOptions& options) {
  Problem problem = make_problem(model, dataset);
  FittedGp out{model, Route::kDense, 0.0, 0.0, problem.samples, 0, nullptr};
  out.route = choose_route(model.kernel, problem, options.route);
  Workers workers(options.threads);
  const Eigen::VectorXd log_noise = log_noise_values(model);
  const auto dense = process_count() > 1 ? fit_distributed : fit_dense;
  Fit fitted = out.route == Route::kFeatures
                   ? fit_features(workers, model.kernel, log_noise, std::move(problem))
                   : dense(workers, model.kernel, log_noise, std::move(problem), options);
  out.posterior = std::move(fitted.posterior);
  out.log_likelihood = fitted.log_likelihood;
  out.jitter = fitted.jitter;
  out.features = fitted.features;
  return out;
}

namespace {

using Eigen::Index;

Eigen::RowVectorXd target_scale(const FittedGp& fitted) {
  const Eigen::RowVectorXd& scale = fitted.model.normalisation.target_scale;
  if (scale.size() > 0) return scale;
  return Eigen::RowVectorXd::Ones(fitted.model.kernel.outputs());
}

}  // namespace

Prediction predict(const FittedGp& fitted, const Inputs& inputs, const PredictOptions& options) {
  const GpModel& model = fitted.model;
  if (inputs.cols() < model.kernel.input_columns()) {
    throw bad_request("inputs", "too few columns", "give the columns of the training inputs");
  }
  Workers workers(options.threads);
  const Index outputs = model.kernel.outputs();
  const Moments moments = fitted.posterior->predict(
      workers, model.normalisation.normalised_inputs(inputs), options.variance);
  const Eigen::RowVectorXd scale = target_scale(fitted);
  Prediction out;
  out.mean = by_sample(moments.mean, outputs).array().rowwise() * scale.array();
  if (model.normalisation.target_shift.size() > 0) {
    out.mean.rowwise() += model.normalisation.target_shift;
  }
  if (options.variance) {
    out.variance = by_sample(moments.variance, outputs).array().rowwise() * scale.array().square();
  }
  out.noise_variance = scale.array().square();
  const Eigen::VectorXd log_noise = log_noise_values(model);
  for (Index o = 0; o < outputs; ++o) {
    out.noise_variance[o] *= std::exp(log_noise[o % log_noise.size()]);
  }
  return out;
}

Eigen::VectorXd kernel_weights(const FittedGp& fitted) {
  return fitted.posterior->kernel_weights();
}

struct Predictor::State {
  const Posterior* posterior = nullptr;
  std::shared_ptr<const Posterior> owner;
  Normalisation normalisation;
  Eigen::RowVectorXd scale;
  OneSample work;
  Eigen::VectorXd mean;
  Eigen::VectorXd variance;
};

Predictor::Predictor(const FittedGp& fitted) : state_(std::make_unique<State>()) {
  state_->owner = fitted.posterior;
  state_->posterior = fitted.posterior.get();
  state_->normalisation = fitted.model.normalisation;
  state_->scale = target_scale(fitted);
}

Predictor::~Predictor() = default;

const Eigen::VectorXd& Predictor::mean(const Eigen::Ref<const Eigen::VectorXd>& input) {
  const SingleThreadedBlas guard;
  State& state = *state_;
  const Normalisation& normalisation = state.normalisation;
  state.work.input.resize(1, input.size());
  state.work.input = input.transpose();
  if (normalisation.input_shift.size() > 0) {
    state.work.input.row(0) -= normalisation.input_shift;
    state.work.input.row(0).array() /= normalisation.input_scale.array();
  }
  state.posterior->mean_of_one(state.work);
  state.mean = state.work.mean.cwiseProduct(state.scale.transpose());
  if (normalisation.target_shift.size() > 0) {
    state.mean += normalisation.target_shift.transpose();
  }
  return state.mean;
}

const Eigen::VectorXd& Predictor::variance() {
  const SingleThreadedBlas guard;
  State& state = *state_;
  KINESCOPE_CHECK(state.mean.size() > 0, "ask for the mean first");
  state.posterior->variance_of_one(state.work);
  state.variance = state.work.variance.array() * state.scale.transpose().array().square();
  return state.variance;
}

}  // namespace kinescope::gp
