// SPDX-License-Identifier: Apache-2.0
#include "app/commands/command_options.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/io/nearest_name.h"
#include "kinematics/core/csv.h"

namespace kinescope {
namespace {

std::string refuse_other(const std::string& word, const std::vector<std::string>& known) {
  if (std::ranges::find(known, word) != known.end()) return {};
  return fmt::format("'{}' is not known; {}", word, did_you_mean(word, known));
}

}  // namespace

CLI::Validator one_of(const std::vector<std::string>& known) {
  CLI::Validator out([known](const std::string& word) { return refuse_other(word, known); }, "");
  out.name(fmt::format("{}", fmt::join(known, " ")));
  return out;
}

CLI::Validator number_in(double least, double most) {
  return {[least, most](const std::string& text) -> std::string {
            const std::optional<double> value = parse_number(text);
            if (value && std::isfinite(*value) && *value >= least && *value <= most) return {};
            return fmt::format("'{}' is not a number from {} to {}", text, least, most);
          },
          fmt::format("{} to {}", least, most)};
}

std::string refuse_empty(const std::string& path) {
  return path.empty() ? "the path is empty" : "";
}

void add_path(CLI::App& command, const char* name, std::optional<std::filesystem::path>& path,
              const char* help) {
  command
      .add_option_function<std::string>(
          name, [&path](const std::string& text) { path = text; }, help)
      ->check(refuse_empty)
      ->type_name("FILE")
      ->group("Files in place of those in the recording");
}

void add_path_argument(CLI::App& command, const char* name, std::filesystem::path& path,
                       const char* help, const char* type) {
  command
      .add_option_function<std::string>(
          name, [&path](const std::string& text) { path = text; }, help)
      ->required()
      ->type_name(type);
}

void add_force(CLI::App& command, bool& force, const char* help) {
  command.add_flag("--force", force, help);
}

void add_threads(CLI::App& command, int& threads) {
  command
      .add_option("--threads", threads, "Threads; 0: all of the machine. Never changes a result")
      ->check(number_in(0, 256))
      ->capture_default_str()
      ->type_name("N");
}

std::vector<std::string> words_of(const CLI::App& command,
                                  const std::vector<std::string>& without) {
  std::vector<std::string> out{command.get_name()};
  std::vector<std::string> named;
  for (const CLI::Option* option : command.get_options()) {
    if (option->count() == 0) continue;
    if (option->get_positional()) {
      out.insert(out.end(), option->results().begin(), option->results().end());
      continue;
    }
    const std::string name = "--" + option->get_lnames().front();
    if (std::ranges::find(without, name) != without.end()) continue;
    const bool is_flag = option->get_type_size() == 0;
    if (is_flag) named.push_back(name);
    for (const std::string& value : option->results())
      if (!is_flag) named.push_back(name + "=" + value);
  }
  out.insert(out.end(), named.begin(), named.end());
  return out;
}

void add_shard(CLI::App& command, std::optional<Shard>& shard, const char* help) {
  command
      .add_option_function<std::string>(
          "--shard", [&shard](const std::string& text) { shard = parse_shard(text); }, help)
      ->check([](const std::string& text) -> std::string {
        return parse_shard(text)
                   ? ""
                   : fmt::format("'{}' is no shard: i/n, i from 1 to n, such as 2/3", text);
      })
      ->type_name("I/N");
}

void add_output_options(CLI::App& command, OutputOptions& output) {
  command.add_flag("--json", output.json, "Print the result as JSON");
  command.add_flag("--quiet", output.quiet, "No progress on standard error (warnings stay)");
}

void add_gravity(CLI::App& command, std::optional<Eigen::Vector3d>& gravity_m_s2) {
  command
      .add_option_function<std::vector<double>>(
          "--gravity",
          [&gravity_m_s2](const std::vector<double>& g) {
            gravity_m_s2 = Eigen::Vector3d(g[0], g[1], g[2]);
          },
          "Acceleration of free fall in the base frame, m/s^2 (default: 0,0,-9.81)")
      ->delimiter(',')
      ->expected(3)
      ->check(number_in(-100, 100))
      ->type_name("X,Y,Z");
}

}  // namespace kinescope
