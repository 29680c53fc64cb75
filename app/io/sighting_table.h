// SPDX-License-Identifier: Apache-2.0
//
// What the readers of tables with positions and rotations share. Internal to the room.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

#include "kinematics/core/bad_rows.h"
#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"

namespace kinescope {

// Further off than any robot or image: what a broken sensor or an unset variable writes.
inline constexpr double kFarthestM = 1e6;
inline constexpr double kFarthestPx = 1e7;

/// A table by its columns' names without units; its numbers come in s, m, rad and px.
[[nodiscard]] CsvTable read_sighting_table(const std::filesystem::path& path);
/// A number no further from zero than `most`.
[[nodiscard]] double bounded_number(const CsvTable& table, std::size_t row, std::string_view name,
                                    double most);
/// Columns x, y, z.
[[nodiscard]] Eigen::Vector3d vector3(const CsvTable& table, std::size_t row);

/// The quaternion of a row as it stands there. The columns' order is x, y, z, w.
[[nodiscard]] Eigen::Quaterniond quaternion(const CsvTable& table, std::size_t row);
/// What rounding to two decimals leaves of a unit quaternion; more is another thing in the columns.
[[nodiscard]] bool is_unit(const Eigen::Quaterniond& q);
[[nodiscard]] Error not_unit(const CsvTable& table, std::size_t row, const Eigen::Quaterniond& q);
/// One odd quaternion is a bad row. Where most are, a whole file was scaled, which changes no
/// rotation: then they are normalised, with a warning.
[[nodiscard]] std::optional<std::string> scaled_quaternions(const CsvTable& table,
                                                            const BadRows& bad);

void append(std::vector<std::string>& warnings, const BadRows& bad);

}  // namespace kinescope
