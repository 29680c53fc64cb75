// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/gaussian_processes.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/data/splits.h"
#include "dynamics/gp/hyperparameters.h"
#include "dynamics/gp/lip_kernel.h"
#include "dynamics/gp/robot_kernels.h"
#include "dynamics/gp/sparse.h"
#include "dynamics/gp/workers.h"
#include "dynamics/identify/model_features.h"
#include "dynamics/models/joint_kinds.h"
#include "dynamics/models/process_values.h"
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

Matrix prior_mean(const Identification& prior, const Motion& motion) {
  return predict_torque_mean(prior, prior.parameters, motion.q, motion.dq, motion.ddq);
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
  gp::Dataset data;                             // learned from, all joints
  std::vector<Matrix> inducing;                 // inputs, one a fit; empty: exact
  std::vector<ModelFeatures> features;          // semi-parametric: one a fit
  double memory_samples = 0.0;  // of the noise, in samples learned from; 0: not asked for
};

gp::Dataset of_joint(const gp::Dataset& data, Eigen::Index joint) {
  gp::Dataset out{data.inputs, data.targets.col(joint), {}, {}};
  if (data.prior_mean.size() > 0) out.prior_mean = data.prior_mean.col(joint);
  return out;
}

// Joints side by side, or, where one matrix is large, one after another on all threads.
void for_each_joint(Eigen::Index joints, Eigen::Index samples, int threads,
                    const std::function<void(Eigen::Index joint, int threads)>& fit) {
  constexpr Eigen::Index kLarge = 3000;  // 72 MB a matrix
  if (samples > kLarge || joints == 1) {
    for (Eigen::Index j = 0; j < joints; ++j) fit(j, threads);
    return;
  }
  gp::Workers workers(threads);
  workers.run(joints, [&](Eigen::Index j, gp::Scratch&) { fit(j, 1); });
}

// Fits of single joints that are done; called from several threads.
class Counter {
 public:
  Counter(const Progress& progress, std::string stage, int total)
      : progress_(progress), stage_(std::move(stage)), total_(total) {
    report_progress(progress_, stage_, 0, total_);
  }
  void one_more() const { report_progress(progress_, stage_, ++done_, total_); }

 private:
  const Progress& progress_;
  std::string stage_;
  int total_;
  mutable std::atomic<int> done_ = 0;
};

struct OneFit {
  gp::FittedGp gp;
  Matrix inducing;  // inputs; empty: exact
};

// The hyperparameters on part of the samples, then the fit on all of them. `known`: of the same
// kernel on other samples: the search starts there and stays in its mode, and inducing inputs stay
// where they are (they say nothing of a torque). `memory_samples`: of the noise, which then counts
// so many times more: inducing points know no noise but the white one.
OneFit fit_gp(const gp::Kernel& kernel, const gp::Dataset& data, bool physical_inputs, bool sparse,
              double memory_samples, const TorqueModelOptions& options, const Processes* known,
              std::size_t number) {
  const gp::Normalisation normalisation = data.targets.cols() > 1 ? common_scale(data)
                                          : physical_inputs       ? gp::standardise_targets(data)
                                                                  : gp::standardise(data);
  const bool several = data.targets.cols() > 1;
  gp::GpModel start = gp::make_model(
      kernel, data.prior_mean.size() > 0 ? kNoiseStartOfRest : kNoiseStart, normalisation, several);
  if (known != nullptr)
    start = gp::with_log_values(start, gp::log_values_of(known->fits[number].model));
  const auto few = evenly_chosen(data.samples(), options.hyperparameter_samples);
  gp::EstimateOptions estimate;
  estimate.starts = known != nullptr ? 1 : options.starts;
  // On fewer ones than that a kernel of many features takes noise for function.
  estimate.samples_for_starts = std::ssize(few);
  estimate.seed = options.seed;
  estimate.relative_tolerance = options.search_tolerance;
  estimate.fit.threads = options.threads;
  const gp::Estimate found = gp::estimate_hyperparameters(start, gp::subset(data, few), estimate);
  gp::FitOptions fit;
  fit.threads = options.threads;
  fit.memory_limit_bytes = options.memory_limit_bytes;
  if (!sparse) return {gp::fit(found.model, data, fit), {}};
  gp::Dataset counted = data;
  counted.noise_scale = Matrix::Constant(data.samples(), 1, std::max(1.0, memory_samples));
  Matrix inducing =
      known != nullptr
          ? known->inducing[number]
          : gp::choose_inducing(found.model, data,
                                {.count = options.inducing_points, .seed = options.seed});
  return {gp::fit_sparse(found.model, counted, inducing, fit), std::move(inducing)};
}

TorquePrediction prediction_of(const Processes& processes, const Motion& motion, int threads) {
  const Eigen::Index rows = motion.q.rows();
  const Eigen::Index joints = motion.q.cols();
  const Matrix inputs = processes.prior
                            ? timed_inputs(motion, Eigen::VectorXd::Constant(rows, kFarOff_s))
                            : motion_inputs(motion.q, motion.dq, motion.ddq);
  TorquePrediction out;
  out.mean = processes.prior ? prior_mean(*processes.prior, motion) : Matrix::Zero(rows, joints);
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

FittedTorqueModel with_constant_joints(FittedTorqueModel fitted, const ConstantJoints& constants) {
  if (constants.joints.empty()) return fitted;
  fitted.predict = [predict = fitted.predict, constants](const Matrix& q, const Matrix& dq,
                                                         const Matrix& ddq) {
    return with_constants(predict(q, dq, ddq), constants);
  };
  return fitted;
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

using Prior = std::shared_ptr<const Identification>;

Prior identified(const DynamicModel& model, const TorqueSamples& samples,
                 const TorqueModelOptions& options) {
  return std::make_shared<const Identification>(
      identify_dynamics(model, samples, options.identify));
}

// How long noise lasts in samples learned from, where it lasts so long in all.
double memory_of_chosen(double samples, const gp::Dataset& chosen, const TorqueSamples& all) {
  return samples * static_cast<double>(chosen.samples()) / static_cast<double>(all.size());
}

// One fit a joint, whatever the order in which they are made.
void take(std::vector<std::optional<OneFit>> fits, bool sparse, Processes& out) {
  for (std::optional<OneFit>& fit : fits) {
    out.fits.push_back(std::move(fit->gp));
    if (sparse) out.inducing.push_back(std::move(fit->inducing));
  }
}

// The identified model of all joints together, whose features in every joint's kernel may then
// differ from it.
Processes fit_semi_parametric(Added added, const DynamicModel& model, const Prior& prior,
                              const TorqueSamples& samples, const TorqueModelOptions& options,
                              const Processes* known, const Counter& counter) {
  const int n = static_cast<int>(samples.joints());
  const ProcessShare share = share_of(TorqueModelKind::kSemiParametric, samples.size(), options);
  const std::vector<Eigen::Index> rows = evenly_chosen(samples.size(), share.samples);
  const TorqueSamples chosen = select_rows(samples, rows);
  Processes out;
  out.data = {timed_inputs(motion_of(chosen), times_of(samples)(rows)),
              chosen.torque,
              prior_mean(*prior, motion_of(chosen)),
              {}};
  out.memory_samples = memory_of_chosen(prior->correlation_samples, out.data, samples);
  out.prior = prior;
  const bool sparse = share.sparse && added == Added::kFunction;
  const double memory_s = prior->correlation_samples * sample_time(samples);
  std::vector<std::optional<OneFit>> fits(static_cast<std::size_t>(n));
  // Those of a fold are those of all samples, so that their processes can be compared: what
  // columns are independent says nothing of a torque.
  if (added == Added::kFunction) {
    out.features = known != nullptr
                       ? known->features
                       : model_features_of_joints(model, share.sparse ? chosen : samples,
                                                  options.identify.drives);
  }
  for_each_joint(n, out.data.samples(), options.threads, [&](Eigen::Index j, int threads) {
    const auto at = static_cast<std::size_t>(j);
    TorqueModelOptions own = options;
    own.threads = threads;
    gp::Kernel kernel = gp::constant();
    if (added == Added::kFunction) {
      const ModelFeatures& features = out.features[at];
      kernel = gp::semi_parametric(features.map, features.prior, gp::first_columns(3 * n));
      if (!sparse && out.memory_samples > kMemorySamples)
        kernel = kernel + noise_memory(3 * n, memory_s);
    }
    fits[at] =
        fit_gp(kernel, of_joint(out.data, j), true, sparse, out.memory_samples, own, known, at);
    counter.one_more();
  });
  take(std::move(fits), sparse, out);
  return out;
}

Processes fit_processes(TorqueModelKind kind, const DynamicModel& model, double memory,
                        const TorqueSamples& samples, const TorqueModelOptions& options,
                        const Processes* known, const Counter& counter) {
  const gp::JointKinds joints = joint_kinds(make_rigid_model(model));
  const int n = static_cast<int>(joints.size());
  const gp::Dataset all{motion_inputs(samples.q, samples.dq, samples.ddq), samples.torque, {}, {}};
  Processes out;
  const ProcessShare share = share_of(kind, samples.size(), options);
  out.data = gp::subset(all, evenly_chosen(samples.size(), share.samples));
  out.memory_samples = memory_of_chosen(memory, out.data, samples);
  if (kind == TorqueModelKind::kLip) {
    std::vector<gp::Kernel> friction;
    friction.reserve(joints.size());
    for (int j = 0; j < n; ++j) {
      friction.push_back(gp::joint_friction(n, j, options.identify.drives.coulomb_width_rad_s));
    }
    out.fits.push_back(fit_gp(gp::lip(joints) + gp::independent_outputs(friction), out.data, true,
                              false, 0.0, options, known, 0)
                           .gp);
    counter.one_more();
    return out;
  }
  std::vector<std::optional<OneFit>> fits(static_cast<std::size_t>(n));
  for_each_joint(n, out.data.samples(), options.threads, [&](Eigen::Index j, int threads) {
    const auto at = static_cast<std::size_t>(j);
    TorqueModelOptions own = options;
    own.threads = threads;
    const gp::Kernel kernel =
        kernel_of_joint(kind, model, joints, samples, static_cast<int>(j), options.identify.drives);
    fits[at] = fit_gp(kernel, of_joint(out.data, j), kind != TorqueModelKind::kRbf, share.sparse,
                      out.memory_samples, own, known, at);
    counter.one_more();
  });
  take(std::move(fits), share.sparse, out);
  return out;
}

// Processes of all samples, those that left a fold out, and what they said about it.
struct TrainedProcesses {
  Processes all;
  std::vector<Processes> folds;
  std::vector<TorqueSamples> tests;  // of the folds
  std::optional<LeftOutTorques> left;
};

// `part`: 0 all samples, then the folds.
using Fit = std::function<Processes(std::size_t part, const TorqueSamples& samples,
                                    const TorqueModelOptions& options, const Processes* known)>;

int band_folds(const TorqueModelOptions& options) {
  return std::min(options.band_folds, options.process_band_folds);
}

TrainedProcesses train(const Fit& fit, const TorqueSamples& samples,
                       const TorqueModelOptions& options) {
  TrainedProcesses out{fit(0, samples, options, nullptr), {}, {}, {}};
  if (band_folds(options) < 2) return out;
  const auto all = static_cast<double>(samples.size());
  out.left = leave_folds_out(
      samples, band_folds(options), kBandRows,
      [&](const TorqueSamples& train, const TorqueSamples& test) {
        const double share = static_cast<double>(train.size()) / all;
        out.folds.push_back(fit(out.folds.size() + 1, train, for_part(options, share), &out.all));
        out.tests.push_back(test);
        return prediction_of(out.folds.back(), motion_of(test), options.threads);
      });
  return out;
}

// Joints whose processes predict motion left out worse than those of a plainer model get the
// latter's: neighbouring samples err alike, and a likelihood that takes them for independent can
// prefer a process that has learned their noise.
std::vector<int> take_the_plainer(const TrainedProcesses& plainer, TrainedProcesses& trained) {
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

// Half the sum of the correlations of a Gaussian with this length scale, in steps; both sides.
double samples_within(double length_s, double step_s) {
  return step_s > 0.0 ? std::max(1.0, std::sqrt(2.0 * std::numbers::pi) * length_s / step_s) : 1.0;
}

// A joint's process without the noise that has a memory, which counts as more of the white one.
gp::GpModel function_of(const Processes& all, std::size_t joint, double step_s) {
  gp::GpModel out = all.fits[joint].model;
  if (!all.inducing.empty()) {
    out.noise_variance[0].value *= std::max(1.0, all.memory_samples);
    return out;
  }
  const std::vector<gp::Parameter>& parameters = out.kernel.parameters();
  const auto first = std::ranges::find_if(parameters, [](const gp::Parameter& parameter) {
    return parameter.name.starts_with(kMemoryName);
  });
  if (first == parameters.end()) return out;
  const auto count = first - parameters.begin();
  out.noise_variance[0].value += first[0].value * samples_within(first[1].value, step_s);
  const ModelFeatures& features = all.features[joint];
  const auto columns = static_cast<int>(all.data.inputs.cols()) - 1;
  const gp::Kernel plain =
      gp::semi_parametric(features.map, features.prior, gp::first_columns(columns));
  out.kernel = plain.with_parameters({parameters.begin(), parameters.begin() + count});
  return out;
}

// Points that carry the variance of an exact process that is saved: a band needs no more of them
// (256 take 4 us a sample).
constexpr int kCarriers = 256;

// One joint as numbers, with the doubt of the folds' processes under the hyperparameters of all
// samples: its scale is calibrated on the residuals of the folds' own.
void save_joint(const TrainedProcesses& trained, std::size_t joint, double step_s,
                const TorqueModelOptions& options, JointProcess& process, Matrix& root,
                Eigen::VectorXd* left_sigma) {
  const Processes& all = trained.all;
  const auto j = static_cast<Eigen::Index>(joint);
  process.function = function_of(all, joint, step_s);
  process.inputs = all.data.inputs;
  process.sparse = !all.inducing.empty();
  process.weights = gp::kernel_weights(all.fits[joint]);
  if (!all.features.empty()) {
    process.terms = all.features[joint].terms;
    process.feature_prior = all.features[joint].prior.diagonal();
  }
  process.inducing = process.sparse
                         ? all.inducing[joint]
                         : gp::choose_inducing(process.function, of_joint(all.data, j),
                                               {.count = kCarriers, .seed = options.seed});
  std::vector<gp::Dataset> parts;
  std::vector<Matrix> inputs;
  for (std::size_t f = 0; f < trained.folds.size(); ++f) {
    parts.push_back(of_joint(trained.folds[f].data, j));
    const TorqueSamples& test = trained.tests[f];
    inputs.push_back(
        all.prior ? timed_inputs(motion_of(test), Eigen::VectorXd::Constant(test.size(), kFarOff_s))
                  : motion_inputs(test.q, test.dq, test.ddq));
  }
  if (parts.empty()) parts.push_back(of_joint(all.data, j));
  gp::CompactVariance variance = gp::compact_variance(
      process.function, parts, inputs, process.inducing, {.threads = options.threads});
  root = std::move(variance.root);
  if (left_sigma == nullptr) return;
  Eigen::Index row = 0;
  for (const Eigen::VectorXd& own : variance.own) {
    left_sigma->segment(row, own.size()) =
        process.function.normalisation.target_scale[0] * own.cwiseSqrt();
    row += own.size();
  }
}

// All joints as numbers; `left` then holds their doubt.
SavedTorqueModel save(TorqueModelKind kind, const DynamicModel& model,
                      const TrainedProcesses& trained, const std::vector<int>& plainer,
                      const TorqueSamples& samples, const TorqueModelOptions& options,
                      LeftOutTorques* left) {
  SavedTorqueModel out;
  out.kind = kind;
  out.robot = model.tree.name;
  out.torque_unit = samples.torque_unit;
  out.rigid = make_rigid_model(model);
  out.drives = options.identify.drives;
  out.samples = static_cast<int>(trained.all.data.samples());
  out.learned = span_of(samples);
  if (trained.all.prior) out.parametric = saved_parametric(*trained.all.prior);
  const Eigen::Index joints = samples.joints();
  out.motions.resize(0, 3 * joints);
  const double step_s = sample_time(samples) * static_cast<double>(samples.size()) /
                        static_cast<double>(trained.all.data.samples());
  std::vector<JointProcess> processes(
      static_cast<std::size_t>(joints),
      {gp::GpModel{gp::constant(), {}, {}}, {}, {}, {}, false, {}, {}});
  std::vector<Matrix> roots(processes.size());
  std::vector<Eigen::VectorXd> doubts(
      processes.size(), Eigen::VectorXd::Zero(left != nullptr ? left->residual.rows() : 0));
  const auto is_plain = [&](Eigen::Index j) {
    return std::ranges::count(plainer, static_cast<int>(j)) > 0;
  };
  for_each_joint(joints, trained.all.data.samples(), options.threads,
                 [&](Eigen::Index j, int threads) {
                   const auto at = static_cast<std::size_t>(j);
                   if (is_plain(j)) return;
                   TorqueModelOptions own = options;
                   own.threads = threads;
                   save_joint(trained, at, step_s, own, processes[at], roots[at],
                              left != nullptr ? &doubts[at] : nullptr);
                 });
  for (Eigen::Index j = 0; j < joints; ++j) {
    const auto at = static_cast<std::size_t>(j);
    if (left != nullptr) left->model_sigma.col(j) = doubts[at];
    if (!is_plain(j)) {
      add_process(kind, processes[at], roots[at], out);
      continue;
    }
    const Matrix far = Matrix::Constant(1, trained.all.data.inputs.cols(), kFarOff_s);
    add_constant_process(gp::predict(trained.all.fits[at], far, {.variance = false}).mean(0, 0),
                         out);
  }
  // As claimed; calibrated below where there are residuals.
  out.parts = {Eigen::VectorXd::Ones(joints), Eigen::VectorXd(joints)};
  for (Eigen::Index j = 0; j < joints; ++j) {
    const gp::GpModel& fitted = trained.all.fits[static_cast<std::size_t>(j)].model;
    out.parts.noise_sigma[j] =
        fitted.normalisation.target_scale[0] * std::sqrt(fitted.noise_variance[0].value);
  }
  return out;
}

bool can_be_saved(TorqueModelKind kind) {
  return kind == TorqueModelKind::kRbf || kind == TorqueModelKind::kGip ||
         kind == TorqueModelKind::kSemiParametric;
}

int most_points(const std::vector<Matrix>& inducing) {
  Eigen::Index most = 0;
  for (const Matrix& own : inducing) most = std::max(most, own.rows());
  return static_cast<int>(most);
}

// The saved model is the fit.
void predict_by_saved(const SavedTorqueModel& saved, int threads, FittedTorqueModel& fitted) {
  const auto shared = std::make_shared<const SavedTorqueModel>(saved);
  fitted.predict = [shared, threads](const Matrix& q, const Matrix& dq, const Matrix& ddq) {
    return predict_torque(*shared, q, dq, ddq, threads);
  };
}

}  // namespace

ProcessShare share_of(TorqueModelKind kind, Eigen::Index samples,
                      const TorqueModelOptions& options) {
  const auto all = static_cast<int>(samples);
  if (kind == TorqueModelKind::kModelBased) return {all, false};  // few features
  if (kind == TorqueModelKind::kLip) return {std::min(all, options.samples_of_all_joints), false};
  if (options.inducing_points > 0) {
    const int most = options.inducing_samples;
    return {most > 0 ? std::min(all, most) : all, true};
  }
  return {std::min(all, options.samples), false};
}

FittedTorqueModel fit_gaussian_processes(TorqueModelKind kind, const DynamicModel& model,
                                         const TorqueSamples& samples,
                                         const TorqueModelOptions& options,
                                         const Progress& progress) {
  const bool semi_parametric = kind == TorqueModelKind::kSemiParametric;
  const bool sparse = share_of(kind, samples.size(), options).sparse;
  const int parts = 1 + (band_folds(options) < 2 ? 0 : band_folds(options));
  const int joints = kind == TorqueModelKind::kLip ? 1 : static_cast<int>(samples.joints());
  const Counter counter(progress, std::string(to_string(kind)) + " model",
                        parts * joints * (semi_parametric ? 2 : 1));
  std::vector<Prior> priors;  // of the parts, for both of the semi-parametric trainings
  const auto with = [&](Added added) -> Fit {
    return [&, added](std::size_t part, const TorqueSamples& own, const TorqueModelOptions& of_part,
                      const Processes* known) {
      if (part == priors.size()) priors.push_back(identified(model, own, of_part));
      return fit_semi_parametric(added, model, priors[part], own, of_part, known, counter);
    };
  };
  // Inducing points take all noise for white: how long it lasts, the identified model says.
  const double memory =
      sparse && !semi_parametric ? identified(model, samples, options)->correlation_samples : 0.0;
  const Fit plain = [&](std::size_t, const TorqueSamples& own, const TorqueModelOptions& of_part,
                        const Processes* known) {
    return fit_processes(kind, model, memory, own, of_part, known, counter);
  };
  TrainedProcesses trained =
      train(semi_parametric ? with(Added::kFunction) : plain, samples, options);
  std::vector<int> plainer;
  if (semi_parametric && trained.left)
    plainer = take_the_plainer(train(with(Added::kConstant), samples, options), trained);
  std::optional<SavedTorqueModel> saved;
  std::optional<LeftOutTorques> left = trained.left;
  if (sparse || (options.keep_saved && can_be_saved(kind)))
    saved = save(kind, model, trained, plainer, samples, options, left ? &*left : nullptr);
  const int learned = static_cast<int>(trained.all.fits.front().samples);
  FittedTorqueModel fitted;
  fitted.inducing_points = most_points(trained.all.inducing);
  if (sparse) {
    fitted.kind = kind;
    fitted.samples = learned;
    predict_by_saved(*saved, options.threads, fitted);
    trained.left = left;
  } else {
    if (!trained.left || bytes_of(trained.folds) > kMostFoldBytes) trained.folds.clear();
    const int most = fitted.inducing_points;
    fitted = with_gps(kind, std::move(trained.all), std::move(trained.folds), options.threads);
    fitted.inducing_points = most;
  }
  fitted.plainer_joints = std::move(plainer);
  if (trained.left) {
    const ConstantJoints constants = give_way_to_constant(*trained.left, samples.torque);
    fitted.constant_joints = constants.joints;
    fitted.left_out_nmse_percent = kinescope::left_out_nmse_percent(*trained.left);
    fitted = calibrated(with_constant_joints(std::move(fitted), constants), *trained.left);
    if (saved) {
      saved->constants = give_way_to_constant(*left, samples.torque);
      CalibratedSigma found = calibrate(*left);
      saved->parts = std::move(found.parts);
      saved->bands = std::move(found.bands);
      // The same to the last bit.
      for (std::size_t k = 0; k < saved->constants.joints.size(); ++k) {
        saved->constants.sigma[static_cast<Eigen::Index>(k)] =
            saved->parts.noise_sigma[saved->constants.joints[k]];
      }
    }
  }
  if (saved) fitted.saved = std::make_shared<const SavedTorqueModel>(*std::move(saved));
  return fitted;
}

}  // namespace kinescope::models
