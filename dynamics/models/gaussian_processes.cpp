// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/gaussian_processes.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "dynamics/gp/hyperparameters.h"
#include "dynamics/gp/lip_kernel.h"
#include "dynamics/gp/robot_kernels.h"
#include "dynamics/gp/sparse.h"
#include "dynamics/identify/model_features.h"

namespace kinescope::models {
namespace {

using Matrix = Eigen::MatrixXd;

// Of normalised torques, to begin with.
constexpr double kNoiseStart = 1e-3;
// Predictions that bands are read from: neighbours in time say the same.
constexpr Eigen::Index kBandRows = 3000;
// Processes of the folds are kept for their sigma up to here; five of seven joints and 1500 samples
// take 0.4 GB.
constexpr double kMostFoldBytes = 1e9;

gp::JointKinds kinds_of(const RigidModel& rigid) {
  gp::JointKinds kinds;
  for (const RigidBody& body : rigid.bodies) {
    kinds.push_back(body.type == JointType::kPrismatic ? gp::JointKind::kPrismatic
                                                       : gp::JointKind::kRevolute);
  }
  return kinds;
}

gp::Kernel kernel_of_joint(TorqueModelKind kind, const DynamicModel& model,
                           const gp::JointKinds& joints, const TorqueSamples& samples, int joint,
                           const DriveTerms& drives) {
  const int n = static_cast<int>(joints.size());
  if (kind == TorqueModelKind::kRbf) return gp::rbf(gp::first_columns(3 * n));
  if (kind == TorqueModelKind::kGip) {
    return gp::gip(joints, motion_inputs(samples.q, samples.dq, samples.ddq)) +
           gp::joint_friction(n, joint, drives.coulomb_width_rad_s);
  }
  const ModelFeatures features = model_features(model, samples, joint, drives);
  if (kind == TorqueModelKind::kModelBased) {
    return gp::feature_kernel(features.map, features.prior);
  }
  return gp::semi_parametric(features.map, features.prior, gp::first_columns(3 * n));
}

// One scale for all torques and no shift: a Lagrangian ties them to each other as they are.
gp::Normalisation common_scale(const gp::Dataset& data) {
  gp::Normalisation out;
  const double square = data.targets.squaredNorm() / static_cast<double>(data.targets.size());
  out.target_shift = Eigen::RowVectorXd::Zero(data.targets.cols());
  out.target_scale =
      Eigen::RowVectorXd::Constant(data.targets.cols(), square > 0.0 ? std::sqrt(square) : 1.0);
  return out;
}

// One process of all joints or one a joint, in their order.
using Processes = std::vector<gp::FittedGp>;

// The hyperparameters on part of the samples, then the fit on all of them. `known`: a fit of the
// same kernel on other samples; the search starts there and stays in its mode.
gp::FittedGp fit_gp(const gp::Kernel& kernel, const gp::Dataset& data, bool physical_inputs,
                    bool sparse, const TorqueModelOptions& options, const gp::FittedGp* known) {
  const gp::Normalisation normalisation = data.targets.cols() > 1 ? common_scale(data)
                                          : physical_inputs       ? gp::standardise_targets(data)
                                                                  : gp::standardise(data);
  const bool several = data.targets.cols() > 1;
  gp::GpModel start = gp::make_model(kernel, kNoiseStart, normalisation, several);
  if (known != nullptr) start = gp::with_log_values(start, gp::log_values_of(known->model));
  const auto few = evenly_chosen(data.samples(), options.hyperparameter_samples);
  gp::EstimateOptions estimate;
  estimate.starts = known != nullptr ? 1 : options.starts;
  // On fewer ones than that a kernel of many features takes noise for function.
  estimate.samples_for_starts = std::ssize(few);
  estimate.seed = options.seed;
  estimate.fit.threads = options.threads;
  const gp::Estimate found = gp::estimate_hyperparameters(start, gp::subset(data, few), estimate);
  gp::FitOptions fit;
  fit.threads = options.threads;
  fit.memory_limit_bytes = options.memory_limit_bytes;
  if (!sparse) return gp::fit(found.model, data, fit);
  const Matrix inducing = gp::choose_inducing(
      found.model, data, {.count = options.inducing_points, .seed = options.seed});
  return gp::fit_sparse(found.model, data, inducing, fit);
}

TorquePrediction prediction_of(const Processes& fits, const Matrix& inputs, Eigen::Index joints,
                               int threads) {
  TorquePrediction out;
  out.mean.resize(inputs.rows(), joints);
  out.model_sigma.resize(inputs.rows(), joints);
  out.sigma.resize(inputs.rows(), joints);
  Eigen::Index column = 0;
  for (const gp::FittedGp& fitted : fits) {
    const gp::Prediction p = gp::predict(fitted, inputs, {.variance = true, .threads = threads});
    const Eigen::Index width = p.mean.cols();
    out.mean.middleCols(column, width) = p.mean;
    out.model_sigma.middleCols(column, width) = p.variance.cwiseMax(0.0).cwiseSqrt();
    out.sigma.middleCols(column, width) =
        (p.variance.cwiseMax(0.0).rowwise() + p.noise_variance).cwiseSqrt();
    column += width;
  }
  return out;
}

// The options of a fit on part of the samples, for the bands: as dense in time as the fit on all,
// so that coloured noise looks the same to it.
TorqueModelOptions for_part(TorqueModelOptions options, double share) {
  const auto part = [&](int count) {
    return std::max(1, static_cast<int>(std::lround(share * static_cast<double>(count))));
  };
  options.samples = part(options.samples);
  options.samples_of_all_joints = part(options.samples_of_all_joints);
  options.hyperparameter_samples = part(options.hyperparameter_samples);
  return options;
}

// Of their Cholesky factors, which outweigh everything else.
double bytes_of(const std::vector<Processes>& folds) {
  double bytes = 0.0;
  for (const Processes& fold : folds) {
    for (const gp::FittedGp& fitted : fold) {
      const auto rows = static_cast<double>(fitted.route == gp::Route::kDense
                                                ? fitted.samples * fitted.model.kernel.outputs()
                                                : fitted.features);
      bytes += 8.0 * rows * rows;
    }
  }
  return bytes;
}

// The doubt of the processes that left a fold out, their root mean square: theirs is what residuals
// were judged by, and a process of all samples is surer than that.
Matrix doubt_of(const std::vector<Processes>& folds, const Matrix& inputs, Eigen::Index joints,
                int threads) {
  Matrix square = Matrix::Zero(inputs.rows(), joints);
  for (const Processes& fold : folds) {
    square += prediction_of(fold, inputs, joints, threads).model_sigma.cwiseAbs2();
  }
  return (square / static_cast<double>(folds.size())).cwiseSqrt();
}

// `folds`: may be empty.
FittedTorqueModel with_gps(TorqueModelKind kind, Processes fits, std::vector<Processes> folds,
                           int threads) {
  FittedTorqueModel out{kind, static_cast<int>(fits.front().samples), {}};
  const auto all = std::make_shared<const Processes>(std::move(fits));
  const auto parts = std::make_shared<const std::vector<Processes>>(std::move(folds));
  out.predict = [all, parts, threads](const Matrix& q, const Matrix& dq, const Matrix& ddq) {
    const Matrix inputs = motion_inputs(q, dq, ddq);
    TorquePrediction prediction = prediction_of(*all, inputs, q.cols(), threads);
    if (!parts->empty()) prediction.model_sigma = doubt_of(*parts, inputs, q.cols(), threads);
    return prediction;
  };
  return out;
}

// Sigma and bands that hold on motion left out of the fit.
FittedTorqueModel calibrated(FittedTorqueModel fitted, const LeftOutTorques& left) {
  CalibratedSigma found = calibrate(left);
  fitted.claim = std::move(fitted.predict);
  fitted.parts = std::move(found.parts);
  fitted.bands = std::move(found.bands);
  fitted.predict = [parts = fitted.parts, claim = fitted.claim](const Matrix& q, const Matrix& dq,
                                                                const Matrix& ddq) {
    return with_sigma_parts(claim(q, dq, ddq), parts);
  };
  return fitted;
}

// `known`: those of other samples, to start from.
Processes fit_processes(TorqueModelKind kind, const DynamicModel& model,
                        const TorqueSamples& samples, const TorqueModelOptions& options,
                        const Processes* known) {
  const gp::JointKinds joints = kinds_of(make_rigid_model(model));
  const int n = static_cast<int>(joints.size());
  const gp::Dataset all{motion_inputs(samples.q, samples.dq, samples.ddq), samples.torque, {}, {}};
  const ProcessShare share = share_of(kind, samples.size(), options);
  const auto rows = evenly_chosen(samples.size(), share.samples);
  const gp::Dataset chosen = gp::subset(all, rows);
  const auto known_of = [&](int number) {
    return known != nullptr ? &(*known)[static_cast<std::size_t>(number)] : nullptr;
  };
  Processes fits;
  if (kind == TorqueModelKind::kLip) {
    std::vector<gp::Kernel> friction;
    friction.reserve(joints.size());
    for (int j = 0; j < n; ++j) {
      friction.push_back(gp::joint_friction(n, j, options.identify.drives.coulomb_width_rad_s));
    }
    fits.push_back(fit_gp(gp::lip(joints) + gp::independent_outputs(friction), chosen, true, false,
                          options, known_of(0)));
  } else {
    for (int j = 0; j < n; ++j) {
      const gp::Dataset one{chosen.inputs, chosen.targets.col(j), {}, {}};
      const gp::Kernel kernel =
          kernel_of_joint(kind, model, joints, samples, j, options.identify.drives);
      fits.push_back(
          fit_gp(kernel, one, kind != TorqueModelKind::kRbf, share.sparse, options, known_of(j)));
    }
  }
  return fits;
}

// Processes of all samples, those that left a fold out, and what they said about it.
struct Trained {
  Processes all;
  std::vector<Processes> folds;
  std::optional<LeftOutTorques> left;
};

Trained train(TorqueModelKind kind, const DynamicModel& model, const TorqueSamples& samples,
              const TorqueModelOptions& options) {
  Trained out{fit_processes(kind, model, samples, options, nullptr), {}, {}};
  const int folds = std::min(options.band_folds, options.process_band_folds);
  if (folds < 2) return out;
  const auto all = static_cast<double>(samples.size());
  out.left = leave_folds_out(
      samples, folds, kBandRows, [&](const TorqueSamples& train, const TorqueSamples& test) {
        const double share = static_cast<double>(train.size()) / all;
        out.folds.push_back(fit_processes(kind, model, train, for_part(options, share), &out.all));
        return prediction_of(out.folds.back(), motion_inputs(test.q, test.dq, test.ddq),
                             test.joints(), options.threads);
      });
  return out;
}

// Joints whose processes predict motion left out worse than those of a plainer kind get the
// latter's: neighbouring samples err alike, and a likelihood that takes them for independent can
// prefer a process that has learned their noise.
std::vector<int> take_the_plainer(const Trained& plainer, Trained& trained) {
  std::vector<int> out;
  if (!trained.left || !plainer.left) return out;
  for (Eigen::Index j = 0; j < trained.left->residual.cols(); ++j) {
    if (trained.left->residual.col(j).squaredNorm() <=
        plainer.left->residual.col(j).squaredNorm()) {
      continue;
    }
    const auto at = static_cast<std::size_t>(j);
    trained.all[at] = plainer.all[at];
    for (std::size_t f = 0; f < trained.folds.size(); ++f) {
      trained.folds[f][at] = plainer.folds[f][at];
    }
    trained.left->residual.col(j) = plainer.left->residual.col(j);
    trained.left->model_sigma.col(j) = plainer.left->model_sigma.col(j);
    trained.left->sigma.col(j) = plainer.left->sigma.col(j);
    out.push_back(static_cast<int>(j));
  }
  return out;
}

}  // namespace

ProcessShare share_of(TorqueModelKind kind, Eigen::Index samples,
                      const TorqueModelOptions& options) {
  const auto all = static_cast<int>(samples);
  if (kind == TorqueModelKind::kModelBased) return {all, false};  // few features
  if (kind == TorqueModelKind::kLip) return {std::min(all, options.samples_of_all_joints), false};
  if (options.inducing_points > 0) return {all, true};
  return {std::min(all, options.samples), false};
}

FittedTorqueModel fit_gaussian_processes(TorqueModelKind kind, const DynamicModel& model,
                                         const TorqueSamples& samples,
                                         const TorqueModelOptions& options) {
  Trained trained = train(kind, model, samples, options);
  std::vector<int> plainer;
  if (kind == TorqueModelKind::kSemiParametric && trained.left) {
    plainer =
        take_the_plainer(train(TorqueModelKind::kModelBased, model, samples, options), trained);
  }
  if (!trained.left || bytes_of(trained.folds) > kMostFoldBytes) trained.folds.clear();
  FittedTorqueModel fitted =
      with_gps(kind, std::move(trained.all), std::move(trained.folds), options.threads);
  fitted.plainer_joints = std::move(plainer);
  return trained.left ? calibrated(std::move(fitted), *trained.left) : fitted;
}

}  // namespace kinescope::models
