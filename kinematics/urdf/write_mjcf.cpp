// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>
#include <tinyxml2.h>

#include "kinematics/core/error.h"
#include "kinematics/urdf/mjcf.h"
#include "kinematics/urdf/urdf_inertia.h"
#include "kinematics/urdf/xml_numbers.h"

namespace kinescope {
namespace {

using tinyxml2::XMLElement;
using urdf_document::add;
using urdf_document::number_text;

void set(XMLElement& element, const char* name, const std::string& value) {
  element.SetAttribute(name, value.c_str());
}

std::string quaternion_text(const Eigen::Quaterniond& rotation) {
  const Eigen::Quaterniond q = rotation.normalized();
  return fmt::format("{} {} {} {}", number_text(q.w()), number_text(q.x()), number_text(q.y()),
                     number_text(q.z()));
}

void set_pose(XMLElement& element, const Pose& pose) {
  set(element, "pos", number_text(pose.translation));
  set(element, "quat", quaternion_text(pose.rotation));
}

/// A link that moves, with all that is fixed to it, in its frame.
class Writer {
 public:
  Writer(const DynamicModel& model, const MjcfOptions& options)
      : model_(model), options_(options) {}

  void write(XMLElement& root) {
    set(root, "model", model_.tree.name);
    for (const std::string& note : options_.notes) {
      root.InsertNewComment(fmt::format(" {} ", comment_text(note)).c_str());
    }
    XMLElement& compiler = add(root, "compiler");
    set(compiler, "angle", "radian");
    set(compiler, "autolimits", "true");
    XMLElement& option = add(root, "option");
    set(option, "gravity", number_text(model_.gravity_m_s2));
    set(option, "timestep", number_text(options_.step_s));
    XMLElement& world = add(root, "worldbody");
    add_content(world, LinkId{0}, Pose{});
    add_motors(add(root, "actuator"));
  }

 private:
  /// XML has no place for "--" in a comment.
  static std::string comment_text(std::string text) {
    for (std::size_t at = 0; (at = text.find("--", at)) != std::string::npos;) text[at] = ' ';
    return text;
  }

  /// Sites for the link and what is fixed to it, bodies for what moves on it.
  void add_content(XMLElement& body, LinkId link, const Pose& T_body_link) {
    XMLElement& site = add(body, "site");
    set(site, "name", model_.tree.links[link.index()].name);
    set_pose(site, T_body_link);
    for (const CarriedBody& load : options_.carried) {
      if (load.link == model_.tree.links[link.index()].name) add_load(body, load, T_body_link);
    }
    for (const Joint& joint : model_.tree.joints) {
      if (joint.parent != link) continue;
      const Pose T_body_child = T_body_link * joint.T_parent_joint;
      if (joint.type == JointType::kFixed) {
        add_content(body, joint.child, T_body_child);
      } else {
        add_body(body, joint, T_body_child);
      }
    }
  }

  /// MuJoCo takes a point mass where nothing moves on its own, yet none as a full inertia.
  static void add_load(XMLElement& parent, const CarriedBody& load, const Pose& T_parent_link) {
    XMLElement& body = add(parent, "body");
    set(body, "name", load.name);
    set_pose(body, T_parent_link);
    constexpr double kBeyondRounding = 1e-9;  // of the largest eigenvalue of the pseudo-inertia
    if (is_consistent(load.inertia, -kBeyondRounding)) {
      add_central(body, to_central(load.inertia));
      return;
    }
    XMLElement& inertial = add(body, "inertial");
    set(inertial, "pos", number_text(to_central(load.inertia).centre_m));
    set(inertial, "mass", number_text(load.inertia.mass_kg));
    set(inertial, "diaginertia", "0 0 0");
  }

  void add_body(XMLElement& parent, const Joint& joint, const Pose& T_parent_body) {
    XMLElement& body = add(parent, "body");
    set(body, "name", model_.tree.links[joint.child.index()].name);
    set_pose(body, T_parent_body);
    add_inertial(body, joint.child);
    add_joint(body, joint);
    add_content(body, joint.child, Pose{});
  }

  [[nodiscard]] InertialParameters carried(LinkId link, const Pose& T_body_link) const {
    InertialParameters sum = in_frame(T_body_link, model_.links[link.index()]);
    for (const Joint& joint : model_.tree.joints) {
      if (joint.parent != link || is_movable(joint)) continue;
      sum += carried(joint.child, T_body_link * joint.T_parent_joint);
    }
    return sum;
  }

  void add_inertial(XMLElement& body, LinkId link) {
    const InertialParameters whole = carried(link, Pose{});
    const std::string& name = model_.tree.links[link.index()].name;
    if (!(whole.mass_kg > 0.0)) {
      throw bad_request("MJCF", fmt::format("link '{}' has no mass", name),
                        "give it one, or learn it with kinescope dynamics: MuJoCo needs a mass for "
                        "every body that moves");
    }
    if (!is_consistent(whole)) {
      throw bad_request("MJCF", fmt::format("no body has the inertia of link '{}'", name),
                        "export robot_dynamics.urdf, whose masses are consistent");
    }
    add_central(body, to_central(whole));
  }

  static void add_central(XMLElement& body, const CentralInertia& central) {
    const Eigen::Matrix3d& I = central.inertia_kgm2;
    XMLElement& inertial = add(body, "inertial");
    set(inertial, "pos", number_text(central.centre_m));
    set(inertial, "mass", number_text(central.mass_kg));
    set(inertial, "fullinertia",
        fmt::format("{} {} {} {} {} {}", number_text(I(0, 0)), number_text(I(1, 1)),
                    number_text(I(2, 2)), number_text(I(0, 1)), number_text(I(0, 2)),
                    number_text(I(1, 2))));
  }

  void add_joint(XMLElement& body, const Joint& joint) {
    XMLElement& element = add(body, "joint");
    set(element, "name", joint.name);
    set(element, "type", joint.type == JointType::kRevolute ? "hinge" : "slide");
    set(element, "axis", number_text(joint.axis));
    if (joint.limits) {
      set(element, "range",
          fmt::format("{} {}", number_text(joint.limits->lower), number_text(joint.limits->upper)));
    }
    const auto index = static_cast<std::size_t>(&joint - model_.tree.joints.data());
    const JointDynamics& drive = model_.joints[index];
    if (drive.viscous != 0.0) set(element, "damping", number_text(drive.viscous));
    if (drive.coulomb != 0.0) set(element, "frictionloss", number_text(drive.coulomb));
    if (drive.motor_inertia != 0.0) set(element, "armature", number_text(drive.motor_inertia));
    const auto spring = options_.springs.find(joint.name);
    if (spring == options_.springs.end()) return;
    set(element, "stiffness", number_text(spring->second.stiffness));
    set(element, "springref", number_text(spring->second.rest));
  }

  void add_motors(XMLElement& actuator) {
    for (const Joint& joint : model_.tree.joints) {
      if (joint.type == JointType::kFixed) continue;
      XMLElement& motor = add(actuator, "motor");
      set(motor, "name", joint.name);
      set(motor, "joint", joint.name);
      if (!joint.effort) continue;
      set(motor, "ctrlrange",
          fmt::format("{} {}", number_text(-*joint.effort), number_text(*joint.effort)));
    }
  }

  const DynamicModel& model_;
  const MjcfOptions& options_;
};

}  // namespace

std::string write_mjcf(const DynamicModel& model, const MjcfOptions& options) {
  check_model(model);
  tinyxml2::XMLDocument document;
  XMLElement& root = *document.NewElement("mujoco");
  document.InsertEndChild(&root);
  Writer(model, options).write(root);
  tinyxml2::XMLPrinter printer;
  document.Print(&printer);
  return printer.CStr();
}

}  // namespace kinescope
