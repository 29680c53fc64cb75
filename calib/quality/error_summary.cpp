// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/error_summary.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>

namespace kinescope {
namespace {

constexpr double kTailFraction = 0.95;

/// The lengths of one row, gathered before they are summed up.
struct Lengths {
  std::vector<double> before_px, training_px, held_out_px;
  std::vector<double> before_m, training_m, held_out_m;
  std::vector<double> before_rad, training_rad, held_out_rad;
};

void add_pixels(const std::vector<Eigen::Vector2d>& corners, std::vector<double>& lengths) {
  for (const Eigen::Vector2d& corner : corners) lengths.push_back(corner.norm());
}

/// The direction from the camera to every sighting, in the camera's axes.
class LinesOfSight {
 public:
  explicit LinesOfSight(const Calibration& calibration) : calibration_(calibration) {}

  /// The optical axis where the place is not known.
  [[nodiscard]] Eigen::Vector3d to(const SightingResidual& sighting) {
    const Marker* marker = calibration_.tree.marker(sighting.id);
    const Eigen::MatrixXd& values = calibration_.joint_values;
    if (marker == nullptr || sighting.frame < 0 || sighting.frame >= values.rows()) {
      return Eigen::Vector3d::UnitZ();
    }
    if (sighting.frame != frame_) {
      frame_ = sighting.frame;
      values_ = values.row(frame_).transpose();
      // Joints that are not known move what is behind them, not the base and its markers.
      links_ = forward_kinematics(calibration_.tree, values_.unaryExpr([](double value) {
        return std::isfinite(value) ? value : 0.0;
      }));
    }
    const auto is_known = [&](JointId joint) {
      return std::isfinite(values_[static_cast<Eigen::Index>(joint.index())]);
    };
    if (!std::ranges::all_of(calibration_.tree.path_to(marker->link), is_known)) {
      return Eigen::Vector3d::UnitZ();
    }
    const Pose T_base_marker = links_[marker->link.index()] * marker->T_link_marker;
    const Eigen::Vector3d place =
        camera_from_base(calibration_, sighting.frame, links_) * T_base_marker.translation;
    return place.norm() > 0.0 ? Eigen::Vector3d(place.normalized()) : Eigen::Vector3d::UnitZ();
  }

 private:
  const Calibration& calibration_;
  int frame_ = -1;
  Eigen::VectorXd values_;   ///< of frame_
  std::vector<Pose> links_;  ///< of frame_
};

/// One displacement (rad, m): whole lengths for poses and points; for corners what one camera sees
/// well, the shift across its line of sight and the turn about it.
void add_displacement(MeasurementKind kind, const Vector6d& displacement,
                      const Eigen::Vector3d& sight, std::vector<double>& metres,
                      std::vector<double>& radians) {
  const Eigen::Vector3d turn = displacement.head<3>();
  const Eigen::Vector3d shift = displacement.tail<3>();
  switch (kind) {
    case MeasurementKind::kCorners:
      metres.push_back((shift - shift.dot(sight) * sight).norm());
      radians.push_back(std::abs(turn.dot(sight)));
      break;
    case MeasurementKind::kPose:
      metres.push_back(shift.norm());
      radians.push_back(turn.norm());
      break;
    case MeasurementKind::kPoint:
      metres.push_back(shift.norm());
      break;
  }
}

void add_sighting(MeasurementKind kind, const SightingResidual& sighting,
                  const Eigen::Vector3d& sight, Lengths& lengths) {
  // A displacement of exactly zero was never filled: no model was asked about this sighting.
  const bool was_before = !sighting.before_displacement.isZero(0.0);
  const bool was_held_out = !sighting.held_out_displacement.isZero(0.0);
  add_pixels(sighting.before_px, lengths.before_px);
  add_pixels(sighting.corners_px, lengths.training_px);
  add_pixels(sighting.held_out_px, lengths.held_out_px);
  add_displacement(kind, sighting.displacement, sight, lengths.training_m, lengths.training_rad);
  if (was_before) {
    add_displacement(kind, sighting.before_displacement, sight, lengths.before_m,
                     lengths.before_rad);
  }
  if (was_held_out) {
    add_displacement(kind, sighting.held_out_displacement, sight, lengths.held_out_m,
                     lengths.held_out_rad);
  }
}

ErrorRow make_row(std::string name, Lengths lengths) {
  return {.name = std::move(name),
          .before_px = statistics(std::move(lengths.before_px)),
          .training_px = statistics(std::move(lengths.training_px)),
          .held_out_px = statistics(std::move(lengths.held_out_px)),
          .before_m = statistics(std::move(lengths.before_m)),
          .training_m = statistics(std::move(lengths.training_m)),
          .held_out_m = statistics(std::move(lengths.held_out_m)),
          .before_rad = statistics(std::move(lengths.before_rad)),
          .training_rad = statistics(std::move(lengths.training_rad)),
          .held_out_rad = statistics(std::move(lengths.held_out_rad))};
}

/// The value below which the fraction lies, linear between neighbours (R's type 7).
double quantile(const std::vector<double>& sorted, double fraction) {
  const double place = fraction * static_cast<double>(sorted.size() - 1);
  const auto low = static_cast<std::size_t>(place);
  const std::size_t high = std::min(low + 1, sorted.size() - 1);
  return sorted[low] + (place - static_cast<double>(low)) * (sorted[high] - sorted[low]);
}

}  // namespace

ErrorStatistics statistics(std::vector<double> lengths) {
  std::erase_if(lengths, [](double length) { return !std::isfinite(length); });
  if (lengths.empty()) return {};
  std::ranges::sort(lengths);
  double squares = 0.0;
  for (const double length : lengths) squares += length * length;
  return {.count = static_cast<int>(lengths.size()),
          .rms = std::sqrt(squares / static_cast<double>(lengths.size())),
          .median = quantile(lengths, 0.5),
          .p95 = quantile(lengths, kTailFraction),
          .max = lengths.back()};
}

ErrorSummary summarise_errors(const Calibration& calibration) {
  Lengths all;
  std::map<LinkId, Lengths> by_link;
  std::map<TagId, Lengths> by_marker;
  LinesOfSight lines(calibration);
  for (const SightingResidual& sighting : calibration.residuals) {
    if (!sighting.used) continue;
    const Eigen::Vector3d sight = lines.to(sighting);
    add_sighting(calibration.kind, sighting, sight, all);
    add_sighting(calibration.kind, sighting, sight, by_marker[sighting.id]);
    if (const Marker* marker = calibration.tree.marker(sighting.id)) {
      add_sighting(calibration.kind, sighting, sight, by_link[marker->link]);
    }
  }
  ErrorSummary summary;
  summary.all = make_row("all", std::move(all));
  for (auto& [link, lengths] : by_link) {
    summary.links.push_back(
        make_row(calibration.tree.links.at(link.index()).name, std::move(lengths)));
  }
  for (auto& [id, lengths] : by_marker) {
    summary.markers.push_back(make_row("tag_" + std::to_string(id.value), std::move(lengths)));
  }
  return summary;
}

}  // namespace kinescope
