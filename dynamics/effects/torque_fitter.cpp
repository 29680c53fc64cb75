// SPDX-License-Identifier: Apache-2.0
//
// measured(t + delay) = sensor * (rigid bodies + effects)(t) + noise: linear in nearly everything.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "dynamics/effects/candidates.h"
#include "dynamics/effects/torque_parts.h"
#include "kinematics/core/error.h"

namespace kinescope::effects {
namespace {

constexpr int kMostSteps = 40;
constexpr double kSettled = 1e-5;    // of the residual's length
constexpr double kBasePrior = 1e-6;  // of what the whole log says about a base parameter
// Widths of the turn of friction: within these factors of the nominal one, by which they are drawn
// (a log that does not show them leaves them there).
constexpr double kNarrowest = 0.05;
constexpr double kWidest = 4.0;
constexpr double kWidthPrior = 1.0;  // of the logarithm

/// Rows of instants x joints.
Eigen::VectorXd as_rows(const Eigen::MatrixXd& torque) { return torque.transpose().reshaped(); }

Eigen::MatrixXd as_matrix(const Eigen::VectorXd& rows, Eigen::Index joints) {
  return rows.reshaped(joints, rows.size() / joints).transpose();
}

bool is_coupling(const Candidate& candidate) { return candidate.parameters.size() > 1; }

/// H x = g with columns scaled to length 1; directions that nothing determines stay.
Eigen::VectorXd scaled_solve(const Eigen::MatrixXd& H, const Eigen::VectorXd& g) {
  const Eigen::VectorXd diagonal = H.diagonal();
  const Eigen::VectorXd scale =
      (diagonal.array() > 0.0).select(diagonal.cwiseMax(1e-300).cwiseSqrt().cwiseInverse(), 0.0);
  Eigen::MatrixXd scaled = scale.asDiagonal() * H * scale.asDiagonal();
  scaled.diagonal().array() += 1e-12;
  return scale.asDiagonal() * scaled.ldlt().solve(scale.asDiagonal() * g);
}

const Candidate& candidate_of(const std::vector<Candidate>& candidates, const EffectId& id) {
  const auto found = std::ranges::find(candidates, id, &Candidate::id);
  KINESCOPE_CHECK(found != candidates.end(), "effects that `candidates` named");
  return *found;
}

}  // namespace

TorqueFitter::TorqueFitter(const TorqueTracedModel::Parts& parts,
                           const std::vector<AddedEffect>& effects)
    : parts_(parts),
      joints_(parts.motion->joints()),
      rows_(parts.motion->instants() * parts.motion->joints()) {
  set_gravity(Eigen::Vector2d::Zero());
  for (Eigen::Index j = 0; j < joints_; ++j) {
    if (parts_.coulomb[j] > 0.0) turning_.push_back(j);
  }
  read(effects);
}

void TorqueFitter::read(const std::vector<AddedEffect>& effects) {
  for (const AddedEffect& effect : effects) {
    const Candidate& candidate = candidate_of(candidates_, effect.id);
    Added added;
    added.effect = effect;
    added.first = effect_parameters_;
    added.values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(candidate.parameters.size()));
    effect_parameters_ += added.values.size();
    const std::string& name = effect.id.effect;
    if (name == "torque_delay") added.kind = Kind::kDelay;
    if (name == "torque_gain") added.kind = Kind::kGain;
    if (name == "gravity_direction") added.kind = Kind::kGravity;
    if (name == "cross_talk" && !is_coupling(candidate)) added.kind = Kind::kCross;
    const auto& names = parts_.context.joints;
    for (std::size_t j = 0; j < names.size(); ++j) {
      if (effect.id.place == names[j] || effect.id.place.starts_with(names[j] + " ")) {
        added.joint = static_cast<Eigen::Index>(j);
      }
      if (effect.id.place.ends_with(" from " + names[j])) added.from = static_cast<Eigen::Index>(j);
    }
    const bool turns = std::ranges::find(turning_, added.joint) != turning_.end();
    if (name == "coulomb" && !turns) turning_.push_back(added.joint);
    added_.push_back(std::move(added));
  }
}

void TorqueFitter::set_gravity(const Eigen::Vector2d& tilt_deg) {
  case_ = tilt_deg.isZero(0.0) ? parts_.upright : make_gravity_case(parts_, tilt_deg);
  const Eigen::VectorXd widths = context_.widths;
  context_ = case_->context;
  if (widths.size() > 0) context_.widths = widths;
  candidates_ = make_candidates(context_);
  base_values_ = Eigen::VectorXd::Zero(case_->base.cols());
}

void TorqueFitter::set_widths(const Eigen::VectorXd& widths) {
  context_.widths = widths;
  candidates_ = make_candidates(context_);
}

FittedTorque TorqueFitter::fitted() const {
  FittedTorque out{case_->rigid, context_.widths, parts_.viscous, parts_.coulomb};
  if (parts_.base.kind == TorqueBaseKind::kIdentified) {
    out.rigid = with_body_parameters(case_->rigid, case_->bodies * base_values_);
  }
  return out;
}

Eigen::VectorXd TorqueFitter::observed() const {
  Eigen::MatrixXd torque = parts_.motion->rows_at_instants(parts_.motion->samples().torque);
  for (const Added& added : added_) {
    if (added.kind != Kind::kDelay) continue;
    torque.col(added.joint) = parts_.motion->at_instants(
        parts_.motion->shifted(parts_.motion->samples().torque.col(added.joint), added.values[0]));
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
  Eigen::VectorXd out = case_->fixed + case_->base * base_values_;
  for (const Eigen::Index joint : turning_) out += declared_coulomb(joint, context_);
  for (const Added& added : added_) {
    if (added.kind != Kind::kLinear) continue;
    out += as_rows(effect_torque(case_->carriers, candidate_of(candidates_, added.effect.id),
                                 added.effect.scan, added.values, joints_));
  }
  return out;
}

/// d measured / d parameter of all effects at the present values, rows x parameters, not whitened.
Eigen::MatrixXd TorqueFitter::effect_columns() const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(rows_, effect_parameters_);
  const Eigen::MatrixXd torque = as_matrix(physical(), joints_);
  for (const Added& added : added_) {
    const auto own_rows = Eigen::seqN(added.joint, torque.rows(), joints_);
    if (added.kind == Kind::kDelay) {
      const Eigen::VectorXd& all = parts_.motion->samples().torque.col(added.joint);
      const Eigen::VectorXd late =
          parts_.motion->shifted(parts_.motion->rate(all), added.values[0]);
      out(own_rows, added.first) = -parts_.motion->at_instants(late);
    } else if (added.kind == Kind::kGain || added.kind == Kind::kCross) {
      out(own_rows, added.first) = torque.col(added.kind == Kind::kGain ? added.joint : added.from);
    } else {
      const Candidate& candidate = candidate_of(candidates_, added.effect.id);
      const double scan = added.kind == Kind::kGravity ? 0.0 : added.effect.scan;
      for (Eigen::Index k = 0; k < added.values.size(); ++k) {
        const Eigen::VectorXd unit = Eigen::VectorXd::Unit(added.values.size(), k);
        out.col(added.first + k) =
            through_sensor(as_rows(effect_torque(case_->carriers, candidate, scan, unit, joints_)));
      }
    }
  }
  return out;
}

Eigen::VectorXd TorqueFitter::declared_coulomb(Eigen::Index joint,
                                               const EffectContext& context) const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(rows_);
  if (parts_.coulomb[joint] == 0.0) return out;
  out(Eigen::seqN(joint, rows_ / joints_, joints_)) =
      parts_.coulomb[joint] * direction_column(context, static_cast<std::size_t>(joint));
  return out;
}

/// All of a joint's friction that turns round with its speed, for a width of that.
Eigen::VectorXd TorqueFitter::friction_of(Eigen::Index joint, double width) const {
  EffectContext context = context_;
  context.widths[joint] = width;
  std::vector<Candidate> candidates;
  add_friction_of(std::make_shared<const EffectContext>(context), static_cast<std::size_t>(joint),
                  candidates);
  Eigen::VectorXd out = declared_coulomb(joint, context);
  for (const Added& added : added_) {
    const auto found = std::ranges::find(candidates, added.effect.id, &Candidate::id);
    if (found == candidates.end()) continue;
    out +=
        as_rows(effect_torque(case_->carriers, *found, added.effect.scan, added.values, joints_));
  }
  return out;
}

/// d measured / d logarithm of the width of each joint that turns.
Eigen::MatrixXd TorqueFitter::width_columns() const {
  constexpr double kStep = 0.05;
  Eigen::MatrixXd out(rows_, free_widths());
  for (Eigen::Index k = 0; k < free_widths(); ++k) {
    const Eigen::Index joint = turning_[static_cast<std::size_t>(k)];
    const double width = context_.widths[joint];
    out.col(k) = through_sensor(friction_of(joint, width * std::exp(kStep)) -
                                friction_of(joint, width * std::exp(-kStep))) /
                 (2.0 * kStep);
  }
  return out;
}

void TorqueFitter::make_design() {
  const Eigen::Index p = base_values_.size();
  design_.resize(rows_, own_parameters() + effect_parameters_);
  for (Eigen::Index k = 0; k < p; ++k) {
    design_.col(k) = whitened(through_sensor(case_->base.col(k)));
  }
  const Eigen::MatrixXd widths = width_columns();
  for (Eigen::Index k = 0; k < widths.cols(); ++k) design_.col(p + k) = whitened(widths.col(k));
  const Eigen::MatrixXd effects = effect_columns();
  for (Eigen::Index k = 0; k < effect_parameters_; ++k) {
    design_.col(own_parameters() + k) = whitened(effects.col(k));
  }
  residual_ = whitened(observed() - through_sensor(physical()));
}

Eigen::MatrixXd TorqueFitter::own_prior() const {
  const Eigen::Index n = own_parameters() + effect_parameters_;
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  out.diagonal().head(base_values_.size()).setConstant(kBasePrior);
  out.diagonal().segment(base_values_.size(), free_widths()).setConstant(kWidthPrior);
  return out;
}

/// One step of all parameters; gives its length beside the residual's.
double TorqueFitter::step() {
  make_design();
  if (design_.cols() == 0) return 0.0;
  const Eigen::Index p = base_values_.size();
  Eigen::MatrixXd H = design_.transpose() * design_;
  Eigen::VectorXd g = design_.transpose() * residual_;
  H += own_prior();
  g.head(p) -= kBasePrior * base_values_;
  for (Eigen::Index k = 0; k < free_widths(); ++k) {
    const Eigen::Index joint = turning_[static_cast<std::size_t>(k)];
    g[p + k] -= kWidthPrior * std::log(context_.widths[joint] / parts_.context.widths[joint]);
  }
  const Eigen::VectorXd change = scaled_solve(H, g);
  const double length = (design_ * change).norm() / std::max(residual_.norm(), 1e-300);
  apply(change);
  return length;
}

void TorqueFitter::apply(const Eigen::VectorXd& change) {
  constexpr double kLongest = 0.5;  // step of a width's logarithm
  const Eigen::Index p = base_values_.size();
  base_values_ += change.head(p);
  Eigen::Vector2d tilt = case_->tilt_deg;
  for (Added& added : added_) {
    added.values += change.segment(own_parameters() + added.first, added.values.size());
    if (added.kind == Kind::kGravity) tilt = added.values;
  }
  Eigen::VectorXd widths = context_.widths;
  for (Eigen::Index k = 0; k < free_widths(); ++k) {
    const Eigen::Index joint = turning_[static_cast<std::size_t>(k)];
    const double nominal = parts_.context.widths[joint];
    widths[joint] =
        std::clamp(widths[joint] * std::exp(std::clamp(change[p + k], -kLongest, kLongest)),
                   kNarrowest * nominal, kWidest * nominal);
  }
  if (tilt != case_->tilt_deg) {
    const RigidModel now = fitted().rigid;
    set_gravity(tilt);
    // The tilt's columns at the masses found; what the log does not show of them stays unknown.
    if (parts_.base.kind == TorqueBaseKind::kIdentified) {
      auto found = std::make_shared<GravityCase>(*case_);
      found->context.rigid = now;
      found->context.rigid.gravity_m_s2 = case_->rigid.gravity_m_s2;
      found->carriers = make_carriers(found->context);
      case_ = found;
    }
  }
  if (free_widths() > 0) set_widths(widths);
}

/// A base on a wall is far from one on the floor: the axes' directions are tried first.
void TorqueFitter::choose_gravity_start(Added& gravity) {
  const auto starts = gravity_starts();
  double best = std::numeric_limits<double>::infinity();
  Eigen::Vector2d chosen = starts[0];
  for (const Eigen::Vector2d& start : starts) {
    gravity.values = start;
    set_gravity(start);
    make_design();
    // What is left when all that is linear is fitted and the tilt stays.
    const Eigen::Index at = own_parameters() + gravity.first;
    design_.middleCols(at, gravity.values.size()).setZero();
    const Eigen::VectorXd g = design_.transpose() * residual_;
    const double cost =
        residual_.squaredNorm() - g.dot(scaled_solve(design_.transpose() * design_, g));
    if (cost < best) {
      best = cost;
      chosen = start;
    }
  }
  gravity.values = chosen;
  set_gravity(chosen);
}

TracedFit TorqueFitter::run() {
  const auto gravity = std::ranges::find(added_, Kind::kGravity, &Added::kind);
  if (gravity != added_.end()) choose_gravity_start(*gravity);
  bool converged = false;
  for (int k = 0; k < kMostSteps && !converged; ++k) converged = step() < kSettled;
  make_design();
  return read_back(residual_.allFinite());
}

}  // namespace kinescope::effects
