// SPDX-License-Identifier: Apache-2.0
//
// corners.csv, poses.csv and points.csv: rows in any order, one frame for all rows of the same `t`.
// A few bad rows are left out; of corners.csv the sightings that they belong to.
#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "app/io/bag_files.h"
#include "app/io/recording.h"
#include "app/io/sighting_table.h"
#include "kinematics/bags/bag.h"
#include "kinematics/core/bad_rows.h"
#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// Where a table declares no sigma. The calibration scales all of them to the residuals it finds, so
// only the ratio of the two of a pose matters: 1 mm against 2 mrad is a marker of 10 cm at a few
// tenths of a pixel.
constexpr double kCornerSigmaPx = 0.1;
constexpr double kPoseSigmaM = 1e-3;
constexpr double kPoseSigmaRad = 2e-3;
constexpr double kPointSigmaM = 1e-4;

// px, m or rad; simulations without noise declare less than sensors have, but no such thing.
constexpr double kSmallestSigma = 1e-15;

/// A row whose time and id can be read.
struct KeyedRow {
  std::size_t row = 0;
  double time_s = 0.0;
  TagId id;
};

TagId read_id(const CsvTable& table, std::size_t row, std::size_t column) {
  const TagId id{table.integer(row, column)};
  if (id.value >= 0) return id;
  throw bad_input(table.place(row),
                  fmt::format("column '{}' holds {}", table.header[column], id.value),
                  "numbers begin at 0");
}

std::vector<KeyedRow> read_keys(const CsvTable& table, const char* id_column, BadRows& bad) {
  const std::size_t t = table.require_column("t");
  const std::size_t id = table.require_column(id_column);
  std::vector<KeyedRow> keys;
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    try {
      keys.push_back({r, table.number(r, t), read_id(table, r, id)});
    } catch (const Error& error) {
      bad.add(table.lines[r], error);
    }
  }
  return keys;
}

std::vector<double> distinct_times(const std::vector<KeyedRow>& keys) {
  std::vector<double> times_s;
  times_s.reserve(keys.size());
  for (const KeyedRow& key : keys) times_s.push_back(key.time_s);
  std::ranges::sort(times_s);
  const auto repeated = std::ranges::unique(times_s);
  times_s.erase(repeated.begin(), repeated.end());
  return times_s;
}

using Groups = std::map<std::pair<int, TagId>, std::vector<std::size_t>>;

/// Rows by frame, then id, each pair's rows in the file's order.
Groups group_by_sighting(const std::vector<KeyedRow>& keys, const std::vector<double>& times_s) {
  Groups groups;
  for (const KeyedRow& key : keys) {
    const auto frame = std::ranges::lower_bound(times_s, key.time_s) - times_s.begin();
    groups[{static_cast<int>(frame), key.id}].push_back(key.row);
  }
  return groups;
}

/// A sigma, where the column is there and the cell is filled.
std::optional<double> sigma(const CsvTable& table, std::size_t row, std::string_view name) {
  const auto column = table.column(name);
  if (!column) return std::nullopt;
  const std::optional<double> value = table.optional_number(row, *column);
  if (value && *value <= 0.0) {
    throw bad_input(table.place(row),
                    fmt::format("column '{}' holds {}, not above zero", name, *value),
                    "give a standard deviation, or leave the cell empty");
  }
  if (value && *value < kSmallestSigma) {
    throw bad_input(
        table.place(row),
        fmt::format("column '{}' holds {}, less than any instrument's noise", name, *value),
        "give a standard deviation, or leave the cell empty");
  }
  return value;
}

std::string marker_in_frame(const char* kind, TagId id, double time_s) {
  return fmt::format("{} {} at t = {}", kind, id.value, time_s);
}

/// One marker's corners from its rows, in any order.
TagObservation read_sighting(const CsvTable& table, const std::vector<std::size_t>& rows,
                             std::size_t corner_count, const std::string& who) {
  const std::size_t corner_column = table.require_column("corner");
  TagObservation out;
  out.corners_px.resize(corner_count);
  std::vector<bool> seen(corner_count, false);
  double variance_sum = 0.0;
  for (const std::size_t row : rows) {
    const int corner = table.integer(row, corner_column);
    if (corner < 0 || static_cast<std::size_t>(corner) >= corner_count) {
      throw bad_input(table.place(row), fmt::format("{} has no corner {}", who, corner),
                      fmt::format("corners are numbered from 0 to {}", corner_count - 1));
    }
    const auto index = static_cast<std::size_t>(corner);
    if (seen[index]) {
      throw bad_input(table.place(row), fmt::format("{} has its corner {} twice", who, corner),
                      "keep one of the rows");
    }
    seen[index] = true;
    out.corners_px[index] = {bounded_number(table, row, "u", kFarthestPx),
                             bounded_number(table, row, "v", kFarthestPx)};
    const double sigma_px = sigma(table, row, "sigma").value_or(kCornerSigmaPx);
    variance_sum += sigma_px * sigma_px;
  }
  if (rows.size() != corner_count) {
    throw bad_input(table.place(rows.back()),
                    fmt::format("{} has {} corners of {}", who, rows.size(), corner_count),
                    "give all of them, or leave the sighting out");
  }
  out.sigma_px = std::sqrt(variance_sum / static_cast<double>(corner_count));
  if (const auto hamming = table.column("hamming")) {
    out.hamming = table.integer(rows.front(), *hamming);
  }
  if (const auto margin = table.column("margin")) {
    out.decision_margin = table.number(rows.front(), *margin);
  }
  return out;
}

bool has_corners(const MarkerSet& markers, TagId id) {
  return markers.size_m(id) > 0.0 || markers.boards.contains(id);
}

/// Throws for a quaternion that is no unit one where `unit` is asked for.
PoseSample read_pose(const CsvTable& table, std::size_t row, int frame, bool unit) {
  PoseSample sample;
  sample.frame = frame;
  const Eigen::Quaterniond q = quaternion(table, row);
  if (unit && !is_unit(q)) throw not_unit(table, row, q);
  sample.T_camera_marker = {q.normalized(), vector3(table, row)};
  const double sigma_m = sigma(table, row, "sigma_m").value_or(kPoseSigmaM);
  const double sigma_rad = sigma(table, row, "sigma_rad").value_or(kPoseSigmaRad);
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(sigma_rad * sigma_rad),
      Eigen::Vector3d::Constant(sigma_m * sigma_m);
  sample.covariance = variances.asDiagonal();
  return sample;
}

/// Width of the middle nine tenths of the positions along the axis where it is largest.
double span_m(const std::vector<Eigen::Vector3d>& positions) {
  double widest = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> along;
    for (const Eigen::Vector3d& position : positions) along.push_back(position[axis]);
    if (along.empty()) return 0.0;
    std::ranges::sort(along);
    widest =
        std::max(widest, along[along.size() - 1 - along.size() / 20] - along[along.size() / 20]);
  }
  return widest;
}

/// No robot spans as much, as of the poses of a flange (flange_file.cpp); one of 0.2 m does in cm.
void ask_for_unit(double span, const std::string& source, std::vector<std::string>& warnings) {
  constexpr double kNoCellM = 20.0;
  if (span <= kNoCellM) return;
  warnings.push_back(
      fmt::format("{}: the positions span {:.0f} m: are they in another unit? Say it in the header "
                  "(x [cm],y [cm],z [cm])",
                  source, span));
}

/// No camera or tracker sees a robot over 100 m; one of half a metre spans more than that in mm.
constexpr double kNoHall = 100.0;

std::string taken_as_mm(const std::string& source, double span) {
  return fmt::format("{}: the positions span {:.0f} m: they are taken as mm (write x, y, z in m)",
                     source, span);
}

void read_as_metres(ReadSightings<PoseTracks>& poses, const std::string& source) {
  std::vector<Eigen::Vector3d> positions;
  for (const PoseTrack& track : poses.found.tracks)
    for (const PoseSample& sample : track.samples)
      positions.push_back(sample.T_camera_marker.translation);
  const double span = span_m(positions);
  if (span <= kNoHall) return ask_for_unit(span, source, poses.warnings);
  for (PoseTrack& track : poses.found.tracks) {
    for (PoseSample& sample : track.samples) sample.T_camera_marker.translation *= 1e-3;
  }
  poses.warnings.push_back(taken_as_mm(source, span));
}

/// Sigmas that the table declares are in the positions' unit.
void read_as_metres(ReadSightings<PointObservations>& points, const std::string& source) {
  std::vector<Eigen::Vector3d> positions;
  for (const PointObservation& point : points.found.observations)
    if (point.position_m) positions.push_back(*point.position_m);
  const double span = span_m(positions);
  if (span <= kNoHall) return ask_for_unit(span, source, points.warnings);
  for (PointObservation& point : points.found.observations) {
    if (!point.position_m) continue;
    *point.position_m *= kMetrePerMillimetre;
    if (point.sigma_m != kPointSigmaM) point.sigma_m *= kMetrePerMillimetre;
  }
  points.warnings.push_back(taken_as_mm(source, span));
}

PointObservation read_point(const CsvTable& table, std::size_t row) {
  PointObservation out;
  const auto target = table.column("target");
  int filled = 0;
  for (const char* name : {"x", "y", "z"}) {
    if (table.optional_number(row, table.require_column(name))) ++filled;
  }
  if (filled == 3) {
    out.position_m = vector3(table, row);
  } else if (filled > 0) {
    throw bad_input(table.place(row), "some of x, y, z are empty", "fill in all three or none");
  } else if (!target || table.rows[row][*target].empty()) {
    throw bad_input(table.place(row), "has neither a position nor a target",
                    "fill in x, y, z, or name the target that holds the point");
  } else {
    out.target = table.rows[row][*target];
  }
  out.sigma_m = sigma(table, row, "sigma").value_or(kPointSigmaM);
  return out;
}

Error twice(const CsvTable& table, std::size_t row, const std::string& who) {
  return bad_input(table.place(row), who + " stands there twice", "keep one of the rows");
}

/// Sightings of one row each: reads the first row of every group; further ones are bad.
template <typename Read>
void read_each(const CsvTable& table, const Groups& groups, const std::vector<double>& times_s,
               const char* kind, BadRows& bad, const Read& read) {
  for (const auto& [key, rows] : groups) {
    const auto [frame, id] = key;
    const double time_s = times_s[static_cast<std::size_t>(frame)];
    for (std::size_t k = 1; k < rows.size(); ++k) {
      bad.add(table.lines[rows[k]], twice(table, rows[k], marker_in_frame(kind, id, time_s)));
    }
    try {
      read(rows.front(), frame, id);
    } catch (const Error& error) {
      bad.add(table.lines[rows.front()], error);
    }
  }
}

}  // namespace

TagObservations read_corners(const std::filesystem::path& path, const MarkerSet& markers) {
  const auto bag = bags::bag_source(path);
  const CsvTable table = bag ? corners_of_bag(*bag, markers.family) : read_sighting_table(path);
  for (const char* name : {"corner", "u", "v"}) static_cast<void>(table.require_column(name));
  BadRows bad_rows(table);
  const std::vector<KeyedRow> keys = read_keys(table, "tag", bad_rows);
  TagObservations out;
  out.times_s = distinct_times(keys);
  const Groups groups = group_by_sighting(keys, out.times_s);
  BadRows bad(table.source, groups.size(), "sightings");
  for (const auto& [key, rows] : groups) {
    const auto [frame, id] = key;
    const double time_s = out.times_s[static_cast<std::size_t>(frame)];
    if (!has_corners(markers, id)) {
      if (!markers.only_listed) {
        throw bad_input(table.place(rows.front()),
                        fmt::format("tag {} has no declared size", id.value),
                        "add its size to tags.yaml");
      }
      out.rejected.push_back({.frame = frame, .id = id, .reason = "not listed in tags.yaml"});
      continue;
    }
    try {
      TagObservation sighting = read_sighting(table, rows, markers.corners_m(id).size(),
                                              marker_in_frame("tag", id, time_s));
      sighting.frame = frame;
      sighting.id = id;
      out.observations.push_back(std::move(sighting));
    } catch (const Error& error) {
      bad.add(table.lines[rows.front()], error);
    }
  }
  if (out.observations.empty()) {
    throw bad_input(table.source, "holds no tag that tags.yaml lists", "correct tags.yaml");
  }
  append(out.warnings, bad_rows);
  append(out.warnings, bad);
  return out;
}

ReadSightings<PoseTracks> read_poses(const std::filesystem::path& path) {
  const CsvTable table = read_sighting_table(path);
  for (const char* name : {"x", "y", "z", "qx", "qy", "qz", "qw"}) {
    static_cast<void>(table.require_column(name));
  }
  BadRows bad(table);
  const std::vector<KeyedRow> keys = read_keys(table, "body", bad);
  ReadSightings<PoseTracks> out;
  const std::optional<std::string> scaled = scaled_quaternions(table, bad);
  if (scaled) out.warnings.push_back(*scaled);
  out.found.times_s = distinct_times(keys);
  std::map<TagId, PoseTrack> tracks;
  read_each(table, group_by_sighting(keys, out.found.times_s), out.found.times_s, "body", bad,
            [&](std::size_t row, int frame, TagId id) {
              PoseSample sample = read_pose(table, row, frame, !scaled);
              tracks[id].samples.push_back(std::move(sample));
            });
  for (auto& [id, track] : tracks) {
    track.id = id;
    out.found.tracks.push_back(std::move(track));
  }
  append(out.warnings, bad);
  read_as_metres(out, table.source);
  return out;
}

ReadSightings<PointObservations> read_points(const std::filesystem::path& path) {
  const CsvTable table = read_sighting_table(path);
  for (const char* name : {"x", "y", "z"}) static_cast<void>(table.require_column(name));
  BadRows bad(table);
  const std::vector<KeyedRow> keys = read_keys(table, "point", bad);
  ReadSightings<PointObservations> out;
  out.found.times_s = distinct_times(keys);
  read_each(table, group_by_sighting(keys, out.found.times_s), out.found.times_s, "point", bad,
            [&](std::size_t row, int frame, TagId id) {
              PointObservation point = read_point(table, row);
              point.frame = frame;
              point.id = id;
              out.found.observations.push_back(std::move(point));
            });
  append(out.warnings, bad);
  read_as_metres(out, table.source);
  return out;
}

}  // namespace kinescope
