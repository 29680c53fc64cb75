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

#include "app/io/flange_convention.h"
#include "app/io/flange_matrix.h"
#include "app/io/recording.h"
#include "app/io/sighting_table.h"
#include "kinematics/log/header_units.h"

namespace kinescope {
namespace {

// Three columns that are read as a rotation; of names that two makers use for two things, both.
struct FlangeAngles {
  std::array<const char*, 3> columns;
  const char* words;
  std::string_view convention;
};
constexpr const char* kKawasakiT = "t of o, a, t";
constexpr std::array<FlangeAngles, 6> kFlangeAngles{{
    {{"roll", "pitch", "yaw"}, "roll, pitch, yaw about fixed x, y, z", "fixed_xyz"},
    {{"w", "p", "r"}, "W, P, R about fixed x, y, z", "fixed_xyz"},
    {{"a", "b", "c"}, "A, B, C about z, then y, then x", "zyx"},
    {{"o", "a", kKawasakiT}, "O, A, T about z, then the turned y, then the turned z", "zyz"},
    {{"rx", "ry", "rz"}, "rx, ry, rz as a rotation vector", "rotation_vector"},
    {{"rx", "ry", "rz"}, "rx, ry, rz as angles about fixed x, y, z", "fixed_xyz"},
}};
constexpr std::array<const char*, 4> kQuaternion{"qx", "qy", "qz", "qw"};

constexpr std::array<const char*, 4> kClockColumns{"t", "time", "stamp", "timestamp"};
constexpr std::array<const char*, 6> kNumberColumns{"row", "index", "frame", "image", "pose", "id"};

bool has_all(const CsvTable& table, std::span<const char* const> names) {
  return std::ranges::all_of(names,
                             [&](const char* name) { return table.column(name).has_value(); });
}

bool has_quaternion(const CsvTable& table) { return has_all(table, kQuaternion); }

// "pose.position.x" of a ROS message is x, its "orientation.x" (a transform's "rotation.x") is qx.
std::string plain_name(std::string name) {
  std::ranges::transform(name, name.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const std::size_t point = name.rfind('.');
  if (point == std::string::npos || point + 2 != name.size()) return name;
  const std::string_view of = std::string_view(name).substr(0, point);
  if (of.ends_with("position") || of.ends_with("translation")) return name.substr(point + 1);
  if (of.ends_with("orientation") || of.ends_with("rotation")) return "q" + name.substr(point + 1);
  return name;
}

// ABB counts the parts of a quaternion from w.
void name_numbered_quaternion(std::vector<std::string>& header) {
  constexpr std::array<const char*, 4> kNumbered{"q1", "q2", "q3", "q4"};
  constexpr std::array<const char*, 4> kParts{"qw", "qx", "qy", "qz"};
  std::array<std::size_t, 4> at{};
  for (std::size_t k = 0; k < at.size(); ++k) {
    const auto found = std::ranges::find(header, kNumbered[k]);
    if (found == header.end()) return;
    at[k] = static_cast<std::size_t>(found - header.begin());
  }
  for (std::size_t k = 0; k < at.size(); ++k) header[at[k]] = kParts[k];
}

// Kawasaki's third angle is named as the time is: it stands behind the second.
void name_kawasaki_t(std::vector<std::string>& header) {
  for (std::size_t c = 2; c < header.size(); ++c) {
    const bool third = header[c].starts_with('t') || header[c].starts_with('T');
    if (third && header[c - 2] == "o" && header[c - 1] == "a") header[c] = kKawasakiT;
  }
}

struct FlangeTable {
  CsvTable table;
  std::vector<bool> has_unit;  ///< of each column: its name in the file says it
  std::string of_matrix = {};  ///< the reading in words, where the pose is one
};

// Names as makers write them: X, Y, Z, A, B, C.
FlangeTable read_flange_table(const std::filesystem::path& path) {
  FlangeTable out{read_csv(path, RaggedRows::kSetAside), {}};
  CsvTable& table = out.table;
  for (const std::string& column : table.header) {
    table.factors.push_back(header_factor(column));
    out.has_unit.push_back(without_unit(column) != column);
  }
  strip_units(table);
  std::vector<std::string> names;
  for (const std::string& column : table.header) {
    std::string name = plain_name(column);
    const bool twice = std::ranges::find(names, name) != names.end();
    names.push_back(twice ? column : std::move(name));
  }
  name_kawasaki_t(names);
  table.header = names;
  out.of_matrix = matrix_to_quaternion(table).value_or("");
  out.has_unit.resize(table.header.size(), false);
  if (!has_quaternion(table)) name_numbered_quaternion(table.header);
  return out;
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
                    "o, a, t, or rx, ry, rz, or T00 to T33; degrees as \"roll [deg]\"");
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

// One way to read the columns.
struct ColumnReading {
  const RotationConvention* convention = nullptr;
  std::array<std::size_t, 4> columns{};  ///< as many as the convention has
  double factor = 1.0;                   ///< of angles: to rad, beside the header's
  bool inverted = false;
  bool usual = true;
  std::string words = {};
  FlangeDeclaration declaration = {};
  bool usual_convention = true;
  bool usual_unit = true;
};

Eigen::Quaterniond rotation_in(const CsvTable& table, std::size_t row, const ColumnReading& as) {
  Eigen::Vector4d numbers = Eigen::Vector4d::Zero();
  for (std::size_t k = 0; k < as.convention->columns; ++k)
    numbers[static_cast<Eigen::Index>(k)] = as.factor * table.number(row, as.columns[k]);
  const Eigen::Quaterniond q = as.convention->read(numbers).normalized();
  return as.inverted ? q.conjugate() : q;
}

// What a row must be, whichever way it is read.
void require_rotation_in(const CsvTable& table, std::size_t row, const ColumnReading& as,
                         bool unit) {
  if (!has_quaternion(table)) {
    static_cast<void>(rotation_in(table, row, as));
    return;
  }
  const Eigen::Quaterniond q = quaternion(table, row);
  if (unit && !is_unit(q)) throw not_unit(table, row, q);
}

// Rows in the order of time that can be read; the same time twice is a bad row.
std::vector<FlangeRow> good_rows(const CsvTable& table, const FlangeTime& time,
                                 const ColumnReading& as, bool unit, BadRows& bad) {
  std::vector<FlangeRow> rows;
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    try {
      const FlangeRow row{time_in(table, r, time), r, vector3(table, r)};
      require_rotation_in(table, r, as, unit);
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
               const ColumnReading& as, double to_metres) {
  PoseLog out;
  out.source = table.source;
  out.time_column = table.header[time.column];
  out.numbered = time.numbered;
  for (const FlangeRow& row : rows) {
    out.times_s.push_back(row.time_s);
    out.poses.push_back({rotation_in(table, row.row, as), to_metres * row.position_m});
    out.lines.push_back(table.lines[row.row]);
  }
  return out;
}

// Columns of a quaternion, or the three that a maker's angles are named by.
struct RotationColumns {
  std::array<std::size_t, 4> columns{};
  std::size_t count = 0;
  std::string names;
};

RotationColumns columns_of(const CsvTable& table, std::span<const char* const> names) {
  RotationColumns out{{}, names.size(), fmt::format("{}", fmt::join(names, ", "))};
  for (std::size_t k = 0; k < names.size(); ++k) out.columns[k] = table.require_column(names[k]);
  return out;
}

// Angles without a unit are in rad, but where they are beyond a turn: then a controller's degrees.
bool are_beyond_a_turn(const CsvTable& table, const RotationColumns& of) {
  for (std::size_t k = 0; k < of.count; ++k) {
    for (const std::vector<std::string>& row : table.rows) {
      const auto value = parse_number(row[of.columns[k]]);
      if (value && std::abs(*value) > 2.0 * std::numbers::pi) return true;
    }
  }
  return false;
}

// Each of the candidates with angles in the unit that the header says; in both where it says none.
std::vector<ColumnReading> in_units(const std::vector<ColumnReading>& all, const FlangeTable& file,
                                    const RotationColumns& of) {
  const bool said = std::any_of(of.columns.begin(), of.columns.begin() + of.count,
                                [&](std::size_t column) { return file.has_unit[column]; });
  if (said || of.count != 3) return all;
  const bool usually_degrees = are_beyond_a_turn(file.table, of);
  std::vector<ColumnReading> out;
  for (const bool degrees : {usually_degrees, !usually_degrees}) {
    for (ColumnReading as : all) {
      as.usual_unit = degrees == usually_degrees;
      as.usual = as.usual && as.usual_unit;
      as.factor = degrees ? kRadPerDegree : 1.0;
      if (degrees) as.words += ", in degrees";
      if (degrees || usually_degrees) as.declaration.degrees = degrees;
      if (!degrees && usually_degrees) as.words += ", in rad";
      out.push_back(std::move(as));
    }
  }
  return out;
}

// Each of the candidates, and with its rotations inverted.
std::vector<ColumnReading> with_conjugates(std::vector<ColumnReading> all) {
  const std::size_t plain = all.size();
  for (std::size_t k = 0; k < plain; ++k) {
    ColumnReading as = all[k];
    as.usual = false;
    as.inverted = as.declaration.conjugate = true;
    as.words += ", the rotation inverted";
    all.push_back(std::move(as));
  }
  return all;
}

// A quaternion by the names of its columns, and by their order in the file.
std::vector<ColumnReading> quaternions(const CsvTable& table) {
  const RotationColumns named = columns_of(table, kQuaternion);
  RotationColumns in_order = named;
  std::ranges::sort(in_order.columns);
  const ColumnReading usual{&rotation_convention("quaternion_xyzw"), named.columns};
  std::vector<ColumnReading> out{usual};
  out.front().words = "quaternion";
  for (const RotationConvention& convention : rotation_conventions()) {
    if (convention.columns != named.count) continue;
    ColumnReading as{&convention, in_order.columns};
    as.usual = as.usual_convention = false;
    as.words = fmt::format("{} in the columns' order", convention.words);
    as.declaration.rotation = convention.name;
    out.push_back(std::move(as));
  }
  return out;
}

// The numbers themselves say how a matrix is to be read.
ColumnReading matrix(const FlangeTable& file) {
  ColumnReading out{&rotation_convention("quaternion_xyzw"),
                    columns_of(file.table, kQuaternion).columns};
  out.words = file.of_matrix;
  return out;
}

// Angles as their names say, and as other makers read three of them.
std::vector<ColumnReading> triples(const std::vector<FlangeAngles>& named,
                                   const RotationColumns& of) {
  std::vector<ColumnReading> out;
  for (const FlangeAngles& angles : named) {
    ColumnReading as{&rotation_convention(angles.convention), of.columns};
    as.words = angles.words;
    out.push_back(std::move(as));
  }
  for (const RotationConvention& convention : rotation_conventions()) {
    if (convention.columns != of.count) continue;
    ColumnReading as{&convention, of.columns};
    as.usual = as.usual_convention = false;
    as.words = fmt::format("{} as {}", of.names, convention.words);
    as.declaration.rotation = convention.name;
    out.push_back(std::move(as));
  }
  return out;
}

std::vector<ColumnReading> candidates_of(const FlangeTable& file) {
  if (!file.of_matrix.empty()) return with_conjugates({matrix(file)});
  if (has_quaternion(file.table)) return with_conjugates(quaternions(file.table));
  const std::vector<FlangeAngles> named = angles_in(file.table);
  require_rotation(file.table, named);
  const RotationColumns of = columns_of(file.table, named.front().columns);
  // Names of one set: beside roll, pitch, yaw no a, b, c is a rotation.
  std::vector<FlangeAngles> own;
  for (const FlangeAngles& angles : named)
    if (angles.columns == named.front().columns) own.push_back(angles);
  return in_units(with_conjugates(triples(own, of)), file, of);
}

// What a declaration leaves, with nothing more to be said.
std::vector<ColumnReading> declared(const std::vector<ColumnReading>& all,
                                    const FlangeDeclaration& as, const CsvTable& table) {
  std::vector<ColumnReading> out;
  for (ColumnReading candidate : all) {
    const FlangeDeclaration& own = candidate.declaration;
    const bool convention =
        as.rotation.empty() ? candidate.usual_convention : own.rotation == as.rotation;
    const bool unit =
        as.degrees ? own.degrees.value_or(false) == *as.degrees : candidate.usual_unit;
    if (!convention || !unit || own.conjugate != as.conjugate) continue;
    candidate.usual = true;
    candidate.declaration = {};
    out.push_back(std::move(candidate));
  }
  if (!out.empty()) return out;
  throw bad_input(fmt::format("{}:{}", table.source, table.header_line),
                  fmt::format("cannot be read as recording.yaml says: {}", to_string(as)),
                  has_quaternion(table)
                      ? "a quaternion has no unit, and a rotation of four columns"
                      : "correct it: the header holds three angles, with a unit or without");
}

bool say_the_same(const PoseLog& one, const PoseLog& other) {
  constexpr double kRounding = 1e-12;
  return std::ranges::equal(one.poses, other.poses, [](const Pose& a, const Pose& b) {
    return std::abs(std::abs(a.rotation.dot(b.rotation)) - 1.0) < kRounding;
  });
}

FlangeReading with_row_offset(FlangeReading reading, int offset) {
  reading.log = with_rows_moved(std::move(reading.log), offset);
  return reading;
}

}  // namespace

ReadSightings<std::vector<FlangeReading>> read_flange(const std::filesystem::path& path,
                                                      const std::optional<FlangeDeclaration>& as) {
  const FlangeTable file = read_flange_table(path);
  const CsvTable& table = file.table;
  for (const char* name : {"x", "y", "z"}) static_cast<void>(table.require_column(name));
  const FlangeTime time = time_of(table);
  std::vector<ColumnReading> candidates = candidates_of(file);
  if (as) candidates = declared(candidates, *as, table);
  BadRows bad(table);
  ReadSightings<std::vector<FlangeReading>> out;
  const auto scaled = has_quaternion(table) ? scaled_quaternions(table, bad) : std::nullopt;
  if (scaled) out.warnings.push_back(*scaled);
  const std::vector<FlangeRow> rows = good_rows(table, time, candidates.front(), !scaled, bad);
  append(out.warnings, bad);
  if (rows.empty()) throw bad_input(table.source, "holds no pose", "log the flange's poses");
  const bool millimetres = is_in_millimetres(table, rows);
  if (millimetres) {
    out.warnings.push_back(
        fmt::format("{}: most positions are beyond 20 m: they are taken as mm (write \"x [mm]\")",
                    table.source));
  }
  for (const ColumnReading& candidate : candidates) {
    FlangeReading reading{candidate.words,
                          log_of(table, time, rows, candidate, millimetres ? 1e-3 : 1.0),
                          candidate.usual, candidate.declaration};
    const bool known = std::ranges::any_of(out.found, [&](const FlangeReading& other) {
      return say_the_same(other.log, reading.log);
    });
    if (!known) out.found.push_back(with_row_offset(std::move(reading), as ? as->row_offset : 0));
  }
  return out;
}

std::vector<FlangeReading> with_moved_rows(std::vector<FlangeReading> readings) {
  const std::size_t plain = readings.size();
  for (const int offset : {1, -1}) {
    for (std::size_t k = 0; k < plain; ++k) {
      FlangeReading moved = with_row_offset(readings[k], offset);
      if (moved.log.poses.empty()) continue;
      moved.usual = false;
      moved.declaration.row_offset = offset;
      moved.rotation +=
          fmt::format(", each image with the {} {}", moved.log.numbered ? "number" : "row",
                      offset > 0 ? "after its own" : "before its own");
      readings.push_back(std::move(moved));
    }
  }
  return readings;
}

}  // namespace kinescope
