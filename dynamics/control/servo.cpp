// SPDX-License-Identifier: Apache-2.0
#include "dynamics/control/servo.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "dynamics/control/velocity_estimator.h"
#include "dynamics/effects/first_order_lag.h"
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

/// Each column behind the low-pass of its drive.
Eigen::MatrixXd lagged(Eigen::MatrixXd rows, const Eigen::VectorXd& lag_s,
                       const TorqueSamples& samples) {
  for (Eigen::Index j = 0; j < rows.cols(); ++j) {
    if (lag_s[j] == 0.0) continue;
    rows.col(j) = first_order_lag(rows.col(j), samples.t_s, samples.trajectory, lag_s[j]);
  }
  return rows;
}

/// Where the robot was at every stamp, and what the controller and its motors did about it.
struct Run {
  Eigen::MatrixXd q, dq, ddq, applied;
  Eigen::MatrixXd feedback, command, weight;
  Eigen::VectorXi limited;

  explicit Run(const TorqueSamples& reference)
      : q(reference.q), dq(q), ddq(q), applied(q), feedback(q), command(q), weight(q) {}
};

MotionPoint row_of(const TorqueSamples& reference, Eigen::Index k) {
  return {reference.t_s[k], reference.q.row(k), reference.dq.row(k), reference.ddq.row(k)};
}

Run follow(const Plant& plant, const TorqueSamples& reference, Controller controller,
           const ServoOptions& options) {
  const auto late = static_cast<Eigen::Index>(std::lround(options.delay_s * options.rate_hz));
  const double step_s = 1.0 / (options.rate_hz * options.steps);
  const MotionPoint first = row_of(reference, 0);
  Simulation simulation(plant, PlantState::at(plant, first.q, first.dq, first.t_s));
  std::optional<VelocityEstimator> velocity;
  Run run(reference);
  Eigen::VectorXd before;
  for (Eigen::Index k = 0; k < reference.size(); ++k) {
    const PlantState& state = simulation.state();
    const Eigen::VectorXd reading = quantised(state.q, options.encoder_step);
    run.q.row(k) = reading.transpose();
    run.dq.row(k) = state.dq.transpose();
    if (velocity) {
      run.dq.row(k) = velocity->update(reading).transpose();
    } else if (options.velocity_cutoff_hz > 0.0) {
      velocity.emplace(reading, state.dq, options.rate_hz, options.velocity_cutoff_hz);
    }
    // What the controller knows of is this late; before the beginning it knew the beginning.
    const Eigen::Index seen = std::max<Eigen::Index>(0, k - late);
    const Eigen::VectorXd torque = controller.command(
        row_of(reference, k),
        {run.q.row(seen), run.dq.row(seen), reference.q.row(seen), reference.dq.row(seen)});
    run.feedback.row(k) = controller.feedback().transpose();
    run.command.row(k) = torque.transpose();
    run.weight.row(k) = controller.weight().transpose();
    const Eigen::VectorXd mean = k == 0 ? torque : (0.5 * (before + torque)).eval();
    before = torque;
    run.applied.row(k) = mean.transpose();
    run.ddq.row(k) = simulation.acceleration(mean).transpose();
    for (int step = 0; step < options.steps; ++step) (void)simulation.step(torque, step_s);
  }
  run.limited = controller.limiter().limited();
  return run;
}

Eigen::VectorXd rms_of(const Eigen::MatrixXd& rows) {
  return rows.colwise().norm().transpose() / std::sqrt(static_cast<double>(rows.rows()));
}

ServoLog log_of(const Run& run, const Plant& plant, const TorqueSamples& reference,
                const ServoOptions& options, Rng& rng) {
  ServoLog out;
  out.samples = reference;
  out.samples.q = run.q;
  out.samples.dq = run.dq;
  out.samples.ddq = run.ddq;
  out.samples.torque = delayed(lagged(run.applied * plant.gain.transpose(), plant.lag_s, reference),
                               plant.delay_s, options.rate_hz);
  if (options.torque_noise > 0.0) {
    for (double& torque : out.samples.torque.reshaped()) torque += rng.normal(options.torque_noise);
  }
  const Eigen::MatrixXd error = run.q - reference.q;
  out.tracking_error = rms_of(error);
  out.largest_error = error.cwiseAbs().colwise().maxCoeff().transpose();
  out.feedback = rms_of(run.feedback);
  out.torque = rms_of(run.command);
  out.weight = run.weight.colwise().mean().transpose();
  out.limited = run.limited;
  return out;
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
        std::pair{options.torque_noise, "torque noise"},
        std::pair{options.velocity_cutoff_hz, "velocity cut-off"}}) {
    if (!(value >= 0.0) || !std::isfinite(value)) {
      throw wrong(fmt::format("a {} of {}", name, value), "give a number from 0 up");
    }
  }
  check_vector(options.kp, joints, "kp");
  check_vector(options.kd, joints, "kd");
  check_vector(options.torque_limit, joints, "torque limit");
  check_vector(options.torque_rate_limit, joints, "torque rate limit");
  if (options.velocity_cutoff_hz >= 0.5 * options.rate_hz) {
    throw wrong(fmt::format("a velocity cut-off of {} Hz at a rate of {} Hz",
                            options.velocity_cutoff_hz, options.rate_hz),
                "give one below half the rate");
  }
  if (options.torque_rate_limit.size() > 0 && options.torque_rate_limit.minCoeff() == 0.0) {
    throw wrong("a torque rate limit of 0: no torque would ever change", "give one above 0");
  }
  const bool own_gains = options.kp.size() > 0 || options.kd.size() > 0;
  if (options.law == ControlLaw::kComputedTorque && own_gains) {
    throw wrong("gains of single joints for computed torque, whose gains are the mass matrix's",
                "give the bandwidth, or another law");
  }
}

ServoLog run_servo(const Plant& plant, const TorqueSamples& reference, const KnownRobot& robot,
                   const ServoOptions& options, Rng& rng) {
  check_options(options, plant.size());
  KINESCOPE_CHECK(reference.joints() == plant.size() && reference.size() > 1,
                  "a reference of this robot");
  ControllerOptions control;
  control.law = options.law;
  control.bandwidth_hz = options.bandwidth_hz;
  control.rate_hz = options.rate_hz;
  control.limits = {options.torque_limit, options.torque_rate_limit};
  control.gains = {options.kp, options.kd};
  if (options.kp.size() == 0 || options.kd.size() == 0) {
    // Motors that turn with two joints are on the data sheet, too.
    const Eigen::MatrixXd mass =
        mass_matrix(robot.nominal, reference.q.row(0).transpose()) + plant.coupled_inertia;
    const ServoGains gains = servo_gains(mass, options.bandwidth_hz);
    if (options.kp.size() == 0) control.gains.kp = gains.kp;
    if (options.kd.size() == 0) control.gains.kd = gains.kd;
  }
  return log_of(follow(plant, reference, Controller(robot, control), options), plant, reference,
                options, rng);
}

ServoLog run_servo(const Plant& plant, const TorqueSamples& reference, const ServoOptions& options,
                   Rng& rng) {
  return run_servo(plant, reference, {.nominal = plant.rigid}, options, rng);
}

}  // namespace kinescope
