// SPDX-License-Identifier: Apache-2.0
#include "app/commands/control_bench.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "app/commands/simulated_robot.h"
#include "dynamics/experiments/reference_arms.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/mass_matrix.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

constexpr double kTraining_s = 40.0;

// Samples that a curve is drawn through.
auto shown_rows(const TorqueSamples& samples) {
  constexpr Eigen::Index kShownPoints = 600;
  return Eigen::seq(Eigen::Index{0}, samples.size() - 1, 1 + (samples.size() - 1) / kShownPoints);
}

TorqueRobot robot_with_masses(const fs::path& file, const ControlOptions& options) {
  TorqueRobot out = read_torque_robot(file, options.gravity_m_s2);
  require_masses(file, out.model);
  return out;
}

/// The URDF's efforts, where every joint has one.
Eigen::VectorXd efforts_of(const DynamicModel& model) {
  const std::vector<JointId> joints = moving_joints(model.tree);
  Eigen::VectorXd out(std::ssize(joints));
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const auto& effort = model.tree.joints[joints[j].index()].effort;
    if (!effort || !(*effort > 0.0)) return {};
    out[static_cast<Eigen::Index>(j)] = *effort;
  }
  return out;
}

CorrectedTorqueModel with_load(CorrectedTorqueModel model, const ControlOptions& options) {
  TorqueEffect load;
  const RigidModel& rigid = model.base.rigid;
  load.id = {"payload", rigid.bodies[last_body(rigid)].name};
  load.values =
      from_central({*options.payload_kg, options.payload_centre_m, Eigen::Matrix3d::Zero()})
          .vector();
  model.effects.push_back(std::move(load));
  model.in_model.push_back(0);
  return model;
}

/// Between the turns of each joint of a path, at frequencies up to twice the path's own.
TorqueSamples sinusoids_like(const TorqueSamples& path, DynamicModel model,
                             const ControlOptions& options, int round) {
  const std::vector<JointId> joints = moving_joints(model.tree);
  double rate = 0.0;
  for (Eigen::Index j = 0; j < path.joints(); ++j) {
    const double low = path.q.col(j).minCoeff();
    const double high = path.q.col(j).maxCoeff();
    model.tree.joints[joints[static_cast<std::size_t>(j)].index()].limits = JointLimits{low, high};
    const double spread = (path.q.col(j).array() - path.q.col(j).mean()).matrix().norm();
    if (spread > 0.0) rate = std::max(rate, path.dq.col(j).norm() / spread);
  }
  SinusoidOptions sinusoids;
  sinusoids.rate_hz = options.servo.rate_hz;
  sinusoids.samples = static_cast<int>(kTraining_s * options.servo.rate_hz) + 1;
  sinusoids.sines = 10;
  sinusoids.highest_hz = rate / std::numbers::pi;
  sinusoids.lowest_hz = 0.1 * sinusoids.highest_hz;
  sinusoids.range_share = 1.0;
  Rng rng = Rng::from_name(fmt::format("control training {}", round), options.seed);
  return sinusoid_log(model, sinusoids, rng);
}

}  // namespace

ControlBench::ControlBench(const ControlOptions& options, const Console& console)
    : options_(options),
      console_(console),
      robot_(robot_with_masses(options.robot, options)),
      nominal_(robot_with_masses(options.nominal.value_or(options.robot), options)),
      nominal_file_(options.nominal.value_or(options.robot)),
      servo_(options.servo),
      reference_(reference_motion(options.trajectory, robot_, options.servo.rate_hz, console)) {
  if (nominal_.joints != robot_.joints) {
    throw bad_input(nominal_file_.string(),
                    fmt::format("has other joints than {}", options.robot.filename().string()),
                    "give the same robot with the masses that its controller knows");
  }
  if (servo_.torque_limit.size() == 0) servo_.torque_limit = efforts_of(robot_.model);
  check_options(servo_, reference_.joints());
  check_path(reference_, options.trajectory);
  check_limits();
  const CorrectedTorqueModel model =
      simulated_robot(options.robot, robot_.model, options.effects, reference_, console);
  plants_[0] = make_plant(model);
  plants_[1] = options.payload_kg ? make_plant(with_load(model, options)) : plants_[0];
  // The same gains for all, from the masses that the controller knows.
  const ServoGains gains =
      servo_gains(mass_matrix(make_rigid_model(nominal_.model), reference_.q.row(0).transpose()),
                  servo_.bandwidth_hz);
  if (servo_.kp.size() == 0) servo_.kp = gains.kp;
  if (servo_.kd.size() == 0) servo_.kd = gains.kd;
}

void ControlBench::check_path(const TorqueSamples& path, const fs::path& file) const {
  constexpr double kRounding = 1e-6;
  const std::vector<JointId> joints = moving_joints(robot_.model.tree);
  for (Eigen::Index j = 0; j < path.joints(); ++j) {
    const Joint& joint = robot_.model.tree.joints[joints[static_cast<std::size_t>(j)].index()];
    const double low = path.q.col(j).minCoeff();
    const double high = path.q.col(j).maxCoeff();
    if (joint.limits &&
        (low < joint.limits->lower - kRounding || high > joint.limits->upper + kRounding)) {
      throw bad_input(file.string(),
                      fmt::format("moves '{}' from {:.4g} to {:.4g}, its limits are {:.4g} and "
                                  "{:.4g}",
                                  joint.name, low, high, joint.limits->lower, joint.limits->upper),
                      "give a trajectory within the limits of the URDF");
    }
    const double fastest = path.dq.col(j).cwiseAbs().maxCoeff();
    if (joint.velocity && *joint.velocity > 0.0 && fastest > *joint.velocity * (1.0 + kRounding)) {
      throw bad_input(file.string(),
                      fmt::format("moves '{}' at up to {:.4g} per s, its limit is {:.4g}",
                                  joint.name, fastest, *joint.velocity),
                      "give a slower trajectory");
    }
  }
}

/// A limit below what the postures need contradicts the trajectory.
void ControlBench::check_limits() const {
  if (servo_.torque_limit.size() == 0) return;
  const Eigen::MatrixXd still = Eigen::MatrixXd::Zero(reference_.size(), reference_.joints());
  const Eigen::VectorXd needed =
      inverse_dynamics_of_samples(make_rigid_model(robot_.model), reference_.q, still, still)
          .cwiseAbs()
          .colwise()
          .maxCoeff()
          .transpose();
  for (Eigen::Index j = 0; j < needed.size(); ++j) {
    if (needed[j] <= servo_.torque_limit[j]) continue;
    throw bad_request(
        "--torque-limit",
        fmt::format("{} may give {:.4g}, and holding it on the trajectory needs "
                    "{:.4g}",
                    robot_.joints[static_cast<std::size_t>(j)], servo_.torque_limit[j], needed[j]),
        "raise the limit, or give another trajectory");
  }
}

Eigen::VectorXd ControlBench::shown_times() const { return reference_.t_s(shown_rows(reference_)); }

TorqueSamples ControlBench::training(int round) const {
  if (!options_.training) return sinusoids_like(reference_, nominal_.model, options_, round);
  TorqueSamples out = reference_motion(*options_.training, robot_, servo_.rate_hz, console_);
  check_path(out, *options_.training);
  return out;
}

ServoLog ControlBench::follow(const Contender& contender, const TorqueSamples& path) const {
  ServoOptions servo = servo_;
  servo.law = contender.law;
  if (servo.law == ControlLaw::kComputedTorque) servo.kp = servo.kd = Eigen::VectorXd();
  const KnownRobot known{make_rigid_model(nominal_.model), contender.learned, contender.known_load};
  Rng rng = Rng::from_name("control " + contender.file, options_.seed);
  return run_servo(plants_[contender.loaded ? 1 : 0], path, known, servo, rng);
}

ControlRun ControlBench::judge(const Contender& contender, const OutputFolder& folder) const {
  const ServoLog log = follow(contender, reference_);
  ControlRun out{contender.name, contender.law, contender.kind};
  if (contender.loaded) out.payload = contender.known_load ? "identified" : "unknown";
  out.round = contender.round;
  out.log = contender.file + ".csv";
  out.error = log.tracking_error;
  out.largest = log.largest_error;
  out.feedback = log.feedback.cwiseQuotient(log.torque);
  out.weight = log.weight;
  out.limited = log.limited;
  out.errors = (log.samples.q - reference_.q)(shown_rows(reference_), Eigen::all);
  folder.write(out.log, torque_log_csv(log.samples, robot_.joints));
  return out;
}

}  // namespace kinescope
