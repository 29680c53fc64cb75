// SPDX-License-Identifier: Apache-2.0
//
// Units in the names of columns: "t [ms]", "ch0 (rad)", and of times also "time_ns".
#pragma once

#include <string>
#include <string_view>

#include "kinematics/core/csv.h"

namespace kinescope {

/// The column's name without a unit in brackets at its end, a time's also without one behind an
/// underscore. Only units are cut off: "q[0]" and "arm (left)" are names.
[[nodiscard]] std::string without_unit(std::string_view column);

/// What brings a column to s, m, rad or px by the unit in its name; 1 where it names none, or one
/// that is not known.
[[nodiscard]] double header_factor(std::string_view column);

/// The table with names without units, as far as they stay different. Its values stay as they are.
void strip_units(CsvTable& table);

}  // namespace kinescope
