// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/gaussian_processes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/gp/hyperparameters.h"
#include "dynamics/gp/lip_kernel.h"
#include "dynamics/gp/robot_kernels.h"
#include "dynamics/gp/sparse.h"
#include "dynamics/identify/model_features.h"
#include "kinematics/core/median.h"

namespace kinescope::models {
namespace {

using Matrix = Eigen::MatrixXd;

// Variance of the noise to begin with, of normalised torques, and of what an identified model
// leaves.
constexpr double kNoiseStart = 1e-3;
constexpr double kNoiseStartOfRest = 0.5;
// Predictions that bands are read from: neighbours in time say the same.
constexpr Eigen::Index kBandRows = 3000;
// Processes of the folds are kept for their sigma up to here; five of seven joints and 1500 samples
// take 0.4 GB.
constexpr double kMostFoldBytes = 1e9;

// Torques of joints that move so: samples x joints.
struct Motion {
  const Matrix& q;
  const Matrix& dq;
  const Matrix& ddq;
};

Motion motion_of(const TorqueSamples& samples) { return {samples.q, samples.dq, samples.ddq}; }

// Noise that lasts, as a function of the time alone: without it, a process takes that for a
// function of the motion. Inputs have the time after the motion; where torques are predicted it is
// far off.
constexpr double kFarOff_s = 1e9;
constexpr double kBetweenTrajectories_s = 100.0;
constexpr double kMemoryStart = 0.1;    // variance, of normalised targets
constexpr double kMemorySamples = 2.0;  // of those learned from; noise with less is white to them
constexpr const char* kMemoryName = "noise memory";  // its parameters' names begin so

gp::Kernel noise_memory(int time_column, double memory_s) {
  const gp::Kernel kernel = gp::rbf(gp::columns({time_column}));
  std::vector<gp::Parameter> parameters = kernel.parameters();
  parameters[0].value = kMemoryStart;
  parameters[1].value = memory_s;
  for (gp::Parameter& parameter : parameters)
    parameter.name = std::string(kMemoryName) + ", " + parameter.name;
  return kernel.with_parameters(std::move(parameters));
}

// Variance of that noise, in squared units of the targets; 0 where there is none.
double memory_variance(const gp::FittedGp& fitted) {
  for (const gp::Parameter& parameter : fitted.model.kernel.parameters()) {
    if (!parameter.name.starts_with(kMemoryName)) continue;
    return parameter.value * std::pow(fitted.model.normalisation.target_scale[0], 2);
  }
  return 0.0;
}

// One trajectory after the other, from 0.
Eigen::VectorXd times_of(const TorqueSamples& samples) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(samples.size());
  for (Eigen::Index i = 1; i < samples.size(); ++i) {
    const bool same = samples.trajectory[i] == samples.trajectory[i - 1];
    out[i] = out[i - 1] + (same ? samples.t_s[i] - samples.t_s[i - 1] : kBetweenTrajectories_s);
  }
  return out;
}

Matrix timed_inputs(const Motion& motion, const Eigen::VectorXd& times_s) {
  Matrix out(motion.q.rows(), 3 * motion.q.cols() + 1);
  out << motion_inputs(motion.q, motion.dq, motion.ddq), times_s;
  return out;
}

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
  return gp::feature_kernel(features.map, features.prior);
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
struct Processes {
  std::vector<gp::FittedGp> fits;
  std::shared_ptr<const Identification> prior;  // whose torques they add to; null: none
};

// The hyperparameters on part of the samples, then the fit on all of them. `known`: a fit of the
// same kernel on other samples; the search starts there and stays in its mode.
gp::FittedGp fit_gp(const gp::Kernel& kernel, const gp::Dataset& data, bool physical_inputs,
                    bool sparse, const TorqueModelOptions& options, const gp::FittedGp* known) {
  const gp::Normalisation normalisation = data.targets.cols() > 1 ? common_scale(data)
                                          : physical_inputs       ? gp::standardise_targets(data)
                                                                  : gp::standardise(data);
  const bool several = data.targets.cols() > 1;
  gp::GpModel start = gp::make_model(
      kernel, data.prior_mean.size() > 0 ? kNoiseStartOfRest : kNoiseStart, normalisation, several);
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

TorquePrediction prediction_of(const Processes& processes, const Motion& motion, int threads) {
  const Eigen::Index rows = motion.q.rows();
  const Eigen::Index joints = motion.q.cols();
  const Matrix inputs = processes.prior
                            ? timed_inputs(motion, Eigen::VectorXd::Constant(rows, kFarOff_s))
                            : motion_inputs(motion.q, motion.dq, motion.ddq);
  TorquePrediction out;
  out.mean = processes.prior
                 ? predict_torque(*processes.prior, motion.q, motion.dq, motion.ddq).mean
                 : Matrix::Zero(rows, joints);
  out.model_sigma.resize(rows, joints);
  out.sigma.resize(rows, joints);
  Eigen::Index column = 0;
  for (const gp::FittedGp& fitted : processes.fits) {
    const gp::Prediction p = gp::predict(fitted, inputs, {.variance = true, .threads = threads});
    const Eigen::Index width = p.mean.cols();
    const Eigen::ArrayXXd doubt = (p.variance.array() - memory_variance(fitted)).max(0.0);
    out.mean.middleCols(column, width) += p.mean;
    out.model_sigma.middleCols(column, width) = doubt.sqrt();
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
    for (const gp::FittedGp& fitted : fold.fits) {
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
Matrix doubt_of(const std::vector<Processes>& folds, const Motion& motion, int threads) {
  Matrix square = Matrix::Zero(motion.q.rows(), motion.q.cols());
  for (const Processes& fold : folds) {
    square += prediction_of(fold, motion, threads).model_sigma.cwiseAbs2();
  }
  return (square / static_cast<double>(folds.size())).cwiseSqrt();
}

// `folds`: may be empty.
FittedTorqueModel with_gps(TorqueModelKind kind, Processes processes, std::vector<Processes> folds,
                           int threads) {
  FittedTorqueModel out{kind, static_cast<int>(processes.fits.front().samples), {}};
  const auto all = std::make_shared<const Processes>(std::move(processes));
  const auto parts = std::make_shared<const std::vector<Processes>>(std::move(folds));
  out.predict = [all, parts, threads](const Matrix& q, const Matrix& dq, const Matrix& ddq) {
    const Motion motion{q, dq, ddq};
    TorquePrediction prediction = prediction_of(*all, motion, threads);
    if (!parts->empty()) prediction.model_sigma = doubt_of(*parts, motion, threads);
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

// `known`: those of other samples, to start from; null: none.
const gp::FittedGp* known_of(const Processes* known, int number) {
  return known != nullptr ? &known->fits[static_cast<std::size_t>(number)] : nullptr;
}

// Between neighbouring samples, the median, s.
double sample_time(const TorqueSamples& samples) {
  std::vector<double> steps;
  for (Eigen::Index i = 1; i < samples.size(); ++i) {
    if (samples.trajectory[i] == samples.trajectory[i - 1])
      steps.push_back(samples.t_s[i] - samples.t_s[i - 1]);
  }
  return steps.empty() ? 0.0 : median_of(std::move(steps));
}

// What a semi-parametric model adds to the identified one.
enum class Added {
  kFunction,  // its features, a squared exponential, and noise with a memory
  kConstant
};

// The identified model of all joints together, whose features in every joint's kernel may then
// differ from it.
Processes fit_semi_parametric(Added added, const DynamicModel& model, const TorqueSamples& samples,
                              const TorqueModelOptions& options, const Processes* known) {
  const int n = static_cast<int>(samples.joints());
  const auto prior =
      std::make_shared<const Identification>(identify_dynamics(model, samples, options.identify));
  const gp::Dataset all{timed_inputs(motion_of(samples), times_of(samples)),
                        samples.torque,
                        predict_torque(*prior, samples.q, samples.dq, samples.ddq).mean,
                        {}};
  const ProcessShare share = share_of(TorqueModelKind::kSemiParametric, samples.size(), options);
  const gp::Dataset chosen = gp::subset(all, evenly_chosen(samples.size(), share.samples));
  // Of the noise, in s and in samples learned from.
  const double memory_s = prior->correlation_samples * sample_time(samples);
  const double memory = prior->correlation_samples * static_cast<double>(chosen.samples()) /
                        static_cast<double>(samples.size());
  Processes out{{}, prior};
  for (int j = 0; j < n; ++j) {
    const gp::Dataset one{chosen.inputs, chosen.targets.col(j), chosen.prior_mean.col(j), {}};
    gp::Kernel kernel = gp::constant();
    if (added == Added::kFunction) {
      const ModelFeatures features = model_features(model, samples, j, options.identify.drives);
      kernel = gp::semi_parametric(features.map, features.prior, gp::first_columns(3 * n));
      if (memory > kMemorySamples) kernel = kernel + noise_memory(3 * n, memory_s);
    }
    out.fits.push_back(fit_gp(kernel, one, true, share.sparse && added == Added::kFunction, options,
                              known_of(known, j)));
  }
  return out;
}

Processes fit_processes(TorqueModelKind kind, const DynamicModel& model,
                        const TorqueSamples& samples, const TorqueModelOptions& options,
                        const Processes* known) {
  const gp::JointKinds joints = kinds_of(make_rigid_model(model));
  const int n = static_cast<int>(joints.size());
  const gp::Dataset all{motion_inputs(samples.q, samples.dq, samples.ddq), samples.torque, {}, {}};
  const ProcessShare share = share_of(kind, samples.size(), options);
  const gp::Dataset chosen = gp::subset(all, evenly_chosen(samples.size(), share.samples));
  Processes out;
  if (kind == TorqueModelKind::kLip) {
    std::vector<gp::Kernel> friction;
    friction.reserve(joints.size());
    for (int j = 0; j < n; ++j) {
      friction.push_back(gp::joint_friction(n, j, options.identify.drives.coulomb_width_rad_s));
    }
    out.fits.push_back(fit_gp(gp::lip(joints) + gp::independent_outputs(friction), chosen, true,
                              false, options, known_of(known, 0)));
    return out;
  }
  for (int j = 0; j < n; ++j) {
    const gp::Dataset one{chosen.inputs, chosen.targets.col(j), {}, {}};
    const gp::Kernel kernel =
        kernel_of_joint(kind, model, joints, samples, j, options.identify.drives);
    out.fits.push_back(fit_gp(kernel, one, kind != TorqueModelKind::kRbf, share.sparse, options,
                              known_of(known, j)));
  }
  return out;
}

// Processes of all samples, those that left a fold out, and what they said about it.
struct Trained {
  Processes all;
  std::vector<Processes> folds;
  std::optional<LeftOutTorques> left;
};

using Fit = std::function<Processes(const TorqueSamples& samples, const TorqueModelOptions& options,
                                    const Processes* known)>;

Trained train(const Fit& fit, const TorqueSamples& samples, const TorqueModelOptions& options) {
  Trained out{fit(samples, options, nullptr), {}, {}};
  const int folds = std::min(options.band_folds, options.process_band_folds);
  if (folds < 2) return out;
  const auto all = static_cast<double>(samples.size());
  out.left = leave_folds_out(
      samples, folds, kBandRows, [&](const TorqueSamples& train, const TorqueSamples& test) {
        const double share = static_cast<double>(train.size()) / all;
        out.folds.push_back(fit(train, for_part(options, share), &out.all));
        return prediction_of(out.folds.back(), motion_of(test), options.threads);
      });
  return out;
}

// Joints whose processes predict motion left out worse than those of a plainer model get the
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
    trained.all.fits[at] = plainer.all.fits[at];
    for (std::size_t f = 0; f < trained.folds.size(); ++f) {
      trained.folds[f].fits[at] = plainer.folds[f].fits[at];
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
  const bool semi_parametric = kind == TorqueModelKind::kSemiParametric;
  const auto with = [&](Added added) -> Fit {
    return [&model, added](const TorqueSamples& part, const TorqueModelOptions& of_part,
                           const Processes* known) {
      return fit_semi_parametric(added, model, part, of_part, known);
    };
  };
  const Fit plain = [&](const TorqueSamples& part, const TorqueModelOptions& of_part,
                        const Processes* known) {
    return fit_processes(kind, model, part, of_part, known);
  };
  Trained trained = train(semi_parametric ? with(Added::kFunction) : plain, samples, options);
  std::vector<int> plainer;
  if (semi_parametric && trained.left)
    plainer = take_the_plainer(train(with(Added::kConstant), samples, options), trained);
  if (!trained.left || bytes_of(trained.folds) > kMostFoldBytes) trained.folds.clear();
  FittedTorqueModel fitted =
      with_gps(kind, std::move(trained.all), std::move(trained.folds), options.threads);
  fitted.plainer_joints = std::move(plainer);
  return trained.left ? calibrated(std::move(fitted), *trained.left) : fitted;
}

}  // namespace kinescope::models
