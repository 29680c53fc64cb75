// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/identify.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "dynamics/identify/block_jackknife.h"
#include "dynamics/identify/gain_system.h"
#include "dynamics/identify/prediction.h"
#include "dynamics/identify/term_size.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using identify::GainSystem;
using identify::ScaledSolver;
using identify::StackedSystem;
using identify::WeightedFit;
using identify::WeightedFitOptions;

void check_samples(const RigidModel& rigid, const TorqueSamples& samples,
                   const Eigen::MatrixXd& weights) {
  const Eigen::Index rows = samples.torque.rows();
  const auto fits = [&](const Eigen::MatrixXd& m) {
    return m.rows() == rows && m.cols() == rigid.size();
  };
  if (!fits(samples.q) || !fits(samples.dq) || !fits(samples.ddq) || !fits(samples.torque) ||
      !fits(weights) || samples.trajectory.size() != rows) {
    throw bad_request(
        "torque samples",
        fmt::format("the arrays are not all {} samples x {} joints", rows, rigid.size()),
        "give one column a movable joint of the model and one row a sample");
  }
  for (Eigen::Index t = 0; t < rows; ++t) {
    if (weights.row(t).isZero(0.0)) continue;
    bool finite = samples.q.row(t).allFinite() && samples.dq.row(t).allFinite() &&
                  samples.ddq.row(t).allFinite();
    for (Eigen::Index j = 0; j < rigid.size(); ++j) {
      finite = finite && weights(t, j) >= 0.0 && std::isfinite(weights(t, j)) &&
               (weights(t, j) == 0.0 || std::isfinite(samples.torque(t, j)));
    }
    if (finite) continue;
    throw bad_request("torque samples", fmt::format("sample {} has no finite numbers", t),
                      "leave it out by a weight of 0");
  }
}

/// The samples of non-zero weight, in their order, with torques of weight 0 set to 0.
StackedSystem used_rows(TorqueSamples& samples, const Eigen::MatrixXd& weights) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index t = 0; t < weights.rows(); ++t) {
    if (!weights.row(t).isZero(0.0)) rows.push_back(t);
  }
  samples.q = samples.q(rows, Eigen::all).eval();
  samples.dq = samples.dq(rows, Eigen::all).eval();
  samples.ddq = samples.ddq(rows, Eigen::all).eval();
  samples.trajectory = samples.trajectory(rows).eval();
  StackedSystem system;
  system.weights = weights(rows, Eigen::all);
  system.torque = samples.torque(rows, Eigen::all);
  system.torque = (system.weights.array() > 0.0).select(system.torque, 0.0);
  samples.torque = system.torque;
  return system;
}

/// What the model's own masses and joints say.
Eigen::VectorXd prior_terms(const DynamicModel& model, const RigidModel& rigid,
                            const std::vector<TorqueTerm>& terms) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(terms.size()));
  const Eigen::VectorXd bodies = body_parameters(rigid);
  out.head(bodies.size()) = bodies;
  const std::vector<JointId> joints = moving_joints(model.tree);
  for (std::size_t k = 0; k < terms.size(); ++k) {
    if (terms[k].kind > TermKind::kCoulomb || terms[k].kind == TermKind::kInertial) continue;
    const JointDynamics& joint =
        model.joints[joints[static_cast<std::size_t>(terms[k].index)].index()];
    const auto at = static_cast<Eigen::Index>(k);
    if (terms[k].kind == TermKind::kMotorInertia) out[at] = joint.motor_inertia;
    if (terms[k].kind == TermKind::kViscous) out[at] = joint.viscous;
    if (terms[k].kind == TermKind::kCoulomb) out[at] = joint.coulomb;
  }
  return out;
}

/// What the normal matrix says about each direction; unmoved parameters get an infinite variance,
/// directions that only the ridge holds the size of the parameters themselves.
void judge_directions(const Eigen::MatrixXd& H, double ridge, Identification& out) {
  const Eigen::Index p = out.parameters.size();
  const Eigen::VectorXd diagonal = H.diagonal().head(p);
  const Eigen::VectorXd length = (diagonal.array() > 0.0).select(diagonal.cwiseSqrt(), 1.0);
  const Eigen::VectorXd inverse = length.cwiseInverse();
  const Eigen::MatrixXd scaled =
      inverse.asDiagonal() * H.topLeftCorner(p, p) * inverse.asDiagonal();
  const SymmetricEigen eigen = symmetric_eigen(scaled);
  const Eigen::VectorXd& values = eigen.values;
  out.condition = std::sqrt(values[p - 1] / std::max(values[0], 1e-300));
  const double size = length.cwiseProduct(out.parameters).norm();
  for (Eigen::Index k = 0; k < p && values[k] < 10.0 * ridge; ++k) {
    const Eigen::VectorXd direction = size * inverse.cwiseProduct(eigen.vectors.col(k));
    out.covariance += direction * direction.transpose();
  }
  for (Eigen::Index k = 0; k < p; ++k) {
    if (diagonal[k] > 0.0) continue;
    out.undetermined.push_back(static_cast<int>(k));
    out.covariance.row(k).setZero();
    out.covariance.col(k).setZero();
    out.covariance(k, k) = std::numeric_limits<double>::infinity();
  }
}

void keep_fit(const WeightedFit& fit, const GainSystem& gains, const StackedSystem& system,
              RobustLoss loss, Identification& out) {
  const Eigen::Index p = static_cast<Eigen::Index>(out.basis.kept.size());
  out.parameters = fit.parameters.head(p);
  out.gains = gains.gains();
  out.iterations = fit.iterations;
  out.status = fit.converged ? IdentifyStatus::kConverged : IdentifyStatus::kIterationLimit;
  out.sigma = fit.sigma;
  // Student's scale is not a standard deviation; for normal noise the ratio is this (4 degrees of
  // freedom).
  if (loss == RobustLoss::kStudent) out.sigma *= 1.2;
  const auto joints = system.torque.cols();
  out.used = (system.weights.array() > 0.0).cast<int>().matrix().colwise().sum().transpose();
  out.down_weighted.resize(joints);
  for (Eigen::Index j = 0; j < joints; ++j) {
    const auto low =
        (fit.robust_weights.col(j).array() < 0.5 && system.weights.col(j).array() > 0.0);
    out.down_weighted[j] = static_cast<double>(low.count()) / std::max(1, out.used[j]);
  }
  out.fit_error_percent =
      normalised_error_percent(system.torque, system.torque - fit.residuals, system.weights);
}

void estimate_covariance(const TorqueSamples& samples, const StackedSystem& system,
                         const WeightedFit& fit, const GainSystem& gains,
                         const IdentifyOptions& options, Identification& out) {
  const Eigen::Index p = out.parameters.size();
  const Eigen::MatrixXd whitened = fit.residuals.cwiseProduct(fit.final_weights.cwiseSqrt());
  out.correlation_samples = identify::correlation_samples(whitened, samples.trajectory);
  const std::vector<identify::Block> blocks = identify::make_blocks(
      samples.trajectory, options.block_correlations * out.correlation_samples,
      options.fewest_blocks);
  out.blocks = static_cast<int>(blocks.size());
  const double rows_per_block = static_cast<double>(samples.trajectory.size()) / out.blocks;
  out.short_blocks = rows_per_block < 3.0 * out.correlation_samples;
  const Eigen::MatrixXd covariance =
      identify::jackknife_covariance(system, fit, options.ridge, blocks);
  out.covariance = covariance.topLeftCorner(p, p);
  out.gain_sigma = Eigen::VectorXd::Zero(out.gains.size());
  for (std::size_t k = 0; k < gains.free().size(); ++k) {
    const Eigen::Index at = p + static_cast<Eigen::Index>(k);
    out.gain_sigma[gains.free()[k]] = std::sqrt(covariance(at, at));
  }
  const Eigen::Index rows = system.torque.rows();
  const Eigen::MatrixXd H = identify::gram(system, fit.curvature, 0, rows);
  const Eigen::MatrixXd scores =
      identify::gram(system, fit.final_weights.cwiseProduct(fit.residuals).cwiseAbs2(), 0, rows);
  const ScaledSolver solver(H, options.ridge);
  out.white_covariance = solver.solve(solver.solve(scores).transpose()).topLeftCorner(p, p);
  out.information = H.topLeftCorner(p, p);
  judge_directions(H, options.ridge, out);
}

}  // namespace

double Identification::sigma_of(Eigen::Index parameter) const {
  return std::sqrt(covariance(parameter, parameter));
}

Identification identify_dynamics(const DynamicModel& model, const TorqueSamples& samples,
                                 const IdentifyOptions& options, const Eigen::MatrixXd& weights) {
  Identification out;
  out.prior = model;
  out.rigid = make_rigid_model(model);
  out.drives = options.drives;
  TorqueSamples rows = samples;
  const Eigen::MatrixXd all_weights =
      weights.size() > 0 ? weights
                         : Eigen::MatrixXd::Ones(samples.torque.rows(), samples.torque.cols());
  check_samples(out.rigid, rows, all_weights);
  out.terms = torque_terms(out.rigid, options.drives);
  out.basis = independent_terms(out.rigid, options.drives, out.terms);
  StackedSystem system = used_rows(rows, all_weights);
  const auto count = static_cast<Eigen::Index>(out.basis.kept.size());
  if ((system.weights.array() > 0.0).count() <= 2 * count ||
      rows.q.rows() < options.fewest_blocks) {
    throw undetermined("identification",
                       fmt::format("{} samples for {} parameters", rows.q.rows(), count),
                       "record a longer motion of all joints");
  }
  std::vector<std::string> names;
  std::vector<TorqueTerm> kept;
  for (const TorqueTerm& term : out.terms) names.push_back(term.name);
  for (std::size_t k = 0; k < out.basis.kept.size(); ++k) {
    kept.push_back(out.terms[static_cast<std::size_t>(out.basis.kept[k])]);
    out.names.push_back(combination_name(out.basis.regroup.row(static_cast<Eigen::Index>(k)), names,
                                         out.basis.kept[k]));
  }
  std::vector<Eigen::MatrixXd> columns =
      term_columns(out.rigid, options.drives, kept, rows.q, rows.dq, rows.ddq);
  identify::clear_columns_at_rest(identify::usual_sizes(out.rigid, options.drives, kept), columns);
  for (const Eigen::MatrixXd& all : columns) {
    system.joints.push_back(identify::compact_columns(all));
  }
  system.parameters = count;
  const WeightedFitOptions fit_options{
      .loss = options.loss,
      .ridge = options.ridge,
      .prior = out.basis.regroup * prior_terms(model, out.rigid, out.terms),
      .max_iterations = options.max_iterations};
  GainSystem gains(std::move(system), options.gains, options.gain_reference);
  gains.find_gains(fit_options);
  const StackedSystem final_system = gains.final_system();
  const WeightedFitOptions final_options = gains.padded(fit_options);
  const WeightedFit fit = weighted_fit(final_system, final_options);
  gains.take(fit.parameters);
  keep_fit(fit, gains, final_system, options.loss, out);
  estimate_covariance(rows, final_system, fit, gains, options, out);
  return out;
}

}  // namespace kinescope
