// SPDX-License-Identifier: Apache-2.0
#include "app/commands/simulation_command_line.h"

#include <span>
#include <vector>

#include <fmt/format.h>

#include "app/commands/command_options.h"

namespace kinescope {
namespace {

template <typename Path>
CLI::Option* add_file(CLI::App& command, const char* name, Path& path, const char* help) {
  return command
      .add_option_function<std::string>(
          name, [&path](const std::string& text) { path = text; }, help)
      ->check([](const std::string& text) { return text.empty() ? "the path is empty" : ""; })
      ->type_name("FILE");
}

/// One number a joint.
CLI::Option* add_list(CLI::App& command, const char* name, Eigen::VectorXd& values,
                      const char* help) {
  return command
      .add_option_function<std::vector<double>>(
          name,
          [&values](const std::vector<double>& numbers) {
            values = Eigen::Map<const Eigen::VectorXd>(numbers.data(), std::ssize(numbers));
          },
          help)
      ->delimiter(',')
      ->check(number_in(0.0, 1e9))
      ->type_name("LIST");
}

struct NumberOption {
  const char* name;
  double ServoOptions::* value;
  double least, most;
  const char* type;
  const char* help;
};

constexpr NumberOption kLogNumbers[] = {
    {"--rate", &ServoOptions::rate_hz, 1.0, 1e5, "HZ",
     "Of the log, and of the controller (default: 1000)"},
    {"--torque-noise", &ServoOptions::torque_noise, 0.0, 1e6, "NM",
     "Standard deviation of the logged torques, N m or N (default: none)"},
};

constexpr NumberOption kServoNumbers[] = {
    {"--bandwidth", &ServoOptions::bandwidth_hz, 1e-3, 1e4, "HZ",
     "Of the position loop, from which the gains follow (default: 10)"},
    {"--delay", &ServoOptions::delay_s, 0.0, 1.0, "S",
     "From measurement to torque (default: none)"},
    {"--encoder-step", &ServoOptions::encoder_step, 0.0, 1.0, "RAD",
     "Positions are multiples of it, rad or m (default: exact)"},
};

std::vector<CLI::Option*> add_numbers(CLI::App& command, ServoOptions& servo,
                                      std::span<const NumberOption> table) {
  std::vector<CLI::Option*> out;
  for (const NumberOption& option : table) {
    out.push_back(command.add_option(option.name, servo.*option.value, option.help)
                      ->check(number_in(option.least, option.most))
                      ->type_name(option.type));
  }
  return out;
}

void add_servo(CLI::App& command, ServoOptions& servo, CLI::Option* in_servo) {
  std::vector<CLI::Option*> options = add_numbers(command, servo, kServoNumbers);
  options.push_back(
      add_list(command, "--kp", servo.kp, "Gains on the position, N m/rad or N/m, one a joint"));
  options.push_back(
      add_list(command, "--kd", servo.kd, "Gains on the velocity, N m s/rad or N s/m"));
  options.push_back(add_list(command, "--torque-limit", servo.torque_limit,
                             "Largest torque of every joint, N m or N (default: none)"));
  options.push_back(command.add_flag_callback(
      "--no-feed-forward", [&servo] { servo.feed_forward = false; },
      "Without the torque of the robot's masses along the trajectory"));
  for (CLI::Option* option : options) option->needs(in_servo)->group("The servo of --servo");
}

}  // namespace

void add_simulate(CLI::App& app, CommandLine& line) {
  CLI::App& command = *app.add_subcommand(
      "simulate", "From a robot, a trajectory and effects to the torque log that they would give");
  SimulateOptions& simulate = line.simulate;
  add_file(command, "ROBOT", simulate.robot, "The robot (URDF with masses)")->required();
  add_file(command, "--trajectory", simulate.trajectory,
           "Joint positions over time: CSV with t in s and a column a joint, rad or m")
      ->required();
  add_file(command, "--effects", simulate.effects,
           "What the robot has beyond its URDF: a trace.json of kinescope dynamics, or a YAML list "
           "(default: nothing)");
  add_file(command, "-o,--output", simulate.output, "The log that kinescope dynamics reads")
      ->required();
  (void)add_numbers(command, simulate.servo, kLogNumbers);
  CLI::Option* in_servo =
      command.add_flag("--servo", simulate.in_servo,
                       "In a servo loop, with friction that sticks at rest (default: the torques "
                       "that move the robot exactly along the trajectory)");
  add_servo(command, simulate.servo, in_servo);
  command.add_option("--seed", simulate.seed, "Of the torque noise (default: 1)")
      ->type_name("NUMBER");
  add_gravity(command, simulate.gravity_m_s2);
  add_force(command, simulate.force, kReplaceFile);
  add_output_options(command, line.output);
  command.footer(fmt::format(
      "Effects in YAML (names and parameters as in trace.json):\n"
      "  effects:\n"
      "    - {{effect: stribeck, joint: joint2, at: 0.05, parameters: {{excess_at_rest: 1.5}}}}\n"
      "    - {{effect: viscous, joint: joint2, parameters: {{viscous: 0.8}}}}\n\n"
      "Example:\n  kinescope simulate robot_dynamics.urdf --trajectory joints.csv --effects "
      "effects.yaml -o log.csv\n  kinescope dynamics log.csv --robot robot_dynamics.urdf\n\n{}",
      kExitCodes));
}

void add_export(CLI::App& app, CommandLine& line) {
  CLI::App& command =
      *app.add_subcommand("export", "The learned robot with its masses and friction for MuJoCo");
  ExportOptions& exported = line.exported;
  add_file(command, "SOURCE", exported.source,
           "Folder of kinescope run or dynamics, or a URDF with masses")
      ->required();
  add_file(command, "--mjcf", exported.mjcf,
           "Model for MuJoCo: masses, damping, frictionloss, armature, ranges, a motor a joint")
      ->required();
  add_gravity(command, exported.gravity_m_s2);
  add_force(command, exported.force, kReplaceFile);
  add_output_options(command, line.output);
  command.footer(
      fmt::format("Example:\n  kinescope dynamics log.csv --robot robot.urdf\n"
                  "  kinescope export log_dynamics --mjcf robot.xml\n\n{}",
                  kExitCodes));
}

}  // namespace kinescope
