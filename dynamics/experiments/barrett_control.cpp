// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/barrett_control.h"

#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "dynamics/experiments/logged_runs.h"

namespace kinescope::experiments {
namespace {

/// Joint 4 alone: the robot's file knows no sensor and no friction.
DynamicModel joint_four(double sensor_kg, double motor_kgm2) {
  DynamicModel arm = wam_arm(sensor_kg);
  Eigen::VectorXd posture = Eigen::VectorXd::Zero(std::ssize(moving_joints(arm.tree)));
  posture[1] = kWamShoulder_rad;
  DynamicModel out = held_arm(std::move(arm), kWamJoint, posture);
  out.joints[moving_joints(out.tree).front().index()].motor_inertia = motor_kgm2;
  return out;
}

TorqueEffect effect(const DynamicModel& arm, const char* name, double value, double scan = 0.0) {
  TorqueEffect out;
  out.id = {name, arm.tree.joints[moving_joints(arm.tree).front().index()].name};
  out.scan = scan;
  out.values = Eigen::VectorXd::Constant(1, value);
  return out;
}

Plant plant_of(const BarrettControlOptions& options) {
  const BarrettOptions& robot = options.robot;
  const DynamicModel arm = joint_four(robot.sensor_kg, options.motor_kgm2);
  return sticking(make_plant(with_effects(
      arm, {effect(arm, "coulomb", robot.coulomb_nm), effect(arm, "viscous", robot.viscous_nms),
            effect(arm, "stribeck", robot.breakaway_nm, robot.stribeck_rad_s)})));
}

TorqueSamples sinusoid(const WamMotion& motion, double duration_s, double rate_hz) {
  TorqueSamples out;
  const auto rows = static_cast<Eigen::Index>(duration_s * rate_hz) + 1;
  out.t_s = Eigen::VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / rate_hz);
  const double w = motion.rate_rad_s;
  const Eigen::ArrayXd angle = w * out.t_s.array();
  out.q = motion.middle_rad + motion.amplitude_rad * angle.sin();
  out.dq = motion.amplitude_rad * w * angle.cos();
  out.ddq = -motion.amplitude_rad * w * w * angle.sin();
  out.torque = Eigen::MatrixXd::Zero(rows, 1);
  out.trajectory = Eigen::VectorXi::Zero(rows);
  return out;
}

BarrettControlRow row_of(std::string name, const ServoLog& run, const TorqueSamples& path,
                         const WamMotion& motion) {
  BarrettControlRow out{
      std::move(name),     0.0, 0.0, run.feedback[0] / run.torque[0], run.weight[0],
      run.samples.q.col(0)};
  const double first_s = 2.0 * std::numbers::pi / motion.rate_rad_s;
  const Eigen::Index first = (path.t_s.array() < first_s).count();
  const Eigen::VectorXd error = (run.samples.q - path.q).col(0).tail(path.size() - first);
  out.error_rad = error.norm() / std::sqrt(static_cast<double>(error.size()));
  out.largest_rad = error.cwiseAbs().maxCoeff();
  return out;
}

}  // namespace

DynamicModel held_arm(DynamicModel arm, Eigen::Index joint, const Eigen::VectorXd& posture) {
  const std::vector<JointId> joints = moving_joints(arm.tree);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    if (i == joint) continue;
    Joint& held = arm.tree.joints[joints[j].index()];
    held.T_parent_joint =
        held.T_parent_joint * Pose{exp_rotation(held.axis * posture[i]), Eigen::Vector3d::Zero()};
    held.type = JointType::kFixed;
    arm.joints[joints[j].index()] = {};
  }
  return arm;
}

BarrettControlResult run_barrett_control(const BarrettControlOptions& options, int threads,
                                         const Progress& progress) {
  const DynamicModel nominal = joint_four(0.0, options.motor_kgm2);
  const Plant plant = plant_of(options);
  ServoOptions servo{.rate_hz = options.rate_hz,
                     .bandwidth_hz = options.bandwidth_hz,
                     .law = ControlLaw::kPdGravity,
                     .velocity_cutoff_hz = options.velocity_cutoff_hz,
                     .encoder_step = options.encoder_step_rad,
                     .torque_noise = options.robot.noise_nm};
  KnownRobot known{.nominal = make_rigid_model(nominal)};
  const TorqueSamples path = sinusoid(options.compensated, options.test_s, options.rate_hz);
  BarrettControlResult out;
  out.t_s = path.t_s;
  out.reference_rad = path.q.col(0);
  const auto judge = [&](std::string name) {
    Rng rng = Rng::from_name("barrett control", options.robot.seed);
    out.rows.push_back(row_of(std::move(name), run_servo(plant, path, known, servo, rng), path,
                              options.compensated));
  };
  judge("PD, nominal gravity");
  Rng rng = Rng::from_name("barrett control log", options.robot.seed);
  const ServoLog log = run_servo(plant, sinusoid(options.learned, options.learn_s, options.rate_hz),
                                 known, servo, rng);
  servo.law = ControlLaw::kFeedForward;
  judge("feed-forward, nominal");
  report_progress(progress, "joint 4: trace", 0, 0);
  LearnedTorque effects = learn_effects(nominal, log, progress);
  for (const TorqueEffect& one : effects.traced->effects) {
    out.effects.push_back(fmt::format("{} at {}", one.id.effect, one.id.place));
  }
  known.learned = std::make_shared<const LearnedTorque>(std::move(effects));
  judge("feed-forward, traced effects");
  for (const TorqueModelKind kind : options.kinds) {
    known.learned =
        std::make_shared<const LearnedTorque>(learn_model(kind, nominal, log, threads, progress));
    judge(fmt::format("feed-forward, {}", to_string(kind)));
  }
  return out;
}

}  // namespace kinescope::experiments
