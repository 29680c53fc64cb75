// SPDX-License-Identifier: Apache-2.0
#include "tests/acceptance/truth_robot.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/file.h"
#include "kinematics/core/rng.h"

namespace kinescope::acceptance {
namespace {

using nlohmann::json;

constexpr int kPostures = 300;

Pose pose_of(const json& rows) {
  Eigen::Matrix4d m;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) {
      m(r, c) = rows.at(static_cast<std::size_t>(r)).at(static_cast<std::size_t>(c)).get<double>();
    }
  }
  return pose_from_matrix(m);
}

JointType type_of(const std::string& name) {
  if (name == "revolute") return JointType::kRevolute;
  if (name == "prismatic") return JointType::kPrismatic;
  return JointType::kFixed;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  const std::size_t n = values.size();
  return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

// Joint values of the learned robot for the truth's, matched by name.
Eigen::VectorXd values_for(const KinematicTree& learned, const TruthRobot& truth,
                           const Eigen::VectorXd& q) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(learned.joints.size()));
  for (std::size_t j = 0; j < truth.tree.joints.size(); ++j) {
    const auto id = learned.joint(truth.tree.joints[j].name);
    if (!id) throw std::runtime_error("no joint " + truth.tree.joints[j].name);
    out[id->value] = q[static_cast<Eigen::Index>(j)];
  }
  return out;
}

// Tag centres in the base frame.
Eigen::Matrix3Xd centres(const KinematicTree& tree, const std::vector<Marker>& order,
                         const Eigen::VectorXd& q) {
  const std::vector<Pose> links = forward_kinematics(tree, q);
  Eigen::Matrix3Xd out(3, static_cast<Eigen::Index>(order.size()));
  for (std::size_t m = 0; m < order.size(); ++m) {
    const Marker* marker = tree.marker(order[m].id);
    if (marker == nullptr) throw std::runtime_error(fmt::format("no tag {}", order[m].id.value));
    out.col(static_cast<Eigen::Index>(m)) =
        links[marker->link.index()] * marker->T_link_marker.translation;
  }
  return out;
}

struct Line {
  Eigen::Vector3d point;
  Eigen::Vector3d direction;
};

Line axis_line(const KinematicTree& tree, JointId id, const Eigen::VectorXd& q) {
  const Joint& joint = tree.joints[id.index()];
  const Pose T_base_joint =
      forward_kinematics(tree, q)[joint.parent.index()] * joint.T_parent_joint;
  return {T_base_joint.translation, T_base_joint.rotation * joint.axis};
}

double distance_to(const Line& line, const Eigen::Vector3d& p) {
  return (p - line.point).cross(line.direction).norm();
}

}  // namespace

TruthRobot read_truth(const std::filesystem::path& truth_json) {
  const json data = json::parse(read_text_file(truth_json));
  TruthRobot truth;
  std::map<std::string, std::string> channel_of;
  for (const auto& [channel, joint] : data.at("channels").items()) {
    if (joint.is_string()) channel_of[joint.get<std::string>()] = channel;
  }
  std::map<std::string, LinkId> links;
  for (const json& link : data.at("links")) {
    links[link.get<std::string>()] = LinkId{static_cast<int>(truth.tree.links.size())};
    truth.tree.links.push_back({link.get<std::string>()});
  }
  for (const json& entry : data.at("joints")) {
    Joint joint;
    joint.name = channel_of.at(entry.at("name").get<std::string>());
    joint.channel = joint.name;
    joint.type = type_of(entry.at("type").get<std::string>());
    joint.parent = links.at(entry.at("parent").get<std::string>());
    joint.child = links.at(entry.at("child").get<std::string>());
    joint.T_parent_joint = pose_of(entry.at("T_parent_joint"));
    const auto axis = entry.at("axis").get<std::vector<double>>();
    joint.axis = Eigen::Vector3d(axis[0], axis[1], axis[2]).normalized();
    const auto range = entry.at("range_used").get<std::vector<double>>();
    truth.range.push_back({range[0], range[1]});
    truth.tree.joints.push_back(joint);
  }
  for (const json& tag : data.at("tags")) {
    Marker marker;
    marker.id = TagId{tag.at("id").get<int>()};
    marker.link = links.at(tag.at("link").get<std::string>());
    marker.T_link_marker = pose_of(tag.at("T_link_tag"));
    marker.size_m = tag.at("size_true").get<double>();
    truth.tree.markers.push_back(marker);
  }
  truth.latency_s = data.at("timing").at("latency_s").get<double>();
  truth.effect = data.at("effects").at(0).at("kind").get<std::string>();
  return truth;
}

TruthComparison compare_with_truth(const TruthRobot& truth, const KinematicTree& learned) {
  Rng rng = Rng::from_name("unseen postures");
  const auto joints = static_cast<Eigen::Index>(truth.tree.joints.size());
  const auto tags = static_cast<Eigen::Index>(truth.tree.markers.size());
  Eigen::Matrix3Xd expected(3, kPostures * tags);
  Eigen::Matrix3Xd found(3, kPostures * tags);
  for (int i = 0; i < kPostures; ++i) {
    Eigen::VectorXd q(joints);
    for (Eigen::Index j = 0; j < joints; ++j) {
      const JointLimits& range = truth.range[static_cast<std::size_t>(j)];
      q[j] = rng.uniform(range.lower, range.upper);
    }
    expected.middleCols(i * tags, tags) = centres(truth.tree, truth.tree.markers, q);
    found.middleCols(i * tags, tags) =
        centres(learned, truth.tree.markers, values_for(learned, truth, q));
  }
  const Pose T_truth_learned = pose_from_matrix(Eigen::umeyama(found, expected, false));
  TruthComparison out;
  double sum = 0.0;
  for (Eigen::Index c = 0; c < found.cols(); ++c) {
    sum += (T_truth_learned * Eigen::Vector3d(found.col(c)) - expected.col(c)).squaredNorm();
  }
  out.marker_rms_m = std::sqrt(sum / static_cast<double>(found.cols()));
  const Eigen::Matrix4d similar = Eigen::umeyama(found, expected, true);
  out.scale = 1.0 / similar.topLeftCorner<3, 3>().colwise().norm().mean() - 1.0;

  Eigen::VectorXd middle(joints);
  for (Eigen::Index j = 0; j < joints; ++j) {
    const JointLimits& range = truth.range[static_cast<std::size_t>(j)];
    middle[j] = 0.5 * (range.lower + range.upper);
  }
  const Eigen::VectorXd middle_learned = values_for(learned, truth, middle);
  std::vector<double> directions;
  std::vector<double> positions;
  for (std::size_t j = 0; j < truth.tree.joints.size(); ++j) {
    const Joint& joint = truth.tree.joints[j];
    const Line a = axis_line(truth.tree, JointId{static_cast<int>(j)}, middle);
    Line b = axis_line(learned, *learned.joint(joint.name), middle_learned);
    b.point = T_truth_learned * b.point;
    b.direction = T_truth_learned.rotation * b.direction;
    AxisError error{joint.name, joint.type, 0.0, 0.0};
    error.direction_rad =
        std::atan2(a.direction.cross(b.direction).norm(), a.direction.dot(b.direction));
    directions.push_back(error.direction_rad);
    if (joint.type == JointType::kRevolute) {
      // The point of the true axis nearest to a marker of the child.
      Eigen::Vector3d near = a.point;
      const auto links = forward_kinematics(truth.tree, middle);
      for (const Marker& marker : truth.tree.markers) {
        if (marker.link != joint.child) continue;
        const Eigen::Vector3d centre =
            links[marker.link.index()] * marker.T_link_marker.translation;
        near = a.point + a.direction * a.direction.dot(centre - a.point);
      }
      error.position_m = distance_to(b, near);
      positions.push_back(error.position_m);
    }
    out.axes.push_back(error);
  }
  out.median_direction_rad = median(directions);
  out.worst_direction_rad = *std::ranges::max_element(directions);
  out.median_position_m = median(positions);
  out.worst_position_m = positions.empty() ? 0.0 : *std::ranges::max_element(positions);
  return out;
}

std::string structure_difference(const TruthRobot& truth, const KinematicTree& learned) {
  std::string difference;
  const auto complain = [&](const std::string& text) {
    difference += (difference.empty() ? "" : "; ") + text;
  };
  int movable = 0;
  for (const Joint& joint : learned.joints) movable += joint.type != JointType::kFixed ? 1 : 0;
  if (movable != static_cast<int>(truth.tree.joints.size())) {
    complain(fmt::format("{} joints instead of {}", movable, truth.tree.joints.size()));
  }
  // A link is known by its tags: two robots agree when the joint before each tag's link is the
  // same.
  for (const Joint& joint : truth.tree.joints) {
    const auto id = learned.joint(joint.name);
    if (!id) {
      complain("no joint driven by " + joint.name);
      continue;
    }
    if (learned.joints[id->index()].type != joint.type) {
      complain(fmt::format("{} is {}", joint.name, to_string(learned.joints[id->index()].type)));
    }
  }
  for (const Marker& marker : truth.tree.markers) {
    const Marker* found = learned.marker(marker.id);
    if (found == nullptr) {
      complain(fmt::format("tag {} is on no link", marker.id.value));
      continue;
    }
    std::vector<std::string> expected;
    std::vector<std::string> path;
    for (const JointId id : truth.tree.path_to(marker.link)) {
      expected.push_back(truth.tree.joints[id.index()].name);
    }
    for (const JointId id : learned.path_to(found->link)) {
      if (learned.joints[id.index()].type != JointType::kFixed) {
        path.push_back(learned.joints[id.index()].name);
      }
    }
    if (path != expected) complain(fmt::format("tag {} is behind other joints", marker.id.value));
  }
  return difference;
}

}  // namespace kinescope::acceptance
