// SPDX-License-Identifier: Apache-2.0
#include "app/manual/command_page.h"

#include <algorithm>
#include <sstream>

#include <CLI/CLI.hpp>

namespace kinescope {
namespace {

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  return {std::istream_iterator<std::string>(in), {}};
}

/// The words that add_choice() leaves in the validator's name; none where anything is taken.
std::vector<std::string> choices(CLI::Option& option) {
  try {
    return words_of(option.get_validator(0)->get_name());
  } catch (const CLI::OptionNotFound&) {
    return {};  // no validator
  }
}

OptionEntry describe_option(CLI::Option& option) {
  OptionEntry out;
  for (const std::string& name : option.get_snames()) out.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) out.names.push_back("--" + name);
  if (option.get_positional()) out.names = {option.get_name(true)};
  out.help = option.get_description();
  if (option.get_type_size() == 0) return out;  // a flag
  // CLI11 joins the argument's name and the validator's description, here a range.
  const std::string type = option.get_type_name();
  const std::size_t colon = type.find(':');
  out.argument = type.substr(0, colon);
  if (colon != std::string::npos) out.range = type.substr(colon + 1);
  out.default_value = option.get_default_str();
  out.required = option.get_required();
  out.repeated = option.get_expected_max() == CLI::detail::expected_max_vector_size;
  out.several = out.repeated && option.get_allow_extra_args();
  out.words = choices(option);
  return out;
}

std::vector<PageSection> describe_footer(const std::string& footer) {
  std::vector<PageSection> out;
  std::istringstream in(footer);
  for (std::string line; std::getline(in, line);) {
    if (line.empty()) continue;
    const std::size_t text = line.find_first_not_of(' ');
    if (text == 0) {
      out.push_back({line.substr(0, line.find(':')), {}});
    } else if (!out.empty()) {
      out.back().lines.push_back(line.substr(text));
    }
  }
  return out;
}

}  // namespace

CommandPage describe_command(CLI::App& app) {
  CommandPage out;
  out.name = app.get_name();
  out.description = app.get_description();
  for (CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;  // hidden from --help
    if (option->get_positional()) {
      out.positionals.push_back(describe_option(*option));
      continue;
    }
    const std::string& title = option->get_group();
    auto group = std::ranges::find(out.groups, title, &OptionGroup::title);
    if (group == out.groups.end()) {
      out.groups.push_back({title, {}});
      group = std::prev(out.groups.end());
    }
    group->options.push_back(describe_option(*option));
  }
  out.footer = describe_footer(app.get_footer());
  for (CLI::App* command : app.get_subcommands({})) {
    out.commands.push_back(describe_command(*command));
  }
  return out;
}

}  // namespace kinescope
