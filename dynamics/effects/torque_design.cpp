// SPDX-License-Identifier: Apache-2.0
//
// The linearised rows of a fit and their normal equations, joint by joint.
#include <algorithm>
#include <cmath>

#include "dynamics/effects/candidates.h"
#include "dynamics/effects/torque_parts.h"

namespace kinescope::effects {
namespace {

void add(JointTorques& sum, const JointTorques& torques, double factor) {
  for (std::size_t j = 0; j < torques.size(); ++j) {
    if (torques[j].size() == 0 || factor == 0.0) continue;
    if (sum[j].size() == 0) {
      sum[j] = factor * torques[j];
    } else {
      sum[j] += factor * torques[j];
    }
  }
}

/// Torque of an effect, a unit of each parameter.
std::vector<JointTorques> torques_of(const GravityCase& gravity, const Candidate& candidate,
                                     double scan) {
  std::vector<JointTorques> out;
  for (const EffectColumn& column : candidate.columns(scan)) {
    JointTorques torques = gravity.carrier_torques[static_cast<std::size_t>(column.carrier)];
    if (column.share.size() > 0) {
      for (Eigen::VectorXd& torque : torques) {
        if (torque.size() > 0) torque = torque.cwiseProduct(column.share).eval();
      }
    }
    out.push_back(std::move(torques));
  }
  return out;
}

}  // namespace

Eigen::MatrixXd TorqueFitter::observed() const {
  Eigen::MatrixXd torque = parts_.motion->rows_at_instants(parts_.motion->samples().torque);
  for (const Added& added : added_) {
    if (added.kind != Kind::kDelay) continue;
    torque.col(added.joint) = parts_.motion->at_instants(
        parts_.motion->shifted(parts_.motion->samples().torque.col(added.joint), added.values[0]));
  }
  return torque;
}

Eigen::MatrixXd TorqueFitter::sensor() const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Identity(joints_, joints_);
  for (const Added& added : added_) {
    if (added.kind == Kind::kGain) out(added.joint, added.joint) += added.values[0];
    if (added.kind == Kind::kCross) out(added.joint, added.from) += added.values[0];
  }
  return out;
}

/// Time constant of a joint's low-pass.
double TorqueFitter::lag_s(Eigen::Index joint) const {
  double out = 0.0;
  for (const Added& added : added_) {
    if (added.kind == Kind::kLag && added.joint == joint) out += added.values[0];
  }
  return out;
}

/// Torques of the joints, instants x joints, behind their low-passes.
Eigen::MatrixXd TorqueFitter::lagged(Eigen::MatrixXd torque) const {
  for (Eigen::Index j = 0; j < joints_; ++j) {
    const double constant_s = lag_s(j);
    if (constant_s > 0.0)
      torque.col(j) = parts_.motion->lagged_at_instants(torque.col(j), constant_s);
  }
  return torque;
}

/// What the sensors show of a torque.
JointTorques TorqueFitter::seen(const JointTorques& torques, const Eigen::MatrixXd& sensor) const {
  JointTorques out(torques.size());
  for (std::size_t j = 0; j < torques.size(); ++j) {
    for (std::size_t from = 0; from < torques.size(); ++from) {
      const double share = sensor(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(from));
      JointTorques part(torques.size());
      part[j] = torques[from];
      add(out, part, share);
    }
    const double constant_s = lag_s(static_cast<Eigen::Index>(j));
    if (constant_s > 0.0 && out[j].size() > 0)
      out[j] = parts_.motion->lagged_at_instants(out[j], constant_s);
  }
  return out;
}

/// d lagged / d constant: with L = 1 / (1 + constant s), -s L^2 = (L^2 - L) / constant.
Eigen::VectorXd TorqueFitter::lag_column(const Eigen::VectorXd& torque, double constant_s) const {
  constexpr double kNearlyNone_s = 1e-6;  // the same formula where there is none yet
  const double constant = std::max(constant_s, kNearlyNone_s);
  const Eigen::VectorXd once = parts_.motion->lagged_at_instants(torque, constant);
  return (parts_.motion->lagged_at_instants(once, constant) - once) / constant;
}

/// Of the effects that are no matter of the sensors, at the present state.
void TorqueFitter::make_torques() {
  for (Added& added : added_) {
    if (added.kind != Kind::kLinear && added.kind != Kind::kGravity) continue;
    const double scan = added.kind == Kind::kGravity ? 0.0 : added.effect.scan;
    added.torques = torques_of(*case_, candidate_of(candidates_, added.effect.id), scan);
  }
}

/// Torque of the rigid bodies and of all effects that are no matter of the sensors.
Eigen::MatrixXd TorqueFitter::physical() const {
  Eigen::MatrixXd out = case_->fixed;
  for (Eigen::Index j = 0; j < joints_; ++j) {
    out.col(j).noalias() += case_->base[static_cast<std::size_t>(j)] * base_values_;
  }
  for (const Eigen::Index joint : turning_) out.col(joint) += declared_coulomb(joint, context_);
  for (const Added& added : added_) {
    if (added.kind != Kind::kLinear) continue;
    for (std::size_t k = 0; k < added.torques.size(); ++k) {
      for (Eigen::Index j = 0; j < joints_; ++j) {
        const Eigen::VectorXd& torque = added.torques[k][static_cast<std::size_t>(j)];
        if (torque.size() > 0) out.col(j) += added.values[static_cast<Eigen::Index>(k)] * torque;
      }
    }
  }
  return out;
}

/// d measured / d parameter of all effects at the present values, not whitened.
std::vector<JointTorques> TorqueFitter::measured_columns(const Eigen::MatrixXd& physical) const {
  const Eigen::MatrixXd S = sensor();
  std::vector<JointTorques> out;
  for (const Added& added : added_) {
    JointTorques own(static_cast<std::size_t>(joints_));
    Eigen::VectorXd& at_joint = own[static_cast<std::size_t>(added.joint)];
    switch (added.kind) {
      case Kind::kDelay: {
        const Eigen::VectorXd& all = parts_.motion->samples().torque.col(added.joint);
        at_joint = -parts_.motion->at_instants(
            parts_.motion->shifted(parts_.motion->rate(all), added.values[0]));
        out.push_back(std::move(own));
        break;
      }
      case Kind::kLag:
        at_joint = lag_column(physical * S.row(added.joint).transpose(), lag_s(added.joint));
        out.push_back(std::move(own));
        break;
      case Kind::kGain:
      case Kind::kCross:
        at_joint = parts_.motion->lagged_at_instants(
            physical.col(added.kind == Kind::kGain ? added.joint : added.from), lag_s(added.joint));
        out.push_back(std::move(own));
        break;
      default:
        for (const JointTorques& torques : added.torques) out.push_back(seen(torques, S));
    }
  }
  return out;
}

Eigen::VectorXd TorqueFitter::declared_coulomb(Eigen::Index joint,
                                               const EffectContext& context) const {
  if (parts_.coulomb[joint] == 0.0) return Eigen::VectorXd::Zero(instants_);
  return parts_.coulomb[joint] * direction_column(context, static_cast<std::size_t>(joint));
}

/// All friction that turns round with a joint's speed, with widths `factor` as large: instants x
/// turning joints.
Eigen::MatrixXd TorqueFitter::turning_friction(double factor) const {
  auto context = std::make_shared<EffectContext>(context_);
  context->widths *= factor;
  Eigen::MatrixXd out(instants_, free_widths());
  for (Eigen::Index k = 0; k < free_widths(); ++k) {
    const Eigen::Index joint = turning_[static_cast<std::size_t>(k)];
    std::vector<Candidate> candidates;
    add_friction_of(context, static_cast<std::size_t>(joint), candidates);
    out.col(k) = declared_coulomb(joint, *context);
    for (const Added& added : added_) {
      const auto found = std::ranges::find(candidates, added.effect.id, &Candidate::id);
      if (found == candidates.end()) continue;
      const std::vector<EffectColumn> columns = found->columns(added.effect.scan);
      for (std::size_t c = 0; c < columns.size(); ++c) {
        out.col(k) += added.values[static_cast<Eigen::Index>(c)] * columns[c].share;
      }
    }
  }
  return out;
}

/// d torque / d logarithm of the width of each joint that turns.
Eigen::MatrixXd TorqueFitter::width_columns() const {
  constexpr double kStep = 0.05;
  if (free_widths() == 0) return Eigen::MatrixXd(instants_, 0);
  return (turning_friction(std::exp(kStep)) - turning_friction(std::exp(-kStep))) / (2.0 * kStep);
}

void TorqueFitter::put_base(Eigen::Index joint, const Eigen::MatrixXd& sensor) {
  const auto j = static_cast<std::size_t>(joint);
  JointDesign& rows = design_[j];
  Eigen::RowVectorXd others = sensor.row(joint);
  others[joint] = 0.0;
  const double inverse = 1.0 / parts_.base.sigma[joint];
  const double constant_s = lag_s(joint);
  if (others.isZero(0.0) && constant_s == 0.0) {
    rows.base = &case_->base[j];
    rows.base_squares = &case_->base_squares[j];
    rows.base_gain = sensor(joint, joint) * inverse;
    return;
  }
  rows.mixed = Eigen::MatrixXd::Zero(instants_, base_values_.size());
  for (Eigen::Index from = 0; from < joints_; ++from) {
    if (sensor(joint, from) == 0.0) continue;
    rows.mixed += sensor(joint, from) * case_->base[static_cast<std::size_t>(from)];
  }
  rows.mixed = parts_.motion->lagged_at_instants(rows.mixed, constant_s);
  rows.mixed_squares = rows.mixed.transpose() * rows.mixed;
  rows.base = &rows.mixed;
  rows.base_squares = &rows.mixed_squares;
  rows.base_gain = inverse;
}

void TorqueFitter::make_design() {
  make_torques();
  const Eigen::MatrixXd torque = physical();
  const Eigen::MatrixXd S = sensor();
  const Eigen::MatrixXd residual = observed() - lagged(torque * S.transpose());
  std::vector<JointTorques> columns;
  const Eigen::MatrixXd widths = width_columns();
  for (Eigen::Index k = 0; k < free_widths(); ++k) {
    JointTorques own(static_cast<std::size_t>(joints_));
    own[static_cast<std::size_t>(turning_[static_cast<std::size_t>(k)])] = widths.col(k);
    columns.push_back(seen(own, S));
  }
  std::ranges::move(measured_columns(torque), std::back_inserter(columns));
  design_.clear();
  design_.resize(static_cast<std::size_t>(joints_));
  for (Eigen::Index j = 0; j < joints_; ++j) {
    JointDesign& rows = design_[static_cast<std::size_t>(j)];
    const double inverse = 1.0 / parts_.base.sigma[j];
    put_base(j, S);
    rows.residual = inverse * residual.col(j);
    for (std::size_t c = 0; c < columns.size(); ++c) {
      if (columns[c][static_cast<std::size_t>(j)].size() == 0) continue;
      rows.parameters.push_back(base_values_.size() + static_cast<Eigen::Index>(c));
    }
    rows.columns.resize(instants_, std::ssize(rows.parameters));
    for (Eigen::Index c = 0; c < rows.columns.cols(); ++c) {
      const Eigen::Index parameter = rows.parameters[static_cast<std::size_t>(c)];
      const auto column = static_cast<std::size_t>(parameter - base_values_.size());
      rows.columns.col(c) = inverse * columns[column][static_cast<std::size_t>(j)];
    }
  }
}

TorqueFitter::Normal TorqueFitter::normal() const {
  const Eigen::Index p = base_values_.size();
  const Eigen::Index n = own_parameters() + effect_parameters_;
  Normal out{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
  for (const JointDesign& rows : design_) {
    out.squares += rows.residual.squaredNorm();
    out.H.topLeftCorner(p, p) += rows.base_gain * rows.base_gain * *rows.base_squares;
    out.g.head(p).noalias() += rows.base_gain * (rows.base->transpose() * rows.residual);
    const Eigen::MatrixXd cross = rows.base_gain * (rows.base->transpose() * rows.columns);
    const Eigen::MatrixXd squares = rows.columns.transpose() * rows.columns;
    const Eigen::VectorXd score = rows.columns.transpose() * rows.residual;
    for (Eigen::Index a = 0; a < score.size(); ++a) {
      const Eigen::Index at = rows.parameters[static_cast<std::size_t>(a)];
      out.g[at] += score[a];
      out.H.col(at).head(p) += cross.col(a);
      out.H.row(at).head(p) += cross.col(a).transpose();
      for (Eigen::Index b = 0; b < score.size(); ++b) {
        out.H(at, rows.parameters[static_cast<std::size_t>(b)]) += squares(a, b);
      }
    }
  }
  return out;
}

}  // namespace kinescope::effects
