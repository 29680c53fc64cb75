// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/contact_world.h"

#include <cmath>
#include <numbers>
#include <string>

#include "dynamics/rigid/inverse_dynamics.h"

namespace kinescope::experiments {
namespace {

constexpr int kSines = 6;
constexpr double kHighest_rad_s = 5.0;

struct Sine {
  double amplitude, rate, phase;
};

struct Excitation {
  Eigen::MatrixXd q, dq, ddq;
};

Excitation random_excitation(Eigen::Index joints, Eigen::Index samples, double rate_hz, Rng& rng) {
  Excitation out{.q = Eigen::MatrixXd::Zero(samples, joints),
                 .dq = Eigen::MatrixXd::Zero(samples, joints),
                 .ddq = Eigen::MatrixXd::Zero(samples, joints)};
  for (Eigen::Index j = 0; j < joints; ++j) {
    for (int s = 0; s < kSines; ++s) {
      const Sine sine{.amplitude = rng.uniform(0.05, 0.25),
                      .rate = rng.uniform(0.3, kHighest_rad_s),
                      .phase = rng.uniform(0.0, 2.0 * std::numbers::pi)};
      for (Eigen::Index k = 0; k < samples; ++k) {
        const double angle = sine.rate * static_cast<double>(k) / rate_hz + sine.phase;
        out.q(k, j) += sine.amplitude * std::sin(angle);
        out.dq(k, j) += sine.amplitude * sine.rate * std::cos(angle);
        out.ddq(k, j) -= sine.amplitude * sine.rate * sine.rate * std::sin(angle);
      }
    }
  }
  return out;
}

double profile(ContactShape shape, double share) {
  if (share < 0.0 || share > 1.0) return 0.0;
  if (shape == ContactShape::kStep) return 1.0;
  if (shape == ContactShape::kHalfSine) return std::sin(std::numbers::pi * share);
  return std::min(1.0, std::min(share, 1.0 - share) / 0.2);
}

/// J' F of a force (base axes) at a point of a body's frame: the derivative of its place in q.
Eigen::VectorXd joint_torque(const RigidModel& model, const Eigen::VectorXd& q, int body,
                             const Eigen::Vector3d& point, const Eigen::Vector3d& force) {
  std::vector<Pose> placed;
  Eigen::VectorXd out = Eigen::VectorXd::Zero(q.size());
  for (int k = 0; k <= body; ++k) {
    const RigidBody& own = model.bodies[static_cast<std::size_t>(k)];
    const Pose T_parent_joint{Eigen::Quaterniond(own.R_parent_joint), own.p_parent_joint};
    const Pose T_joint_body{Eigen::Quaterniond(Eigen::AngleAxisd(q[k], own.axis)),
                            Eigen::Vector3d::Zero()};
    const Pose T_base_joint = k == 0 ? T_parent_joint : placed.back() * T_parent_joint;
    placed.push_back(T_base_joint * T_joint_body);
  }
  const Eigen::Vector3d at = placed.back() * point;
  for (int k = 0; k <= body; ++k) {
    const Pose& T = placed[static_cast<std::size_t>(k)];
    const Eigen::Vector3d axis = T.rotation * model.bodies[static_cast<std::size_t>(k)].axis;
    out[k] = axis.cross(at - T.translation).dot(force);
  }
  return out;
}

Eigen::Index next_reversal(const Eigen::MatrixXd& dq, Eigen::Index from) {
  Eigen::Index k = from;
  while (k + 1 < dq.rows() && dq(k, 0) * dq(k + 1, 0) > 0.0) ++k;
  return k;
}

void add_contact(const RigidModel& model, const Excitation& motion,
                 const ContactWorldOptions& options, int number, ContactWorld& world, Rng& rng) {
  const auto joints = static_cast<int>(model.size());
  const int body = joints - 1 - number % std::max(1, joints - 1);
  const double spacing_s = options.duration_s / (options.contacts + 1.0);
  auto begin = static_cast<Eigen::Index>(
      ((number + 1.0) * spacing_s + rng.uniform(-0.2, 0.2) * spacing_s) * options.rate_hz);
  if (options.at_reversal) begin = next_reversal(motion.dq, begin);
  const auto length = static_cast<Eigen::Index>(options.contact_s * options.rate_hz);
  if (begin + length >= motion.q.rows()) return;
  const Eigen::Vector3d point = Eigen::Vector3d(0.02, 0.02, 0.1);
  const Eigen::Vector3d force = options.force_n * rng.unit3();
  for (Eigen::Index k = begin; k <= begin + length; ++k) {
    const double share = static_cast<double>(k - begin) / static_cast<double>(length);
    world.external.row(k) +=
        profile(options.shape, share) *
        joint_torque(model, motion.q.row(k).transpose(), body, point, force).transpose();
  }
  world.labels.push_back({.begin_s = static_cast<double>(begin) / options.rate_hz,
                          .end_s = static_cast<double>(begin + length) / options.rate_hz,
                          .link = body});
}

double torque_sigma(const ContactWorldOptions& options, Eigen::Index joint) {
  if (options.torque_sigmas_nm.size() > 0) return options.torque_sigmas_nm[joint];
  return options.torque_sigma_nm * std::pow(0.6, static_cast<double>(joint));
}

void add_noise(const ContactWorldOptions& options, TorqueSamples& samples, Rng& rng) {
  const double quantum = options.position_quantum_rad;
  for (Eigen::Index j = 0; j < samples.q.cols(); ++j) {
    const double torque_sigma_nm = torque_sigma(options, j);
    for (Eigen::Index k = 0; k < samples.q.rows(); ++k) {
      if (quantum > 0.0) samples.q(k, j) = quantum * std::round(samples.q(k, j) / quantum);
      samples.dq(k, j) += rng.normal(options.velocity_sigma_rad_s);
      samples.torque(k, j) += rng.normal(torque_sigma_nm);
    }
  }
}

}  // namespace

DynamicModel contact_arm(int joints) {
  KinematicTree tree;
  tree.links.push_back({.name = "base"});
  for (int k = 0; k < joints; ++k) {
    const std::string number = std::to_string(k + 1);
    tree.links.push_back({.name = "link" + number});
    Joint joint;
    joint.name = "joint" + number;
    joint.type = JointType::kRevolute;
    joint.parent = LinkId{k};
    joint.child = LinkId{k + 1};
    joint.T_parent_joint.translation << 0.0, 0.03, k == 0 ? 0.1 : 0.25;
    joint.axis = k % 2 == 0 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitY();
    tree.joints.push_back(joint);
  }
  DynamicModel model = without_masses(tree);
  for (int k = 0; k < joints; ++k) {
    const double mass = 4.0 * std::pow(0.7, k);
    model.links[static_cast<std::size_t>(k) + 1] =
        from_central({.mass_kg = mass,
                      .centre_m = Eigen::Vector3d(0.01, 0.02, 0.1),
                      .inertia_kgm2 = 0.01 * mass * Eigen::Matrix3d::Identity()});
    model.joints[static_cast<std::size_t>(k)] = {.viscous = 0.2, .motor_inertia = 0.05};
  }
  return model;
}

ContactWorld contact_world(const DynamicModel& model, const ContactWorldOptions& options,
                           Rng& rng) {
  const RigidModel rigid = make_rigid_model(model);
  const auto count = static_cast<Eigen::Index>(options.duration_s * options.rate_hz);
  const Excitation motion = random_excitation(rigid.size(), count, options.rate_hz, rng);
  ContactWorld world;
  world.external = Eigen::MatrixXd::Zero(count, rigid.size());
  for (int c = 0; c < options.contacts; ++c) {
    add_contact(rigid, motion, options, c, world, rng);
  }
  TorqueSamples& samples = world.samples;
  samples.t_s =
      Eigen::VectorXd::LinSpaced(count, 0.0, static_cast<double>(count - 1) / options.rate_hz);
  samples.q = motion.q;
  samples.dq = motion.dq;
  samples.ddq = motion.ddq;
  samples.trajectory = Eigen::VectorXi::Zero(count);
  samples.torque = inverse_dynamics_of_samples(rigid, motion.q, motion.dq, motion.ddq);
  for (Eigen::Index j = 0; j < rigid.size(); ++j) {
    const double viscous = model.joints[static_cast<std::size_t>(j)].viscous;
    samples.torque.col(j) += viscous * motion.dq.col(j);
    samples.torque.col(j).array() +=
        options.undeclared_coulomb_nm * (motion.dq.col(j).array() / 0.01).tanh();
  }
  add_noise(options, samples, rng);
  samples.torque -= world.external;
  for (Eigen::Index k = 0; k < count; ++k) {
    if (rng.uniform() < options.missing_share) samples.torque(k, 0) = std::nan("");
  }
  return world;
}

}  // namespace kinescope::experiments
