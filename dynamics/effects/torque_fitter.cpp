// SPDX-License-Identifier: Apache-2.0
//
// measured(t + delay) = sensor * (rigid bodies + effects)(t) + noise: linear in nearly everything.
#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "dynamics/effects/candidates.h"
#include "dynamics/effects/torque_parts.h"
#include "dynamics/identify/block_jackknife.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/regressor.h"
#include "kinematics/core/error.h"

namespace kinescope::effects {
namespace {

constexpr int kMostSteps = 30;
constexpr double kSettled = 1e-9;   // of the residual's length
constexpr double kUnseen = 1e-10;   // base parameters: share of the largest direction's square
constexpr double kBasePrior = 1e-6; // of what the whole log says about a base parameter

/// Rows of instants x joints.
Eigen::VectorXd as_rows(const Eigen::MatrixXd& torque) {
  return torque.transpose().reshaped();
}

Eigen::MatrixXd as_matrix(const Eigen::VectorXd& rows, Eigen::Index joints) {
  return rows.reshaped(joints, rows.size() / joints).transpose();
}

bool is_coupling(const Candidate& candidate) { return candidate.parameters.size() > 1; }

}  // namespace

TorqueFitter::TorqueFitter(const TorqueTracedModel::Parts& parts,
                           const std::vector<AddedEffect>& effects)
    : parts_(parts),
      joints_(parts.motion->joints()),
      rows_(parts.motion->instants() * parts.motion->joints()) {
  read_widths(effects);
  set_gravity(Eigen::Vector2d::Zero());
  read(effects);
}

/// Friction that refines a joint's Coulomb friction turns round as that does.
void TorqueFitter::read_widths(const std::vector<AddedEffect>& effects) {
  widths_ = parts_.context.widths;
  for (const AddedEffect& effect : effects) {
    if (effect.id.effect != "coulomb") continue;
    const auto& names = parts_.context.joints;
    widths_[std::ranges::find(names, effect.id.place) - names.begin()] = effect.scan;
  }
}

void TorqueFitter::read(const std::vector<AddedEffect>& effects) {
  for (const AddedEffect& effect : effects) {
    const Candidate* candidate = library_.find(effect.id);
    KINESCOPE_CHECK(candidate != nullptr, "effects that `candidates` named");
    Added added;
    added.effect = effect;
    added.first = effect_parameters_;
    const auto count = static_cast<Eigen::Index>(candidate->parameters.size());
    added.values = Eigen::VectorXd::Zero(count);
    effect_parameters_ += count;
    const std::string& name = effect.id.effect;
    if (name == "torque_delay") added.kind = Kind::kDelay;
    if (name == "torque_gain") added.kind = Kind::kGain;
    if (name == "gravity_direction") added.kind = Kind::kGravity;
    if (name == "cross_talk" && !is_coupling(*candidate)) added.kind = Kind::kCross;
    const auto& names = parts_.context.joints;
    for (std::size_t j = 0; j < names.size(); ++j) {
      if (effect.id.place == names[j] || effect.id.place.starts_with(names[j] + " from ")) {
        added.joint = static_cast<Eigen::Index>(j);
      }
      if (effect.id.place.ends_with(" from " + names[j])) added.from = static_cast<Eigen::Index>(j);
    }
    added_.push_back(std::move(added));
  }
}

void TorqueFitter::set_gravity(const Eigen::Vector2d& tilt_deg) {
  tilt_deg_ = tilt_deg;
  const Eigen::Vector3d gravity = tilted(parts_.base.rigid.gravity_m_s2, tilt_deg);
  rigid_ = parts_.base.rigid;
  rigid_.gravity_m_s2 = gravity;
  context_ = parts_.context;
  context_.rigid.gravity_m_s2 = gravity;
  context_.widths = widths_;
  if (!tilt_deg.isZero(0.0)) {
    context_.load = inverse_dynamics_of_samples(context_.rigid, parts_.q, parts_.dq, parts_.ddq);
  }
  library_ = make_effect_library(context_);
  if (parts_.base.kind == TorqueBaseKind::kDeclared) {
    fixed_ = as_rows(inverse_dynamics_of_samples(rigid_, parts_.q, parts_.dq, parts_.ddq) +
                     parts_.drives);
    base_.resize(rows_, 0);
    bodies_.resize(0, 0);
    base_values_.resize(0);
    return;
  }
  fixed_ = Eigen::VectorXd::Zero(rows_);
  const std::vector<Eigen::MatrixXd> Y =
      regressors_of_samples(rigid_, parts_.q, parts_.dq, parts_.ddq);
  const Eigen::Index n = Y.front().cols();
  Eigen::MatrixXd all(rows_, n);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index j = 0; j < joints_; ++j) {
    const Eigen::MatrixXd& own = Y[static_cast<std::size_t>(j)];
    all(Eigen::seqN(j, own.rows(), joints_), Eigen::all) = own;
    H.noalias() += own.transpose() * own / std::pow(parts_.base.sigma[j], 2);
  }
  const Eigen::VectorXd diagonal = H.diagonal();
  const Eigen::VectorXd scale =
      (diagonal.array() > 0.0).select(diagonal.cwiseMax(1e-300).cwiseSqrt().cwiseInverse(), 0.0);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * H *
                                                             scale.asDiagonal());
  const Eigen::VectorXd& values = eigen.eigenvalues();
  Eigen::Index first = 0;
  while (first < n && !(values[first] > kUnseen * values[n - 1])) ++first;
  bodies_ = scale.asDiagonal() * eigen.eigenvectors().rightCols(n - first) *
            values.tail(n - first).cwiseSqrt().cwiseInverse().asDiagonal();
  base_ = all * bodies_;
  base_values_ = Eigen::VectorXd::Zero(base_.cols());
}

RigidModel TorqueFitter::rigid() const {
  if (parts_.base.kind == TorqueBaseKind::kDeclared) return rigid_;
  return with_body_parameters(rigid_, bodies_ * base_values_);
}

Eigen::VectorXd TorqueFitter::observed() const {
  Eigen::MatrixXd torque = parts_.motion->rows_at_instants(parts_.motion->samples().torque);
  for (const Added& added : added_) {
    if (added.kind != Kind::kDelay) continue;
    torque.col(added.joint) = parts_.motion->at_instants(parts_.motion->shifted(
        parts_.motion->samples().torque.col(added.joint), added.values[0]));
  }
  return as_rows(torque);
}

Eigen::MatrixXd TorqueFitter::sensor() const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Identity(joints_, joints_);
  for (const Added& added : added_) {
    if (added.kind == Kind::kGain) out(added.joint, added.joint) += added.values[0];
    if (added.kind == Kind::kCross) out(added.joint, added.from) += added.values[0];
  }
  return out;
}

Eigen::VectorXd TorqueFitter::through_sensor(const Eigen::VectorXd& rows) const {
  return (sensor() * rows.reshaped(joints_, rows.size() / joints_)).reshaped();
}

Eigen::VectorXd TorqueFitter::whitened(const Eigen::VectorXd& rows) const {
  const Eigen::VectorXd inverse = parts_.base.sigma.cwiseInverse();
  return (inverse.asDiagonal() * rows.reshaped(joints_, rows.size() / joints_)).reshaped();
}

/// Torque of the rigid bodies and of all effects that are no matter of the sensors.
Eigen::VectorXd TorqueFitter::physical() const {
  Eigen::VectorXd out = fixed_ + base_ * base_values_;
  for (const Added& added : added_) {
    if (added.kind != Kind::kLinear) continue;
    const Candidate* candidate = library_.find(added.effect.id);
    out += as_rows(effect_torque(library_, *candidate, added.effect.scan, added.values, joints_));
  }
  return out;
}

/// d measured / d parameter of all effects at the present values, rows x parameters, not whitened.
Eigen::MatrixXd TorqueFitter::effect_columns() const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(rows_, effect_parameters_);
  const Eigen::MatrixXd torque = as_matrix(physical(), joints_);
  for (const Added& added : added_) {
    if (added.kind == Kind::kDelay) {
      const Eigen::VectorXd& all = parts_.motion->samples().torque.col(added.joint);
      const Eigen::VectorXd late =
          parts_.motion->shifted(parts_.motion->rate(all), added.values[0]);
      out(Eigen::seqN(added.joint, torque.rows(), joints_), added.first) =
          -parts_.motion->at_instants(late);
    } else if (added.kind == Kind::kGain || added.kind == Kind::kCross) {
      const Eigen::Index from = added.kind == Kind::kGain ? added.joint : added.from;
      out(Eigen::seqN(added.joint, torque.rows(), joints_), added.first) = torque.col(from);
    } else {
      const Candidate* candidate = library_.find(added.effect.id);
      for (Eigen::Index k = 0; k < added.values.size(); ++k) {
        const Eigen::VectorXd unit = Eigen::VectorXd::Unit(added.values.size(), k);
        out.col(added.first + k) = through_sensor(
            as_rows(effect_torque(library_, *candidate, added.effect.scan, unit, joints_)));
      }
    }
  }
  return out;
}

void TorqueFitter::make_design() {
  const Eigen::Index p = base_.cols();
  design_.resize(rows_, p + effect_parameters_);
  for (Eigen::Index k = 0; k < p; ++k) {
    design_.col(k) = whitened(through_sensor(base_.col(k)));
  }
  const Eigen::MatrixXd effects = effect_columns();
  for (Eigen::Index k = 0; k < effect_parameters_; ++k) {
    design_.col(p + k) = whitened(effects.col(k));
  }
  residual_ = whitened(observed() - through_sensor(physical()));
}

/// One step of all parameters; gives its length beside the residual's.
double TorqueFitter::step() {
  make_design();
  const Eigen::Index p = base_.cols();
  const Eigen::Index n = design_.cols();
  if (n == 0) return 0.0;
  Eigen::MatrixXd H = design_.transpose() * design_;
  Eigen::VectorXd g = design_.transpose() * residual_;
  H.diagonal().head(p).array() += kBasePrior;
  g.head(p) -= kBasePrior * base_values_;
  const Eigen::VectorXd diagonal = H.diagonal();
  const Eigen::VectorXd scale =
      (diagonal.array() > 0.0).select(diagonal.cwiseMax(1e-300).cwiseSqrt().cwiseInverse(), 0.0);
  Eigen::MatrixXd scaled = scale.asDiagonal() * H * scale.asDiagonal();
  scaled.diagonal().array() += 1e-12;
  const Eigen::VectorXd change = scale.asDiagonal() * scaled.ldlt().solve(scale.asDiagonal() * g);
  base_values_ += change.head(p);
  Eigen::Vector2d tilt = tilt_deg_;
  for (Added& added : added_) {
    const Eigen::VectorXd own = change.segment(p + added.first, added.values.size());
    added.values += own;
    if (added.kind == Kind::kGravity) tilt = added.values;
  }
  const double length = (design_ * change).norm() / std::max(residual_.norm(), 1e-300);
  if (tilt != tilt_deg_) {
    const RigidModel now = rigid();
    set_gravity(tilt);
    // The tilt's columns at the masses found; what the log does not show of them stays unknown.
    if (parts_.base.kind == TorqueBaseKind::kIdentified) {
      context_.rigid = now;
      context_.rigid.gravity_m_s2 = rigid_.gravity_m_s2;
      library_ = make_effect_library(context_);
    }
  }
  return length;
}

/// A base on a wall is far from one on the floor: the axes' directions are tried first.
void TorqueFitter::choose_gravity_start(Added& gravity) {
  constexpr double kRight = 90.0;
  const std::array<Eigen::Vector2d, 6> starts = {
      Eigen::Vector2d{0, 0},      Eigen::Vector2d{kRight, 0}, Eigen::Vector2d{-kRight, 0},
      Eigen::Vector2d{0, kRight}, Eigen::Vector2d{0, -kRight}, Eigen::Vector2d{2.0 * kRight, 0}};
  double best = std::numeric_limits<double>::infinity();
  Eigen::Vector2d chosen = starts[0];
  for (const Eigen::Vector2d& start : starts) {
    for (Added& added : added_) added.values.setZero();
    gravity.values = start;
    set_gravity(start);
    // What is left when all that is linear is fitted and the tilt stays.
    make_design();
    const Eigen::Index p = base_.cols();
    Eigen::MatrixXd columns(rows_, design_.cols() - 2);
    columns << design_.leftCols(p + gravity.first), design_.rightCols(effect_parameters_ - gravity.first - 2);
    double cost = residual_.squaredNorm();
    if (columns.cols() > 0) {
      Eigen::MatrixXd H = columns.transpose() * columns;
      H.diagonal().array() *= 1.0 + 1e-10;
      H.diagonal().array() += 1e-12;
      const Eigen::VectorXd g = columns.transpose() * residual_;
      cost -= g.dot(H.ldlt().solve(g));
    }
    if (cost < best) {
      best = cost;
      chosen = start;
    }
  }
  for (Added& added : added_) added.values.setZero();
  gravity.values = chosen;
  set_gravity(chosen);
}

TracedFit TorqueFitter::run() {
  const auto gravity = std::ranges::find(added_, Kind::kGravity, &Added::kind);
  if (gravity != added_.end()) choose_gravity_start(*gravity);
  bool converged = false;
  for (int k = 0; k < kMostSteps && !converged; ++k) converged = step() < kSettled;
  make_design();
  return read_back(converged && residual_.allFinite());
}

/// Only waves may come several times: of all else a second one would mend the first one's shape.
bool TorqueFitter::is_open(const EffectId& id) const {
  if (id.effect == "ripple") return true;
  return std::ranges::none_of(added_, [&](const Added& a) { return a.effect.id == id; });
}

TracedFit TorqueFitter::read_back(bool converged) const {
  TracedFit out;
  out.converged = converged;
  if (!converged) out.reason = "delay, gain or gravity did not settle";
  Linearisation& linear = out.linear;
  linear.residual = residual_;
  linear.jacobian = design_;
  linear.prior = Eigen::MatrixXd::Zero(design_.cols(), design_.cols());
  linear.prior.diagonal().head(base_.cols()).setConstant(kBasePrior);
  linear.carriers = library_.carriers;
  for (int c = 0; c < linear.carriers.outerSize(); ++c) {
    for (Eigen::SparseMatrix<double>::InnerIterator e(linear.carriers, c); e; ++e) {
      e.valueRef() /= parts_.base.sigma[e.row() % joints_];
    }
  }
  const Eigen::Index instants = parts_.motion->instants();
  for (Eigen::Index i = 0; i <= instants; ++i) linear.first_row.push_back(i * joints_);
  linear.time_s = parts_.motion->at_instants(parts_.motion->time_s());
  for (const Eigen::Index row : parts_.motion->kept()) {
    linear.fold.push_back(parts_.fold[static_cast<std::size_t>(row)]);
  }
  linear.unit = parts_.base.sigma.replicate(instants, 1);
  linear.unit_name = parts_.context.torque_unit == "Nm" ? "N m" : parts_.context.torque_unit;
  const Eigen::VectorXi trajectory = parts_.motion->samples().trajectory(parts_.motion->kept());
  linear.correlation_time_s =
      identify::correlation_samples(as_matrix(residual_, joints_), trajectory) *
      (linear.time_s[instants - 1] - linear.time_s[0]) / static_cast<double>(instants);
  for (const Added& added : added_) out.values.push_back(added.values);
  EffectContext now = context_;
  now.torque = as_matrix(physical(), joints_);
  for (Candidate& candidate : make_effect_library(now).candidates) {
    if (is_open(candidate.id)) out.candidates.push_back(std::move(candidate));
  }
  const auto& names = parts_.context.joints;
  for (std::size_t j = 0; j < names.size(); ++j) {
    const auto c = static_cast<Eigen::Index>(j);
    const std::string rate = parts_.context.angle(j) + "/s";
    out.covariates.push_back({"value of " + names[j], parts_.context.angle(j), parts_.q.col(c)});
    out.covariates.push_back({"speed of " + names[j], rate, parts_.dq.col(c)});
    out.covariates.push_back(
        {"acceleration of " + names[j], rate + "^2", parts_.ddq.col(c)});
    out.covariates.push_back({"load of " + names[j], parts_.context.unit(j), context_.load.col(c)});
    out.rest_places.push_back({names[j], parts_.context.unit(j), static_cast<int>(j)});
  }
  out.covariates.push_back({"time", "s", linear.time_s});
  if (parts_.context.temperature_c.size() > 0) {
    out.covariates.push_back({"temperature", "deg C", parts_.context.temperature_c});
  }
  return out;
}

}  // namespace kinescope::effects
