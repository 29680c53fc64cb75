// SPDX-License-Identifier: Apache-2.0
//
// kinescope_manual FOLDER: writes the manual pages, the shells' completion and the functions of the
// Python module, while building.
#include <cstdio>
#include <exception>
#include <filesystem>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/commands/command_line.h"
#include "app/io/output_folder.h"
#include "app/manual/command_page.h"
#include "app/manual/completion.h"
#include "app/manual/man_page.h"
#include "app/manual/python_functions.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

void write_manual(const std::filesystem::path& folder) {
  CLI::App app;
  CommandLine line;
  add_commands(app, line);
  const CommandPage program = describe_command(app);
  require_writable_folder(folder / "man1");
  const auto write_page = [&](const CommandPage& page) {
    write_file_atomically(folder / "man1" / man_page_name(program, page),
                          man_page(program, page, program_version()));
  };
  write_page(program);
  for (const CommandPage& command : program.commands) write_page(command);
  write_file_atomically(folder / (program.name + ".bash"), bash_completion(program));
  write_file_atomically(folder / ("_" + program.name), zsh_completion(program));
  write_file_atomically(folder / "commands.py", python_functions(program));
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: kinescope_manual FOLDER\n");
    return 2;
  }
  try {
    kinescope::write_manual(argv[1]);
  } catch (const std::exception& error) {
    fmt::print(stderr, "kinescope_manual: {}\n", error.what());
    return 1;
  }
  return 0;
}
