// SPDX-License-Identifier: Apache-2.0
//
// A fit as calib/trace takes it.
#include <algorithm>

#include <Eigen/SVD>

#include "dynamics/effects/noise_reference.h"
#include "dynamics/effects/torque_parts.h"
#include "dynamics/identify/block_jackknife.h"

namespace kinescope::effects {

/// Only waves may come several times: of all else a second one would mend the first one's shape. So
/// would a low-pass beside a delay, the same to first order: each is in the other's place or not at
/// all.
bool TorqueFitter::is_open(const EffectId& id) const {
  if (id.effect == "ripple") return true;
  const auto is_late = [](const std::string& effect) {
    return effect == "torque_delay" || effect == "torque_lag";
  };
  return std::ranges::none_of(added_, [&](const Added& a) {
    const EffectId& other = a.effect.id;
    return other == id || (other.place == id.place && is_late(other.effect) && is_late(id.effect));
  });
}

/// Whitened, instants x joints.
Eigen::MatrixXd TorqueFitter::residual() const {
  Eigen::MatrixXd out(instants_, joints_);
  for (Eigen::Index j = 0; j < joints_; ++j) {
    out.col(j) = design_[static_cast<std::size_t>(j)].residual;
  }
  return out;
}

/// Integral time of the noise, in instants: not of what the model still lacks, which the widest
/// description knows best, nor of what that lacks and the model has by now. What is left in either
/// makes it seem longer.
double TorqueFitter::noise_memory(const Eigen::VectorXi& trajectory) const {
  constexpr double kBothSides = 0.5;
  return kBothSides * std::min(identify::correlation_samples(parts_.widest, trajectory),
                               identify::correlation_samples(residual(), trajectory));
}

/// How gravity turns from where it points by now, a degree of the tilt that took it there.
Eigen::Matrix2d TorqueFitter::turn_of_tilt(const Eigen::Vector2d& tilt_deg) const {
  constexpr double kStep_deg = 1e-3;
  // Near 180 degrees, tilts of all directions are nearly the same.
  constexpr double kLeast = 1e-3;
  const Eigen::Vector3d& upright = parts_.base.rigid.gravity_m_s2;
  const Eigen::Vector3d& now = case_->rigid.gravity_m_s2;
  Eigen::Matrix2d out;
  for (int a = 0; a < 2; ++a) {
    const Eigen::Vector2d step = kStep_deg * Eigen::Vector2d::Unit(a);
    out.col(a) = (tilt_between(now, tilted(upright, tilt_deg + step)) -
                  tilt_between(now, tilted(upright, tilt_deg - step))) /
                 (2.0 * kStep_deg);
  }
  const Eigen::JacobiSVD<Eigen::Matrix2d> svd(out, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * svd.singularValues().cwiseMax(kLeast).asDiagonal() *
         svd.matrixV().transpose();
}

TracedFit TorqueFitter::read_back(bool converged) const {
  TracedFit out;
  out.converged = converged;
  if (!converged) out.reason = "delay, gain or gravity did not settle";
  Linearisation& linear = out.linear;
  const Eigen::Index p = base_values_.size();
  linear.residual.resize(instants_ * joints_);
  linear.jacobian.setZero(instants_ * joints_, own_parameters() + effect_parameters_);
  for (Eigen::Index j = 0; j < joints_; ++j) {
    const JointDesign& rows = design_[static_cast<std::size_t>(j)];
    const auto own = Eigen::seqN(j, instants_, joints_);
    linear.residual(own) = rows.residual;
    linear.jacobian(own, Eigen::seqN(0, p)) = rows.base_gain * *rows.base;
    for (Eigen::Index c = 0; c < rows.columns.cols(); ++c) {
      linear.jacobian(own, rows.parameters[static_cast<std::size_t>(c)]) = rows.columns.col(c);
    }
  }
  for (const Added& added : added_) {
    if (added.kind != Kind::kGravity) continue;
    auto columns = linear.jacobian.middleCols(own_parameters() + added.first, 2);
    columns = (columns * turn_of_tilt(added.values)).eval();
  }
  linear.prior = own_prior();
  linear.carriers = sparse_carriers(case_->carrier_torques, instants_);
  for (int c = 0; c < linear.carriers.outerSize(); ++c) {
    for (Eigen::SparseMatrix<double>::InnerIterator entry(linear.carriers, c); entry; ++entry) {
      entry.valueRef() /= parts_.base.sigma[entry.row() % joints_];
    }
  }
  for (Eigen::Index i = 0; i <= instants_; ++i) linear.first_row.push_back(i * joints_);
  linear.time_s = parts_.motion->at_instants(parts_.motion->time_s());
  for (const Eigen::Index row : parts_.motion->kept()) {
    linear.fold.push_back(parts_.fold[static_cast<std::size_t>(row)]);
  }
  linear.noise =
      noise_at_most(*parts_.motion, residual(), parts_.base.sigma).replicate(instants_, 1);
  linear.unit = parts_.base.sigma.replicate(instants_, 1);
  linear.unit_name = parts_.context.torque_unit == "Nm" ? "N m" : parts_.context.torque_unit;
  const Eigen::VectorXi trajectory = parts_.motion->samples().trajectory(parts_.motion->kept());
  linear.correlation_time_s = noise_memory(trajectory) *
                              (linear.time_s[instants_ - 1] - linear.time_s[0]) /
                              static_cast<double>(instants_);
  for (const Added& added : added_) out.values.push_back(added.values);
  EffectContext now = context_;
  now.torque = physical();
  for (Candidate& candidate : make_candidates(now)) {
    if (is_open(candidate.id)) out.candidates.push_back(std::move(candidate));
  }
  name_covariates(out);
  return out;
}

void TorqueFitter::name_covariates(TracedFit& out) const {
  const EffectContext& context = parts_.context;
  for (std::size_t j = 0; j < context.joints.size(); ++j) {
    const auto c = static_cast<Eigen::Index>(j);
    const std::string& name = context.joints[j];
    const std::string rate = context.angle(j) + "/s";
    out.covariates.push_back({"value of " + name, context.angle(j), parts_.q.col(c)});
    out.covariates.push_back({"speed of " + name, rate, parts_.dq.col(c)});
    out.covariates.push_back({"acceleration of " + name, rate + "^2", parts_.ddq.col(c)});
    out.covariates.push_back({"load of " + name, context.unit(j), context_.load.col(c)});
    out.rest_places.push_back({name, context.unit(j), static_cast<int>(j), 0.0, 0.0});
  }
  out.covariates.push_back({"time", "s", out.linear.time_s});
  if (context.temperature_c.size() > 0) {
    out.covariates.push_back({"temperature", "deg C", context.temperature_c});
  }
}

}  // namespace kinescope::effects
