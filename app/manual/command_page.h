// SPDX-License-Identifier: Apache-2.0
//
// Takes   the command line's description, a tree of CLI::App.
// Gives   CommandPage, the same as a value: what --help says, for the manual and for completion.
// Not here: how that is written (man_page.h, completion.h); what the options do (app/commands).
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace kinescope {

struct OptionEntry {
  std::vector<std::string> names;  ///< "-o", "--output"; of a positional its one name
  std::string argument;            ///< such as FILE; empty: none is taken
  std::string range;               ///< such as "0 to 50"; empty: any
  std::string default_value;       ///< empty: none, or in the help
  std::string help;
  std::vector<std::string> words;  ///< the argument is one of these; empty: anything
  bool required = false;
  bool repeated = false;  ///< may be given again
  bool several = false;   ///< takes several arguments at once
};

struct OptionGroup {
  std::string title;
  std::vector<OptionEntry> options;
};

/// A paragraph behind the options: a title and its lines, without their indent.
struct PageSection {
  std::string title;
  std::vector<std::string> lines;
};

struct CommandPage {
  std::string name;
  std::string description;
  std::vector<OptionEntry> positionals;
  std::vector<OptionGroup> groups;  ///< in the order of their first option
  std::vector<PageSection> footer;
  std::vector<CommandPage> commands;
};

[[nodiscard]] CommandPage describe_command(CLI::App& app);

}  // namespace kinescope
