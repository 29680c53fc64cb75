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
#include "dynamics/identify/torque_terms.h"

namespace kinescope::models {
namespace {

using Matrix = Eigen::MatrixXd;

// Of normalised torques, to begin with.
constexpr double kNoiseStart = 1e-3;
// Predictions that bands are read from: neighbours in time say the same.
constexpr Eigen::Index kBandRows = 3000;

Matrix inputs_of(const Matrix& q, const Matrix& dq, const Matrix& ddq) {
  Matrix inputs(q.rows(), 3 * q.cols());
  inputs << q, dq, ddq;
  return inputs;
}

gp::JointKinds kinds_of(const RigidModel& rigid) {
  gp::JointKinds kinds;
  for (const RigidBody& body : rigid.bodies) {
    kinds.push_back(body.type == JointType::kPrismatic ? gp::JointKind::kPrismatic
                                                       : gp::JointKind::kRevolute);
  }
  return kinds;
}

// The independent columns of one joint's torque in the parametric model.
struct ModelFeatures {
  gp::FeatureMap map;
  Matrix prior;  ///< covariance of their weights: each feature may explain the whole torque
};

ModelFeatures model_features(const DynamicModel& model, const TorqueSamples& samples, int joint,
                             const DriveTerms& drives) {
  const auto rigid = std::make_shared<const RigidModel>(make_rigid_model(model));
  const auto terms = std::make_shared<const std::vector<TorqueTerm>>(torque_terms(*rigid, drives));
  const auto at = static_cast<std::size_t>(joint);
  const Matrix columns =
      term_columns(*rigid, drives, *terms, samples.q, samples.dq, samples.ddq)[at];
  std::vector<int> order(static_cast<std::size_t>(columns.cols()));
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  constexpr double kIndependent = 1e-7;  // relative to the largest pivot
  const ColumnBasis basis = independent_columns(columns, order, kIndependent);
  ModelFeatures out;
  out.prior = Matrix::Zero(static_cast<Eigen::Index>(basis.kept.size()),
                           static_cast<Eigen::Index>(basis.kept.size()));
  for (std::size_t k = 0; k < basis.kept.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const double square =
        columns.col(basis.kept[k]).squaredNorm() / static_cast<double>(columns.rows());
    out.prior(i, i) = 1.0 / square;
    out.map.names.push_back((*terms)[static_cast<std::size_t>(basis.kept[k])].name);
  }
  const int n = static_cast<int>(samples.joints());
  out.map.input_columns = 3 * n;
  out.map.map = [rigid, terms, drives, at, n, kept = basis.kept](gp::Inputs inputs,
                                                                 gp::Features features) {
    const auto all = term_columns(*rigid, drives, *terms, inputs.leftCols(n),
                                  inputs.middleCols(n, n), inputs.rightCols(n));
    for (std::size_t k = 0; k < kept.size(); ++k) {
      features.col(static_cast<Eigen::Index>(k)) = all[at].col(kept[k]);
    }
  };
  return out;
}

gp::Kernel kernel_of_joint(TorqueModelKind kind, const DynamicModel& model,
                           const gp::JointKinds& joints, const TorqueSamples& samples, int joint,
                           const DriveTerms& drives) {
  const int n = static_cast<int>(joints.size());
  if (kind == TorqueModelKind::kRbf) return gp::rbf(gp::first_columns(3 * n));
  if (kind == TorqueModelKind::kGip) {
    return gp::gip(joints, inputs_of(samples.q, samples.dq, samples.ddq)) +
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

// The hyperparameters on part of the samples, then the fit on all of them.
gp::FittedGp fit_gp(const gp::Kernel& kernel, const gp::Dataset& data, bool physical_inputs,
                    bool sparse, const TorqueModelOptions& options) {
  const gp::Normalisation normalisation = data.targets.cols() > 1 ? common_scale(data)
                                          : physical_inputs       ? gp::standardise_targets(data)
                                                                  : gp::standardise(data);
  const bool several = data.targets.cols() > 1;
  const gp::GpModel start = gp::make_model(kernel, kNoiseStart, normalisation, several);
  gp::EstimateOptions estimate;
  estimate.starts = options.starts;
  estimate.seed = options.seed;
  estimate.fit.threads = options.threads;
  const auto few = evenly_chosen(data.samples(), options.hyperparameter_samples);
  const gp::Estimate found = gp::estimate_hyperparameters(start, gp::subset(data, few), estimate);
  gp::FitOptions fit;
  fit.threads = options.threads;
  fit.memory_limit_bytes = options.memory_limit_bytes;
  if (!sparse) return gp::fit(found.model, data, fit);
  const Matrix inducing = gp::choose_inducing(
      found.model, data, {.count = options.inducing_points, .seed = options.seed});
  return gp::fit_sparse(found.model, data, inducing, fit);
}

TorquePrediction prediction_of(const std::vector<gp::FittedGp>& fits, const Matrix& inputs,
                               Eigen::Index joints, int threads) {
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
// so that coloured noise looks the same to it, and one start of the search.
TorqueModelOptions for_part(TorqueModelOptions options, double share) {
  const auto part = [&](int count) {
    return std::max(1, static_cast<int>(std::lround(share * static_cast<double>(count))));
  };
  options.samples = part(options.samples);
  options.samples_of_all_joints = part(options.samples_of_all_joints);
  options.hyperparameter_samples = part(options.hyperparameter_samples);
  options.starts = 1;
  options.band_folds = 0;
  return options;
}

// Sigma and bands that hold on motion left out of the fit.
FittedTorqueModel calibrated(FittedTorqueModel fitted, const LeftOutTorques& left) {
  const SigmaParts parts = sigma_parts_of(left);
  fitted.predict = [parts, claimed = std::move(fitted.predict)](const Matrix& q, const Matrix& dq,
                                                                const Matrix& ddq) {
    return with_sigma_parts(claimed(q, dq, ddq), parts);
  };
  LeftOutTorques judged = left;
  const TorquePrediction sigmas =
      with_sigma_parts({left.residual, left.model_sigma, left.sigma}, parts);
  judged.sigma = sigmas.sigma;
  fitted.bands = bands_of(judged);
  return fitted;
}

FittedTorqueModel with_gps(TorqueModelKind kind, int samples, std::vector<gp::FittedGp> fits,
                           int threads) {
  FittedTorqueModel out{kind, samples, {}};
  const auto shared = std::make_shared<const std::vector<gp::FittedGp>>(std::move(fits));
  out.predict = [shared, threads](const Matrix& q, const Matrix& dq, const Matrix& ddq) {
    return prediction_of(*shared, inputs_of(q, dq, ddq), q.cols(), threads);
  };
  return out;
}

FittedTorqueModel fit_processes(TorqueModelKind kind, const DynamicModel& model,
                                const TorqueSamples& samples, const TorqueModelOptions& options) {
  const gp::JointKinds joints = kinds_of(make_rigid_model(model));
  const int n = static_cast<int>(joints.size());
  const gp::Dataset all{inputs_of(samples.q, samples.dq, samples.ddq), samples.torque, {}, {}};
  const ProcessShare share = share_of(kind, samples.size(), options);
  const auto rows = evenly_chosen(samples.size(), share.samples);
  const gp::Dataset chosen = gp::subset(all, rows);
  std::vector<gp::FittedGp> fits;
  if (kind == TorqueModelKind::kLip) {
    std::vector<gp::Kernel> friction;
    friction.reserve(joints.size());
    for (int j = 0; j < n; ++j) {
      friction.push_back(gp::joint_friction(n, j, options.identify.drives.coulomb_width_rad_s));
    }
    fits.push_back(
        fit_gp(gp::lip(joints) + gp::independent_outputs(friction), chosen, true, false, options));
  } else {
    for (int j = 0; j < n; ++j) {
      const gp::Dataset one{chosen.inputs, chosen.targets.col(j), {}, {}};
      const gp::Kernel kernel =
          kernel_of_joint(kind, model, joints, samples, j, options.identify.drives);
      fits.push_back(fit_gp(kernel, one, kind != TorqueModelKind::kRbf, share.sparse, options));
    }
  }
  return with_gps(kind, static_cast<int>(chosen.samples()), std::move(fits), options.threads);
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
  FittedTorqueModel fitted = fit_processes(kind, model, samples, options);
  const int folds = std::min(options.band_folds, options.process_band_folds);
  if (folds < 2) return fitted;
  const auto all = static_cast<double>(samples.size());
  const auto left = leave_folds_out(
      samples, folds, kBandRows, [&](const TorqueSamples& train, const TorqueSamples& test) {
        const double share = static_cast<double>(train.size()) / all;
        return fit_processes(kind, model, train, for_part(options, share))
            .predict(test.q, test.dq, test.ddq);
      });
  return left ? calibrated(std::move(fitted), *left) : fitted;
}

}  // namespace kinescope::models
