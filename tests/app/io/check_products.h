// SPDX-License-Identifier: Apache-2.0
//
// The JSON files of a run folder against the schemas that programs rely on (app/io/schema), by
// check_products.py.
#pragma once

#include <array>
#include <cstdio>
#include <filesystem>
#include <string>

#include <sys/wait.h>

namespace kinescope {

struct ProductCheck {
  bool done = false;    ///< false: `words` says what is missing on this machine
  bool passed = false;  ///< every file is valid, and no key of it may be left out or misspelt
  std::string words;    ///< what was checked, and every fault
};

[[nodiscard]] inline ProductCheck check_products(const std::filesystem::path& folder) {
  const std::filesystem::path source = KINESCOPE_SOURCE_DIR;
  const std::string command = "python3 '" + (source / "tests/app/io/check_products.py").string() +
                              "' '" + (source / "app/io/schema").string() + "' '" +
                              folder.string() + "' 2>&1";
  constexpr int kMissing = 77;  // of the script; the shell's own for a program that is not there
  constexpr int kNoProgram = 127;
  ProductCheck out;
  FILE* pipe = popen(command.c_str(), "r");  // NOLINT(cert-env33-c): its own arguments only
  if (pipe == nullptr) return out;
  std::array<char, 4096> line{};
  while (std::fgets(line.data(), line.size(), pipe) != nullptr) out.words += line.data();
  const int status = pclose(pipe);
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  out.done = code != kMissing && code != kNoProgram;
  out.passed = code == 0;
  return out;
}

}  // namespace kinescope
