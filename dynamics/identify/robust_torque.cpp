// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/robust_torque.h"

#include <algorithm>
#include <cmath>

#include "dynamics/data/splits.h"
#include "dynamics/data/statistics.h"
#include "dynamics/gp/leave_out.h"
#include "dynamics/gp/robot_kernels.h"
#include "dynamics/gp/robust.h"
#include "dynamics/identify/model_features.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFreedom = 4.0;      // of Student's t
constexpr double kNormalScale = 1.2;  // standard deviation of normal noise over the scale of its t
constexpr double kVague = 100.0;      // variance of the rigid body's weights: they are free

/// What is searched over, as logarithms: bandwidth of q, dq, ddq, standard deviation beyond the
/// rigid body, scale of the noise.
using Search = Eigen::Matrix<double, 5, 1>;

TorqueSamples evenly_thinned(const TorqueSamples& samples, int count) {
  const auto wanted = std::min<Index>(samples.size(), count);
  std::vector<Index> rows;
  for (Index i = 0; i < wanted; ++i) rows.push_back(i * samples.size() / wanted);
  return select_rows(samples, rows);
}

void assign_folds(const Folds& folds, RobustTorque& out) {
  out.folds = static_cast<int>(folds.folds.size());
  out.by_trajectory = folds.by_trajectory;
  out.fold_of.assign(static_cast<std::size_t>(out.samples.size()), 0);
  for (int k = 0; k < out.folds; ++k) {
    for (const Index row : folds.folds[static_cast<std::size_t>(k)].test) {
      out.fold_of[static_cast<std::size_t>(row)] = k;
    }
  }
}

/// Of each row: 1 in the fold and, where folds are blocks of one motion, within the guard of it.
std::vector<char> near_fold(const RobustTorque& learned, int fold) {
  const auto n = static_cast<Index>(learned.fold_of.size());
  const TorqueSamples& samples = learned.samples;
  std::vector<char> near(learned.fold_of.size(), 0);
  const double guard_s = learned.by_trajectory ? 0.0 : SplitOptions{}.guard_s;
  for (const int direction : {1, -1}) {
    Index last = -1;
    for (Index k = 0; k < n; ++k) {
      const Index row = direction > 0 ? k : n - 1 - k;
      const bool within = learned.fold_of[static_cast<std::size_t>(row)] == fold;
      if (within) last = row;
      const bool guarded = last >= 0 && samples.trajectory[row] == samples.trajectory[last] &&
                           std::abs(samples.t_s[row] - samples.t_s[last]) <= guard_s;
      if (within || guarded) near[static_cast<std::size_t>(row)] = 1;
    }
  }
  return near;
}

/// Every fold left out with its guard. Guards lie in the neighbouring blocks: even and odd folds by
/// turns, so that none is left out twice at once.
gp::LeaveOut leave_folds_out(const gp::FittedGp& fitted, const gp::Dataset& data,
                             const RobustTorque& learned) {
  if (learned.by_trajectory) {
    return gp::leave_out(fitted, data, learned.fold_of, learned.threads);
  }
  gp::LeaveOut out;
  for (const int parity : {0, 1}) {
    std::vector<int> label(learned.fold_of.size(), -1);
    for (int fold = parity; fold < learned.folds; fold += 2) {
      const std::vector<char> near = near_fold(learned, fold);
      for (std::size_t i = 0; i < label.size(); ++i) {
        const bool own = learned.fold_of[i] == fold;
        if (own || (near[i] != 0 && label[i] < 0 && learned.fold_of[i] % 2 != parity)) {
          label[i] = fold;
        }
      }
    }
    const gp::LeaveOut left = gp::leave_out(fitted, data, label, learned.threads);
    if (parity == 0) out = left;
    for (Index i = 0; i < left.z.rows(); ++i) {
      if (learned.fold_of[static_cast<std::size_t>(i)] % 2 != parity) continue;
      out.z.row(i) = left.z.row(i);
      out.variance.row(i) = left.variance.row(i);
      out.residual.row(i) = left.residual.row(i);
    }
  }
  return out;
}

gp::Dataset dataset_of(const TorqueSamples& samples, Index joint) {
  return {motion_inputs(samples.q, samples.dq, samples.ddq), samples.torque.col(joint), {}, {}};
}

VectorXd column_deviations(const MatrixXd& inputs) {
  const MatrixXd centred = inputs.rowwise() - inputs.colwise().mean();
  const VectorXd out =
      (centred.colwise().squaredNorm() / static_cast<double>(inputs.rows())).cwiseSqrt();
  return (out.array() > 0.0).select(out, 1.0);
}

/// The Gaussian process of one joint, for any point of the search.
class JointModel {
 public:
  JointModel(const DynamicModel& model, const TorqueSamples& samples, int joint,
             const DriveTerms& drives)
      : data_(dataset_of(samples, joint)),
        deviation_(column_deviations(data_.inputs)),
        start_(make(model_features(model, samples, joint, drives))) {}

  [[nodiscard]] const gp::Dataset& data() const { return data_; }
  /// Torque per unit of the normalised targets.
  [[nodiscard]] double scale() const { return start_.normalisation.target_scale[0]; }

  [[nodiscard]] gp::GpModel at(const Search& search) const {
    gp::GpModel out = start_;
    std::vector<gp::Parameter> parameters = start_.kernel.parameters();
    Index column = 0;
    for (gp::Parameter& parameter : parameters) {
      if (parameter.name == "model scale") parameter.value = kVague;
      if (parameter.name == "rbf variance") parameter.value = std::exp(2.0 * search[3]);
      if (parameter.name.starts_with("rbf length scale")) {
        parameter.value = deviation_[column] * std::exp(search[column / joints()]);
        ++column;
      }
    }
    out.kernel = start_.kernel.with_parameters(std::move(parameters));
    out.noise_variance[0].value = std::exp(2.0 * search[4]);
    return out;
  }

 private:
  [[nodiscard]] Index joints() const { return deviation_.size() / 3; }

  [[nodiscard]] gp::GpModel make(const ModelFeatures& features) const {
    const auto columns = static_cast<int>(data_.inputs.cols());
    return gp::make_model(
        gp::semi_parametric(features.map, features.prior, gp::first_columns(columns)), 1.0,
        gp::standardise_targets(data_));
  }

  gp::Dataset data_;
  VectorXd deviation_;
  gp::GpModel start_;
};

struct Judged {
  double score = 0.0;
  double unseen_rms = 0.0;
  double noise = 0.0;  ///< what of it the doubt about the function does not say
};

/// Log density of the left-out samples as Student's t: outliers must not choose the bandwidth.
Judged judge(const JointModel& joint, const Search& search, const RobustTorque& folds) {
  gp::FitOptions options;
  options.route = gp::Route::kDense;
  options.threads = folds.threads;
  const gp::FittedGp fitted = gp::fit(joint.at(search), joint.data(), options);
  const gp::LeaveOut left = leave_folds_out(fitted, joint.data(), folds);
  Judged out;
  for (Index i = 0; i < left.z.rows(); ++i) {
    const double z = left.z(i, 0);
    out.score -=
        0.5 * (kFreedom + 1.0) * std::log1p(z * z / kFreedom) + 0.5 * std::log(left.variance(i, 0));
  }
  out.unseen_rms = kSigmaOverMedian * median_of(to_vector(left.residual.col(0).cwiseAbs()));
  const double noise_square = std::pow(joint.scale() * std::exp(search[4]), 2);
  const double function = median_of(to_vector(left.variance.col(0))) - noise_square;
  const double unseen_square = out.unseen_rms * out.unseen_rms;
  out.noise = std::sqrt(std::max(unseen_square - function, 0.25 * unseen_square));
  return out;
}

struct CrossValidated {
  Search search;
  Judged judged;
};

/// One coordinate after the other, doubled or halved for as long as that helps.
CrossValidated cross_validate(const JointModel& joint, const RobustTorque& folds) {
  constexpr int kMostSweeps = 4;
  constexpr double kWorthwhile = 0.5;  // of log density; less is no reason to go on
  const Search step(Search::Constant(std::log(2.0)));
  Search start;
  start << std::log(4.0), std::log(8.0), std::log(8.0), std::log(0.05), std::log(0.02);
  const Search lower = start - 6.0 * step;
  const Search upper = start + 6.0 * step;
  CrossValidated best{start, judge(joint, start, folds)};
  const auto try_step = [&](Index k, double sign) {
    Search moved = best.search;
    moved[k] += sign * step[k];
    if (moved[k] < lower[k] - 1e-9 || moved[k] > upper[k] + 1e-9) return false;
    const Judged judged = judge(joint, moved, folds);
    if (!(judged.score > best.judged.score + kWorthwhile)) return false;
    best = {moved, judged};
    return true;
  };
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    bool better = false;
    for (const Index k : {4, 3, 0, 1, 2}) {  // the noise first: the others are judged by it
      bool moved = false;
      while (try_step(k, -1.0)) moved = true;
      while (!moved && try_step(k, 1.0)) better = true;
      better = better || moved;
    }
    if (!better) break;
  }
  return best;
}

void learn_joint(const DynamicModel& model, int index, const RobustTorqueOptions& options,
                 RobustTorque& out) {
  const JointModel joint(model, out.samples, index, options.drives);
  const CrossValidated found = cross_validate(joint, out);
  RobustJoint facts;
  facts.bandwidth = found.search.head<3>().array().exp();
  facts.beyond = joint.scale() * std::exp(found.search[3]);
  facts.noise = found.judged.noise;
  facts.unseen_rms = found.judged.unseen_rms;

  const gp::GpModel heavy = joint.at(found.search);
  gp::GpModel normal = heavy;
  normal.noise_variance[0].value *= kNormalScale * kNormalScale;
  gp::FitOptions fit;
  fit.route = gp::Route::kDense;
  fit.threads = options.threads;
  out.fits[0].push_back(gp::fit(normal, joint.data(), fit));
  gp::TrimOptions trim;
  trim.widen = options.widen;
  trim.share = options.trimmed_share;
  trim.fit = fit;
  out.fits[1].push_back(gp::fit_trimmed(normal, joint.data(), trim).fitted);
  gp::StudentOptions student;
  student.degrees_of_freedom = kFreedom;
  student.max_iterations = 20;
  student.tolerance = 1e-2;
  student.estimate_scale = false;  // cross-validation knows it better than the fit's own residuals
  student.fit = fit;
  gp::RobustFit robust = gp::fit_student(heavy, joint.data(), student);
  out.weight.col(index) = robust.weight.col(0);
  facts.down_weighted = (robust.weight.array() < 0.5).cast<double>().mean();
  out.fits[2].push_back(std::move(robust.fitted));
  out.joints.push_back(facts);
}

MatrixXd mean_of(const std::vector<gp::FittedGp>& fits, const MatrixXd& inputs, int threads) {
  MatrixXd out(inputs.rows(), static_cast<Index>(fits.size()));
  for (std::size_t j = 0; j < fits.size(); ++j) {
    out.col(static_cast<Index>(j)) =
        gp::predict(fits[j], inputs, {.variance = false, .threads = threads}).mean;
  }
  return out;
}

}  // namespace

std::string_view to_string(RobustMethod method) {
  constexpr std::array<std::string_view, kRobustMethods.size()> kNames = {"plain", "trimmed",
                                                                          "student"};
  return kNames[static_cast<std::size_t>(method)];
}

TorquePrediction RobustTorque::predict(RobustMethod method, const MatrixXd& q, const MatrixXd& dq,
                                       const MatrixXd& ddq) const {
  const std::vector<gp::FittedGp>& all = fits[static_cast<std::size_t>(method)];
  const MatrixXd inputs = motion_inputs(q, dq, ddq);
  TorquePrediction out;
  out.mean.resize(q.rows(), q.cols());
  out.model_sigma.resize(q.rows(), q.cols());
  out.sigma.resize(q.rows(), q.cols());
  for (std::size_t k = 0; k < all.size(); ++k) {
    const auto j = static_cast<Index>(k);
    const gp::Prediction p = gp::predict(all[k], inputs, {.variance = true, .threads = threads});
    const VectorXd variance = p.variance.col(0).cwiseMax(0.0);
    out.mean.col(j) = p.mean;
    out.model_sigma.col(j) = variance.cwiseSqrt();
    out.sigma.col(j) = (variance.array() + std::pow(joints[k].noise, 2)).sqrt();
  }
  return out;
}

RobustTorque learn_robust_torque(const DynamicModel& model, const TorqueSamples& samples,
                                 const RobustTorqueOptions& options) {
  RobustTorque out;
  out.threads = options.threads;
  out.samples = evenly_thinned(samples, options.samples);
  SplitOptions split;
  split.folds = options.folds;
  assign_folds(split_folds(out.samples, split), out);
  out.weight.resize(out.samples.size(), out.samples.joints());
  for (int j = 0; j < static_cast<int>(samples.joints()); ++j) {
    learn_joint(model, j, options, out);
  }
  return out;
}

std::vector<gp::FittedGp> without_fold(const RobustTorque& learned, int fold) {
  std::vector<Index> rows;
  const std::vector<char> near = near_fold(learned, fold);
  for (std::size_t i = 0; i < near.size(); ++i) {
    if (near[i] == 0) rows.push_back(static_cast<Index>(i));
  }
  std::vector<gp::FittedGp> out;
  const std::vector<gp::FittedGp>& all =
      learned.fits[static_cast<std::size_t>(RobustMethod::kStudent)];
  for (std::size_t j = 0; j < all.size(); ++j) {
    const auto column = static_cast<Index>(j);
    gp::Dataset data = dataset_of(learned.samples, column);
    data.noise_scale = learned.weight.col(column).cwiseInverse();
    gp::FitOptions options;
    options.route = gp::Route::kDense;
    options.threads = learned.threads;
    out.push_back(gp::fit(all[j].model, gp::subset(data, rows), options));
  }
  return out;
}

TorqueSplit split_torque(const std::vector<gp::FittedGp>& fits, const MatrixXd& q,
                         const MatrixXd& dq, const MatrixXd& ddq, int threads) {
  const MatrixXd still = MatrixXd::Zero(q.rows(), q.cols());
  const MatrixXd there = mean_of(fits, motion_inputs(q, dq, still), threads);
  const MatrixXd back = mean_of(fits, motion_inputs(q, -dq, still), threads);
  TorqueSplit out;
  out.friction = 0.5 * (there - back);
  out.gravity = 0.5 * (there + back);
  out.inertia = mean_of(fits, motion_inputs(q, dq, ddq), threads) - there;
  return out;
}

std::vector<FrictionBin> friction_profile(const VectorXd& velocity, const VectorXd& friction,
                                          int bins) {
  const double fastest = velocity.size() > 0 ? velocity.cwiseAbs().maxCoeff() : 0.0;
  if (!(fastest > 0.0)) return {};
  std::vector<FrictionBin> all(static_cast<std::size_t>(bins));
  for (Index i = 0; i < velocity.size(); ++i) {
    const auto place = static_cast<int>(0.5 * (velocity[i] / fastest + 1.0) * bins);
    FrictionBin& bin = all[static_cast<std::size_t>(std::clamp(place, 0, bins - 1))];
    bin.velocity += velocity[i];
    bin.friction += friction[i];
    bin.spread += friction[i] * friction[i];
    ++bin.samples;
  }
  std::erase_if(all, [](const FrictionBin& bin) { return bin.samples == 0; });
  for (FrictionBin& bin : all) {
    bin.velocity /= bin.samples;
    bin.friction /= bin.samples;
    bin.spread = std::sqrt(std::max(0.0, bin.spread / bin.samples - bin.friction * bin.friction));
  }
  return all;
}

}  // namespace kinescope
