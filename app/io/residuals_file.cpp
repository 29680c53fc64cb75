// SPDX-License-Identifier: Apache-2.0
#include "app/io/residuals_file.h"

#include <cmath>
#include <string>
#include <vector>

#include "kinematics/core/csv.h"

namespace kinescope {
namespace {

// Sums of squared distances, and how many there are.
struct SquareSum {
  double sum = 0.0;
  int count = 0;
  void add(double square) {
    sum += square;
    ++count;
  }
  [[nodiscard]] double rms() const { return count > 0 ? std::sqrt(sum / count) : 0.0; }
};

struct FrameSums {
  SquareSum all, held_out;
  std::map<int, SquareSum> of_id;
  int rejected = 0;
};

std::vector<std::size_t> columns_named(const CsvTable& table, const std::string& prefix,
                                       const std::vector<std::string>& names) {
  std::vector<std::size_t> out;
  for (const std::string& name : names) out.push_back(table.require_column(prefix + name));
  return out;
}

std::optional<double> square_of(const CsvTable& table, std::size_t row,
                                const std::vector<std::size_t>& columns) {
  double out = 0.0;
  for (const std::size_t column : columns) {
    const auto value = table.optional_number(row, column);
    if (!value) return std::nullopt;
    out += *value * *value;
  }
  return out;
}

bool is_of_reference(const CsvTable& table, std::size_t row, const Calibration& calibration) {
  const bool several = table.header.front() == "camera" || table.header.front() == "recording";
  return !several || table.rows[row].front() == calibration.camera_name;
}

}  // namespace

FrameResiduals read_frame_residuals(const std::filesystem::path& path,
                                    const Calibration& calibration) {
  const CsvTable table = read_csv(path);
  FrameResiduals out;
  out.in_px = table.column("corner").has_value();
  const std::vector<std::string> names =
      out.in_px ? std::vector<std::string>{"du", "dv"} : std::vector<std::string>{"x", "y", "z"};
  const std::vector<std::size_t> final = columns_named(table, "", names);
  const std::vector<std::size_t> held_out = columns_named(table, "held_out_", names);
  const std::size_t time = table.require_column("t");
  const std::size_t id = table.require_column(out.in_px ? "tag" : "body");
  const std::size_t used = table.require_column("used");
  std::map<double, FrameSums> sums;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    if (!is_of_reference(table, row, calibration)) continue;
    FrameSums& frame = sums[table.number(row, time)];
    const auto square = square_of(table, row, final);
    if (table.integer(row, used) == 0 || !square) {
      ++frame.rejected;
      continue;
    }
    frame.all.add(*square);
    frame.of_id[table.integer(row, id)].add(*square);
    if (const auto unseen = square_of(table, row, held_out)) frame.held_out.add(*unseen);
  }
  for (const auto& [t, frame] : sums) {
    FrameResidual& one = out.at[t];
    if (frame.all.count > 0) one.rms = frame.all.rms();
    one.used = frame.all.count;
    one.rejected = frame.rejected;
    if (frame.held_out.count > 0) one.held_out_rms = frame.held_out.rms();
    for (const auto& [marker, sum] : frame.of_id) one.of_id[marker] = sum.rms();
  }
  return out;
}

}  // namespace kinescope
