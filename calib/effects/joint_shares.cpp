// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/joint_shares.h"

#include <algorithm>

namespace kinescope::effects {
namespace {

// Links behind a joint, the farthest (by the number of joints) last.
std::vector<std::size_t> links_behind(const KinematicTree& tree, int joint) {
  std::vector<std::pair<std::size_t, std::size_t>> found;  // joints to it, link
  for (std::size_t l = 0; l < tree.links.size(); ++l) {
    const std::vector<JointId> path = tree.path_to(LinkId{static_cast<int>(l)});
    if (std::ranges::find(path, JointId{joint}) != path.end()) found.emplace_back(path.size(), l);
  }
  std::ranges::stable_sort(found);
  std::vector<std::size_t> out;
  for (const auto& [depth, link] : found) out.push_back(link);
  return out;
}

// A point of every link that stands for its mass: the middle of its frame, its markers and the
// joints it carries.
std::vector<Eigen::Vector3d> middles(const KinematicTree& tree) {
  std::vector<Eigen::Vector3d> sum(tree.links.size(), Eigen::Vector3d::Zero());
  std::vector<double> count(tree.links.size(), 1.0);
  for (const Joint& joint : tree.joints) {
    sum[joint.parent.index()] += joint.T_parent_joint.translation;
    count[joint.parent.index()] += 1.0;
  }
  for (const Marker& marker : tree.markers) {
    sum[marker.link.index()] += marker.T_link_marker.translation;
    count[marker.link.index()] += 1.0;
  }
  for (std::size_t l = 0; l < sum.size(); ++l) sum[l] /= count[l];
  return sum;
}

}  // namespace

Eigen::VectorXd play_state(const Eigen::VectorXd& drive, double width) {
  Eigen::VectorXd out(drive.size());
  if (drive.size() == 0) return out;
  const double half = 0.5 * width;
  // Nothing is known of the past: the gap starts on the side that the first motion pushes to.
  double link = drive[0];
  for (Eigen::Index i = 1; i < drive.size(); ++i) {
    if (drive[i] != drive[0]) {
      link = drive[0] + (drive[i] > drive[0] ? -half : half);
      break;
    }
  }
  for (Eigen::Index i = 0; i < drive.size(); ++i) {
    link = std::clamp(link, drive[i] - half, drive[i] + half);
    out[i] = (link - drive[i]) / width;
  }
  return out;
}

Eigen::VectorXd read_at(const std::vector<double>& from_s, const Eigen::VectorXd& values,
                        const std::vector<double>& to_s) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(to_s.size()));
  for (std::size_t i = 0; i < to_s.size(); ++i) {
    const auto above = std::ranges::upper_bound(from_s, to_s[i]);
    const auto at = static_cast<Eigen::Index>(i);
    if (above == from_s.begin()) {
      out[at] = values[0];
    } else if (above == from_s.end()) {
      out[at] = values[values.size() - 1];
    } else {
      const auto right = static_cast<Eigen::Index>(above - from_s.begin());
      const double begin = *(above - 1);
      const double fraction = (to_s[i] - begin) / (*above - begin);
      out[at] = (1.0 - fraction) * values[right - 1] + fraction * values[right];
    }
  }
  return out;
}

namespace {

// Torque about (force along) the axis by a unit of gravity along each axis of the base frame that
// acts at a point: axis . (arm x g) = g . (axis x arm).
Eigen::RowVector3d load_at(const Joint& joint, const Pose& T_base_child,
                           const Eigen::Vector3d& point_base) {
  const Eigen::Vector3d axis = T_base_child.rotation * joint.axis;
  if (joint.type == JointType::kPrismatic) return axis.transpose();
  return axis.cross(point_base - T_base_child.translation).transpose();
}

}  // namespace

std::vector<Load> gravity_loads(const KinematicTree& tree, const JointMotion& motion, int joint,
                                const std::optional<Eigen::Vector3d>& gravity_base) {
  const Joint& axis = tree.joints[static_cast<std::size_t>(joint)];
  const std::vector<std::size_t> behind = links_behind(tree, joint);
  const std::vector<Eigen::Vector3d> middle = middles(tree);
  const Eigen::Quaterniond across = rotation_to_axis(axis.axis);
  const Eigen::Index instants = motion.value.rows();
  Eigen::MatrixXd all(instants, 3);  // the middles of all links behind
  Eigen::MatrixXd own_x(instants, 3);
  Eigen::MatrixXd own_y(instants, 3);
  Eigen::MatrixXd tip(instants, 3);
  for (Eigen::Index i = 0; i < instants; ++i) {
    const std::vector<Pose> T_base_link = forward_kinematics(tree, motion.value.row(i).transpose());
    const Pose& T_base_child = T_base_link[axis.child.index()];
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const std::size_t link : behind) {
      mean += T_base_link[link] * middle[link] / static_cast<double>(behind.size());
    }
    all.row(i) = load_at(axis, T_base_child, mean);
    own_x.row(i) = load_at(axis, T_base_child, T_base_child * (across * Eigen::Vector3d::UnitX()));
    own_y.row(i) = load_at(axis, T_base_child, T_base_child * (across * Eigen::Vector3d::UnitY()));
    tip.row(i) = load_at(axis, T_base_child, T_base_link[behind.back()] * middle[behind.back()]);
  }
  std::vector<Load> out;
  if (!gravity_base) {
    for (int k = 0; k < 3; ++k) {
      out.push_back({std::string("gravity along ") + "xyz"[k], all.col(k)});
    }
    return out;
  }
  if (axis.type == JointType::kPrismatic) return {{"what it carries", all * *gravity_base}};
  out.push_back({"its own link, across x", own_x * *gravity_base});
  out.push_back({"its own link, across y", own_y * *gravity_base});
  if (behind.size() > 1) out.push_back({"the links behind it", all * *gravity_base});
  if (behind.size() > 2) out.push_back({"the last link", tip * *gravity_base});
  return out;
}

}  // namespace kinescope::effects
