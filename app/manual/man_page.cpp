// SPDX-License-Identifier: Apache-2.0
#include "app/manual/man_page.h"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

namespace kinescope {
namespace {

/// Text that roff prints as it stands: hyphens that can be copied, no controls.
std::string plain(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '-') {
      out += "\\-";
    } else if (c == '\\') {
      out += "\\e";
    } else if (c == '\'') {
      out += "\\(aq";
    } else {
      out += c;
    }
  }
  return out.starts_with('.') ? "\\&" + out : out;
}

std::string bold(std::string_view text) { return fmt::format("\\fB{}\\fR", plain(text)); }
std::string italic(std::string_view text) { return fmt::format("\\fI{}\\fR", plain(text)); }

std::string upper(std::string text) {
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return text;
}

std::string sentence(std::string text) {
  if (!text.empty() && !text.ends_with('.') && !text.ends_with(')')) text += '.';
  return text;
}

std::string full_name(const CommandPage& program, const CommandPage& page) {
  return &program == &page ? program.name : fmt::format("{}-{}", program.name, page.name);
}

std::string argument_words(const OptionEntry& option) {
  if (option.argument.empty()) return "";
  return " " + italic(option.argument) + (option.several ? " ..." : "");
}

/// What stands in brackets in a help text: required, range, default.
std::string remarks(const OptionEntry& option) {
  std::string out;
  const auto add = [&out](const std::string& remark) { out += (out.empty() ? "" : "; ") + remark; };
  if (option.required) add("required");
  if (!option.range.empty()) add(option.range);
  if (!option.default_value.empty()) add("default: " + option.default_value);
  return out.empty() ? "" : fmt::format("\n[{}]", plain(out));
}

void append_option(const OptionEntry& option, std::string& out) {
  std::string names;
  for (const std::string& name : option.names) names += (names.empty() ? "" : ", ") + bold(name);
  out += fmt::format(".TP\n{}{}\n{}{}\n", names, argument_words(option),
                     plain(sentence(option.help)), remarks(option));
}

void add_synopsis(const CommandPage& program, const CommandPage& page, std::string& out) {
  out += ".SH SYNOPSIS\n";
  if (&program == &page) {
    out += fmt::format("{} {} [{}]\n.br\n{} [{}]\n", bold(program.name), italic("COMMAND"),
                       italic("OPTIONS"), bold(program.name), italic("OPTIONS"));
    return;
  }
  out += fmt::format("{} [{}]", bold(program.name + " " + page.name), italic("OPTIONS"));
  for (const OptionGroup& group : page.groups) {
    for (const OptionEntry& option : group.options) {
      if (option.required) out += " " + bold(option.names.back()) + argument_words(option);
    }
  }
  for (const OptionEntry& positional : page.positionals) {
    out += " " + italic(positional.names.front()) + (positional.several ? " ..." : "");
  }
  out += '\n';
}

void add_commands(const CommandPage& program, std::string& out) {
  out += ".SH COMMANDS\n";
  for (const CommandPage& command : program.commands) {
    out += fmt::format(".TP\n{}(1)\n{}\n", bold(full_name(program, command)),
                       plain(sentence(command.description)));
  }
}

void append_options(const CommandPage& page, std::string& out) {
  if (!page.positionals.empty()) {
    out += ".SH ARGUMENTS\n";
    for (const OptionEntry& positional : page.positionals) append_option(positional, out);
  }
  out += ".SH OPTIONS\n";
  for (const OptionGroup& group : page.groups) {
    if (group.title != "Options") out += fmt::format(".SS {}\n", plain(group.title));
    for (const OptionEntry& option : group.options) append_option(option, out);
  }
}

/// "0  done" and so on as a list, command lines as they stand.
void add_section(const PageSection& section, std::string& out) {
  if (section.title == "Exit codes") {
    out += ".SH EXIT STATUS\n";
    for (const std::string& line : section.lines) {
      const std::size_t gap = line.find("  ");
      out += fmt::format(".TP\n{}\n{}\n", bold(line.substr(0, gap)),
                         plain(sentence(line.substr(gap + 2))));
    }
    return;
  }
  out += fmt::format(".SH {}\n.nf\n", upper(section.title));
  for (const std::string& line : section.lines) out += plain(line) + '\n';
  out += ".fi\n";
}

void add_see_also(const CommandPage& program, const CommandPage& page, std::string& out) {
  out += ".SH SEE ALSO\n";
  std::string separator;
  const auto add = [&](const CommandPage& other) {
    if (&other == &page) return;
    out += separator + bold(full_name(program, other)) + "(1)";
    separator = ",\n";
  };
  add(program);
  for (const CommandPage& command : program.commands) add(command);
  out += '\n';
}

}  // namespace

std::string man_page_name(const CommandPage& program, const CommandPage& page) {
  return full_name(program, page) + ".1";
}

std::string man_page(const CommandPage& program, const CommandPage& page,
                     std::string_view version) {
  const std::string name = full_name(program, page);
  std::string out = ".\\\" SPDX-License-Identifier: Apache-2.0\n";
  out += fmt::format(".TH {} 1 \"\" \"{} {}\" \"{} manual\"\n.nh\n.ad l\n", upper(plain(name)),
                     program.name, version, program.name);
  out += fmt::format(".SH NAME\n{} \\- {}\n", plain(name), plain(page.description));
  add_synopsis(program, page, out);
  if (&program == &page) add_commands(program, out);
  append_options(page, out);
  for (const PageSection& section : page.footer) add_section(section, out);
  add_see_also(program, page, out);
  return out;
}

}  // namespace kinescope
