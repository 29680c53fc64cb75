// SPDX-License-Identifier: Apache-2.0
#include "app/torque/contact_model.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "app/torque/torque_inputs.h"
#include "dynamics/contact/sliding.h"
#include "dynamics/data/splits.h"
#include "dynamics/data/torque_scale.h"
#include "dynamics/identify/prediction.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// Velocities as the slope between the neighbouring positions, where the log has none.
Eigen::MatrixXd velocities(const TorqueLog& log) {
  if (log.dq.cols() > 0) return log.dq;
  Eigen::MatrixXd dq = Eigen::MatrixXd::Zero(log.q.rows(), log.q.cols());
  const Eigen::Index last = log.rows() - 1;
  for (Eigen::Index i = 0; i <= last; ++i) {
    Eigen::Index a = std::max<Eigen::Index>(0, i - 1);
    Eigen::Index b = std::min(last, i + 1);
    if (log.trajectory[a] != log.trajectory[i]) a = i;
    if (log.trajectory[b] != log.trajectory[i]) b = i;
    if (a < b) dq.row(i) = (log.q.row(b) - log.q.row(a)) / (log.t_s[b] - log.t_s[a]);
    if ((a < i && i < b) || a == b) continue;
    // At an end, of the parabola through three positions.
    const Eigen::Index inwards = a == i ? 1 : -1;
    const Eigen::Index third = i + 2 * inwards;
    if (third < 0 || third > last || log.trajectory[third] != log.trajectory[i]) continue;
    dq.row(i) = 2.0 * dq.row(i) - (log.q.row(third) - log.q.row(i)) / (log.t_s[third] - log.t_s[i]);
  }
  return dq;
}

// Filtered, with what the model's masses predict; nothing of a log that is too short to filter.
struct RigidPrediction {
  TorqueSamples samples;
  Eigen::MatrixXd torque;  // samples x joints
};

std::optional<RigidPrediction> predicted_by(const RigidModel& rigid, const TorqueLogReport& log,
                                            const TorqueDataOptions& options) {
  RigidPrediction out;
  try {
    out.samples = measured_part(filtered_data(log, options.motion).samples);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    return std::nullopt;
  }
  out.torque = inverse_dynamics_of_samples(rigid, out.samples.q, out.samples.dq, out.samples.ddq);
  return out;
}

// Friction that is not known leaves a joint's torque without a say.
std::vector<SlidingFriction> friction_of_measured(const RigidModel& rigid,
                                                  const std::vector<TorqueSamples>& motions,
                                                  const std::vector<Eigen::Index>& unmeasured) {
  std::vector<SlidingFriction> out = sliding_friction(rigid, motions);
  for (const Eigen::Index j : unmeasured) out[static_cast<std::size_t>(j)] = {};
  return out;
}

ContactModel from_urdf(const ContactCommandOptions& options, const DynamicModel& model,
                       const TorqueLogReport& looked_at, const TorqueLogReport& learn) {
  const RigidModel rigid = make_rigid_model(model);
  std::vector<LogFinding> findings;
  if (const auto log = predicted_by(rigid, looked_at, options.data)) {
    findings = compare_torque_scale(log->samples, log->torque).findings;
    put_into_place(options.logs, findings);
    throw_refusals(findings);
  }
  const Eigen::VectorXd gains = Eigen::VectorXd::Ones(rigid.size());
  std::vector<Eigen::Index> joints(static_cast<std::size_t>(rigid.size()));
  std::iota(joints.begin(), joints.end(), 0);
  return {.rigid = rigid,
          .joints = joints,
          .friction = friction_of_measured(rigid, unfiltered(learn.log, gains),
                                           unmeasured_joints(looked_at.log, learn.log)),
          .gains = gains,
          .identified = {},
          .words = "those of " + options.robot.filename().string() +
                   ", friction and torque offsets of the log",
          .findings = findings};
}

// A joint that may stick tells its torque to within friction only, some ten times the noise.
Eigen::MatrixXd weights_of(const RigidModel& rigid, const TorqueSamples& samples,
                           const std::vector<Eigen::Index>& unmeasured) {
  constexpr double kSticking = 0.01;
  Eigen::MatrixXd out =
      (sliding_states(rigid, samples).array() == 0)
          .select(kSticking, Eigen::MatrixXd::Ones(samples.size(), samples.joints()));
  for (const Eigen::Index j : unmeasured) out.col(j).setZero();
  if (samples.torque_missing.size() > 0) out = samples.torque_missing.select(0.0, out.array());
  return out;
}

// Where the joints stand among `chosen`, those that do.
std::vector<Eigen::Index> places_among(const std::vector<Eigen::Index>& chosen,
                                       const std::vector<Eigen::Index>& joints) {
  std::vector<Eigen::Index> out;
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    if (std::ranges::find(joints, chosen[k]) != joints.end())
      out.push_back(static_cast<Eigen::Index>(k));
  }
  return out;
}

// The parameters without what is not significant: along each axis of their covariance, columns
// scaled to equal torques, what stands out of two sigmas is kept (James and Stein 1961, positive
// part). A parameter that the log hardly moves would carry the noise of speeds into the balance.
Eigen::VectorXd significant_parameters(const Identification& found) {
  const Eigen::Index n = found.parameters.size();
  std::vector<Eigen::Index> moved;
  for (Eigen::Index k = 0; k < n; ++k) {
    if (std::isfinite(found.covariance(k, k)) && found.information(k, k) > 0.0) moved.push_back(k);
  }
  Eigen::VectorXd out = Eigen::VectorXd::Zero(n);
  if (moved.empty()) return out;
  const Eigen::VectorXd scale = found.information.diagonal()(moved).cwiseSqrt();
  const Eigen::MatrixXd covariance =
      scale.asDiagonal() * found.covariance(moved, moved) * scale.asDiagonal();
  const SymmetricEigen axes = symmetric_eigen(covariance);
  Eigen::VectorXd along = axes.vectors.transpose() * scale.cwiseProduct(found.parameters(moved));
  for (Eigen::Index k = 0; k < along.size(); ++k) {
    const double square = along[k] * along[k];
    along[k] *= square > 0.0 ? std::max(0.0, 1.0 - 4.0 * axes.values[k] / square) : 0.0;
  }
  out(moved) = (axes.vectors * along).cwiseQuotient(scale);
  return out;
}

// Bodies with base parameters as the log has them: bent towards bodies that can exist, they would
// predict worse. Torques and momentum are linear in them.
RigidModel identified_model(const Identification& found) {
  const Eigen::VectorXd parameters = significant_parameters(found);
  Eigen::VectorXd bodies = Eigen::VectorXd::Zero(10 * found.rigid.size());
  Eigen::VectorXd motors = Eigen::VectorXd::Zero(found.rigid.size());
  for (std::size_t k = 0; k < found.basis.kept.size(); ++k) {
    const TorqueTerm& term = found.terms[static_cast<std::size_t>(found.basis.kept[k])];
    const double value = parameters[static_cast<Eigen::Index>(k)];
    if (term.kind == TermKind::kInertial) bodies[term.index] = value;
    if (term.kind == TermKind::kMotorInertia) motors[term.index] = value;
  }
  RigidModel out = with_body_parameters(found.rigid, bodies);
  for (std::size_t j = 0; j < out.bodies.size(); ++j) {
    out.bodies[j].motor_inertia = motors[static_cast<Eigen::Index>(j)];
  }
  return out;
}

int rigid_parameters(const Identification& found) {
  return static_cast<int>(std::ranges::count_if(found.basis.kept, [&](int k) {
    const TermKind kind = found.terms[static_cast<std::size_t>(k)].kind;
    return kind == TermKind::kInertial || kind == TermKind::kMotorInertia;
  }));
}

RigidModel without_inertia(const RigidModel& model) {
  RigidModel out = with_body_parameters(model, Eigen::VectorXd::Zero(10 * model.size()));
  for (RigidBody& body : out.bodies) body.motor_inertia = 0.0;
  return out;
}

// The robot with its other joints held where they stand on average.
DynamicModel with_joints_held(DynamicModel model, const std::vector<Eigen::Index>& moving,
                              const Eigen::MatrixXd& q) {
  const std::vector<JointId> joints = moving_joints(model.tree);
  for (std::size_t k = 0; k < joints.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    if (std::ranges::find(moving, column) != moving.end()) continue;
    Joint& joint = model.tree.joints[joints[k].index()];
    joint.T_parent_joint =
        joint.T_parent_joint * joint_motion(joint.type, joint.axis, q.col(column).mean());
    joint.type = JointType::kFixed;
    model.joints[joints[k].index()] = {};
  }
  return model;
}

std::vector<TorqueSamples> with_joints(std::vector<TorqueSamples> motions,
                                       const std::vector<Eigen::Index>& joints) {
  for (TorqueSamples& motion : motions) motion = with_joints(motion, joints);
  return motions;
}

ContactModel from_log(const ContactCommandOptions& options, const DynamicModel& model,
                      const TorqueLogReport& looked_at, const TorqueLogReport& learn) {
  const auto& files = options.learn_logs.empty() ? options.logs : options.learn_logs;
  const TorqueData data = filtered_data(learn, options.data.motion);
  const RigidModel all = make_rigid_model(model);
  ContactModel out;
  out.joints = joints_in_motion(all, learn.log);
  if (out.joints.empty()) {
    throw undetermined("contact", "no joint slides: at rest friction hides what pushes",
                       "record motion of every joint that is to be looked at");
  }
  const DynamicModel held = with_joints_held(model, out.joints, learn.log.q);
  const TorqueSamples samples = with_joints(data.samples, out.joints);
  const std::vector<Eigen::Index> unmeasured =
      places_among(out.joints, unmeasured_joints(looked_at.log, learn.log));
  // A unit of current is another torque at every drive.
  IdentifyOptions identify;
  identify.gains = data.samples.torque_unit == "A" && out.joints.size() > 1;
  const Identification found = identify_dynamics(
      held, samples, identify, weights_of(make_rigid_model(held), samples, unmeasured));
  out.gains = Eigen::VectorXd::Ones(all.size());
  out.gains(out.joints) = found.gains;
  const std::vector<TorqueSamples> motions =
      with_joints(unfiltered(learn.log, out.gains), out.joints);
  out.rigid = identified_model(found);
  out.identified = found;
  out.friction = friction_of_measured(out.rigid, motions, unmeasured);
  // Masses that a log hardly moves are noise: friction alone where it explains as much.
  const RigidModel massless = without_inertia(out.rigid);
  std::vector<SlidingFriction> friction_alone = friction_of_measured(massless, motions, unmeasured);
  if (sliding_deviance(friction_alone, 0) <
      sliding_deviance(out.friction, rigid_parameters(found))) {
    out.rigid = massless;
    out.identified.reset();
    out.friction = std::move(friction_alone);
  }
  out.words =
      fmt::format("identified from {} samples of {}", data.samples.size(), file_list(files));
  return out;
}

// At the samples of `motion`, those of the nearest of `all` in its trajectory; empty where there
// are none.
Eigen::MatrixXd nearest_rows(const TorqueSamples& all, const Eigen::MatrixXd& values,
                             const TorqueSamples& motion) {
  std::vector<Eigen::Index> own;
  for (Eigen::Index k = 0; k < all.size(); ++k) {
    if (all.trajectory[k] == motion.trajectory[0]) own.push_back(k);
  }
  if (own.empty()) return {};
  Eigen::MatrixXd out(motion.size(), values.cols());
  std::size_t at = 0;
  const auto miss = [&](std::size_t k, double t) { return std::abs(all.t_s[own[k]] - t); };
  for (Eigen::Index t = 0; t < motion.size(); ++t) {
    while (at + 1 < own.size() && miss(at + 1, motion.t_s[t]) <= miss(at, motion.t_s[t])) ++at;
    out.row(t) = values.row(own[at]);
  }
  return out;
}

}  // namespace

std::vector<Eigen::Index> joints_in_motion(const RigidModel& rigid, const TorqueLog& log) {
  constexpr double kPlace = 0.02;  // rad or m
  constexpr Eigen::Index kFewest = 100;
  std::vector<Eigen::Index> counts(static_cast<std::size_t>(rigid.size()), 0);
  for (const TorqueSamples& part : unfiltered(log, Eigen::VectorXd::Ones(rigid.size()))) {
    const Eigen::MatrixXi states = sliding_states(rigid, part.t_s, part.q);
    for (Eigen::Index j = 0; j < rigid.size(); ++j) {
      const SlidCount count = slid(states, j);
      counts[static_cast<std::size_t>(j)] += count.forward + count.backward;
    }
  }
  std::vector<Eigen::Index> out;
  for (Eigen::Index j = 0; j < rigid.size(); ++j) {
    const double way = log.q.col(j).maxCoeff() - log.q.col(j).minCoeff();
    if (counts[static_cast<std::size_t>(j)] >= kFewest || way > kPlace) out.push_back(j);
  }
  return out;
}

std::vector<Eigen::Index> unmeasured_joints(const TorqueLog& looked_at, const TorqueLog& learn) {
  std::vector<Eigen::Index> out;
  const auto is_constant = [](const auto& torque) {
    return torque.maxCoeff() == torque.minCoeff();
  };
  for (Eigen::Index j = 0; j < looked_at.torque.cols(); ++j) {
    if (is_constant(looked_at.torque.col(j)) || is_constant(learn.torque.col(j))) out.push_back(j);
  }
  return out;
}

TorqueSamples with_joints(const TorqueSamples& samples, const std::vector<Eigen::Index>& joints) {
  TorqueSamples out = samples;
  const auto chosen = [&](const Eigen::MatrixXd& all) -> Eigen::MatrixXd {
    if (all.cols() == 0) return all;
    return all(Eigen::all, joints);
  };
  out.q = chosen(samples.q);
  out.dq = chosen(samples.dq);
  out.ddq = chosen(samples.ddq);
  out.torque = chosen(samples.torque);
  if (samples.torque_missing.size() > 0)
    out.torque_missing = samples.torque_missing(Eigen::all, joints);
  out.joint_names.clear();
  return out;
}

std::vector<TorqueSamples> unfiltered(const TorqueLog& log, const Eigen::VectorXd& gains) {
  const Eigen::MatrixXd dq = velocities(log);
  const std::vector<Eigen::Index> bounds = log.bounds();
  std::vector<TorqueSamples> out;
  for (std::size_t k = 0; k + 1 < bounds.size(); ++k) {
    const Eigen::Index from = bounds[k];
    const Eigen::Index count = bounds[k + 1] - from;
    if (count < 3) continue;
    TorqueSamples part;
    part.t_s = log.t_s.segment(from, count);
    part.q = log.q.middleRows(from, count);
    part.dq = dq.middleRows(from, count);
    part.torque = log.torque.middleRows(from, count) * gains.cwiseInverse().asDiagonal();
    part.trajectory = log.trajectory.segment(from, count);
    if (log.torque_missing.size() > 0)
      part.torque_missing = log.torque_missing.middleRows(from, count);
    part.torque_unit = log.torque_unit;
    out.push_back(std::move(part));
  }
  return out;
}

ModelDoubt model_doubt(const ContactModel& model, const TorqueLogReport& log,
                       const TorqueDataOptions& options) {
  ModelDoubt out;
  if (!model.identified) return out;
  try {
    out.samples = with_joints(filtered_data(log, options.motion).samples, model.joints);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    return out;
  }
  // What a parameter that the log says nothing of would do: 1e3 times the noise hides all.
  constexpr double kMost = 1e3;
  const Identification& found = *model.identified;
  const Eigen::MatrixXd sigma =
      predict_torque(found, out.samples.q, out.samples.dq, out.samples.ddq).model_sigma *
      found.sigma.cwiseMax(1e-300).cwiseInverse().asDiagonal();
  out.sigma = (1.0 + sigma.array().min(kMost).square()).sqrt();
  return out;
}

std::vector<BalanceSample> balance_samples(const ContactModel& model, const TorqueSamples& motion,
                                           const ModelDoubt& doubt, bool speeds_logged) {
  const TorqueSamples own = with_joints(motion, model.joints);
  std::vector<BalanceSample> out = sliding_balance(
      model.rigid, model.friction, own, nearest_rows(doubt.samples, doubt.sigma, motion));
  // The parabola's slope has 3.6 times the noise of one between neighbours.
  constexpr double kEndNoise = 3.6;
  if (!speeds_logged) {
    out.front().mass *= kEndNoise;
    out.back().mass *= kEndNoise;
  }
  if (own.joints() == motion.joints()) return out;
  const Eigen::Index n = motion.joints();
  for (BalanceSample& sample : out) {
    BalanceSample all{.stamp_s = sample.stamp_s,
                      .momentum = Eigen::VectorXd::Zero(n),
                      .drive = Eigen::VectorXd::Zero(n),
                      .velocity = Eigen::VectorXd::Zero(n),
                      .mass = Eigen::MatrixXd::Zero(n, n),
                      .sigma = Eigen::VectorXd::Ones(n),
                      .sticks = Eigen::VectorXi::Ones(n)};
    all.momentum(model.joints) = sample.momentum;
    all.drive(model.joints) = sample.drive;
    all.velocity(model.joints) = sample.velocity;
    all.mass(model.joints, model.joints) = sample.mass;
    all.sigma(model.joints) = sample.sigma;
    all.sticks(model.joints) = sample.sticks;
    sample = std::move(all);
  }
  return out;
}

ContactModel make_contact_model(const ContactCommandOptions& options, const DynamicModel& model,
                                const TorqueLogReport& looked_at, const TorqueLogReport& learn) {
  const bool masses = has_masses(model) && looked_at.log.torque_unit != "A";
  return masses && !options.identify ? from_urdf(options, model, looked_at, learn)
                                     : from_log(options, model, looked_at, learn);
}

}  // namespace kinescope
