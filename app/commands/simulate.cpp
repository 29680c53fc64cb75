// SPDX-License-Identifier: Apache-2.0
//
// `kinescope simulate`: a torque log of a robot with known effects along a trajectory.
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "app/commands/simulated_robot.h"
#include "app/io/output_folder.h"
#include "app/report/result_values.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

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

}  // namespace

ExitCode simulate_command(const SimulateOptions& options, const Console& console) {
  std::vector<fs::path> inputs{options.robot, options.trajectory};
  if (options.effects) inputs.push_back(*options.effects);
  require_folder_of(options.output);
  require_new_file(options.output, "--output", inputs, options.force);
  const TorqueRobot robot = read_torque_robot(options.robot, options.gravity_m_s2);
  require_masses(options.robot, robot.model);
  const TorqueSamples motion =
      reference_motion(options.trajectory, robot, options.servo.rate_hz, console);
  const CorrectedTorqueModel model =
      simulated_robot(options.robot, robot.model, options.effects, motion, console);
  const Plant plant = make_plant(model);
  Rng rng(options.seed);
  const ServoLog log = options.in_servo ? run_servo(plant, motion, options.servo, rng)
                                        : exact_log(model, motion, options.servo.torque_noise, rng);
  if (!log.samples.torque.allFinite()) {
    throw bad_input(options.trajectory.string(),
                    "moves faster than any torque could move the robot",
                    "check its unit and its stamps");
  }
  write_file_atomically(options.output, torque_log_csv(log.samples, robot.joints));
  for (const std::string& effect : plant.left_out) {
    console.warn(fmt::format("{} is left out: the temperature is not simulated", effect));
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
    console.print(document);
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
