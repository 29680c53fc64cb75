// SPDX-License-Identifier: Apache-2.0
#include "app/commands/policy_command_line.h"

#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands/command_options.h"
#include "dynamics/policy/systems/library.h"
#include "kinematics/core/csv.h"

namespace kinescope {
namespace {

constexpr const char* kHow = "How it is learned";

struct CountOption {
  const char* name;
  int PolicyCommandOptions::* value;
  double least, most;
  const char* help;
};

constexpr CountOption kCounts[] = {
    {"--explorations", &PolicyCommandOptions::explorations, 1, 100,
     "Trials with random inputs before the first policy"},
    {"--particles", &PolicyCommandOptions::particles, 2, 100000,
     "Rollouts of the model that estimate the cost of a policy; more: smoother and slower"},
    {"--basis-functions", &PolicyCommandOptions::basis_functions, 1, 10000,
     "Of the policy; more: finer and slower"},
    {"--starts", &PolicyCommandOptions::starts, 1, 100,
     "Policies that each search begins with; the one that costs least soon goes on"},
    {"--search-steps", &PolicyCommandOptions::search_steps, 1, 1000000,
     "Gradient steps before each trial, at most; it stops where the cost no longer falls"},
};

void add_learning(CLI::App& command, PolicyCommandOptions& policy) {
  static const std::map<std::string, policy::VelocityKernel> kKernels = {
      {"se", policy::VelocityKernel::kSquaredExponential},
      {"se_p2", policy::VelocityKernel::kPolynomial2},
      {"semi_parametric", policy::VelocityKernel::kSemiParametric}};
  static const std::map<std::string, policy::Sensing> kSensing = {
      {"full", policy::Sensing::kFullState}, {"positions", policy::Sensing::kPositionsOnly}};
  command
      .add_option_function<int>(
          "--trials", [&policy](const int& count) { policy.trials = count; },
          "Trials with a learned policy (default: as many as the system asks for); a folder with "
          "fewer "
          "is gone on with")
      ->check(number_in(1, 1000))
      ->type_name("N")
      ->group(kHow);
  for (const CountOption& option : kCounts) {
    command.add_option(option.name, policy.*option.value, option.help)
        ->check(number_in(option.least, option.most))
        ->capture_default_str()
        ->type_name("N")
        ->group(kHow);
  }
  add_choice(
      command, "--kernel", kKernels, policy.kernel,
      "Of the model: se (squared exponential; default), se_p2 (and a polynomial of degree 2), "
      "semi_parametric (and the terms of the plant's equations)")
      ->type_name("KERNEL")
      ->group(kHow);
  add_choice(command, "--sensing", kSensing, policy.sensing,
             "Of a plant of the literature: full (default), or positions, from which speeds are "
             "estimated")
      ->type_name("WHAT")
      ->group(kHow);
  command
      .add_flag(
          "--plain", policy.plain,
          "With --sensing positions, for comparison: the model's particles do not see through "
          "the sensors and their filters")
      ->group(kHow);
}

// "3..7".
std::optional<std::pair<int, int>> seeds_of(const std::string& text) {
  const std::size_t dots = text.find("..");
  if (dots == std::string::npos) return std::nullopt;
  const std::optional<double> first = parse_number(text.substr(0, dots));
  const std::optional<double> last = parse_number(text.substr(dots + 2));
  const auto whole = [](const std::optional<double>& value) {
    return value && *value >= 0.0 && *value <= 1e9 && *value == std::floor(*value);
  };
  if (!whole(first) || !whole(last) || *last < *first) return std::nullopt;
  return std::pair(static_cast<int>(*first), static_cast<int>(*last));
}

CLI::Option* add_seeds(CLI::App& command, PolicyCommandOptions& policy) {
  return command
      .add_option_function<std::string>(
          "--seeds", [&policy](const std::string& text) { policy.seeds = seeds_of(text); },
          "Several searches, one after another: A..B; each in a folder seed_N of the output, with "
          "a table of all that are there (also those that another machine wrote)")
      ->check([](const std::string& text) {
        return seeds_of(text) ? std::string()
                              : fmt::format("'{}' is no range of seeds such as 1..50", text);
      })
      ->type_name("A..B");
}

}  // namespace

void add_policy(CLI::App& app, CommandLine& line) {
  CLI::App& command = *app.add_subcommand(
      "policy", "From a system that may be tried a few times to a policy that controls it");
  PolicyCommandOptions& policy = line.policy;
  command
      .add_option_function<std::string>(
          "SYSTEM", [&policy](const std::string& text) { policy.system = text; },
          fmt::format("A plant of the literature ({}), or a YAML file with a system of one's own",
                      fmt::join(policy::problem_names(), ", ")))
      ->check([](const std::string& text) { return text.empty() ? "the name is empty" : ""; })
      ->required()
      ->type_name("SYSTEM");
  add_learning(command, policy);
  CLI::Option* seed = command.add_option("--seed", policy.seed, "Of all random numbers")
                          ->check(number_in(0, 1e9))
                          ->capture_default_str()
                          ->type_name("N");
  add_seeds(command, policy)->excludes(seed);
  add_threads(command, policy.threads);
  command
      .add_option_function<std::string>(
          "-o,--output", [&policy](const std::string& text) { policy.output = text; },
          "Folder for the results (default: <system>_policy here); a search that was cut off goes "
          "on")
      ->type_name("FOLDER");
  add_force(command, policy.force,
            "Begin anew, and replace what others wrote in the output folder");
  add_output_options(command, line.output);
  command.footer(
      fmt::format("Examples:\n  kinescope policy cartpole --seed 1 -o cartpole_1\n"
                  "  kinescope policy my_robot.yaml --trials 8\n"
                  "  kinescope policy cartpole --seeds 1..50 -o cartpole_seeds\n\n{}",
                  kExitCodes));
}

}  // namespace kinescope
