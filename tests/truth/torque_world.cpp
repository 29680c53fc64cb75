// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/torque_world.h"

#include <array>
#include <cmath>
#include <numbers>

#include "dynamics/rigid/inverse_dynamics.h"

namespace kinescope {
namespace {

constexpr std::size_t kSines = 10;

struct Sines {
  std::array<double, kSines> amplitude{};
  std::array<double, kSines> omega{};
  std::array<double, kSines> phase{};
};

Sines random_sines(double amplitude, double highest_hz, Rng& rng) {
  Sines out;
  double sum = 0.0;
  for (std::size_t k = 0; k < kSines; ++k) {
    out.amplitude[k] = rng.uniform(0.2, 1.0);
    out.omega[k] = 2.0 * std::numbers::pi * rng.uniform(0.05, highest_hz);
    out.phase[k] = rng.uniform(0.0, 2.0 * std::numbers::pi);
    sum += out.amplitude[k];
  }
  for (double& a : out.amplitude) a *= 2.0 * amplitude / sum;
  return out;
}

void move(TorqueSamples& log, const std::vector<RigidBody>& bodies, Eigen::Index first,
          Eigen::Index rows, const TorqueWorldOptions& options, Rng& rng) {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const auto j = static_cast<Eigen::Index>(b);
    const double size = bodies[b].type == JointType::kRevolute ? 1.0 : 0.2;
    const Sines sines = random_sines(size * options.amplitude_rad, options.highest_hz, rng);
    for (Eigen::Index t = first; t < first + rows; ++t) {
      const double time = static_cast<double>(t - first) / options.rate_hz;
      log.t_s[t] = time;
      for (std::size_t k = 0; k < kSines; ++k) {
        const double w = sines.omega[k];
        const double angle = w * time + sines.phase[k];
        log.q(t, j) += sines.amplitude[k] * std::sin(angle);
        log.dq(t, j) += sines.amplitude[k] * w * std::cos(angle);
        log.ddq(t, j) -= sines.amplitude[k] * w * w * std::sin(angle);
      }
    }
  }
}

void add_friction(TorqueSamples& log, const DynamicModel& model,
                  const TorqueWorldOptions& options) {
  const std::vector<JointId> joints = moving_joints(model.tree);
  for (std::size_t k = 0; k < joints.size(); ++k) {
    const auto j = static_cast<Eigen::Index>(k);
    const JointDynamics& joint = model.joints[joints[k].index()];
    const bool turns = model.tree.joints[joints[k].index()].type == JointType::kRevolute;
    const double width = turns ? options.coulomb_width_rad_s : options.coulomb_width_m_s;
    log.torque.col(j).array() += joint.viscous * log.dq.col(j).array() +
                                 joint.coulomb * (log.dq.col(j).array() / width).tanh();
    if (options.offsets.size() > 0) log.torque.col(j).array() += options.offsets[j];
  }
}

/// AR(1) of variance 1, started in its steady state.
Eigen::VectorXd coloured(Eigen::Index rows, double memory, Rng& rng) {
  Eigen::VectorXd out(rows);
  double state = rng.normal();
  for (Eigen::Index t = 0; t < rows; ++t) {
    state = memory * state + std::sqrt(1.0 - memory * memory) * rng.normal();
    out[t] = state;
  }
  return out;
}

void add_noise(TorqueSamples& log, const TorqueWorldOptions& options, Rng& rng) {
  const Eigen::Index rows = log.torque.rows();
  const Eigen::VectorXd common = coloured(rows, options.noise_memory, rng);
  for (Eigen::Index j = 0; j < log.torque.cols(); ++j) {
    const double rms = log.torque.col(j).norm() / std::sqrt(static_cast<double>(rows));
    const Eigen::VectorXd own = coloured(rows, options.noise_memory, rng);
    log.torque.col(j) +=
        options.noise * rms *
        (std::sqrt(options.common_noise) * common + std::sqrt(1.0 - options.common_noise) * own);
    for (Eigen::Index t = 0; t < rows; ++t) {
      if (rng.uniform() < options.outliers) log.torque(t, j) += rms * rng.uniform(-10.0, 10.0);
    }
  }
}

}  // namespace

TorqueSamples torque_log_of(const DynamicModel& model, const TorqueWorldOptions& options,
                            Rng& rng) {
  const RigidModel rigid = make_rigid_model(model);
  const Eigen::Index n = rigid.size();
  const Eigen::Index rows = options.samples;
  TorqueSamples log;
  log.t_s = Eigen::VectorXd::Zero(rows);
  log.q = log.dq = log.ddq = Eigen::MatrixXd::Zero(rows, n);
  log.trajectory = Eigen::VectorXi::Zero(rows);
  for (int k = 0; k < options.trajectories; ++k) {
    const Eigen::Index first = rows * k / options.trajectories;
    const Eigen::Index count = rows * (k + 1) / options.trajectories - first;
    log.trajectory.segment(first, count).setConstant(k);
    move(log, rigid.bodies, first, count, options, rng);
  }
  log.torque = inverse_dynamics_of_samples(rigid, log.q, log.dq, log.ddq);
  add_friction(log, model, options);
  add_noise(log, options, rng);
  return log;
}

}  // namespace kinescope
