// SPDX-License-Identifier: Apache-2.0
//
// Tables of shared data that are stored as .csv.gz, for tests.
#pragma once

#include <array>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include <Eigen/Core>

#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"

namespace kinescope {

/// The text of a gzipped file, by gzip itself.
[[nodiscard]] inline std::string read_gzip(const std::filesystem::path& path) {
  const std::string command = "gzip -dc '" + path.string() + "'";
  const auto close = [](std::FILE* file) { pclose(file); };
  const std::unique_ptr<std::FILE, decltype(close)> pipe(popen(command.c_str(), "r"), close);
  KINESCOPE_CHECK(pipe != nullptr, "gzip starts");
  std::string text;
  std::array<char, 65536> buffer{};
  while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe.get())) {
    text.append(buffer.data(), count);
  }
  return text;
}

[[nodiscard]] inline CsvTable read_gzip_csv(const std::filesystem::path& path) {
  return parse_csv(read_gzip(path), path.string());
}

/// Columns prefix1 .. prefixN, every `step`th row.
[[nodiscard]] inline Eigen::MatrixXd numbered_columns(const CsvTable& table,
                                                      const std::string& prefix, int count,
                                                      std::size_t step = 1) {
  const std::size_t rows = (table.rows.size() + step - 1) / step;
  Eigen::MatrixXd out(static_cast<Eigen::Index>(rows), count);
  for (int c = 0; c < count; ++c) {
    const std::size_t column = table.require_column(prefix + std::to_string(c + 1));
    for (std::size_t r = 0; r < rows; ++r) {
      out(static_cast<Eigen::Index>(r), c) = table.number(r * step, column);
    }
  }
  return out;
}

}  // namespace kinescope
