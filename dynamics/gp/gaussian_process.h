// SPDX-License-Identifier: Apache-2.0
//
// Takes   GpModel (kernel, noise, mean, normalisation) and Dataset (samples x columns).
// Gives   FittedGp; Prediction: mean and variance of the function, noise apart.
// Units   those of the dataset; kernel and noise work on normalised inputs and targets.
// Method  exact regression (Rasmussen and Williams 2006, algorithm 2.1) by Cholesky factor, or, for
//         kernels of few features, in the space of the features by QR: the same answers.
// Not here: hyperparameters.h, leave_out.h, robust.h; sparse.h for what does not fit in memory.
#pragma once

#include <cstddef>
#include <memory>

#include "dynamics/gp/dataset.h"
#include "dynamics/gp/kernel.h"

namespace kinescope::gp {

struct GpModel {
  Kernel kernel;
  /// Of normalised targets, squared units: one for all outputs, or one for each.
  std::vector<Parameter> noise_variance;
  Normalisation normalisation;
};

/// A model with common noise for its outputs (or its own for each) that starts at `noise_variance`.
[[nodiscard]] GpModel make_model(Kernel kernel, double noise_variance,
                                 Normalisation normalisation = {}, bool noise_per_output = false);

enum class Route {
  kAuto,      ///< features where there are clearly fewer of them than samples
  kDense,     ///< the kernel matrix: N^3 / 3
  kFeatures,  ///< N d^2
  kSparse,    ///< of fit_sparse() only
};

struct FitOptions {
  Route route = Route::kAuto;
  int threads = 0;  ///< 0: all of the machine. Never changes a result
  /// A kernel matrix without a Cholesky factor gets this much on its diagonal at most, relative to
  /// its mean diagonal. What was added is in the result. 0: none.
  double max_jitter = 1e-8;
  std::size_t memory_limit_bytes = 0;  ///< 0: what the machine has available
};

struct Prediction {
  Eigen::MatrixXd mean;               ///< samples x outputs, units of the targets
  Eigen::MatrixXd variance;           ///< of the function, without noise; empty where not asked for
  Eigen::RowVectorXd noise_variance;  ///< of a new measurement, to be added; one for each output
};

class Posterior;

struct FittedGp {
  GpModel model;
  Route route = Route::kDense;
  double log_likelihood = 0.0;  ///< of the normalised targets
  double jitter = 0.0;          ///< added to the diagonal, normalised units; 0 as a rule
  Eigen::Index samples = 0;
  Eigen::Index features = 0;  ///< of the route kFeatures; of kSparse: inducing points
  std::shared_ptr<const Posterior> posterior;
};

/// Throws bad_request for data that do not fit the model or into memory, undetermined where the
/// kernel matrix is singular beyond `max_jitter`.
[[nodiscard]] FittedGp fit(const GpModel& model, const Dataset& dataset,
                           const FitOptions& options = {});

/// Whether fit() of so many samples keeps their kernel matrix (Route::kDense), rows * 8 bytes a row
/// (memory.h): one of them, in which the factor is made.
[[nodiscard]] bool keeps_kernel_matrix(const Kernel& kernel, Eigen::Index samples);

struct PredictOptions {
  bool variance = true;
  int threads = 0;
};

/// The dataset's `prior_mean` is not known at new inputs: add it yourself.
[[nodiscard]] Prediction predict(const FittedGp& fitted, const Inputs& inputs,
                                 const PredictOptions& options = {});

/// Weights w of the normalised mean sum_i w_i k(x, x_i) of one output, over the training samples
/// or, of fit_sparse(), the inducing inputs.
[[nodiscard]] Eigen::VectorXd kernel_weights(const FittedGp& fitted);

/// One sample after another at control rate: no allocation after the first call. One for each
/// thread. Needs a model without mean function.
class Predictor {
 public:
  explicit Predictor(const FittedGp& fitted);
  ~Predictor();
  Predictor(const Predictor&) = delete;
  Predictor& operator=(const Predictor&) = delete;

  /// Mean of each output.
  [[nodiscard]] const Eigen::VectorXd& mean(const Eigen::Ref<const Eigen::VectorXd>& input);
  /// Variance of each output at the input of the last `mean`.
  [[nodiscard]] const Eigen::VectorXd& variance();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kinescope::gp
