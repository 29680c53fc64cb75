// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/carrying_link.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "calib/bundle/links_in_camera.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

double turn_between(const Pose& a, const Pose& b) { return a.rotation.angularDistance(b.rotation); }

Eigen::Vector3d middle_of(const std::vector<Pose>& poses) {
  Eigen::Vector3d out;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Pose& pose : poses) values.push_back(pose.translation[axis]);
    out[axis] = median_of(std::move(values));
  }
  return out;
}

double usual_distance(const std::vector<Pose>& poses, const Eigen::Vector3d& from) {
  std::vector<double> distances;
  for (const Pose& pose : poses) distances.push_back((pose.translation - from).norm());
  return median_of(std::move(distances));
}

// That of the pose which most others turn least against: some are of the wrong planar branch.
Eigen::Quaterniond usual_rotation(const std::vector<Pose>& poses) {
  constexpr std::size_t kEnough = 100;  // pairs of poses grow with the square
  const std::size_t step = std::max<std::size_t>(1, poses.size() / kEnough);
  double least = std::numeric_limits<double>::infinity();
  Eigen::Quaterniond out = poses.front().rotation;
  for (std::size_t i = 0; i < poses.size(); i += step) {
    std::vector<double> angles;
    for (std::size_t j = 0; j < poses.size(); j += step)
      angles.push_back(turn_between(poses[i], poses[j]));
    const double usual = median_of(std::move(angles));
    if (usual >= least) continue;
    least = usual;
    out = poses[i].rotation;
  }
  return out;
}

}  // namespace

std::vector<Marker> on_carrying_links(const Calibration& robot, const PoseTrack& marker) {
  const std::vector<std::vector<Pose>> links = bundle::links_in_camera(robot);
  std::vector<std::pair<double, Marker>> by_motion;
  for (std::size_t l = 0; l < robot.tree.links.size(); ++l) {
    std::vector<Pose> on_link;
    for (const PoseSample& sample : marker.samples) {
      const std::vector<Pose>& then = links[static_cast<std::size_t>(sample.frame)];
      if (!then.empty()) on_link.push_back(then[l].inverse() * sample.T_camera_marker);
    }
    if (on_link.empty()) continue;
    const Pose middle{usual_rotation(on_link), middle_of(on_link)};
    by_motion.push_back({usual_distance(on_link, middle.translation),
                         Marker{marker.id, LinkId{static_cast<int>(l)}, middle, 0.0}});
  }
  std::ranges::stable_sort(by_motion, {}, &std::pair<double, Marker>::first);
  std::vector<Marker> out;
  for (const auto& [motion, on_link] : by_motion) out.push_back(on_link);
  return out;
}

}  // namespace kinescope
