// SPDX-License-Identifier: Apache-2.0
#include "app/report/prediction.h"

#include <cstddef>

#include "calib/camera/marker_set.h"

namespace kinescope::report {

bool base_is_camera(const Calibration& calibration) {
  if (calibration.moving) return false;
  constexpr double kSame = 1e-9;  // m and rad
  return calibration.T_camera_base.translation.norm() < kSame &&
         log_rotation(calibration.T_camera_base.rotation).norm() < kSame;
}

Predictor::Predictor(const Calibration& calibration) : calibration_(calibration) {
  const KinematicTree& tree = calibration.tree;
  const auto joints = static_cast<Eigen::Index>(tree.joints.size());
  links_.resize(calibration.times_s.size());
  for (std::size_t frame = 0; frame < links_.size(); ++frame) {
    const auto row = static_cast<Eigen::Index>(frame);
    if (row >= calibration.joint_values.rows() || calibration.joint_values.cols() != joints)
      continue;
    Eigen::VectorXd values = calibration.joint_values.row(row).transpose();
    bool known = true;
    for (Eigen::Index j = 0; j < joints; ++j) {
      const bool fixed = tree.joints[static_cast<std::size_t>(j)].type == JointType::kFixed;
      if (fixed) values(j) = 0.0;
      known = known && std::isfinite(values(j));
    }
    if (known) links_[frame] = forward_kinematics(tree, values);
  }
  moves_.assign(tree.joints.size(), std::vector<bool>(tree.links.size(), false));
  for (std::size_t link = 0; link < tree.links.size(); ++link) {
    for (const JointId joint : tree.path_to(LinkId{static_cast<int>(link)})) {
      moves_[joint.index()][link] = true;
    }
  }
}

const std::vector<Pose>& Predictor::links(int frame) const {
  static const std::vector<Pose> kUnknown;
  if (frame < 0 || static_cast<std::size_t>(frame) >= links_.size()) return kUnknown;
  return links_[static_cast<std::size_t>(frame)];
}

std::vector<Eigen::Vector3d> Predictor::corners_base(const SightingResidual& sighting,
                                                     const std::vector<Pose>& links,
                                                     const Marker& marker) const {
  const Pose T_base_marker = links[marker.link.index()] * marker.T_link_marker;
  std::vector<Eigen::Vector3d> corners;
  if (sighting.corners_px.size() == 4) {
    for (const Eigen::Vector3d& corner : square_corners(marker.size_m)) {
      corners.push_back(T_base_marker * corner);
    }
  } else {
    corners.assign(sighting.corners_px.size(), T_base_marker.translation);
  }
  return corners;
}

std::vector<Eigen::Vector2d> Predictor::corners(const SightingResidual& sighting) const {
  const std::vector<Pose>& links_base = links(sighting.frame);
  const Marker* marker = calibration_.tree.marker(sighting.id);
  if (links_base.empty() || marker == nullptr) return {};
  const std::size_t camera = calibration_.camera_at(sighting.frame);
  std::vector<Eigen::Vector2d> pixels;
  for (const Eigen::Vector3d& corner : corners_base(sighting, links_base, *marker)) {
    const auto pixel = project(calibration_.model_of_camera(camera),
                               camera_from_base(calibration_, sighting.frame, links_base) * corner);
    if (!pixel) return {};
    pixels.push_back(*pixel);
  }
  return pixels;
}

Eigen::Vector3d Predictor::velocity(const std::vector<Pose>& links, std::size_t joint,
                                    const Eigen::Vector3d& point_base) const {
  const Joint& one = calibration_.tree.joints[joint];
  // The joint's motion leaves its own axis where it is, so the child's frame serves for both.
  const Pose& T_base_child = links[one.child.index()];
  Eigen::Vector3d axis = T_base_child.rotation * one.axis;
  if (one.type == JointType::kPrismatic) return axis;
  return axis.cross(point_base - T_base_child.translation);
}

std::vector<ResidualAndRate> Predictor::rates(const SightingResidual& sighting,
                                              std::size_t joint) const {
  const std::vector<Pose>& links_base = links(sighting.frame);
  const Marker* marker = calibration_.tree.marker(sighting.id);
  if (links_base.empty() || marker == nullptr) return {};
  if (!moves_[joint][marker->link.index()]) return {};
  std::vector<ResidualAndRate> rates;
  if (calibration_.kind == MeasurementKind::kCorners) {
    const std::vector<Eigen::Vector3d> corners = corners_base(sighting, links_base, *marker);
    const std::size_t camera = calibration_.camera_at(sighting.frame);
    const Pose T_camera_base = camera_from_base(calibration_, sighting.frame, links_base);
    for (std::size_t k = 0; k < corners.size(); ++k) {
      const auto projection = project_with_derivatives(calibration_.model_of_camera(camera),
                                                       T_camera_base * corners[k]);
      if (!projection) return {};
      const Eigen::Vector2d rate =
          projection->d_point * (T_camera_base.rotation * velocity(links_base, joint, corners[k]));
      for (int axis = 0; axis < 2; ++axis) {
        rates.push_back({.residual = sighting.corners_px[k](axis), .rate = rate(axis)});
      }
    }
    return rates;
  }
  const Pose T_base_marker = links_base[marker->link.index()] * marker->T_link_marker;
  Eigen::Vector3d rate = velocity(links_base, joint, T_base_marker.translation);
  if (calibration_.kind == MeasurementKind::kPose) {
    rate = T_base_marker.rotation.conjugate() * rate;
  } else {
    rate = calibration_.T_camera_base.rotation * rate;
  }
  for (int axis = 0; axis < 3; ++axis) {
    rates.push_back({.residual = sighting.displacement(3 + axis), .rate = rate(axis)});
  }
  return rates;
}

}  // namespace kinescope::report
