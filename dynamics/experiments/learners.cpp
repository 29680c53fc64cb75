// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/learners.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "dynamics/gp/lip_kernel.h"
#include "dynamics/gp/memory.h"
#include "dynamics/gp/process_group.h"
#include "dynamics/gp/robot_kernels.h"
#include "dynamics/gp/sparse.h"
#include "dynamics/gp/workers.h"
#include "dynamics/identify/model_features.h"
#include "dynamics/models/neural_network.h"
#include "dynamics/rigid/rigid_model.h"
#include "kinematics/core/error.h"

namespace kinescope::experiments {
namespace {

using Matrix = Eigen::MatrixXd;

constexpr std::array<std::pair<std::string_view, Learner>, 10> kNames = {
    {{"gip", Learner::kGip},
     {"rbf", Learner::kRbf},
     {"network", Learner::kNetwork},
     {"semi_parametric", Learner::kSemiParametric},
     {"model_based", Learner::kModelBased},
     {"parametric", Learner::kParametric},
     {"lip", Learner::kLip},
     {"gip_inducing", Learner::kGipInducing},
     {"rbf_inducing", Learner::kRbfInducing},
     {"semi_parametric_inducing", Learner::kSemiParametricInducing}}};

// The learner of all samples that one of inducing points stands for; else itself.
Learner exact_of(Learner learner) {
  if (learner == Learner::kGipInducing) return Learner::kGip;
  if (learner == Learner::kRbfInducing) return Learner::kRbf;
  if (learner == Learner::kSemiParametricInducing) return Learner::kSemiParametric;
  return learner;
}

bool of_inducing_points(Learner learner) { return exact_of(learner) != learner; }

// Variance of the noise to begin with, of normalised torques.
constexpr double kNoiseStart = 1e-3;
// Ranges of the search. With 1e-4 to 1e4, the squared exponential of a torque that is linear in one
// acceleration (a sliding joint) ended at 11 of its bounds with 1.8 times the error.
constexpr double kLowest = 1e-8;
constexpr double kHighest = 1e8;
// As much further as it goes: 1e-5 stopped within 0.2 of the log likelihood of 600 samples.
constexpr double kTolerance = 1e-8;
constexpr int kMostIterations = 500;
// Of each start before the best goes on: of 200 samples of a sliding joint, after 20 even ten
// starts ended 0.1 below the maximum that three find after 100.
constexpr int kStartIterations = 100;
// A kernel of all joints costs their number cubed: its search is shorter and on fewer samples.
constexpr double kLipNoiseStart = 1e-4;
constexpr int kLipIterations = 80;
constexpr double kLipTolerance = 1e-6;
constexpr Eigen::Index kLipStartSamples = 120;
constexpr int kLipSearchSamples = 250;

gp::JointKinds kinds_of(const DynamicModel& model) {
  gp::JointKinds kinds;
  for (const RigidBody& body : make_rigid_model(model).bodies) {
    kinds.push_back(body.type == JointType::kPrismatic ? gp::JointKind::kPrismatic
                                                       : gp::JointKind::kRevolute);
  }
  return kinds;
}

gp::Kernel kernel_of(Learner learner, const DynamicModel& believed, const TorqueSamples& train,
                     int joint) {
  const int joints = static_cast<int>(train.joints());
  const DriveTerms drives;
  if (learner == Learner::kRbf) return gp::rbf(gp::first_columns(3 * joints));
  if (learner == Learner::kGip) {
    return gp::gip(kinds_of(believed), motion_inputs(train.q, train.dq, train.ddq)) +
           gp::joint_friction(joints, joint, drives.coulomb_width_rad_s);
  }
  const ModelFeatures features = model_features(believed, train, joint, drives);
  if (learner == Learner::kModelBased) return gp::feature_kernel(features.map, features.prior);
  return gp::semi_parametric(features.map, features.prior, gp::first_columns(3 * joints));
}

Matrix by_process(Learner learner, const DynamicModel& believed, const TorqueSamples& train,
                  const Matrix& wanted, int joint, const LearnOptions& options) {
  const Learner exact = exact_of(learner);
  const gp::Dataset data{
      motion_inputs(train.q, train.dq, train.ddq), train.torque.col(joint), {}, {}};
  const gp::GpModel start = gp::make_model(
      kernel_of(exact, believed, train, joint), kNoiseStart,
      exact == Learner::kRbf ? gp::standardise(data) : gp::standardise_targets(data));
  const gp::GpModel model = search(start, data, options.search, options.threads).model;
  const gp::FitOptions fit{.threads = options.threads};
  const gp::FittedGp fitted =
      of_inducing_points(learner)
          ? gp::fit_sparse(model, data,
                           gp::choose_inducing(model, data, {.count = options.inducing}), fit)
          : gp::fit(model, data, fit);
  return gp::predict(fitted, wanted, {.variance = false, .threads = options.threads}).mean;
}

bool keeps_kernel_matrix(Learner learner, const DynamicModel& believed, const TorqueSamples& like,
                         Eigen::Index samples) {
  if (learner == Learner::kRbf || learner == Learner::kSemiParametric) return true;
  return learner == Learner::kGip &&
         gp::keeps_kernel_matrix(kernel_of(learner, believed, like, 0), samples);
}

// Whether the workers' kernel matrices fit beside each other, one of a joint each.
bool fit_together(Learner learner, Eigen::Index samples, int at_once) {
  if (of_inducing_points(learner)) return true;
  return gp::process_count() == 1 && !gp::memory_shortage(samples, 1, at_once);
}

// Joints side by side, each on one thread; where the memory is for one kernel matrix alone, or
// several processes share it, one after another on all threads. Neither changes a result.
Matrix by_processes(Learner learner, const DynamicModel& believed, const TorqueSamples& train,
                    const TorqueSamples& test, const LearnOptions& options) {
  const Matrix wanted = motion_inputs(test.q, test.dq, test.ddq);
  Matrix out(test.size(), test.joints());
  gp::Workers workers(options.threads);
  const auto joints = static_cast<int>(train.joints());
  const bool together = fit_together(learner, train.size(), std::min(workers.count(), joints));
  LearnOptions own = options;
  if (together) own.threads = 1;
  const auto learn = [&](Eigen::Index j) {
    out.col(j) = by_process(learner, believed, train, wanted, static_cast<int>(j), own);
  };
  if (together) {
    workers.run(joints, [&](Eigen::Index j, gp::Scratch&) { learn(j); });
  } else {
    for (Eigen::Index j = 0; j < joints; ++j) learn(j);
  }
  return out;
}

// One process of all joints, whose matrix is as many times as wide. One scale for all torques and
// no shift: a Lagrangian ties them to each other as they are.
Matrix by_lip(const DynamicModel& believed, const TorqueSamples& train, const TorqueSamples& test,
              const LearnOptions& options) {
  const gp::Dataset data{motion_inputs(train.q, train.dq, train.ddq), train.torque, {}, {}};
  const Eigen::Index joints = train.joints();
  gp::Normalisation scale;
  scale.target_shift = Eigen::RowVectorXd::Zero(joints);
  scale.target_scale = Eigen::RowVectorXd::Constant(
      joints, std::sqrt(data.targets.squaredNorm() / static_cast<double>(data.targets.size())));
  const gp::GpModel start =
      gp::make_model(gp::lip(kinds_of(believed)), kLipNoiseStart, scale, true);
  gp::EstimateOptions estimate;
  estimate.starts = options.search.starts;
  estimate.seed = options.search.seed;
  estimate.max_iterations = kLipIterations;
  estimate.relative_tolerance = kLipTolerance;
  estimate.samples_for_starts = kLipStartSamples;
  estimate.fit.threads = options.threads;
  const int few = std::min(options.search.samples, kLipSearchSamples);
  const gp::Estimate found = gp::estimate_hyperparameters(
      start, gp::subset(data, evenly_chosen(data.samples(), few)), estimate);
  const gp::FittedGp fitted = gp::fit(found.model, data, {.threads = options.threads});
  return gp::predict(fitted, motion_inputs(test.q, test.dq, test.ddq),
                     {.variance = false, .threads = options.threads})
      .mean;
}

}  // namespace

std::string_view to_string(Learner learner) {
  return std::ranges::find(kNames, learner, [](const auto& one) { return one.second; })->first;
}

std::optional<Learner> learner_of(std::string_view name) {
  const auto found = std::ranges::find(kNames, name, [](const auto& one) { return one.first; });
  if (found == kNames.end()) return {};
  return found->second;
}

std::vector<std::string_view> learner_names() {
  std::vector<std::string_view> out;
  for (const auto& [name, learner] : kNames) out.push_back(name);
  return out;
}

const std::vector<Learner>& usual_learners() {
  static const std::vector<Learner> learners = [] {
    std::vector<Learner> out;
    for (const auto& [name, learner] : kNames) {
      if (learner != Learner::kLip && !of_inducing_points(learner)) out.push_back(learner);
    }
    return out;
  }();
  return learners;
}

void require_memory(const std::vector<Learner>& learners, const DynamicModel& believed,
                    const TorqueSamples& like, Eigen::Index samples, std::size_t limit_bytes) {
  for (const Learner learner : learners) {
    const bool together = learner == Learner::kLip;
    if (!together && !keeps_kernel_matrix(learner, believed, like, samples)) continue;
    const Eigen::Index joints = together ? like.joints() : 1;
    const auto shortage = gp::memory_shortage(samples, joints, gp::machine_share(), limit_bytes);
    if (!shortage) continue;
    std::string remedy = fmt::format("take at most {} samples", shortage->fitting_samples);
    if (!together) remedy += fmt::format(" (--samples), or {}_inducing", to_string(learner));
    throw bad_request(
        std::string(to_string(learner)),
        fmt::format("the kernel matrix of {} samples{} needs {:.1f} GB, {:.1f} GB are available",
                    samples, together ? fmt::format(" of {} joints", joints) : "",
                    shortage->needed_gb, shortage->available_gb),
        remedy);
  }
}

gp::Estimate search(const gp::GpModel& start, const gp::Dataset& data, const SearchOptions& options,
                    int threads) {
  gp::GpModel model = start;
  std::vector<gp::Parameter> parameters = model.kernel.parameters();
  for (gp::Parameter& parameter : parameters) {
    parameter.lower = std::min(parameter.lower, kLowest);
    parameter.upper = std::max(parameter.upper, kHighest);
  }
  model.kernel = model.kernel.with_parameters(std::move(parameters));
  gp::EstimateOptions estimate;
  estimate.starts = options.starts;
  estimate.samples_for_starts = options.samples;
  estimate.seed = options.seed;
  estimate.max_iterations = kMostIterations;
  estimate.start_iterations = kStartIterations;
  estimate.relative_tolerance = kTolerance;
  estimate.fit.threads = threads;
  return gp::estimate_hyperparameters(
      model, gp::subset(data, evenly_chosen(data.samples(), options.samples)), estimate);
}

Eigen::MatrixXd predict_by(Learner learner, const DynamicModel& believed,
                           const TorqueSamples& train, const TorqueSamples& test,
                           const LearnOptions& options) {
  if (learner == Learner::kParametric) {
    const Identification found = identify_dynamics(believed, train);
    return predict_torque_mean(found, found.parameters, test.q, test.dq, test.ddq);
  }
  if (learner == Learner::kNetwork) {
    return models::fit_neural_network(train, options.network, options.search.seed)
        .predict(test.q, test.dq, test.ddq)
        .mean;
  }
  if (learner == Learner::kLip) return by_lip(believed, train, test, options);
  return by_processes(learner, believed, train, test, options);
}

}  // namespace kinescope::experiments
