// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/manual/completion.h"

namespace kinescope {
namespace {

// What the script does with the words that the tables give.
constexpr const char* kHead = R"(# SPDX-License-Identifier: Apache-2.0
# bash completion of {0}(1), from its table of options

_{0}() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}}
  # --option=value arrives as three words.
  if [[ $current == = ]]; then
    current=
  elif [[ $before == = ]]; then
    before=${{COMP_WORDS[COMP_CWORD - 2]}}
  fi
  local command= options= argument= words=
  if ((COMP_CWORD > 1)); then command=${{COMP_WORDS[1]}}; fi
)";

constexpr const char* kTail = R"(  COMPREPLY=()
  if [[ -n $words ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
  elif [[ $argument == FILE ]]; then
    compopt -o filenames 2>/dev/null
    mapfile -t COMPREPLY < <(compgen -f -- "$current")
  elif [[ $argument == FOLDER ]]; then
    compopt -o filenames 2>/dev/null
    mapfile -t COMPREPLY < <(compgen -d -- "$current")
  fi
}}
complete -F _{0} {0}
)";

/// FILE and FOLDER complete paths, anything else nothing.
std::string_view path_kind(const OptionEntry& option) {
  if (option.argument == "FILE" || option.argument == "PATH") return "FILE";
  return option.argument == "FOLDER" ? "FOLDER" : "NONE";
}

/// `before)` of the options that take an argument: what it may be.
std::string argument_case(const OptionEntry& option) {
  const std::string names = fmt::format("{}", fmt::join(option.names, " | "));
  if (option.words.empty())
    return fmt::format("        {}) argument={} ;;\n", names, path_kind(option));
  return fmt::format("        {}) argument=WORD words='{}' ;;\n", names,
                     fmt::join(option.words, " "));
}

/// Files where any of the positionals is one.
std::string_view positional_kind(const CommandPage& page) {
  const auto is_file = [](const OptionEntry& entry) { return path_kind(entry) == "FILE"; };
  if (std::ranges::any_of(page.positionals, is_file)) return "FILE";
  return page.positionals.empty() ? "NONE" : "FOLDER";
}

/// What stands where no option takes it: files, or one of some words, where an option may stand
/// too.
std::string positional_case(const CommandPage& page) {
  for (const OptionEntry& positional : page.positionals) {
    if (positional.words.empty()) continue;
    return fmt::format("argument=NONE words='{}'", fmt::join(positional.words, " "));
  }
  return fmt::format("argument={}", positional_kind(page));
}

void add_page(std::string_view pattern, const CommandPage& page, std::string& out) {
  std::vector<std::string> names;
  std::string cases;
  for (const OptionGroup& group : page.groups) {
    for (const OptionEntry& option : group.options) {
      names.insert(names.end(), option.names.begin(), option.names.end());
      if (!option.argument.empty()) cases += argument_case(option);
    }
  }
  out += fmt::format("    {})\n      options='{}'\n      case $before in\n{}", pattern,
                     fmt::join(names, " "), cases);
  out += fmt::format("        *) {} ;;\n      esac\n      ;;\n", positional_case(page));
}

}  // namespace

std::string bash_completion(const CommandPage& program) {
  std::string out = fmt::format(kHead, program.name);
  out += "  case $command in\n";
  std::vector<std::string> commands;
  for (const CommandPage& command : program.commands) {
    commands.push_back(command.name);
    add_page(command.name, command, out);
  }
  add_page("''", program, out);
  out += "  esac\n";
  out += "  if [[ $current == -* && $argument != WORD ]]; then words=$options; fi\n";
  out += fmt::format("  if [[ -z $command && -z $words ]]; then words='{}'; fi\n",
                     fmt::join(commands, " "));
  return out + fmt::format(kTail, program.name);
}

}  // namespace kinescope
