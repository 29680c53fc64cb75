// SPDX-License-Identifier: Apache-2.0
#include "dynamics/simulation/servo.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/LU>
#include <fmt/format.h>

#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/mass_matrix.h"
#include "dynamics/simulation/simulation.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

Error wrong(const std::string& what, const std::string& remedy) {
  return bad_request("servo", what, remedy);
}

void check_vector(const Eigen::VectorXd& values, Eigen::Index joints, const char* name) {
  if (values.size() == 0) return;
  if (values.size() != joints) {
    throw wrong(fmt::format("{} values of {} for {} joints", values.size(), name, joints),
                "give one a joint");
  }
  if (!(values.array() >= 0.0).all() || !values.allFinite()) {
    throw wrong(fmt::format("{} is negative or no number", name), "give numbers from 0 up");
  }
}

Eigen::VectorXd quantised(const Eigen::VectorXd& q, double step) {
  if (step == 0.0) return q;
  return ((q / step).array().round() * step).matrix();
}

/// Each column as it was `delay_s` earlier (linear between rows; the first row before).
Eigen::MatrixXd delayed(const Eigen::MatrixXd& rows, const Eigen::VectorXd& delay_s,
                        double rate_hz) {
  Eigen::MatrixXd out = rows;
  const auto last = static_cast<double>(rows.rows() - 1);
  for (Eigen::Index j = 0; j < rows.cols(); ++j) {
    if (delay_s[j] == 0.0) continue;
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      const double at = std::clamp(static_cast<double>(i) - delay_s[j] * rate_hz, 0.0, last);
      const auto below = std::min(static_cast<Eigen::Index>(at), rows.rows() - 2);
      const double share = at - static_cast<double>(below);
      out(i, j) = (1.0 - share) * rows(below, j) + share * rows(below + 1, j);
    }
  }
  return out;
}

/// Where the robot was at every stamp, and what the motors applied about it.
struct Run {
  Eigen::MatrixXd q, dq, ddq, applied;
};

Run follow(const Plant& plant, const TorqueSamples& reference, const ServoOptions& options) {
  ServoGains gains = servo_gains(plant, reference.q.row(0).transpose(), options.bandwidth_hz);
  if (options.kp.size() > 0) gains.kp = options.kp;
  if (options.kd.size() > 0) gains.kd = options.kd;
  const Eigen::MatrixXd forward =
      options.feed_forward
          ? inverse_dynamics_of_samples(plant.rigid, reference.q, reference.dq, reference.ddq)
          : Eigen::MatrixXd::Zero(reference.size(), reference.joints());
  const auto late = static_cast<Eigen::Index>(std::lround(options.delay_s * options.rate_hz));
  const double step_s = 1.0 / (options.rate_hz * options.steps);
  Simulation simulation(plant, PlantState::at(plant, reference.q.row(0).transpose(),
                                              reference.dq.row(0).transpose(), reference.t_s[0]));
  Run run{reference.q, reference.q, reference.q, reference.q};
  Eigen::VectorXd before;
  for (Eigen::Index k = 0; k < reference.size(); ++k) {
    const PlantState& state = simulation.state();
    run.q.row(k) = quantised(state.q, options.encoder_step).transpose();
    run.dq.row(k) = state.dq.transpose();
    // What the controller knows of is this late; before the beginning it knew the beginning.
    const Eigen::Index seen = std::max<Eigen::Index>(0, k - late);
    Eigen::VectorXd torque = forward.row(k).transpose();
    torque += gains.kp.cwiseProduct((reference.q.row(seen) - run.q.row(seen)).transpose());
    torque += gains.kd.cwiseProduct((reference.dq.row(seen) - run.dq.row(seen)).transpose());
    if (options.torque_limit.size() > 0) {
      torque = torque.cwiseMax(-options.torque_limit).cwiseMin(options.torque_limit);
    }
    const Eigen::VectorXd mean = k == 0 ? torque : (0.5 * (before + torque)).eval();
    before = torque;
    run.applied.row(k) = mean.transpose();
    run.ddq.row(k) = simulation.acceleration(mean).transpose();
    for (int step = 0; step < options.steps; ++step) (void)simulation.step(torque, step_s);
  }
  return run;
}

}  // namespace

void check_options(const ServoOptions& options, Eigen::Index joints) {
  if (!(options.rate_hz > 0.0) || !std::isfinite(options.rate_hz)) {
    throw wrong(fmt::format("a rate of {} Hz", options.rate_hz), "give a rate above 0");
  }
  if (options.steps < 1) throw wrong("no step a period", "give 1 or more");
  if (!(options.bandwidth_hz > 0.0 && options.bandwidth_hz < 0.5 * options.rate_hz)) {
    throw wrong(fmt::format("a bandwidth of {} Hz at a rate of {} Hz", options.bandwidth_hz,
                            options.rate_hz),
                "give one above 0 and below half the rate");
  }
  for (const auto& [value, name] :
       {std::pair{options.delay_s, "delay"}, std::pair{options.encoder_step, "encoder step"},
        std::pair{options.torque_noise, "torque noise"}}) {
    if (!(value >= 0.0) || !std::isfinite(value)) {
      throw wrong(fmt::format("a {} of {}", name, value), "give a number from 0 up");
    }
  }
  check_vector(options.kp, joints, "kp");
  check_vector(options.kd, joints, "kd");
  check_vector(options.torque_limit, joints, "torque limit");
}

ServoGains servo_gains(const Plant& plant, const Eigen::VectorXd& q, double bandwidth_hz) {
  // What a joint's drive feels while all others are free to move: the least it can be.
  const Eigen::MatrixXd mass = mass_matrix(plant.rigid, q) + plant.coupled_inertia;
  const Eigen::VectorXd inertia = mass.inverse().diagonal().cwiseInverse();
  const double w = 2.0 * std::numbers::pi * bandwidth_hz;
  return {inertia * (w * w), inertia * (2.0 * w)};
}

ServoLog run_servo(const Plant& plant, const TorqueSamples& reference, const ServoOptions& options,
                   Rng& rng) {
  check_options(options, plant.size());
  KINESCOPE_CHECK(reference.joints() == plant.size() && reference.size() > 1,
                  "a reference of this robot");
  const Run run = follow(plant, reference, options);
  ServoLog out{reference, Eigen::VectorXd()};
  out.samples.q = run.q;
  out.samples.dq = run.dq;
  out.samples.ddq = run.ddq;
  out.samples.torque =
      delayed(run.applied * plant.gain.transpose(), plant.delay_s, options.rate_hz);
  if (options.torque_noise > 0.0) {
    for (double& torque : out.samples.torque.reshaped()) torque += rng.normal(options.torque_noise);
  }
  const Eigen::MatrixXd error = run.q - reference.q;
  out.tracking_error =
      error.colwise().norm().transpose() / std::sqrt(static_cast<double>(error.rows()));
  return out;
}

}  // namespace kinescope
