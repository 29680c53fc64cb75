// SPDX-License-Identifier: Apache-2.0
#include "dynamics/effects/traced_torque.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "dynamics/data/splits.h"
#include "dynamics/effects/base_choice.h"
#include "dynamics/effects/candidates.h"
#include "dynamics/effects/drive_laws.h"
#include "dynamics/effects/torque_parts.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/regressor.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using effects::BaseData;

constexpr int kFewestPaths = 5;  // to hold out whole trajectories
constexpr Eigen::Index kFewestInstants = 60;

/// Of every sample: trajectories of one path together where there are enough paths, else stretches
/// of equal length of each, the same of all trajectories of a path.
std::vector<int> folds_of(const TorqueSamples& samples, int folds) {
  std::vector<int> out(static_cast<std::size_t>(samples.size()), 0);
  const std::vector<int> same_as = repeated_paths(samples);
  std::vector<int> paths = same_as;
  std::ranges::sort(paths);
  const auto repeats = std::ranges::unique(paths);
  paths.erase(repeats.begin(), repeats.end());
  const auto count = static_cast<int>(paths.size());
  if (count >= kFewestPaths) {
    const Folds split = split_folds(samples, {.folds = std::min(folds, count)});
    for (std::size_t f = 0; f < split.folds.size(); ++f) {
      for (const Eigen::Index row : split.folds[f].test) {
        out[static_cast<std::size_t>(row)] = static_cast<int>(f);
      }
    }
    return out;
  }
  const int stretches = std::max(1, folds / count);
  std::size_t piece = 0;
  Eigen::Index end = 0;
  for (Eigen::Index begin = 0; begin < samples.size(); begin = end, ++piece) {
    while (end < samples.size() && samples.trajectory[end] == samples.trajectory[begin]) ++end;
    const auto path = std::ranges::lower_bound(paths, same_as[piece]) - paths.begin();
    for (Eigen::Index row = begin; row < end; ++row) {
      const auto stretch = (row - begin) * stretches / (end - begin);
      out[static_cast<std::size_t>(row)] = static_cast<int>(path * stretches + stretch);
    }
  }
  return out;
}

/// Masses that a robot can have: every moving body has some and no distribution forbids it.
bool has_masses(const RigidModel& rigid) {
  constexpr double kRounding = 1e-6;  // URDF writers round
  return std::ranges::all_of(rigid.bodies, [](const RigidBody& body) {
    return body.inertia.mass_kg > 0.0 && is_consistent(body.inertia, kRounding);
  });
}

Eigen::VectorXd declared(const DynamicModel& model, double JointDynamics::* what) {
  const std::vector<JointId> joints = moving_joints(model.tree);
  Eigen::VectorXd out(std::ssize(joints));
  for (Eigen::Index j = 0; j < out.size(); ++j) {
    out[j] = model.joints[joints[static_cast<std::size_t>(j)].index()].*what;
  }
  return out;
}

/// What a joint's drive and sensor may add, linearly: for noise levels and for choosing the base,
/// not for naming anything.
Eigen::MatrixXd drive_columns(const EffectContext& context, const BaseData& data, Eigen::Index j) {
  const auto joint = static_cast<std::size_t>(j);
  const JointTravel& travel = context.travels[joint];
  const double high = travel.high_speed;
  const double slow = 0.1 * travel.rms_speed;
  const Eigen::ArrayXd v = data.dq.col(j).array() / high;
  const Eigen::VectorXd dip = effects::turning_column(
      context, joint, "base stribeck", [&](const FinePath& p, double width) {
        return (effects::direction(p.dq, width) * effects::stribeck_decay(p.dq, slow)).eval();
      });
  const Eigen::VectorXd time_s = context.motion->at_instants(context.motion->time_s());
  const double duration = std::max(time_s[time_s.size() - 1] - time_s[0], 1e-12);
  Eigen::MatrixXd out(v.size(), 11);
  out << Eigen::VectorXd::Ones(v.size()), v.matrix(), data.way.col(j), data.ddq.col(j),
      data.q.col(j), v.abs().matrix(), (v * v.abs()).matrix(), v.cube().matrix(), dip,
      (time_s.array() - time_s[0]).matrix() / duration, context.measured_rate.col(j);
  return out;
}

BaseData base_data(const EffectContext& context, const RigidModel& rigid) {
  BaseData data;
  const TorqueSamples& samples = context.motion->samples();
  data.q = context.motion->rows_at_instants(samples.q);
  data.dq = context.motion->rows_at_instants(samples.dq);
  data.ddq = context.motion->rows_at_instants(samples.ddq);
  data.torque = context.motion->rows_at_instants(samples.torque);
  data.rigid = regressors_of_samples(rigid, data.q, data.dq, data.ddq);
  data.load = context.load;
  data.way.resize(data.q.rows(), data.q.cols());
  const std::vector<int> tips = effects::tips(rigid);
  for (Eigen::Index j = 0; j < data.q.cols(); ++j) {
    data.way.col(j) = effects::direction_column(context, static_cast<std::size_t>(j));
    data.drives.push_back(drive_columns(context, data, j));
    Eigen::MatrixXd common(data.q.rows(), 3 + 10 * static_cast<Eigen::Index>(tips.size()));
    for (std::size_t t = 0; t < tips.size(); ++t) {
      common.middleCols(3 + 10 * static_cast<Eigen::Index>(t), 10) =
          data.rigid[static_cast<std::size_t>(j)].middleCols(10 * tips[t], 10);
    }
    data.common.push_back(std::move(common));
  }
  const std::array<Eigen::MatrixXd, 3> slopes = gravity_slopes_of_samples(rigid, data.q);
  for (std::size_t axis = 0; axis < slopes.size(); ++axis) {
    for (Eigen::Index j = 0; j < data.q.cols(); ++j) {
      data.common[static_cast<std::size_t>(j)].col(static_cast<Eigen::Index>(axis)) =
          slopes[axis].col(j);
    }
  }
  return data;
}

}  // namespace

std::string_view to_string(TorqueBaseKind kind) {
  switch (kind) {
    case TorqueBaseKind::kDeclared:
      return "declared";
    case TorqueBaseKind::kIdentified:
      return "identified";
    default:
      return "auto";
  }
}

TorqueTracedModel::~TorqueTracedModel() = default;

TorqueTracedModel::TorqueTracedModel(const DynamicModel& model, const TorqueSamples& samples,
                                     const TracedTorqueOptions& options, const Kept& kept)
    : parts_(std::make_unique<Parts>()) {
  if (options.folds < 2 || options.most_instants < kFewestInstants ||
      !(options.trust_factor >= 1.0)) {
    throw bad_request("trace", "folds below 2, too few instants, or a trust factor below 1",
                      "leave them out for the defaults");
  }
  Parts& p = *parts_;
  p.model = model;
  p.options = options;
  p.base.rigid = make_rigid_model(model);
  if (samples.joints() != p.base.rigid.size()) {
    throw bad_request(
        "torque samples",
        fmt::format("{} joints, the model moves {}", samples.joints(), p.base.rigid.size()),
        "give one column a movable joint of the model");
  }
  p.motion = std::make_shared<EffectMotion>(
      samples,
      EffectMotionOptions{.filter = options.filter, .most_instants = options.most_instants});
  if (p.motion->instants() < kFewestInstants) {
    throw undetermined("trace", fmt::format("only {} independent samples", p.motion->instants()),
                       "record a longer motion");
  }
  p.fold = folds_of(samples, options.folds);
  p.context.widths.resize(p.base.rigid.size());
  p.context.torque_unit = samples.torque_unit;
  p.context.rigid = p.base.rigid;
  for (const RigidBody& body : p.base.rigid.bodies) {
    p.context.joints.push_back(body.joint);
    const bool turns = body.type == JointType::kRevolute;
    p.context.turns.push_back(turns ? 1 : 0);
    p.context.widths[static_cast<Eigen::Index>(p.context.turns.size()) - 1] =
        turns ? options.widths.rad_s : options.widths.m_s;
  }
  if (kept) p.leave_out(kept(*p.motion));
  p.refresh();
}

void TorqueTracedModel::Parts::leave_out(const std::vector<char>& wanted) const {
  KINESCOPE_CHECK(static_cast<Eigen::Index>(wanted.size()) == motion->samples().size(),
                  "one flag a sample");
  motion->leave_out(wanted);
  if (motion->instants() < kFewestInstants) {
    throw undetermined("trace", "hardly anything is left when contacts are left out",
                       "record a longer motion without contact");
  }
}

void TorqueTracedModel::Parts::refresh() {
  const TorqueSamples& samples = motion->samples();
  base.rigid = context.rigid = make_rigid_model(model);
  context.motion = motion;
  context.cache = std::make_shared<ColumnCache>();
  q = motion->rows_at_instants(samples.q);
  dq = motion->rows_at_instants(samples.dq);
  ddq = motion->rows_at_instants(samples.ddq);
  context.measured_rate.resize(q.rows(), q.cols());
  for (Eigen::Index j = 0; j < q.cols(); ++j) {
    context.measured_rate.col(j) = motion->at_instants(motion->rate(samples.torque.col(j)));
  }
  if (options.temperature_c.size() > 0) {
    context.temperature_c = motion->at_instants(options.temperature_c);
  }
  describe_log(context);
  context.least_stribeck_speed.resize(q.cols());
  for (Eigen::Index j = 0; j < q.cols(); ++j) {
    context.least_stribeck_speed[j] =
        effects::least_stribeck_speed(context, static_cast<std::size_t>(j));
  }
  const RigidModel nominal = make_rigid_model(model);
  context.load = inverse_dynamics_of_samples(nominal, q, dq, ddq);
  viscous = declared(model, &JointDynamics::viscous);
  coulomb = declared(model, &JointDynamics::coulomb);
  BaseData data = base_data(context, nominal);
  data.declared = context.load + dq * viscous.asDiagonal();
  for (Eigen::Index j = 0; j < q.cols(); ++j) {
    data.declared.col(j) +=
        coulomb[j] * effects::direction_column(context, static_cast<std::size_t>(j));
  }
  for (const Eigen::Index row : motion->kept()) {
    data.fold.push_back(fold[static_cast<std::size_t>(row)]);
  }
  effects::WidestFit described = effects::widest_fit(data);
  base.sigma = described.sigma;
  widest = std::move(described.residual);
  data = effects::without_outliers(data, widest);
  choose_base(data, has_masses(nominal));
  if (base.kind == TorqueBaseKind::kIdentified) {
    viscous.setZero();
    coulomb.setZero();
    // What the drives add is found with the effects, as their friction is.
    for (RigidBody& body : base.rigid.bodies) body.motor_inertia = 0.0;
    context.rigid = base.rigid;
    const RigidModel identified =
        with_body_parameters(base.rigid, effects::identified_bodies(data, base.sigma));
    context.load = inverse_dynamics_of_samples(identified, q, dq, ddq);
    // Where gravity may pull is known only for masses that are: declared ones serve better.
    if (!has_masses(nominal)) context.rigid = identified;
  }
  context.torque = context.load;
  if (has_masses(nominal) || base.kind == TorqueBaseKind::kIdentified) {
    context.least_viscous = -viscous;
    context.least_coulomb = -coulomb;
    context.least_motor_inertia.resize(std::ssize(base.rigid.bodies));
    for (std::size_t b = 0; b < base.rigid.bodies.size(); ++b) {
      context.least_motor_inertia[static_cast<Eigen::Index>(b)] =
          -base.rigid.bodies[b].motor_inertia;
    }
  }
  regressors = effects::make_gravity_regressors(context.rigid, q, dq, ddq);
  declared_load = inverse_dynamics_of_samples(context.rigid, q, dq, ddq);
  upright = effects::make_gravity_case(*this, Eigen::Vector2d::Zero(), context.rigid);
  starts = {};
}

void TorqueTracedModel::Parts::choose_base(const effects::BaseData& data, bool masses) {
  base.declared_error = std::numeric_limits<double>::quiet_NaN();
  base.identified_error = base.declared_error;
  if (options.base != TorqueBaseKind::kAuto) {
    base.kind = options.base;
    base.reason = "as asked for";
    return;
  }
  base.kind = TorqueBaseKind::kIdentified;
  base.reason = "the model has no masses that a robot can have";
  if (!masses) return;
  const effects::BaseErrors errors = effects::compare_bases(data, base.sigma);
  base.declared_error = errors.declared;
  base.identified_error = errors.identified;
  const bool trusted = errors.declared <= options.trust_factor * errors.identified ||
                       errors.t < effects::kClearlyBetter;
  if (trusted) base.kind = TorqueBaseKind::kDeclared;
  base.reason = fmt::format(
      "declared masses leave {:.3g} sigma on samples held out, identified ones {:.3g} "
      "(Student's t over the stretches {:.1f})",
      errors.declared, errors.identified, errors.t);
}

TracedFit TorqueTracedModel::fit(const std::vector<AddedEffect>& effects) const {
  return effects::TorqueFitter(*parts_, effects).run();
}

const TorqueBase& TorqueTracedModel::base() const { return parts_->base; }
const EffectContext& TorqueTracedModel::context() const { return parts_->context; }
const EffectMotion& TorqueTracedModel::motion() const { return *parts_->motion; }

void TorqueTracedModel::leave_out(const std::vector<char>& wanted) {
  parts_->leave_out(wanted);
  parts_->refresh();
}

Eigen::MatrixXd TorqueTracedModel::residual_torque(const TracedFit& fit) const {
  const Eigen::Index joints = parts_->motion->joints();
  const Eigen::VectorXd rows = fit.linear.residual.cwiseProduct(fit.linear.unit);
  return rows.reshaped(joints, rows.size() / joints).transpose();
}

FittedTorque TorqueTracedModel::fitted(const std::vector<AddedEffect>& effects) const {
  effects::TorqueFitter fitter(*parts_, effects);
  static_cast<void>(fitter.run());
  return fitter.fitted();
}

}  // namespace kinescope
