// SPDX-License-Identifier: Apache-2.0
//
// What several commands say on the command line. Shows CLI11, as command_line.h does.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "app/commands/command_line.h"
#include "app/io/shard.h"

namespace kinescope {

/// Stands at the end of every command's help.
inline constexpr const char* kExitCodes =
    "Exit codes:\n"
    "  0  done\n"
    "  1  internal error\n"
    "  2  the command line or a setting makes no sense, or the output cannot be written\n"
    "  3  an input cannot be read\n"
    "  4  the data cannot determine what was asked; the message says what to record instead\n"
    "  5  done, but outside a limit set with --fail-on";

/// A finite number in a range. CLI::Range lets NaN through.
[[nodiscard]] CLI::Validator number_in(double least, double most);

/// One of these words, which stand in the validator's name: for completion.
[[nodiscard]] CLI::Validator one_of(const std::vector<std::string>& known);

/// One word of several.
template <typename Enum, typename Value>
CLI::Option* add_choice(CLI::App& command, const char* name,
                        const std::map<std::string, Enum>& words, Value& value, const char* help) {
  std::vector<std::string> known;
  for (const auto& [word, meaning] : words) known.push_back(word);
  return command
      .add_option_function<std::string>(
          name, [&value, words](const std::string& text) { value = words.at(text); }, help)
      ->check(one_of(known));
}

/// A check of paths.
[[nodiscard]] std::string refuse_empty(const std::string& path);
/// A file in place of one of the recording's.
void add_path(CLI::App& command, const char* name, std::optional<std::filesystem::path>& path,
              const char* help);
/// A path that must be given.
void add_path_argument(CLI::App& command, const char* name, std::filesystem::path& path,
                       const char* help, const char* type);

/// --force of a command that writes a file, and of one that writes into a folder.
inline constexpr const char* kReplaceFile = "Replace the file that is there";
inline constexpr const char* kReplaceOthers =
    "Replace what others wrote: files in the output folder, and files that were named";
void add_force(CLI::App& command, bool& force, const char* help);

/// --gravity X,Y,Z in the base frame.
void add_gravity(CLI::App& command, std::optional<Eigen::Vector3d>& gravity_m_s2);

/// --threads of a command whose result does not depend on it.
void add_threads(CLI::App& command, int& threads);

/// The words that say what was understood of a command line, in the order of the options' table:
/// the command's name, its arguments, `--name=value`. Without options of these names.
[[nodiscard]] std::vector<std::string> words_of(const CLI::App& command,
                                                const std::vector<std::string>& without);

/// --shard i/n.
void add_shard(CLI::App& command, std::optional<Shard>& shard, const char* help);

/// --json and --quiet.
void add_output_options(CLI::App& command, OutputOptions& output);

}  // namespace kinescope
