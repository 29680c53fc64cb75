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

Eigen::VectorXd central_rate(const std::vector<double>& times_s, const Eigen::VectorXd& values) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(values.size());
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const Eigen::Index before = std::max<Eigen::Index>(0, i - 1);
    const Eigen::Index after = std::min(values.size() - 1, i + 1);
    const double step =
        times_s[static_cast<std::size_t>(after)] - times_s[static_cast<std::size_t>(before)];
    if (step > 0.0) out[i] = (values[after] - values[before]) / step;
  }
  return out;
}

}  // namespace

Eigen::VectorXd joint_values(const JointLog& log, const Joint& joint, int channel) {
  Eigen::ArrayXd reading = log.values.col(channel).array();
  for (const ChannelShare& share : joint.couplings) {
    if (const auto other = log.channel(share.channel))
      reading += share.ratio * log.values.col(*other).array();
  }
  return (joint.scale * reading + joint.offset).matrix();
}

JointMotion motion_of(const JointLog& log, const KinematicTree& tree) {
  const auto rows = static_cast<Eigen::Index>(log.size());
  const auto joints = static_cast<Eigen::Index>(tree.joints.size());
  JointMotion out{log.times_s, Eigen::MatrixXd::Zero(rows, joints),
                  Eigen::MatrixXd::Zero(rows, joints)};
  for (Eigen::Index j = 0; j < joints; ++j) {
    const Joint& joint = tree.joints[static_cast<std::size_t>(j)];
    const auto channel = log.channel(joint.channel);
    if (!channel) continue;
    out.value.col(j) = joint_values(log, joint, *channel);
    for (const std::string& column : joint.copies) {
      if (const auto copy = log.channel(column))
        out.copies[static_cast<int>(j)].push_back(joint_values(log, joint, *copy));
    }
    out.rate.col(j) = central_rate(log.times_s, out.value.col(j));
  }
  return out;
}

Eigen::VectorXd play_state(const Eigen::VectorXd& drive, double width) {
  // Nothing is known of the past: the gap starts on the side that the first motion pushes to.
  double start = 0.0;
  for (Eigen::Index i = 1; i < drive.size(); ++i) {
    if (drive[i] != drive[0]) {
      start = drive[i] > drive[0] ? -0.5 * width : 0.5 * width;
      break;
    }
  }
  return play_from(drive, width, start).state;
}

StartedPlay play_from(const Eigen::VectorXd& drive, double width, double start) {
  // A reading that trembles at rest pushes by less. Chosen, not measured.
  constexpr double kPushed = 0.01;  // of the width
  StartedPlay out{Eigen::VectorXd(drive.size()), Eigen::VectorXd(drive.size())};
  if (drive.size() == 0) return out;
  const double half = 0.5 * width;
  const double begin = drive[0] + start;
  double link = begin;
  bool unmoved = true;
  for (Eigen::Index i = 0; i < drive.size(); ++i) {
    link = std::clamp(link, drive[i] - half, drive[i] + half);
    unmoved = unmoved && std::abs(link - begin) <= kPushed * width;
    out.state[i] = (link - drive[i]) / width;
    out.unmoved[i] = unmoved ? 1.0 : 0.0;
  }
  return out;
}

Eigen::VectorXd share_of_start(const Eigen::VectorXd& drive, double width) {
  Eigen::VectorXd out(drive.size());
  double furthest = 0.0;
  for (Eigen::Index i = 0; i < drive.size(); ++i) {
    furthest = std::max(furthest, std::abs(drive[i] - drive[0]));
    out[i] = std::max(0.0, 1.0 - furthest / (0.5 * width));
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

std::vector<double> read_times(const JointMotion& motion, int joint) {
  if (motion.read_s.size() == 0) return motion.times_s;
  const auto when = motion.read_s.col(joint);
  return {when.begin(), when.end()};
}

namespace {

// Gravity's torque about (force along) a joint's axis for 1 kg at a point, per unit of gravity
// along each axis of the base frame: axis . (arm x g) = g . (axis x arm).
Eigen::RowVector3d load_of(const Joint& joint, const Eigen::Vector3d& axis_base,
                           const Eigen::Vector3d& arm_base) {
  if (joint.type == JointType::kPrismatic) return axis_base.transpose();
  return axis_base.cross(arm_base).transpose();
}

// A mass in one place of a link: at its origin, or (a first moment) along a direction.
struct Place {
  std::size_t link = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  // in the link; zero: its origin
  std::string what;
};

// Of the joint's own link and of every one behind it that turns, two directions across its own
// joint's axis; of one that slides its origin. More would be combinations of these (Khalil and
// Dombre 2002, section 9.4.2): the origin of a link that turns rests on the link before it.
std::vector<Place> places_of(const KinematicTree& tree, int joint,
                             const std::vector<std::size_t>& behind) {
  std::vector<Place> out;
  for (const std::size_t link : behind) {
    const JointId own = *tree.parent_joint(LinkId{static_cast<int>(link)});
    const Joint& carrier = tree.joints[own.index()];
    const std::string name = tree.links[link].name;
    const bool turns = carrier.type == JointType::kRevolute;
    if (!turns) {
      if (own.value != joint)
        out.push_back({link, Eigen::Vector3d::Zero(), "the origin of " + name});
      continue;
    }
    const Eigen::Quaterniond R = rotation_to_axis(carrier.axis);
    out.push_back({link, R * Eigen::Vector3d::UnitX(), name + " along x"});
    out.push_back({link, R * Eigen::Vector3d::UnitY(), name + " along y"});
  }
  return out;
}

Eigen::MatrixXd loads_over(const KinematicTree& tree, const JointMotion& motion, int joint,
                           const std::vector<Place>& places, const Eigen::Vector3d& gravity_base) {
  const Joint& suspect = tree.joints[static_cast<std::size_t>(joint)];
  Eigen::MatrixXd out(motion.value.rows(), static_cast<Eigen::Index>(places.size()));
  for (Eigen::Index i = 0; i < out.rows(); ++i) {
    const std::vector<Pose> T_base_link = forward_kinematics(tree, motion.value.row(i).transpose());
    const Pose& T_base_child = T_base_link[suspect.child.index()];
    const Eigen::Vector3d axis = T_base_child.rotation * suspect.axis;
    for (std::size_t k = 0; k < places.size(); ++k) {
      const Place& place = places[k];
      const Eigen::Vector3d arm =
          place.direction.isZero(0.0)
              ? Eigen::Vector3d(T_base_link[place.link].translation - T_base_child.translation)
              : Eigen::Vector3d(T_base_link[place.link].rotation * place.direction);
      out(i, static_cast<Eigen::Index>(k)) = load_of(suspect, axis, arm).dot(gravity_base);
    }
  }
  return out;
}

}  // namespace

std::vector<Load> gravity_loads(const KinematicTree& tree, const JointMotion& motion, int joint,
                                const std::optional<Eigen::Vector3d>& gravity_base) {
  const std::vector<std::size_t> behind = links_behind(tree, joint);
  const Joint& suspect = tree.joints[static_cast<std::size_t>(joint)];
  std::vector<Load> out;
  // A slide is pulled at alike wherever the masses are.
  if (gravity_base && suspect.type == JointType::kRevolute) {
    const std::vector<Place> places = places_of(tree, joint, behind);
    const Eigen::MatrixXd loads = loads_over(tree, motion, joint, places, *gravity_base);
    for (std::size_t k = 0; k < places.size(); ++k) {
      out.push_back({places[k].what, loads.col(static_cast<Eigen::Index>(k))});
    }
    if (!out.empty()) return out;
  }
  // All masses in one: the mean of the links' middles.
  const std::vector<Eigen::Vector3d> middle = middles(tree);
  Eigen::MatrixXd all(motion.value.rows(), 3);
  for (Eigen::Index i = 0; i < all.rows(); ++i) {
    const std::vector<Pose> T_base_link = forward_kinematics(tree, motion.value.row(i).transpose());
    const Pose& T_base_child = T_base_link[suspect.child.index()];
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const std::size_t link : behind) {
      mean += T_base_link[link] * middle[link] / static_cast<double>(behind.size());
    }
    all.row(i) =
        load_of(suspect, T_base_child.rotation * suspect.axis, mean - T_base_child.translation);
  }
  if (gravity_base) return {{"what it carries", all * *gravity_base}};
  for (int k = 0; k < 3; ++k) {
    out.push_back({std::string("gravity along ") + "xyz"[k], all.col(k)});
  }
  return out;
}

}  // namespace kinescope::effects
