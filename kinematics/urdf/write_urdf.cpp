// SPDX-License-Identifier: Apache-2.0
//
// Elements stand in the order of urdfdom's own exporter (materials, links, joints), which itself is
// of no use here: it prints six digits, 0.5 um at 1 m.
#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <tinyxml2.h>

#include "kinematics/core/error.h"
#include "kinematics/core/median.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "kinematics/urdf/origin_text.h"
#include "kinematics/urdf/urdf.h"
#include "kinematics/urdf/urdf_document.h"
#include "kinematics/urdf/urdf_inertia.h"
#include "kinematics/urdf/xml_numbers.h"

namespace kinescope {
namespace {

using tinyxml2::XMLElement;
using urdf_document::add;
using urdf_document::kAnyEffort;
using urdf_document::kAnyVelocity;
using urdf_document::number_text;
using urdf_document::roll_pitch_yaw;

std::string first_comment(const KinematicTree& tree, LimitSource source) {
  const auto has_drive = [&](const Joint& joint) { return is_movable(joint) && joint.effort; };
  const bool all = std::ranges::all_of(
      tree.joints, [&](const Joint& joint) { return !is_movable(joint) || joint.effort; });
  std::string drive = fmt::format("effort {:g} with velocity {:g} stands where neither is known",
                                  kAnyEffort, kAnyVelocity);
  if (all && std::ranges::any_of(tree.joints, is_movable))
    drive = "effort and velocity are the robot's own";
  if (std::ranges::none_of(tree.joints, has_drive)) {
    drive = "effort and velocity were not measured and bind nowhere";
  }
  return fmt::format(
      " Written by Kinescope. SI units. A marker is a fixed link tag_ID: x right, y down, z into "
      "the tag. Lower and upper limits are {}; {}. Shapes are for the eye only. ",
      source == LimitSource::kRecording
          ? "the range that the recording shows"
          : "those of the robot's own file, wider where the recording went beyond",
      drive);
}

// The extension is MuJoCo's: without an inertia it refuses a moving body (also one with several
// drawn shapes, whose mass is zero), and by default it merges fixed links (the markers) into their
// parents and drops what is only drawn. No inertia is invented for others.
constexpr double kMujocoMassKg = 0.1;
constexpr double kMujocoInertiaKgM2 = 0.001;

struct Material {
  const char* name;
  const char* rgba;
};
constexpr Material kLinkColour{"link_grey", "0.62 0.66 0.70 1"};
constexpr Material kRevoluteColour{"revolute_orange", "0.90 0.45 0.10 1"};
constexpr Material kPrismaticColour{"prismatic_blue", "0.15 0.45 0.80 1"};
constexpr Material kTagBlack{"tag_black", "0.05 0.05 0.05 1"};
constexpr Material kTagWhite{"tag_white", "0.97 0.97 0.97 1"};

bool is_name_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
         c == '-' || c == '.' || c == '/';
}

/// What ROS, KDL and MuJoCo take as a name: letters, digits, _ - . and / (not in front).
std::string sanitised(std::string_view name, std::string_view fallback) {
  std::string out;
  for (const char c : name) {
    const bool continues_a_character = (static_cast<unsigned char>(c) & 0xC0U) == 0x80U;
    if (is_name_character(c)) {
      out += c;
    } else if (!continues_a_character) {
      out += '_';
    }
  }
  out.erase(0, out.find_first_not_of('/'));
  return out.empty() ? std::string(fallback) : out;
}

/// The name, or name_2, name_3, .. where it is taken.
std::string claim(const std::string& name, std::set<std::string>& taken) {
  std::string out = name;
  for (int i = 2; !taken.insert(out).second; ++i) out = fmt::format("{}_{}", name, i);
  return out;
}

std::string marker_name(const Marker& marker) { return fmt::format("tag_{}", marker.id.value); }

struct Names {
  std::string robot;
  std::vector<std::string> links;
  std::vector<std::string> joints;
};

/// Unique names for everything. Those of the markers are promised to others, so they come first.
Names make_names(const KinematicTree& tree) {
  Names names{.robot = sanitised(tree.name, "robot"), .links = {}, .joints = {}};
  std::set<std::string> links;
  std::set<std::string> joints;
  for (const Marker& marker : tree.markers) {
    KINESCOPE_CHECK(links.insert(marker_name(marker)).second, "a marker stands in the tree once");
    joints.insert(marker_name(marker) + "_joint");
  }
  for (const Link& link : tree.links)
    names.links.push_back(claim(sanitised(link.name, "link"), links));
  for (const Joint& joint : tree.joints) {
    names.joints.push_back(claim(sanitised(joint.name, "joint"), joints));
  }
  return names;
}

void add_origin(XMLElement& parent, const Pose& pose) {
  XMLElement& origin = add(parent, "origin");
  origin.SetAttribute("xyz", number_text(pose.translation).c_str());
  origin.SetAttribute("rpy", number_text(roll_pitch_yaw(pose.rotation)).c_str());
}

/// A <visual> at `pose` whose geometry the caller fills in.
XMLElement& add_visual(XMLElement& link, const Pose& pose, const Material& material) {
  XMLElement& visual = add(link, "visual");
  add_origin(visual, pose);
  XMLElement& geometry = add(visual, "geometry");
  add(visual, "material").SetAttribute("name", material.name);
  return geometry;
}

void add_box(XMLElement& link, const Pose& pose, const Eigen::Vector3d& size,
             const Material& material) {
  add(add_visual(link, pose, material), "box").SetAttribute("size", number_text(size).c_str());
}

void add_cylinder(XMLElement& link, const Pose& pose, double radius, double length,
                  const Material& material) {
  XMLElement& cylinder = add(add_visual(link, pose, material), "cylinder");
  cylinder.SetAttribute("radius", number_text(radius).c_str());
  cylinder.SetAttribute("length", number_text(length).c_str());
}

/// A rod between two points; nothing where they are one.
void add_rod(XMLElement& link, const Eigen::Vector3d& from, const Eigen::Vector3d& to,
             double radius) {
  const Eigen::Vector3d along = to - from;
  if (along.norm() < 0.5 * radius) return;
  add_cylinder(link, {rotation_to_axis(along), 0.5 * (from + to)}, radius, along.norm(),
               kLinkColour);
}

/// Thickness (m) that suits the robot: a share of the typical distance from joint to joint or
/// marker.
double rod_radius(const KinematicTree& tree) {
  constexpr double kSmallest = 0.002;
  constexpr double kLargest = 0.05;
  std::vector<double> lengths;
  for (const Joint& joint : tree.joints) lengths.push_back(joint.T_parent_joint.translation.norm());
  for (const Marker& marker : tree.markers)
    lengths.push_back(marker.T_link_marker.translation.norm());
  std::erase_if(lengths, [](double length) { return length < 1e-4; });
  if (lengths.empty()) return 0.01;
  return std::clamp(0.06 * median_of(std::move(lengths)), kSmallest, kLargest);
}

/// The body of the joint that moves the link, then rods from its origin to all that sits on the
/// link.
void add_link_visuals(XMLElement& link, const KinematicTree& tree, LinkId id, double radius) {
  if (const auto parent = tree.parent_joint(id)) {
    const Joint& joint = tree.joints[parent->index()];
    const Pose along{rotation_to_axis(joint.axis), Eigen::Vector3d::Zero()};
    if (joint.type == JointType::kRevolute) {
      add_cylinder(link, along, 1.8 * radius, 5.0 * radius, kRevoluteColour);
    } else if (joint.type == JointType::kPrismatic) {
      add_box(link, along, {3.0 * radius, 3.0 * radius, 6.0 * radius}, kPrismaticColour);
    }
  }
  for (const Joint& joint : tree.joints) {
    if (joint.parent != id) continue;
    add_rod(link, Eigen::Vector3d::Zero(), joint.T_parent_joint.translation, radius);
  }
  for (const Marker& marker : tree.markers) {
    if (marker.link != id) continue;
    add_rod(link, Eigen::Vector3d::Zero(), marker.T_link_marker.translation, 0.4 * radius);
  }
}

/// A tag is a black plate (its size is the tag's) on a wider white one behind it; a body that is no
/// tag, a ball.
void add_marker_link(XMLElement& robot, const Marker& marker, double radius) {
  XMLElement& link = add(robot, "link");
  link.SetAttribute("name", marker_name(marker).c_str());
  const double s = marker.size_m;
  if (s <= 0.0) {
    add(add_visual(link, {}, kTagBlack), "sphere")
        .SetAttribute("radius", number_text(1.5 * radius).c_str());
    return;
  }
  const double thickness = 0.02 * s;
  const auto at_depth = [](double z) {
    return Pose{Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.0, 0.0, z)};
  };
  add_box(link, at_depth(0.5 * thickness), {s, s, thickness}, kTagBlack);
  add_box(link, at_depth(1.5 * thickness), {1.25 * s, 1.25 * s, thickness}, kTagWhite);
}

const char* urdf_type(const Joint& joint) {
  switch (joint.type) {
    case JointType::kRevolute:
      return joint.limits ? "revolute" : "continuous";
    case JointType::kPrismatic:
      return "prismatic";
    case JointType::kFixed:
      break;
  }
  return "fixed";
}

XMLElement& add_joint(XMLElement& robot, const std::string& name, const char* type,
                      const Pose& origin, const std::string& parent, const std::string& child) {
  XMLElement& joint = add(robot, "joint");
  joint.SetAttribute("name", name.c_str());
  joint.SetAttribute("type", type);
  add_origin(joint, origin);
  add(joint, "parent").SetAttribute("link", parent.c_str());
  add(joint, "child").SetAttribute("link", child.c_str());
  return joint;
}

/// A prismatic joint without limits gets none (lower and upper are optional and then 0, which
/// MuJoCo and parse_urdf both take as none), a revolute one is continuous.
void add_axis_and_limit(XMLElement& element, const Joint& joint) {
  if (joint.type == JointType::kFixed) return;
  add(element, "axis").SetAttribute("xyz", number_text(joint.axis).c_str());
  XMLElement& limit = add(element, "limit");
  limit.SetAttribute("effort", number_text(joint.effort.value_or(kAnyEffort)).c_str());
  limit.SetAttribute("velocity", number_text(joint.velocity.value_or(kAnyVelocity)).c_str());
  if (!joint.limits) return;
  limit.SetAttribute("lower", number_text(joint.limits->lower).c_str());
  limit.SetAttribute("upper", number_text(joint.limits->upper).c_str());
}

/// Of joints that one channel drives all but the first follow that one.
void add_mimic(XMLElement& element, const KinematicTree& tree, std::size_t number,
               const Names& names) {
  const Joint& joint = tree.joints[number];
  if (joint.channel.empty() || joint.type == JointType::kFixed || !joint.couplings.empty()) return;
  const auto first = std::ranges::find_if(tree.joints, [&](const Joint& other) {
    return other.channel == joint.channel && is_movable(other) && other.couplings.empty() &&
           other.scale != 0.0;
  });
  const auto leader = static_cast<std::size_t>(first - tree.joints.begin());
  if (leader >= number) return;
  const double multiplier = joint.scale / first->scale;
  XMLElement& mimic = add(element, "mimic");
  mimic.SetAttribute("joint", names.joints[leader].c_str());
  mimic.SetAttribute("multiplier", number_text(multiplier).c_str());
  mimic.SetAttribute("offset", number_text(joint.offset - multiplier * first->offset).c_str());
}

void add_mujoco_extension(XMLElement& robot, bool bound) {
  XMLElement& compiler = add(add(robot, "mujoco"), "compiler");
  compiler.SetAttribute("boundmass", number_text(bound ? kMujocoMassKg : 0.0).c_str());
  compiler.SetAttribute("boundinertia", number_text(bound ? kMujocoInertiaKgM2 : 0.0).c_str());
  compiler.SetAttribute("inertiafromgeom", "false");
  compiler.SetAttribute("discardvisual", "false");
  compiler.SetAttribute("fusestatic", "false");
}

void check_numbers(const KinematicTree& tree) {
  const auto finite = [](const Pose& pose) {
    return pose.translation.allFinite() && pose.rotation.coeffs().allFinite();
  };
  for (const Joint& joint : tree.joints) {
    KINESCOPE_CHECK(finite(joint.T_parent_joint), "a joint's place is finite");
    KINESCOPE_CHECK(!joint.limits || joint.limits->lower <= joint.limits->upper,
                    "limits are in order");
  }
  for (const Marker& marker : tree.markers) {
    KINESCOPE_CHECK(finite(marker.T_link_marker), "a marker's place is finite");
  }
}

/// Every link that a movable joint carries has a mass.
bool all_moving_links_weigh(const DynamicModel& model) {
  return std::ranges::all_of(model.tree.joints, [&](const Joint& joint) {
    return joint.type == JointType::kFixed || model.links[joint.child.index()].mass_kg > 0.0;
  });
}

void add_materials(XMLElement& robot) {
  for (const Material& material :
       {kLinkColour, kRevoluteColour, kPrismaticColour, kTagBlack, kTagWhite}) {
    XMLElement& element = add(robot, "material");
    element.SetAttribute("name", material.name);
    add(element, "color").SetAttribute("rgba", material.rgba);
  }
}

void add_links(XMLElement& robot, const DynamicModel& model, const Names& names) {
  const KinematicTree& tree = model.tree;
  const double radius = rod_radius(tree);
  for (std::size_t i = 0; i < tree.links.size(); ++i) {
    XMLElement& link = add(robot, "link");
    link.SetAttribute("name", names.links[i].c_str());
    urdf_document::add_inertial(link, names.links[i], model.links[i]);
    add_link_visuals(link, tree, LinkId{static_cast<int>(i)}, radius);
  }
  for (const Marker& marker : tree.markers) add_marker_link(robot, marker, radius);
}

void add_joints(XMLElement& robot, const DynamicModel& model, const Names& names) {
  const KinematicTree& tree = model.tree;
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    XMLElement& element =
        add_joint(robot, names.joints[j], urdf_type(joint), joint.T_parent_joint,
                  names.links[joint.parent.index()], names.links[joint.child.index()]);
    add_axis_and_limit(element, joint);
    add_mimic(element, tree, j, names);
    urdf_document::add_joint_dynamics(element, model.joints[j]);
  }
  for (const Marker& marker : tree.markers) {
    add_joint(robot, marker_name(marker) + "_joint", "fixed", marker.T_link_marker,
              names.links[marker.link.index()], marker_name(marker));
  }
}

}  // namespace

std::string write_urdf(const DynamicModel& model, LimitSource limits) {
  check_model(model);
  check_numbers(model.tree);
  const Names names = make_names(model.tree);
  tinyxml2::XMLDocument document;
  document.InsertEndChild(document.NewDeclaration(R"(xml version="1.0" encoding="UTF-8")"));
  XMLElement& robot = *document.NewElement("robot");
  document.InsertEndChild(&robot);
  robot.SetAttribute("name", names.robot.c_str());
  robot.InsertNewComment(first_comment(model.tree, limits).c_str());
  add_mujoco_extension(robot, !all_moving_links_weigh(model));
  add_materials(robot);
  add_links(robot, model, names);
  add_joints(robot, model, names);
  tinyxml2::XMLPrinter printer;
  document.Print(&printer);
  return printer.CStr();
}

std::string write_urdf(const KinematicTree& tree, LimitSource limits) {
  return write_urdf(without_masses(tree), limits);
}

}  // namespace kinescope
