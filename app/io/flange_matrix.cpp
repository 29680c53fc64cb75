// SPDX-License-Identifier: Apache-2.0
#include "app/io/flange_matrix.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "kinematics/core/error.h"
#include "kinematics/core/nearest_rotation.h"

namespace kinescope {
namespace {

// Four decimals of a rotation matrix leave 1e-4; a position among its entries, or two of them
// exchanged, leaves about 1.
constexpr double kNoRotation = 0.05;

/// Columns of one name, in the order of their numbers.
struct Numbered {
  std::string name;
  std::vector<std::size_t> columns;
};

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

/// "t03" and "t_0_3" are 03 of t; nothing for a name without a number.
std::optional<std::pair<std::string, std::string>> name_and_number(const std::string& column) {
  const auto first = std::ranges::find_if(column, is_digit);
  std::string digits;
  std::ranges::copy_if(first, column.end(), std::back_inserter(digits), is_digit);
  if (digits.empty() || digits.size() > 2 || first == column.begin()) return std::nullopt;
  return std::pair(std::string(column.begin(), first), digits);
}

std::optional<Numbered> numbered_columns(const CsvTable& table,
                                         const std::set<std::size_t>& counts) {
  std::map<std::string, std::map<int, std::size_t>> all;
  for (std::size_t c = 0; c < table.header.size(); ++c)
    if (const auto is = name_and_number(table.header[c]))
      all[is->first].emplace(std::stoi(is->second), c);
  for (const auto& [name, by_number] : all) {
    if (!counts.contains(by_number.size())) continue;
    Numbered out{name, {}};
    for (const auto& [number, column] : by_number) out.columns.push_back(column);
    return out;
  }
  return std::nullopt;
}

/// Where the entries of a matrix stand among the numbered columns.
struct Layout {
  const char* words;
  int row_step;
  int column_step;
};

using Matrix34 = Eigen::Matrix<double, 3, 4>;

struct ReadMatrix {
  Matrix34 T = Matrix34::Zero();
  bool is_pose = false;
};

std::optional<double> value_of_cell(const CsvTable& table, std::size_t row, std::size_t column) {
  const auto value = parse_number(table.rows[row][column]);
  if (!value || !std::isfinite(*value)) return std::nullopt;
  return *value * (table.factors.empty() ? 1.0 : table.factors[column]);
}

bool is_rotation(const Eigen::Matrix3d& R) {
  return (R.transpose() * R - Eigen::Matrix3d::Identity()).norm() < kNoRotation &&
         R.determinant() > 0.0;
}

ReadMatrix read_matrix(const CsvTable& table, std::size_t row, const Numbered& of,
                       const Layout& layout) {
  ReadMatrix out;
  const auto at = [&](int i, int j) -> std::optional<double> {
    const auto k = static_cast<std::size_t>(layout.row_step * i + layout.column_step * j);
    return value_of_cell(table, row, of.columns[k]);
  };
  const int columns = of.columns.size() == 9 ? 3 : 4;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < columns; ++j) {
      const auto value = at(i, j);
      if (!value) return out;
      out.T(i, j) = *value;
    }
  }
  out.is_pose = is_rotation(out.T.leftCols<3>());
  if (of.columns.size() == 16)
    out.is_pose =
        out.is_pose && at(3, 0) == 0.0 && at(3, 1) == 0.0 && at(3, 2) == 0.0 && at(3, 3) == 1.0;
  return out;
}

std::vector<Layout> layouts_of(std::size_t count) {
  if (count == 9) return {{"row by row", 3, 1}};
  return {{"row by row", 4, 1}, {"column by column", 1, count == 16 ? 4 : 3}};
}

Layout likelier_layout(const CsvTable& table, const Numbered& of) {
  for (const Layout& layout : layouts_of(of.columns.size())) {
    std::size_t poses = 0;
    for (std::size_t r = 0; r < table.rows.size(); ++r)
      poses += read_matrix(table, r, of, layout).is_pose ? 1U : 0U;
    if (2 * poses > table.rows.size()) return layout;
  }
  throw bad_input(
      fmt::format("{}:{}", table.source, table.header_line),
      fmt::format("the {} columns {} to {} hold no pose as a matrix, read row by row or "
                  "column by column",
                  of.columns.size(), table.header[of.columns.front()],
                  table.header[of.columns.back()]),
      "write T_base_flange row by row, its last row 0 0 0 1, or x, y, z and a "
      "quaternion");
}

void add_columns(const std::vector<std::string>& names, CsvTable& table) {
  for (const std::string& name : names) {
    table.header.push_back(name);
    if (!table.factors.empty()) table.factors.push_back(1.0);
  }
}

std::vector<std::string> cells_of(const ReadMatrix& read, bool position) {
  std::vector<std::string> out;
  for (int i = 0; position && i < 3; ++i) out.push_back(fmt::format("{}", read.T(i, 3)));
  const Eigen::Quaterniond q(nearest_rotation(Eigen::Matrix3d(read.T.leftCols<3>())));
  for (const double part : {q.x(), q.y(), q.z(), q.w()})
    out.push_back(read.is_pose ? fmt::format("{}", part) : "no rotation matrix");
  return out;
}

}  // namespace

std::optional<std::string> matrix_to_quaternion(CsvTable& table) {
  const bool has_place = table.column("x") && table.column("y") && table.column("z");
  const auto of =
      numbered_columns(table, has_place ? std::set<std::size_t>{9} : std::set<std::size_t>{12, 16});
  if (!of || table.column("qw")) return std::nullopt;
  const Layout layout = likelier_layout(table, *of);
  std::string words = fmt::format("matrix {} to {}, {}", table.header[of->columns.front()],
                                  table.header[of->columns.back()], layout.words);
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    const std::vector<std::string> cells = cells_of(read_matrix(table, r, *of, layout), !has_place);
    table.rows[r].insert(table.rows[r].end(), cells.begin(), cells.end());
  }
  if (!has_place) add_columns({"x", "y", "z"}, table);
  add_columns({"qx", "qy", "qz", "qw"}, table);
  return words;
}

}  // namespace kinescope
