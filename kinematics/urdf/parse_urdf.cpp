// SPDX-License-Identifier: Apache-2.0
#include <charconv>
#include <cmath>
#include <mutex>

#include <console_bridge/console.h>
#include <fmt/format.h>
#include <urdf_parser/urdf_parser.h>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/urdf/urdf.h"
#include "kinematics/urdf/urdf_document.h"

namespace kinescope {
namespace {

/// Keeps what urdfdom would print, as long as it lives. console_bridge has one handler for the
/// whole process, hence the lock.
class MessageCatcher : public console_bridge::OutputHandler {
 public:
  MessageCatcher() : lock_(mutex()) { console_bridge::useOutputHandler(this); }
  ~MessageCatcher() override { console_bridge::restorePreviousOutputHandler(); }
  MessageCatcher(const MessageCatcher&) = delete;
  MessageCatcher& operator=(const MessageCatcher&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char* /*file*/,
           int /*line*/) override {
    if (level < console_bridge::CONSOLE_BRIDGE_LOG_WARN) return;
    if (!messages_.empty()) messages_ += "; ";
    messages_ += text;
  }
  [[nodiscard]] const std::string& messages() const { return messages_; }

 private:
  static std::mutex& mutex() {
    static std::mutex instance;
    return instance;
  }
  std::lock_guard<std::mutex> lock_;
  std::string messages_;
};

urdf::ModelInterfaceSharedPtr parse_model(const std::string& text, const std::string& source) {
  const MessageCatcher catcher;
  urdf::ModelInterfaceSharedPtr model;
  std::string reason;
  try {
    model = urdf::parseURDF(text);
  } catch (const std::exception& error) {
    reason = error.what();
  }
  if (model) return model;
  if (!catcher.messages().empty()) reason = catcher.messages();
  throw bad_input(source, "urdfdom refuses it: " + (reason.empty() ? "no reason given" : reason),
                  "correct the file; check_urdf shows the same");
}

Pose to_pose(const urdf::Pose& pose) {
  const Eigen::Quaterniond q(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z);
  return {q.normalized(), {pose.position.x, pose.position.y, pose.position.z}};
}

JointType to_type(int type) {
  switch (type) {
    case urdf::Joint::REVOLUTE:
    case urdf::Joint::CONTINUOUS:
      return JointType::kRevolute;
    case urdf::Joint::PRISMATIC:
      return JointType::kPrismatic;
    default:
      return JointType::kFixed;
  }
}

/// The number in "tag_<id>".
std::optional<TagId> marker_id(std::string_view link_name) {
  constexpr std::string_view kPrefix = "tag_";
  if (!link_name.starts_with(kPrefix)) return std::nullopt;
  const std::string_view digits = link_name.substr(kPrefix.size());
  TagId id;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), id.value);
  const bool number = error == std::errc{} && end == digits.data() + digits.size();
  if (!number || fmt::format("tag_{}", id.value) != link_name || id.value < 0) return std::nullopt;
  return id;
}

/// Edge of the marker's plate: the first box that is drawn; 0 when there is none.
double marker_size(const urdf::Link& link) {
  for (const auto& visual : link.visual_array) {
    const auto* box = dynamic_cast<const urdf::Box*>(visual->geometry.get());
    if (box != nullptr) return box->dim.x;
  }
  return 0.0;
}

bool is_marker(const urdf::Link& link, const urdf::Joint& joint) {
  return joint.type == urdf::Joint::FIXED && link.child_joints.empty() && marker_id(link.name);
}

Joint to_joint(const urdf::Joint& from, LinkId parent, LinkId child) {
  Joint joint;
  joint.name = from.name;
  joint.type = to_type(from.type);
  joint.parent = parent;
  joint.child = child;
  joint.T_parent_joint = to_pose(from.parent_to_joint_origin_transform);
  if (is_movable(joint)) {
    joint.axis = Eigen::Vector3d(from.axis.x, from.axis.y, from.axis.z).normalized();
  }
  // Limits without width are none: a joint that cannot move would be a fixed one.
  if (from.limits && from.type != urdf::Joint::CONTINUOUS &&
      from.limits->lower < from.limits->upper) {
    joint.limits = JointLimits{from.limits->lower, from.limits->upper};
  }
  const bool known = from.limits && (from.limits->effort != urdf_document::kAnyEffort ||
                                     from.limits->velocity != urdf_document::kAnyVelocity);
  if (is_movable(joint) && known) {
    joint.effort = from.limits->effort;
    joint.velocity = from.limits->velocity;
  }
  if (is_movable(joint) && from.mimic) {
    joint.channel = from.mimic->joint_name;
    joint.scale = from.mimic->multiplier;
    joint.offset = from.mimic->offset;
  }
  return joint;
}

}  // namespace

KinematicTree parse_urdf(std::string_view text, const std::string& source) {
  const urdf_document::KinematicPart part = urdf_document::kinematic_part(text, source);
  const urdf::ModelInterfaceSharedPtr model = parse_model(part.text, source);
  KinematicTree tree;
  tree.name = model->getName();
  tree.links.push_back({part.root});
  for (const std::string& name : part.joint_order) {
    const urdf::JointConstSharedPtr from = model->getJoint(name);
    KINESCOPE_CHECK(from != nullptr, "urdfdom knows every joint of the file");
    const urdf::LinkConstSharedPtr child = model->getLink(from->child_link_name);
    const LinkId parent = *tree.link(from->parent_link_name);
    if (is_marker(*child, *from)) {
      tree.markers.push_back({.id = *marker_id(child->name),
                              .link = parent,
                              .T_link_marker = to_pose(from->parent_to_joint_origin_transform),
                              .size_m = marker_size(*child)});
      continue;
    }
    tree.joints.push_back(to_joint(*from, parent, LinkId{static_cast<int>(tree.links.size())}));
    tree.links.push_back({child->name});
  }
  check_tree(tree);
  return tree;
}

KinematicTree read_urdf(const std::filesystem::path& path) {
  return parse_urdf(read_text_file(path), path.string());
}

}  // namespace kinescope
