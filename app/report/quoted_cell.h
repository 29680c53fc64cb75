// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace kinescope::report {

/// A cell of a CSV file, in quotes where it needs them.
[[nodiscard]] inline std::string quoted_cell(const std::string& value) {
  if (value.find_first_of(",\"\r\n") == std::string::npos) return value;
  std::string out = "\"";
  for (const char c : value) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

}  // namespace kinescope::report
