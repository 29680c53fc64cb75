// SPDX-License-Identifier: Apache-2.0
#include "app/commands/shell_line.h"

#include <fmt/format.h>

namespace kinescope {

std::string shell_line(const std::vector<std::string>& words) {
  std::string text = "kinescope";
  for (const std::string& word : words) {
    const bool plain =
        !word.empty() && word.find_first_of(" \t\n'\"\\$`&|;<>()*?#!~") == std::string::npos;
    text += plain ? fmt::format(" {}", word) : fmt::format(" '{}'", word);
  }
  return text;
}

}  // namespace kinescope
