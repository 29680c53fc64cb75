// SPDX-License-Identifier: Apache-2.0
//
// corners.csv, poses.csv and points.csv: rows in any order, one frame for all rows of the same `t`.
#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "app/io/recording.h"
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

/// The distinct times of a table and the frame of each row.
struct Frames {
  std::vector<double> times_s;
  std::vector<int> of_row;
};

Frames group_by_time(const CsvTable& table) {
  const std::size_t t = table.require_column("t");
  std::vector<double> row_times;
  row_times.reserve(table.rows.size());
  for (std::size_t r = 0; r < table.rows.size(); ++r) row_times.push_back(table.number(r, t));
  Frames frames;
  frames.times_s = row_times;
  std::ranges::sort(frames.times_s);
  const auto repeated = std::ranges::unique(frames.times_s);
  frames.times_s.erase(repeated.begin(), repeated.end());
  for (const double time_s : row_times) {
    const auto frame = std::ranges::lower_bound(frames.times_s, time_s);
    frames.of_row.push_back(static_cast<int>(frame - frames.times_s.begin()));
  }
  return frames;
}

/// Rows by frame, then id, each pair's rows in the file's order.
std::map<std::pair<int, TagId>, std::vector<std::size_t>> group_by_sighting(const CsvTable& table,
                                                                            const Frames& frames,
                                                                            const char* id_column) {
  const std::size_t column = table.require_column(id_column);
  std::map<std::pair<int, TagId>, std::vector<std::size_t>> groups;
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    const TagId id{table.integer(r, column)};
    if (id.value < 0) {
      throw bad_input(table.place(r), fmt::format("column '{}' holds {}", id_column, id.value),
                      "numbers begin at 0");
    }
    groups[{frames.of_row[r], id}].push_back(r);
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
  return value;
}

Eigen::Vector3d vector3(const CsvTable& table, std::size_t row) {
  return {table.number(row, table.require_column("x")),
          table.number(row, table.require_column("y")),
          table.number(row, table.require_column("z"))};
}

std::string marker_in_frame(const char* kind, TagId id, double time_s) {
  return fmt::format("{} {} at t = {}", kind, id.value, time_s);
}

/// One marker's corners from its rows, in any order.
TagObservation read_sighting(const CsvTable& table, const std::vector<std::size_t>& rows,
                             std::size_t corner_count, const std::string& who) {
  const std::size_t corner_column = table.require_column("corner");
  const std::size_t u = table.require_column("u");
  const std::size_t v = table.require_column("v");
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
    out.corners_px[index] = {table.number(row, u), table.number(row, v)};
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

/// Unit quaternion of a row. The columns' order is x, y, z, w.
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
  return q.normalized();
}

PoseSample read_pose(const CsvTable& table, std::size_t row, int frame) {
  PoseSample sample;
  sample.frame = frame;
  sample.T_camera_marker = {quaternion(table, row), vector3(table, row)};
  const double sigma_m = sigma(table, row, "sigma_m").value_or(kPoseSigmaM);
  const double sigma_rad = sigma(table, row, "sigma_rad").value_or(kPoseSigmaRad);
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(sigma_rad * sigma_rad),
      Eigen::Vector3d::Constant(sigma_m * sigma_m);
  sample.covariance = variances.asDiagonal();
  return sample;
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

[[noreturn]] void throw_twice(const CsvTable& table, std::size_t row, const std::string& who) {
  throw bad_input(table.place(row), who + " stands there twice", "keep one of the rows");
}

}  // namespace

TagObservations read_corners(const std::filesystem::path& path, const MarkerSet& markers) {
  const CsvTable table = read_csv(path);
  const Frames frames = group_by_time(table);
  TagObservations out;
  out.times_s = frames.times_s;
  for (const auto& [key, rows] : group_by_sighting(table, frames, "tag")) {
    const auto [frame, id] = key;
    const double time_s = frames.times_s[static_cast<std::size_t>(frame)];
    if (!has_corners(markers, id)) {
      if (!markers.only_listed) {
        throw bad_input(table.place(rows.front()),
                        fmt::format("tag {} has no declared size", id.value),
                        "add its size to tags.yaml");
      }
      out.rejected.push_back({.frame = frame, .id = id, .reason = "not listed in tags.yaml"});
      continue;
    }
    TagObservation sighting = read_sighting(table, rows, markers.corners_m(id).size(),
                                            marker_in_frame("tag", id, time_s));
    sighting.frame = frame;
    sighting.id = id;
    out.observations.push_back(std::move(sighting));
  }
  if (out.observations.empty()) {
    throw bad_input(table.source, "holds no tag that tags.yaml lists", "correct tags.yaml");
  }
  return out;
}

PoseTracks read_poses(const std::filesystem::path& path) {
  const CsvTable table = read_csv(path);
  const Frames frames = group_by_time(table);
  PoseTracks out;
  out.times_s = frames.times_s;
  std::map<TagId, PoseTrack> tracks;
  for (const auto& [key, rows] : group_by_sighting(table, frames, "body")) {
    const auto [frame, id] = key;
    const double time_s = frames.times_s[static_cast<std::size_t>(frame)];
    if (rows.size() > 1) throw_twice(table, rows[1], marker_in_frame("body", id, time_s));
    tracks[id].samples.push_back(read_pose(table, rows.front(), frame));
  }
  for (auto& [id, track] : tracks) {
    track.id = id;
    out.tracks.push_back(std::move(track));
  }
  return out;
}

PointObservations read_points(const std::filesystem::path& path) {
  const CsvTable table = read_csv(path);
  const Frames frames = group_by_time(table);
  PointObservations out;
  out.times_s = frames.times_s;
  for (const auto& [key, rows] : group_by_sighting(table, frames, "point")) {
    const auto [frame, id] = key;
    const double time_s = frames.times_s[static_cast<std::size_t>(frame)];
    if (rows.size() > 1) throw_twice(table, rows[1], marker_in_frame("point", id, time_s));
    PointObservation point = read_point(table, rows.front());
    point.frame = frame;
    point.id = id;
    out.observations.push_back(std::move(point));
  }
  return out;
}

}  // namespace kinescope
