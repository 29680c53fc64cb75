// SPDX-License-Identifier: Apache-2.0
//
// `kinescope simulate`: a torque log of a robot with known effects along a trajectory.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "app/commands/output_folder.h"
#include "app/commands/torque_inputs.h"
#include "app/io/torque_effects_file.h"
#include "app/report/result_values.h"
#include "dynamics/data/log_checks.h"
#include "dynamics/simulation/robot_effects.h"
#include "kinematics/core/file.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/log/smoothing_spline.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

/// The channel of every joint: its name, q_NAME or NAME_position; where none is named so, and there
/// are as many as joints, their order.
std::vector<int> channels_of(const JointLog& log, const TorqueRobot& robot) {
  std::vector<int> out;
  std::string missing;
  for (const std::string& joint : robot.joints) {
    std::optional<int> found;
    for (const std::string& name : {joint, "q_" + joint, joint + "_position"}) {
      if (!found) found = log.channel(name);
    }
    if (found) {
      out.push_back(*found);
    } else if (missing.empty()) {
      missing = joint;
    }
  }
  if (missing.empty()) return out;
  if (out.empty() && log.channels.size() == robot.joints.size()) {
    for (std::size_t j = 0; j < robot.joints.size(); ++j) out.push_back(static_cast<int>(j));
    return out;
  }
  throw bad_input(log.source, fmt::format("has no column for joint '{}'", missing),
                  fmt::format("name the columns t, {}", fmt::join(robot.joints, ", ")));
}

/// Values that are too large to be rad or m.
void require_plausible_units(const JointLog& log, const Eigen::MatrixXd& values,
                             const std::vector<int>& channels, const TorqueRobot& robot) {
  TorqueLog checked;
  checked.sources = {log.source};
  checked.q = values;
  checked.source.assign(static_cast<std::size_t>(values.rows()), 0);
  checked.lines.assign(static_cast<std::size_t>(values.rows()), 0);
  for (std::size_t j = 0; j < channels.size(); ++j) {
    checked.joints.push_back({robot.joints[j], robot.types[j] == JointType::kPrismatic});
    checked.q_columns.push_back(log.channels[static_cast<std::size_t>(channels[j])]);
  }
  for (const LogFinding& finding : check_ranges(checked))
    throw bad_input(log.source, finding.what, "write the trajectory in rad and m");
}

/// The trajectory as a smooth motion in even steps.
TorqueSamples reference_motion(const JointLog& log, const TorqueRobot& robot, double rate_hz) {
  constexpr std::size_t kFewest = 8;  // of the spline
  if (log.size() < kFewest) {
    throw bad_input(log.source, fmt::format("holds {} rows", log.size()),
                    fmt::format("give at least {}", kFewest));
  }
  const std::vector<int> channels = channels_of(log, robot);
  Eigen::MatrixXd values(std::ssize(log.times_s), std::ssize(channels));
  for (std::size_t j = 0; j < channels.size(); ++j) {
    values.col(static_cast<Eigen::Index>(j)) = log.values.col(channels[j]);
  }
  require_plausible_units(log, values, channels, robot);
  const Eigen::VectorXd t_s =
      Eigen::Map<const Eigen::VectorXd>(log.times_s.data(), std::ssize(log.times_s));
  const double span_s = t_s[t_s.size() - 1] - t_s[0];
  // Smooth enough to be followed, near enough to pass through the rows: a quarter of their rate.
  constexpr double kOfRate = 0.25;
  const double cutoff_hz = kOfRate * static_cast<double>(t_s.size() - 1) / span_s;
  const SmoothingSpline spline(t_s, values, cutoff_hz);
  TorqueSamples out;
  const auto rows = static_cast<Eigen::Index>(std::floor(span_s * rate_hz)) + 1;
  if (rows < 2) {
    throw bad_input(log.source, fmt::format("lasts {:.3g} s, less than a period", span_s),
                    "give a longer trajectory, or a higher --rate");
  }
  out.t_s = t_s[0] + Eigen::ArrayXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1)) / rate_hz;
  // Rounding must not leave the spline.
  out.t_s = out.t_s.cwiseMin(t_s[t_s.size() - 1]);
  out.q = spline.evaluate(out.t_s);
  out.dq = spline.evaluate(out.t_s, 1);
  out.ddq = spline.evaluate(out.t_s, 2);
  out.torque = Eigen::MatrixXd::Zero(rows, out.q.cols());
  out.trajectory = Eigen::VectorXi::Zero(rows);
  return out;
}

/// Of a trace, effects that the URDF already holds are not added again.
std::vector<ListedEffect> not_yet_in(const fs::path& robot, const fs::path& trace,
                                     std::vector<ListedEffect> effects) {
  const bool traced_urdf = same_place(robot, trace.parent_path() / "robot_traced.urdf");
  std::erase_if(effects, [&](const ListedEffect& effect) { return traced_urdf && effect.in_urdf; });
  return effects;
}

CorrectedTorqueModel model_of(const SimulateOptions& options, const DynamicModel& robot,
                              const TorqueSamples& motion) {
  if (!options.effects) return with_effects(robot);
  const ListedEffects listed = read_listed_effects(*options.effects);
  const RobotEffects known = effects_of_robot(robot, motion);
  std::vector<JointTravel> travels = known.travels;
  const std::vector<JointId> joints = moving_joints(robot.tree);
  for (std::size_t j = 0; j < travels.size(); ++j) {
    const auto speed = listed.high_speeds.find(robot.tree.joints[joints[j].index()].name);
    if (speed != listed.high_speeds.end()) travels[j].high_speed = speed->second;
  }
  return with_effects(
      robot,
      resolved(not_yet_in(options.robot, *options.effects, listed.effects), known.candidates),
      travels, listed.log.value_or(known.log));
}

/// Inverse dynamics along the trajectory itself.
ServoLog exact_log(const CorrectedTorqueModel& model, const TorqueSamples& motion, double noise,
                   Rng& rng) {
  ServoLog out{motion, Eigen::VectorXd::Zero(motion.joints())};
  out.samples.torque = predict_torque(model, motion);
  if (noise > 0.0) {
    for (double& torque : out.samples.torque.reshaped()) torque += rng.normal(noise);
  }
  return out;
}

// t, then of every joint position, velocity and torque.
std::string log_csv(const TorqueSamples& samples, const std::vector<std::string>& joints) {
  std::string out = "t";
  for (const char* what : {"q", "dq", "tau"}) {
    for (const std::string& joint : joints) out += fmt::format(",{}_{}", what, joint);
  }
  out += "\n";
  for (Eigen::Index i = 0; i < samples.size(); ++i) {
    out += fmt::format("{:.9g}", samples.t_s[i]);
    for (const Eigen::MatrixXd* values : {&samples.q, &samples.dq, &samples.torque}) {
      for (Eigen::Index j = 0; j < values->cols(); ++j) {
        out += fmt::format(",{:.10g}", (*values)(i, j));
      }
    }
    out += "\n";
  }
  return out;
}

}  // namespace

ExitCode simulate_command(const SimulateOptions& options, const Console& console) {
  std::vector<fs::path> inputs{options.robot, options.trajectory};
  if (options.effects) inputs.push_back(*options.effects);
  require_new_file(options.output, "--output", inputs, options.force);
  const TorqueRobot robot = read_torque_robot(options.robot, options.gravity_m_s2);
  if (!has_masses(robot.model)) {
    throw bad_input(options.robot.string(), "no link has a mass",
                    "give a robot with masses: robot_dynamics.urdf of kinescope dynamics");
  }
  const JointLog trajectory = read_joint_log(options.trajectory);
  for (const std::string& warning : trajectory.warnings)
    fmt::print(stderr, "warning: {}\n", warning);
  const TorqueSamples motion = reference_motion(trajectory, robot, options.servo.rate_hz);
  const CorrectedTorqueModel model = model_of(options, robot.model, motion);
  const Plant plant = make_plant(model);
  Rng rng(options.seed);
  const ServoLog log = options.in_servo ? run_servo(plant, motion, options.servo, rng)
                                        : exact_log(model, motion, options.servo.torque_noise, rng);
  if (!log.samples.torque.allFinite()) {
    throw bad_input(options.trajectory.string(),
                    "moves faster than any torque could move the robot",
                    "check its unit and its stamps");
  }
  write_file_atomically(options.output, log_csv(log.samples, robot.joints));
  for (const std::string& effect : plant.left_out) {
    fmt::print(stderr, "warning: {} is left out: the temperature is not simulated\n", effect);
  }
  if (console.json) {
    nlohmann::json document{{"log", report::text(options.output.string())},
                            {"samples", log.samples.size()},
                            {"rate_hz", options.servo.rate_hz},
                            {"effects", model.effects.size()},
                            {"joints", nlohmann::json::array()}};
    for (std::size_t j = 0; j < robot.joints.size(); ++j) {
      document["joints"].push_back(
          {{"name", report::text(robot.joints[j])},
           {"tracking_error", report::number(log.tracking_error[static_cast<Eigen::Index>(j)])}});
    }
    fmt::print("{}\n", document.dump(2));
    return ExitCode::kDone;
  }
  Eigen::Index worst = 0;
  log.tracking_error.maxCoeff(&worst);
  const auto w = static_cast<std::size_t>(worst);
  fmt::print("{} samples at {:.6g} Hz with {} effects; ", log.samples.size(), options.servo.rate_hz,
             model.effects.size());
  if (!options.in_servo) {
    fmt::print("exactly along the trajectory\n");
  } else {
    fmt::print("{} follows it worst, {:.3g} {} rms\n", robot.joints[w], log.tracking_error[worst],
               robot.types[w] == JointType::kPrismatic ? "m" : "rad");
  }
  fmt::print("log     {}\n", options.output.string());
  return ExitCode::kDone;
}

}  // namespace kinescope
