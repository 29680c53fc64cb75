// SPDX-License-Identifier: Apache-2.0
#include "app/io/sighting_table.h"

#include <cmath>

#include <fmt/format.h>

#include "kinematics/log/header_units.h"
#include "kinematics/log/tool_table.h"

namespace kinescope {

CsvTable read_sighting_table(const std::filesystem::path& path) {
  CsvTable table = read_csv(path, RaggedRows::kSetAside);
  for (const std::string& column : table.header) table.factors.push_back(header_factor(column));
  strip_units(table);
  if (const auto time = table.column("t")) dates_to_seconds(table, *time);
  return table;
}

double bounded_number(const CsvTable& table, std::size_t row, std::string_view name, double most) {
  const std::size_t column = table.require_column(name);
  const double value = table.number(row, column);
  if (std::abs(value) <= most) return value;
  throw bad_input(
      table.place(row),
      fmt::format("column '{}' holds {}, which is out of all reach", name, table.rows[row][column]),
      "correct or remove the line");
}

Eigen::Vector3d vector3(const CsvTable& table, std::size_t row) {
  return {bounded_number(table, row, "x", kFarthestM), bounded_number(table, row, "y", kFarthestM),
          bounded_number(table, row, "z", kFarthestM)};
}

Eigen::Quaterniond quaternion(const CsvTable& table, std::size_t row) {
  Eigen::Quaterniond q;
  const char* const columns[] = {"qx", "qy", "qz", "qw"};
  for (int i = 0; i < 4; ++i) {
    q.coeffs()[i] = table.number(row, table.require_column(columns[i]));
  }
  constexpr double kNoRotation = 1e-3;
  if (q.norm() < kNoRotation) {
    throw bad_input(table.place(row), fmt::format("the quaternion has length {}", q.norm()),
                    "columns qx, qy, qz, qw hold a unit quaternion; leave rows without a pose out");
  }
  return q;
}

bool is_unit(const Eigen::Quaterniond& q) {
  constexpr double kRounded = 0.01;
  return std::abs(q.norm() - 1.0) <= kRounded;
}

Error not_unit(const CsvTable& table, std::size_t row, const Eigen::Quaterniond& q) {
  return bad_input(table.place(row), fmt::format("the quaternion has length {:.4g}", q.norm()),
                   "columns qx, qy, qz, qw hold a unit quaternion");
}

std::optional<std::string> scaled_quaternions(const CsvTable& table, const BadRows& bad) {
  std::size_t odd = 0;
  std::string first;
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    try {
      const Eigen::Quaterniond q = quaternion(table, r);
      if (is_unit(q)) continue;
      if (odd++ == 0) first = not_unit(table, r, q).what();
    } catch (const Error&) {
      continue;  // told where the row is read
    }
  }
  if (odd == 0 || !bad.too_many(bad.size() + odd)) return std::nullopt;
  return fmt::format("{}: {} of {} quaternions are normalised, the first: {}", table.source, odd,
                     table.rows.size(), first);
}

void append(std::vector<std::string>& warnings, const BadRows& bad) {
  const std::vector<std::string> more = bad.warnings();
  warnings.insert(warnings.end(), more.begin(), more.end());
}

}  // namespace kinescope
