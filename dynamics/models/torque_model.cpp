// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/torque_model.h"

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "dynamics/data/splits.h"
#include "dynamics/gp/memory.h"
#include "dynamics/models/gaussian_processes.h"
#include "dynamics/models/neural_network.h"
#include "dynamics/models/support_vectors.h"
#include "kinematics/core/error.h"

namespace kinescope {
TorqueModelOptions quick_options(TorqueModelOptions options) {
  if (options.inducing_points == 0) {
    options.inducing_points = 200;
    options.inducing_samples = options.samples;
  }
  options.hyperparameter_samples = 250;
  options.starts = 1;
  options.search_tolerance = 1e-3;
  return options;
}

FittedTorqueModel parametric_model(const Identification& found, const DynamicModel& model,
                                   const TorqueSamples& samples,
                                   const TorqueModelOptions& options) {
  const auto shared = std::make_shared<const Identification>(found);
  FittedTorqueModel out{TorqueModelKind::kParametric, static_cast<int>(samples.size()), {}};
  auto saved = std::make_shared<SavedTorqueModel>();
  saved->kind = TorqueModelKind::kParametric;
  saved->robot = model.tree.name;
  saved->torque_unit = samples.torque_unit;
  saved->rigid = found.rigid;
  saved->drives = found.drives;
  saved->samples = out.samples;
  saved->parametric = saved_parametric(found);
  saved->parts = {Eigen::VectorXd::Ones(found.sigma.size()), found.sigma};
  saved->learned = span_of(samples);
  std::optional<LeftOutTorques> left;
  if (options.band_folds >= 2) {
    left = leave_folds_out(
        samples, options.band_folds, 0,
        [&](const TorqueSamples& train, const TorqueSamples& test) {
          return predict_torque(identify_dynamics(model, train, options.identify), test.q, test.dq,
                                test.ddq);
        },
        options.threads);
  }
  if (left) {
    saved->constants = give_way_to_constant(*left, samples.torque);
    out.constant_joints = saved->constants.joints;
    out.left_out_nmse_percent = left_out_nmse_percent(*left);
    out.bands = saved->bands = bands_of(*left);
  }
  out.predict = [shared, constants = saved->constants](const Eigen::MatrixXd& q,
                                                       const Eigen::MatrixXd& dq,
                                                       const Eigen::MatrixXd& ddq) {
    return with_constants(predict_torque(*shared, q, dq, ddq), constants);
  };
  out.saved = std::move(saved);
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
    const models::ProcessShare share = models::share_of(kind, samples, options);
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
                                   const TorqueSamples& samples, const TorqueModelOptions& options,
                                   const Progress& progress) {
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
  return models::fit_gaussian_processes(kind, model, samples, options, progress);
}

}  // namespace kinescope
