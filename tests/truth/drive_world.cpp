// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/drive_world.h"

#include <cmath>
#include <numbers>

#include "dynamics/rigid/inverse_dynamics.h"

namespace kinescope {
namespace {

using experiments::ContactWorld;

constexpr double kStart_s = 0.15;  ///< from rest to a constant speed

/// Rate and its derivative of a start (share 0 to 1) to unit speed, a raised cosine.
struct Ramp {
  double rate, slope;
};
Ramp ramp(double share) {
  if (share <= 0.0) return {0.0, 0.0};
  if (share >= 1.0) return {1.0, 0.0};
  const double angle = std::numbers::pi * share;
  return {0.5 - 0.5 * std::cos(angle), 0.5 * std::numbers::pi * std::sin(angle)};
}

/// Rates and accelerations; positions follow by summing.
struct Rates {
  Eigen::MatrixXd dq, ddq;
};

/// Moves to random places and back, with rests between.
void add_moves(const DriveWorldOptions& options, Rates& out, Rng& rng) {
  const Eigen::Index rows = out.dq.rows();
  const Eigen::Index joints = out.dq.cols();
  Eigen::VectorXd place = Eigen::VectorXd::Zero(joints);
  double now_s = options.rest_s;
  while (now_s < options.duration_s) {
    Eigen::VectorXd step(joints);
    for (Eigen::Index j = 0; j < joints; ++j) step[j] = rng.uniform(-0.8, 0.8) - place[j];
    place += step;
    const double length_s =
        std::max(2.0 * kStart_s, step.cwiseAbs().minCoeff() / options.speed_rad_s + 1.0);
    for (Eigen::Index k = 0; k < rows; ++k) {
      const double t = static_cast<double>(k) / options.rate_hz - now_s;
      if (t < 0.0 || t > length_s) continue;
      const double share = t / length_s;
      // Quintic from rest to rest.
      const double rate = 30.0 * share * share * (1.0 - share) * (1.0 - share) / length_s;
      const double slope = 60.0 * share * (1.0 - share) * (1.0 - 2.0 * share) / length_s / length_s;
      out.dq.row(k) = rate * step.transpose();
      out.ddq.row(k) = slope * step.transpose();
    }
    now_s += length_s + rng.uniform(0.0, options.rest_s);
  }
}

/// Joint 1 at a constant speed, up to the obstacle; the external torque of joint 1.
Eigen::VectorXd add_sweep(const DriveWorldOptions& options, Rates& out) {
  const Eigen::Index rows = out.dq.rows();
  Eigen::VectorXd external = Eigen::VectorXd::Zero(rows);
  constexpr double kStop_s = 0.02;
  for (Eigen::Index k = 0; k < rows; ++k) {
    const double t = static_cast<double>(k) / options.rate_hz;
    const Ramp start = ramp((t - options.rest_s) / kStart_s);
    out.dq(k, 0) = options.speed_rad_s * start.rate;
    out.ddq(k, 0) = options.speed_rad_s * start.slope / kStart_s;
    const double after_s = t - options.obstacle_s;
    if (options.obstacle_s <= 0.0 || after_s < 0.0) continue;
    // The joint slows down to a tenth of its speed, and is held at the end of the rise.
    const bool held = after_s > options.obstacle_rise_s;
    const double kept = held ? 0.0 : 0.1 + 0.9 * std::exp(-after_s / kStop_s);
    out.dq(k, 0) = options.speed_rad_s * kept;
    out.ddq(k, 0) =
        held ? 0.0 : -options.speed_rad_s * 0.9 / kStop_s * std::exp(-after_s / kStop_s);
    external[k] = -options.obstacle_nm * std::min(1.0, after_s / options.obstacle_rise_s);
  }
  return external;
}

void add_friction(const DriveWorldOptions& options, TorqueSamples& samples, Rng& rng) {
  for (Eigen::Index j = 0; j < samples.q.cols(); ++j) {
    double friction = rng.uniform(-1.0, 1.0) * options.coulomb_nm;
    const double waves = rng.uniform(20.0, 60.0);
    for (Eigen::Index k = 0; k < samples.q.rows(); ++k) {
      const double rate = samples.dq(k, j);
      const double step = k == 0 ? 0.0 : samples.q(k, j) - samples.q(k - 1, j);
      const double low = rate / options.stribeck_rad_s;
      const double level = options.coulomb_nm * (1.0 + options.breakaway * std::exp(-low * low)) *
                           (step > 0.0 ? 1.0 : -1.0);
      friction = level + (friction - level) * std::exp(-std::abs(step) / options.presliding_rad);
      samples.torque(k, j) += friction + options.ripple_nm * std::sin(waves * samples.q(k, j));
    }
  }
}

}  // namespace

ContactWorld drive_world(const DynamicModel& model, const DriveWorldOptions& options, Rng& rng) {
  const RigidModel rigid = make_rigid_model(model);
  DriveWorldOptions own = options;
  if (own.obstacle_s > 0.0) {
    own.duration_s = own.obstacle_s + own.obstacle_rise_s + own.hold_s;
  }
  const auto rows = static_cast<Eigen::Index>(own.duration_s * own.rate_hz);
  Rates rates{.dq = Eigen::MatrixXd::Zero(rows, rigid.size()),
              .ddq = Eigen::MatrixXd::Zero(rows, rigid.size())};
  ContactWorld world;
  world.external = Eigen::MatrixXd::Zero(rows, rigid.size());
  if (own.one_way) {
    world.external.col(0) = add_sweep(own, rates);
  } else {
    add_moves(own, rates, rng);
  }
  TorqueSamples& samples = world.samples;
  samples.t_s = Eigen::VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / own.rate_hz);
  samples.dq = rates.dq;
  samples.ddq = rates.ddq;
  samples.q = Eigen::MatrixXd::Zero(rows, rigid.size());
  for (Eigen::Index k = 1; k < rows; ++k) {
    samples.q.row(k) =
        samples.q.row(k - 1) + 0.5 / own.rate_hz * (rates.dq.row(k) + rates.dq.row(k - 1));
  }
  samples.trajectory = Eigen::VectorXi::Zero(rows);
  samples.torque = inverse_dynamics_of_samples(rigid, samples.q, samples.dq, samples.ddq);
  for (Eigen::Index j = 0; j < rigid.size(); ++j) {
    samples.torque.col(j) += model.joints[static_cast<std::size_t>(j)].viscous * samples.dq.col(j);
  }
  add_friction(own, samples, rng);
  samples.torque -= world.external;
  for (Eigen::Index j = 0; j < rigid.size(); ++j) {
    for (Eigen::Index k = 0; k < rows; ++k) {
      samples.q(k, j) =
          own.position_quantum_rad * std::round(samples.q(k, j) / own.position_quantum_rad);
      samples.dq(k, j) += rng.normal(own.velocity_sigma_rad_s);
      samples.torque(k, j) += rng.normal(own.torque_sigma_nm);
    }
  }
  if (own.obstacle_s > 0.0) {
    world.labels.push_back({.begin_s = own.obstacle_s, .end_s = own.duration_s, .link = 0});
  }
  return world;
}

}  // namespace kinescope
