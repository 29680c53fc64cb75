// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/manual/completion.h"

namespace kinescope {
namespace {

/// One word in single quotes.
std::string shell_quoted(std::string_view text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

/// A backslash before what ends a part of a specification of _arguments.
std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

/// What _arguments offers for an argument.
std::string argument_action(const OptionEntry& option) {
  if (!option.words.empty()) return fmt::format("({})", fmt::join(option.words, " "));
  if (option.argument == "FILE" || option.argument == "PATH") return "_files";
  return option.argument == "FOLDER" ? "_files -/" : " ";
}

void append_completion(const OptionEntry& option, std::string& out) {
  const std::string help = fmt::format("[{}]", escaped(option.help));
  const std::string others =
      option.repeated ? "*" : fmt::format("({})", fmt::join(option.names, " "));
  for (const std::string& name : option.names) {
    std::string spec = others + name;
    if (!option.argument.empty()) spec += name.starts_with("--") ? "=" : "+";
    spec += help;
    if (!option.argument.empty())
      spec += fmt::format(":{}:{}", escaped(option.argument), argument_action(option));
    out += fmt::format(" \\\n        {}", shell_quoted(spec));
  }
}

void append_completions(const CommandPage& page, std::string& out) {
  for (const OptionGroup& group : page.groups) {
    for (const OptionEntry& option : group.options) append_completion(option, out);
  }
}

void add_command(const CommandPage& command, std::string& out) {
  out += fmt::format("    {})\n      _arguments", command.name);
  append_completions(command, out);
  for (const OptionEntry& positional : command.positionals) {
    const std::string spec = fmt::format("{}:{}:{}", positional.several ? "*" : "",
                                         positional.names.front(), argument_action(positional));
    out += fmt::format(" \\\n        {}", shell_quoted(spec));
  }
  out += "\n      ;;\n";
}

}  // namespace

std::string zsh_completion(const CommandPage& program) {
  std::string out = fmt::format(
      "#compdef {0}\n# SPDX-License-Identifier: Apache-2.0\n"
      "# zsh completion of {0}(1), from its table of options\n\n"
      "local context state state_descr line\ntypeset -A opt_args\n_arguments -C",
      program.name);
  append_completions(program, out);
  out += " \\\n        '1:command:->command' '*::argument:->argument' && return\n";
  out += "case $state in\n  command)\n    local -a commands=(\n";
  for (const CommandPage& command : program.commands) {
    out +=
        fmt::format("      {}\n",
                    shell_quoted(fmt::format("{}:{}", command.name, escaped(command.description))));
  }
  out += "    )\n    _describe command commands\n    ;;\n";
  out += "  argument)\n    case $words[1] in\n";
  for (const CommandPage& command : program.commands) add_command(command, out);
  return out + "    esac\n    ;;\nesac\n";
}

}  // namespace kinescope
