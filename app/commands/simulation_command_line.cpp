// SPDX-License-Identifier: Apache-2.0
#include "app/commands/simulation_command_line.h"

#include <span>
#include <string>
#include <string_view>
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
                      const std::string& help) {
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

// What every servo has: `numbers`, gains and limits.
std::vector<CLI::Option*> add_servo_options(CLI::App& command, ServoOptions& servo,
                                            std::span<const NumberOption> numbers,
                                            std::string_view no_limit) {
  std::vector<CLI::Option*> out = add_numbers(command, servo, numbers);
  out.push_back(
      add_list(command, "--kp", servo.kp, "Gains on the position, N m/rad or N/m, one a joint"));
  out.push_back(add_list(command, "--kd", servo.kd, "Gains on the velocity, N m s/rad or N s/m"));
  out.push_back(
      add_list(command, "--torque-limit", servo.torque_limit,
               fmt::format("Largest torque of every joint, N m or N (default: {})", no_limit)));
  return out;
}

void add_servo(CLI::App& command, ServoOptions& servo, CLI::Option* in_servo) {
  std::vector<CLI::Option*> options = add_servo_options(command, servo, kServoNumbers, "none");
  options.push_back(command.add_flag_callback(
      "--no-feed-forward", [&servo] { servo.law = ControlLaw::kPd; },
      "Without the torque of the robot's masses along the trajectory"));
  for (CLI::Option* option : options) option->needs(in_servo)->group("The servo of --servo");
}

constexpr NumberOption kControlNumbers[] = {
    {"--rate", &ServoOptions::rate_hz, 1.0, 1e5, "HZ", "Of the controller (default: 1000)"},
    {"--bandwidth", &ServoOptions::bandwidth_hz, 1e-3, 1e4, "HZ",
     "Of the position loop, from which the gains follow (default: 3)"},
    {"--velocity-cutoff", &ServoOptions::velocity_cutoff_hz, 1e-3, 1e5, "HZ",
     "Of the low-pass behind the differences of the encoders (default: 40)"},
    {"--delay", &ServoOptions::delay_s, 0.0, 1.0, "S",
     "From measurement to torque (default: none)"},
    {"--encoder-step", &ServoOptions::encoder_step, 0.0, 1.0, "RAD",
     "Positions are multiples of it, rad or m (default: exact)"},
    {"--torque-noise", &ServoOptions::torque_noise, 0.0, 1e6, "NM",
     "Standard deviation of the logged torques, N m or N (default: none)"},
};

std::vector<std::string> law_names() {
  std::vector<std::string> out;
  for (const ControlLaw law : all_control_laws()) out.emplace_back(to_string(law));
  return out;
}

void add_servo_of_control(CLI::App& command, ServoOptions& servo) {
  constexpr const char* kGroup = "The servo";
  std::vector<CLI::Option*> options =
      add_servo_options(command, servo, kControlNumbers, "the URDF's");
  options.push_back(add_list(command, "--torque-rate-limit", servo.torque_rate_limit,
                             "Largest change of the torque, N m/s or N/s (default: none)"));
  for (CLI::Option* option : options) option->group(kGroup);
}

/// KG or KG,X,Y,Z.
void add_payload(CLI::App& command, ControlOptions& control) {
  command
      .add_option_function<std::vector<double>>(
          "--payload",
          [&control](const std::vector<double>& numbers) {
            if (numbers.size() != 1 && numbers.size() != 4) {
              throw CLI::ValidationError("--payload", "is a mass, or a mass and x,y,z");
            }
            control.payload_kg = numbers[0];
            if (numbers.size() == 4) {
              control.payload_centre_m = Eigen::Vector3d::Map(numbers.data() + 1);
            }
          },
          "Everything again with a load at the last link: kg, and its centre there, m (default: "
          "its origin)")
      ->delimiter(',')
      ->check(number_in(-1e3, 1e3))
      ->type_name("KG,X,Y,Z");
}

void add_learning(CLI::App& command, ControlOptions& control) {
  add_file(command, "--model", control.model,
           "What was learned: a file of kinescope dynamics --save-model, or dynamics.json of its "
           "folder for the masses and effects of its trace");
  CLI::Option* rounds =
      command
          .add_option("--rounds", control.rounds,
                      "Run, log, learn, compensate, run again: so often, from nothing learned")
          ->check(number_in(0, 100))
          ->type_name("N");
  command
      .add_option("--learn", control.learn,
                  "What rounds learn: parametric (with tracing), gip, semi_parametric, rbf "
                  "(default: parametric)")
      ->check(one_of({"parametric", "gip", "semi_parametric", "rbf"}))
      ->type_name("KIND")
      ->needs(rounds);
  add_file(command, "--training", control.training,
           "Trajectory that rounds learn on (default: sinusoids of their own, within the range and "
           "speed of --trajectory, other ones each round)");
}

}  // namespace

void add_control(CLI::App& app, CommandLine& line) {
  CLI::App& command = *app.add_subcommand(
      "control",
      "How well a simulated robot follows a trajectory with what was learned of it, and without");
  ControlOptions& control = line.control;
  add_file(command, "ROBOT", control.robot, "The simulated robot (URDF with masses)")->required();
  add_file(command, "--trajectory", control.trajectory,
           "Joint positions over time: CSV with t in s and a column a joint, rad or m. None of the "
           "rounds learns from it")
      ->required();
  add_file(command, "--effects", control.effects,
           "What the simulated robot has beyond its URDF: a trace.json of kinescope dynamics, or a "
           "YAML list (default: nothing)");
  add_file(command, "--nominal", control.nominal,
           "The robot as its controller knows it: URDF with masses (default: ROBOT)");
  add_learning(command, control);
  command
      .add_option_function<std::string>(
          "--law",
          [&control](const std::string& name) {
            if (const auto law = control_law(name)) control.servo.law = *law;
          },
          "Of the controller that compensates: pd, pd_gravity, feed_forward or computed_torque "
          "(default: feed_forward)")
      ->check(one_of(law_names()))
      ->type_name("LAW");
  add_payload(command, control);
  add_servo_of_control(command, control.servo);
  command.add_option("--seed", control.seed, "Of noise and sinusoids (default: 1)")
      ->type_name("NUMBER");
  add_gravity(command, control.gravity_m_s2);
  add_file(command, "-o,--output", control.output,
           "Folder for the results (default: <trajectory>_control here)")
      ->type_name("FOLDER");
  add_force(command, control.force, kReplaceOthers);
  add_output_options(command, line.output);
  command.footer(fmt::format(
      "Example:\n  kinescope dynamics log.csv --robot sheet.urdf --save-model torque.json\n"
      "  kinescope control sheet.urdf --effects log_dynamics/trace.json --model torque.json "
      "--trajectory T.csv\n"
      "  kinescope control robot.urdf --nominal sheet.urdf --effects effects.yaml --trajectory "
      "T.csv --rounds 2\n\n{}",
      kExitCodes));
}

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

}  // namespace kinescope
