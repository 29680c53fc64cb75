// SPDX-License-Identifier: Apache-2.0
#include "app/manual/python_functions.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr std::size_t kLineLength = 79;  // of docstrings, PEP 8

/// Of no use to who gets the result as a value.
bool is_of_terminal(const OptionEntry& option) {
  constexpr std::array<std::string_view, 4> kNames{"--help", "--json", "--quiet", "--version"};
  return std::ranges::find(kNames, option.names.back()) != kNames.end();
}

std::vector<const OptionEntry*> python_options(const CommandPage& command) {
  std::vector<const OptionEntry*> out;
  for (const OptionGroup& group : command.groups)
    for (const OptionEntry& option : group.options)
      if (!is_of_terminal(option)) out.push_back(&option);
  // What must be given stands first.
  std::ranges::stable_partition(out, &OptionEntry::required);
  return out;
}

/// "--fail-on" and "RUN_FOLDER" as names of arguments.
std::string argument_name(const OptionEntry& option) {
  std::string out = option.names.back();
  out.erase(0, out.find_first_not_of('-'));
  std::ranges::transform(out, out.begin(), [](unsigned char c) {
    return c == '-' ? '_' : static_cast<char>(std::tolower(c));
  });
  // Its lower-case keywords (The Python Language Reference, 2.3.1), and the last argument of all.
  constexpr std::array<std::string_view, 33> kTaken{
      "and",    "as",   "assert", "async",  "await",    "break",   "class", "continue", "def",
      "del",    "elif", "else",   "except", "finally",  "for",     "from",  "global",   "if",
      "import", "in",   "is",     "lambda", "nonlocal", "not",     "or",    "pass",     "raise",
      "return", "try",  "while",  "with",   "yield",    "progress"};
  KINESCOPE_CHECK(std::ranges::find(kTaken, out) == kTaken.end(),
                  "an option with a word of Python");
  return out;
}

/// Several values in one argument: X,Y,Z.
bool has_commas(const OptionEntry& option) {
  return option.argument == "LIST" || option.argument.find(',') != std::string::npos;
}

std::string type_of(const OptionEntry& option) {
  if (option.argument.empty()) return "bool";
  return option.repeated || has_commas(option) ? "Values" : "Value";
}

std::string parameter(const OptionEntry& option, bool positional) {
  const std::string head = fmt::format("    {}: {}", argument_name(option), type_of(option));
  if (positional || option.required) return head + ",\n";
  return head + (option.argument.empty() ? " = False,\n" : " | None = None,\n");
}

std::string wrapped(std::string_view text, std::string_view indent) {
  std::string out, line(indent);
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    const std::string_view word = text.substr(at, end - at);
    if (line.size() + 1 + word.size() > kLineLength && line.size() > indent.size()) {
      out += line + "\n";
      line = indent;
    }
    if (line.size() > indent.size()) line += ' ';
    line += word;
    at = end + 1;
  }
  return out + line + "\n";
}

/// For a docstring in three quotes that takes backslashes as they stand.
std::string plain_text(std::string text) {
  std::ranges::replace(text, '"', '\'');
  return text;
}

std::string help_of(const OptionEntry& option) {
  std::string head = option.argument.empty() ? "bool" : option.argument;
  if (!option.words.empty()) head = fmt::format("{}", fmt::join(option.words, "|"));
  if (!option.range.empty()) head += ", " + option.range;
  if (!option.default_value.empty()) head += ", default " + option.default_value;
  return fmt::format("    {}: {}\n", argument_name(option), plain_text(head)) +
         wrapped(plain_text(option.help), "        ");
}

std::string docstring(const CommandPage& command, const std::vector<const OptionEntry*>& options) {
  std::string out = fmt::format("    r\"\"\"{}.\n\n", plain_text(command.description));
  out += wrapped(
      fmt::format("What ``kinescope {0} --help`` describes, kinescope-{0}(1).", command.name),
      "    ");
  out += "\n    Parameters\n    ----------\n";
  for (const OptionEntry& positional : command.positionals) out += help_of(positional);
  for (const OptionEntry* option : options) out += help_of(*option);
  return out +
         "    progress: callable(stage, done, total)\n"
         "        Told of long stages, from any thread; total 0: not known.\n\n"
         "    Returns\n    -------\n    dict\n        What ``--json`` prints.\n\n"
         "    Raises\n    ------\n    kinescope.Error\n"
         "        Its subclasses are the program's exit codes.\n    \"\"\"\n";
}

std::string call_of(const CommandPage& command, const std::vector<const OptionEntry*>& options) {
  std::vector<std::string> positionals;
  for (const OptionEntry& positional : command.positionals)
    positionals.push_back(argument_name(positional));
  std::string out = fmt::format("    return call(\n        \"{}\",\n        [{}],\n        [\n",
                                command.name, fmt::join(positionals, ", "));
  for (const OptionEntry* option : options) {
    const std::string value = argument_name(*option);
    out += fmt::format("            (\"{}\", {}),\n", option->names.back(),
                       has_commas(*option) ? fmt::format("commas({})", value) : value);
  }
  return out + "        ],\n        progress,\n    )\n";
}

std::string function_of(const CommandPage& command) {
  const std::vector<const OptionEntry*> options = python_options(command);
  std::string out = fmt::format("\n\ndef {}(\n", command.name);
  for (const OptionEntry& positional : command.positionals) out += parameter(positional, true);
  out += "    *,\n";
  for (const OptionEntry* option : options) out += parameter(*option, false);
  out += "    progress: Progress | None = None,\n) -> dict[str, Any]:\n";
  return out + docstring(command, options) + call_of(command, options);
}

}  // namespace

std::string python_functions(const CommandPage& program) {
  std::vector<std::string> names;
  for (const CommandPage& command : program.commands) names.push_back('"' + command.name + '"');
  std::string out = fmt::format(
      "# SPDX-License-Identifier: Apache-2.0\n"
      "\"\"\"Every command of {0}(1) as a function, from its table of options.\"\"\"\n\n"
      "from __future__ import annotations\n\nfrom typing import Any\n\n"
      "from ._call import Progress, Value, Values, call, commas\n\n__all__ = [\n",
      program.name);
  for (const std::string& name : names) out += fmt::format("    {},\n", name);
  out += "]\n";
  for (const CommandPage& command : program.commands) out += function_of(command);
  return out;
}

}  // namespace kinescope
