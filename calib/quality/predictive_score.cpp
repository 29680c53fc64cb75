// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/predictive_score.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <vector>

#include <Eigen/Geometry>

#include "kinematics/core/student_t.h"

namespace kinescope {
namespace {

constexpr double kOfASquare = 8.0;  // coordinates of its corners

// One kind of residual (corners; turns; shifts): squared lengths, coordinates each, the volume that
// a sighting without a place may be in.
struct Part {
  std::vector<double> squares;
  double coordinates = 1.0;
  double log_extent = 0.0;  // of one coordinate
};

// `read_off`: coordinates that were used up, and may have been anything.
double deviance_of(const Part& part, std::size_t sightings, double read_off = 0.0) {
  const double elsewhere = static_cast<double>(sightings - part.squares.size());
  const double out = elsewhere * 2.0 * part.coordinates * part.log_extent;
  if (part.squares.empty()) return out;
  // Data without noise would be infinitely probable.
  constexpr double kExact = 1e-12;
  const StudentT fit =
      fit_student_t(part.squares, part.coordinates, kExact * std::exp(2.0 * part.log_extent));
  return out + read_off * (2.0 * part.log_extent - std::log(fit.scale_squared)) + fit.deviance;
}

double squared_length(const std::vector<Eigen::Vector2d>& corners) {
  double sum = 0.0;
  for (const Eigen::Vector2d& corner : corners) sum += corner.squaredNorm();
  return sum;
}

// The side of what all places together take up.
double log_side(const std::vector<Eigen::Vector3d>& places) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& place : places) box.extend(place);
  constexpr double kLeast = 1e-6;  // m
  return std::log(std::max(kLeast, box.isEmpty() ? 1.0 : box.diagonal().norm()));
}

std::vector<Eigen::Vector3d> places_of(const Measurements& measurements) {
  std::vector<Eigen::Vector3d> out;
  for (const PoseTrack& track : measurements.poses.tracks)
    for (const PoseSample& sample : track.samples)
      out.push_back(sample.T_camera_marker.translation);
  for (const PointObservation& point : measurements.points.observations)
    if (point.position_m) out.push_back(*point.position_m);
  return out;
}

// Joint values that no channel gives: each was read off the very sightings it is to predict.
double values_read_off(const Calibration& calibration) {
  std::set<int> frames;
  for (const SightingResidual& residual : calibration.residuals) frames.insert(residual.frame);
  const auto undriven = std::ranges::count_if(calibration.tree.joints, [](const Joint& joint) {
    return is_movable(joint) && joint.channel.empty() && joint.limits &&
           joint.limits->upper > joint.limits->lower;
  });
  return static_cast<double>(frames.size()) * static_cast<double>(undriven);
}

}  // namespace

PredictiveScore predictive_score(const Calibration& calibration, const Measurements& measurements) {
  const bool held_out = calibration.folds > 1;
  std::map<double, Part> corners;  // by how many coordinates a marker has
  Part turns{{}, 3.0, std::log(std::numbers::pi)};
  Part shifts{{}, 3.0, log_side(places_of(measurements))};
  for (const SightingResidual& residual : calibration.residuals) {
    const Vector6d& moved = held_out ? residual.held_out_displacement : residual.displacement;
    switch (calibration.kind) {
      case MeasurementKind::kCorners: {
        const auto& px =
            held_out && !residual.held_out_px.empty() ? residual.held_out_px : residual.corners_px;
        if (px.empty()) break;
        Part& part = corners[2.0 * static_cast<double>(px.size())];
        part.squares.push_back(squared_length(px));
        break;
      }
      case MeasurementKind::kPose:
        turns.squares.push_back(moved.head<3>().squaredNorm());
        [[fallthrough]];
      case MeasurementKind::kPoint:
        shifts.squares.push_back(moved.tail<3>().squaredNorm());
        break;
    }
  }
  PredictiveScore out;
  const double read_off = values_read_off(calibration);
  const std::size_t sightings = sightings_in(measurements);
  if (calibration.kind == MeasurementKind::kCorners) {
    std::size_t missing = sightings;
    const double side_px =
        std::max(1.0, 0.5 * (calibration.camera.width + calibration.camera.height));
    for (auto& [coordinates, part] : corners) {
      part.coordinates = coordinates;
      part.log_extent = std::log(side_px);
      missing -= part.squares.size();
      const double share = static_cast<double>(part.squares.size()) /
                           static_cast<double>(calibration.residuals.size());
      out.deviance += deviance_of(part, part.squares.size(), share * read_off);
    }
    out.deviance += deviance_of({{}, kOfASquare, std::log(side_px)}, missing);
  } else {
    out.deviance += deviance_of(shifts, sightings, read_off);
    if (calibration.kind == MeasurementKind::kPose) out.deviance += deviance_of(turns, sightings);
  }
  if (calibration.times_s.size() > 1) {
    const double interval_s = (calibration.times_s.back() - calibration.times_s.front()) /
                              static_cast<double>(calibration.times_s.size() - 1);
    out.alike = std::max(1.0, calibration.correlation_time_s / interval_s);
  }
  return out;
}

double scale_of_corners(const Calibration& calibration) {
  constexpr double kLeast = 1e-12;  // px^2
  std::vector<double> squares;
  for (const SightingResidual& residual : calibration.residuals) {
    const auto& px = residual.held_out_px.empty() ? residual.corners_px : residual.held_out_px;
    if (2.0 * static_cast<double>(px.size()) == kOfASquare) squares.push_back(squared_length(px));
  }
  return std::sqrt(fit_student_t(squares, kOfASquare, kLeast).scale_squared);
}

double log_odds(const PredictiveScore& of, const PredictiveScore& against) {
  return 0.5 * (against.deviance - of.deviance) / std::max(of.alike, against.alike);
}

}  // namespace kinescope
