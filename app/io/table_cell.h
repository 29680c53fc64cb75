// SPDX-License-Identifier: Apache-2.0
//
// Names in tables of our own.
#pragma once

#include <string>
#include <string_view>

namespace kinescope {

/// The name as a cell that the readers of tables (kinematics/core/csv.h) take for one: delimiters,
/// quotes, line ends and '#' become '_'.
[[nodiscard]] inline std::string table_cell(std::string name) {
  for (char& c : name)
    if (std::string_view(",;\t\r\n\"#").find(c) != std::string_view::npos) c = '_';
  return name;
}

}  // namespace kinescope
