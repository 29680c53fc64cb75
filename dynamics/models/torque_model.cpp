// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/torque_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "dynamics/data/splits.h"
#include "dynamics/gp/hyperparameters.h"
#include "dynamics/gp/lip_kernel.h"
#include "dynamics/gp/memory.h"
#include "dynamics/gp/robot_kernels.h"
#include "dynamics/gp/sparse.h"
#include "dynamics/identify/torque_terms.h"
#include "dynamics/models/neural_network.h"
#include "dynamics/models/support_vectors.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using Matrix = Eigen::MatrixXd;

// Of normalised torques, to begin with.
constexpr double kNoiseStart = 1e-3;

constexpr std::array<std::pair<TorqueModelKind, std::string_view>, 8> kNames{{
    {TorqueModelKind::kParametric, "parametric"},
    {TorqueModelKind::kRbf, "rbf"},
    {TorqueModelKind::kGip, "gip"},
    {TorqueModelKind::kModelBased, "model_based"},
    {TorqueModelKind::kSemiParametric, "semi_parametric"},
    {TorqueModelKind::kLip, "lip"},
    {TorqueModelKind::kSupportVectors, "svr"},
    {TorqueModelKind::kNeuralNetwork, "network"},
}};

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

// How a Gaussian process of this kind holds its samples.
struct Share {
  int samples = 0;
  bool sparse = false;
};

Share share_of(TorqueModelKind kind, Eigen::Index samples, const TorqueModelOptions& options) {
  const auto all = static_cast<int>(samples);
  if (kind == TorqueModelKind::kModelBased) return {all, false};  // few features
  if (kind == TorqueModelKind::kLip) return {std::min(all, options.samples_of_all_joints), false};
  if (options.inducing_points > 0) return {all, true};
  return {std::min(all, options.samples), false};
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

FittedTorqueModel with_gps(TorqueModelKind kind, int samples, std::vector<gp::FittedGp> fits,
                           int threads) {
  FittedTorqueModel out{kind, samples, {}};
  const auto shared = std::make_shared<const std::vector<gp::FittedGp>>(std::move(fits));
  out.predict = [shared, threads](const Matrix& q, const Matrix& dq, const Matrix& ddq) {
    return prediction_of(*shared, inputs_of(q, dq, ddq), q.cols(), threads);
  };
  return out;
}

}  // namespace

std::string_view to_string(TorqueModelKind kind) {
  return std::ranges::find(kNames, kind, &decltype(kNames)::value_type::first)->second;
}

std::optional<TorqueModelKind> torque_model_kind(std::string_view name) {
  const auto found = std::ranges::find(kNames, name, &decltype(kNames)::value_type::second);
  if (found == kNames.end()) return std::nullopt;
  return found->first;
}

const std::vector<TorqueModelKind>& all_torque_models() {
  static const std::vector<TorqueModelKind> kinds = [] {
    std::vector<TorqueModelKind> out;
    out.reserve(kNames.size());
    for (const auto& [kind, name] : kNames) out.push_back(kind);
    return out;
  }();
  return kinds;
}

const std::vector<TorqueModelKind>& usual_torque_models() {
  static const std::vector<TorqueModelKind> kinds = [] {
    std::vector<TorqueModelKind> out = all_torque_models();
    std::erase(out, TorqueModelKind::kNeuralNetwork);
    return out;
  }();
  return kinds;
}

FittedTorqueModel parametric_model(const Identification& found, const DynamicModel& model,
                                   const TorqueSamples& samples,
                                   const TorqueModelOptions& options) {
  const auto shared = std::make_shared<const Identification>(found);
  FittedTorqueModel out{TorqueModelKind::kParametric, static_cast<int>(samples.size()), {}};
  out.predict = [shared](const Matrix& q, const Matrix& dq, const Matrix& ddq) {
    return predict_torque(*shared, q, dq, ddq);
  };
  if (options.band_folds < 2) return out;
  out.bands = cross_validated_bands(
      samples, options.band_folds, [&](const TorqueSamples& train, const TorqueSamples& test) {
        return predict_torque(identify_dynamics(model, train, options.identify), test.q, test.dq,
                              test.ddq);
      });
  return out;
}

std::vector<Eigen::Index> evenly_chosen(Eigen::Index samples, int count) {
  std::vector<Eigen::Index> rows;
  const auto wanted = std::min<Eigen::Index>(samples, count);
  rows.reserve(static_cast<std::size_t>(wanted));
  for (Eigen::Index i = 0; i < wanted; ++i) rows.push_back(i * samples / wanted);
  return rows;
}

void check_torque_memory(const std::vector<TorqueModelKind>& kinds, Eigen::Index samples,
                         Eigen::Index joints, const TorqueModelOptions& options) {
  for (const TorqueModelKind kind : kinds) {
    const bool process = kind == TorqueModelKind::kRbf || kind == TorqueModelKind::kGip ||
                         kind == TorqueModelKind::kSemiParametric || kind == TorqueModelKind::kLip;
    if (!process) continue;
    const Share share = share_of(kind, samples, options);
    const bool together = kind == TorqueModelKind::kLip;
    constexpr double kSparseMatrices = 16.0;  // of inducing points, as in dynamics/gp/memory.h
    const auto shortage = gp::memory_shortage(
        share.sparse ? options.inducing_points : share.samples, together ? joints : 1,
        share.sparse ? kSparseMatrices : 1.0, options.memory_limit_bytes);
    if (!shortage) continue;
    throw bad_request(
        to_string(kind),
        fmt::format("the kernel matrix of {}{} needs {:.1f} GB, {:.1f} GB are available",
                    share.sparse ? fmt::format("{} inducing points", options.inducing_points)
                                 : fmt::format("{} samples", share.samples),
                    together ? " of all joints" : "", shortage->needed_gb, shortage->available_gb),
        share.sparse ? fmt::format("take at most {} inducing points", shortage->fitting_inducing)
        : together   ? fmt::format("take at most {} samples", shortage->fitting_samples)
                     : fmt::format("take at most {} samples (--samples), or all of them through at "
                                     "most {} inducing points (--inducing)",
                                   shortage->fitting_samples, shortage->fitting_inducing));
  }
}

FittedTorqueModel fit_torque_model(TorqueModelKind kind, const DynamicModel& model,
                                   const TorqueSamples& samples,
                                   const TorqueModelOptions& options) {
  if (kind == TorqueModelKind::kParametric) {
    return parametric_model(identify_dynamics(model, samples, options.identify), model, samples,
                            options);
  }
  if (kind == TorqueModelKind::kSupportVectors) {
    return models::fit_support_vectors(
        select_rows(samples, evenly_chosen(samples.size(), options.samples)));
  }
  if (kind == TorqueModelKind::kNeuralNetwork) {
    return models::fit_neural_network(
        select_rows(samples, evenly_chosen(samples.size(), options.samples)), options.network,
        options.seed);
  }
  check_torque_memory({kind}, samples.size(), samples.joints(), options);
  const gp::JointKinds joints = kinds_of(make_rigid_model(model));
  const int n = static_cast<int>(joints.size());
  const gp::Dataset all{inputs_of(samples.q, samples.dq, samples.ddq), samples.torque, {}, {}};
  const Share share = share_of(kind, samples.size(), options);
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

}  // namespace kinescope
