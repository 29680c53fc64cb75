// SPDX-License-Identifier: Apache-2.0
//
// flange.csv: the hand's pose in the robot's base, as controllers of several makers write it.
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/io/recording.h"
#include "app/io/sighting_table.h"

namespace kinescope {
namespace {

using FlangeRotation = Eigen::Quaterniond (*)(const Eigen::Vector3d&);

Eigen::Quaterniond turned_about_fixed_axes(double x, double y, double z) {
  return exp_rotation({0.0, 0.0, z}) * exp_rotation({0.0, y, 0.0}) * exp_rotation({x, 0.0, 0.0});
}
Eigen::Quaterniond by_roll_pitch_yaw(const Eigen::Vector3d& a) {
  return turned_about_fixed_axes(a[0], a[1], a[2]);
}
Eigen::Quaterniond by_z_y_x(const Eigen::Vector3d& a) {
  return turned_about_fixed_axes(a[2], a[1], a[0]);
}
Eigen::Quaterniond by_rotation_vector(const Eigen::Vector3d& v) { return exp_rotation(v); }

// Three columns that are read as a rotation; of names that two makers use for two things, both.
struct FlangeAngles {
  std::array<const char*, 3> columns;
  const char* words;
  FlangeRotation read;
};
constexpr std::array<FlangeAngles, 5> kFlangeAngles{{
    {{"roll", "pitch", "yaw"}, "roll, pitch, yaw about fixed x, y, z", by_roll_pitch_yaw},
    {{"w", "p", "r"}, "W, P, R about fixed x, y, z", by_roll_pitch_yaw},
    {{"a", "b", "c"}, "A, B, C about z, then y, then x", by_z_y_x},
    {{"rx", "ry", "rz"}, "rx, ry, rz as a rotation vector", by_rotation_vector},
    {{"rx", "ry", "rz"}, "rx, ry, rz as angles about fixed x, y, z", by_roll_pitch_yaw},
}};

constexpr std::array<const char*, 4> kClockColumns{"t", "time", "stamp", "timestamp"};
constexpr std::array<const char*, 6> kNumberColumns{"row", "index", "frame", "image", "pose", "id"};

bool has_all(const CsvTable& table, std::span<const char* const> names) {
  return std::ranges::all_of(names,
                             [&](const char* name) { return table.column(name).has_value(); });
}

bool has_quaternion(const CsvTable& table) {
  constexpr std::array<const char*, 4> kNames{"qx", "qy", "qz", "qw"};
  return has_all(table, kNames);
}

// Names as makers write them: X, Y, Z, A, B, C.
CsvTable read_flange_table(const std::filesystem::path& path) {
  CsvTable table = read_sighting_table(path);
  std::vector<std::string> lower;
  for (std::string name : table.header) {
    std::ranges::transform(name, name.begin(),
                           [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    const bool twice = std::ranges::find(lower, name) != lower.end();
    lower.push_back(twice ? table.header[lower.size()] : name);
  }
  table.header = std::move(lower);
  return table;
}

struct FlangeTime {
  std::size_t column = 0;
  bool numbered = false;
};

FlangeTime time_of(const CsvTable& table) {
  for (const char* name : kClockColumns)
    if (const auto column = table.column(name)) return {*column, false};
  for (const char* name : kNumberColumns)
    if (const auto column = table.column(name)) return {*column, true};
  throw bad_input(fmt::format("{}:{}", table.source, table.header_line),
                  "has neither a column t nor one named row, index, frame, image or pose",
                  "give each pose the t of the frame it belongs to");
}

// Columns of a unit, or the one of several rotations that is there.
std::vector<FlangeAngles> angles_in(const CsvTable& table) {
  std::vector<FlangeAngles> out;
  for (const FlangeAngles& angles : kFlangeAngles)
    if (has_all(table, angles.columns)) out.push_back(angles);
  return out;
}

void require_rotation(const CsvTable& table, const std::vector<FlangeAngles>& angles) {
  if (has_quaternion(table)) return;
  if (angles.empty()) {
    throw bad_input(fmt::format("{}:{}", table.source, table.header_line),
                    fmt::format("has no rotation that is known, but the columns {}",
                                fmt::join(table.header, ", ")),
                    "name them qx, qy, qz, qw, or roll, pitch, yaw, or a, b, c, or w, p, r, or "
                    "rx, ry, rz; degrees as \"roll [deg]\"");
  }
}

// Without a unit in the header, angles are in rad, and none is beyond a turn.
void require_radians(const CsvTable& table, const FlangeAngles& angles) {
  for (const char* name : angles.columns) {
    const std::size_t column = table.require_column(name);
    if (table.factors[column] != 1.0) continue;
    for (std::size_t r = 0; r < table.rows.size(); ++r) {
      const auto value = parse_number(table.rows[r][column]);
      if (!value || !(std::abs(*value) > 2.0 * std::numbers::pi)) continue;
      throw bad_input(table.place(r),
                      fmt::format("column '{}' holds {}: more than a turn in rad", name, *value),
                      fmt::format("write the unit into the header: \"{} [deg]\"", name));
    }
  }
}

struct FlangeRow {
  double time_s = 0.0;
  std::size_t row = 0;
  Eigen::Vector3d position_m;
};

// A number of an image is no time, whatever a unit in its name says.
double time_in(const CsvTable& table, std::size_t row, const FlangeTime& time) {
  return time.numbered ? static_cast<double>(table.integer(row, time.column))
                       : table.number(row, time.column);
}

Eigen::Quaterniond rotation_in(const CsvTable& table, std::size_t row, const FlangeAngles* angles,
                               bool unit) {
  if (angles == nullptr) {
    const Eigen::Quaterniond q = quaternion(table, row);
    if (unit && !is_unit(q)) throw not_unit(table, row, q);
    return q.normalized();
  }
  Eigen::Vector3d v;
  for (Eigen::Index k = 0; k < 3; ++k)
    v[k] = table.number(row, table.require_column(angles->columns[static_cast<std::size_t>(k)]));
  return angles->read(v);
}

// Rows in the order of time that can be read; the same time twice is a bad row.
std::vector<FlangeRow> good_rows(const CsvTable& table, const FlangeTime& time,
                                 const FlangeAngles* angles, bool unit, BadRows& bad) {
  std::vector<FlangeRow> rows;
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    try {
      const FlangeRow row{time_in(table, r, time), r, vector3(table, r)};
      static_cast<void>(rotation_in(table, r, angles, unit));
      rows.push_back(row);
    } catch (const Error& error) {
      bad.add(table.lines[r], error);
    }
  }
  std::ranges::stable_sort(rows, {}, &FlangeRow::time_s);
  std::vector<FlangeRow> out;
  for (const FlangeRow& row : rows) {
    if (out.empty() || row.time_s > out.back().time_s) {
      out.push_back(row);
      continue;
    }
    bad.add(table.lines[row.row], bad_input(table.place(row.row),
                                            fmt::format("{} = {:g} stands there twice",
                                                        table.header[time.column], row.time_s),
                                            "keep one of the rows"));
  }
  return out;
}

// No robot reaches as far: its controller counts in mm.
bool is_in_millimetres(const CsvTable& table, const std::vector<FlangeRow>& rows) {
  constexpr double kNoReachM = 20.0;
  const bool declared = std::ranges::any_of(std::array{"x", "y", "z"}, [&](const char* name) {
    return table.factors[table.require_column(name)] != 1.0;
  });
  std::vector<double> far;
  for (const FlangeRow& row : rows) far.push_back(row.position_m.norm());
  if (declared || far.empty()) return false;
  std::ranges::sort(far);
  return far[far.size() / 2] > kNoReachM;
}

PoseLog log_of(const CsvTable& table, const FlangeTime& time, const std::vector<FlangeRow>& rows,
               const FlangeAngles* angles, double to_metres) {
  PoseLog out;
  out.source = table.source;
  out.time_column = table.header[time.column];
  out.numbered = time.numbered;
  for (const FlangeRow& row : rows) {
    out.times_s.push_back(row.time_s);
    out.poses.push_back({rotation_in(table, row.row, angles, false), to_metres * row.position_m});
    out.lines.push_back(table.lines[row.row]);
  }
  return out;
}

}  // namespace

ReadSightings<std::vector<FlangeReading>> read_flange(const std::filesystem::path& path) {
  const CsvTable table = read_flange_table(path);
  for (const char* name : {"x", "y", "z"}) static_cast<void>(table.require_column(name));
  const FlangeTime time = time_of(table);
  std::vector<FlangeAngles> angles = angles_in(table);
  require_rotation(table, angles);
  if (has_quaternion(table)) angles.clear();
  for (const FlangeAngles& a : angles) require_radians(table, a);
  const FlangeAngles* first = angles.empty() ? nullptr : angles.data();
  BadRows bad(table);
  ReadSightings<std::vector<FlangeReading>> out;
  const auto scaled = first == nullptr ? scaled_quaternions(table, bad) : std::nullopt;
  if (scaled) out.warnings.push_back(*scaled);
  const std::vector<FlangeRow> rows = good_rows(table, time, first, !scaled, bad);
  append(out.warnings, bad);
  if (rows.empty()) throw bad_input(table.source, "holds no pose", "log the flange's poses");
  const bool millimetres = is_in_millimetres(table, rows);
  if (millimetres) {
    out.warnings.push_back(
        fmt::format("{}: most positions are beyond 20 m: they are taken as mm (write \"x [mm]\")",
                    table.source));
  }
  const double to_metres = millimetres ? 1e-3 : 1.0;
  if (angles.empty())
    out.found.push_back({"quaternion", log_of(table, time, rows, nullptr, to_metres)});
  for (const FlangeAngles& a : angles)
    out.found.push_back({a.words, log_of(table, time, rows, &a, to_metres)});
  return out;
}

}  // namespace kinescope
