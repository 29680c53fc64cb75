// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <tinyxml2.h>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "kinematics/urdf/xml_numbers.h"

namespace kinescope {
namespace {

using tinyxml2::XMLElement;
using urdf_document::xml_numbers;
using urdf_document::xml_place;
using urdf_document::XmlOwner;

/// The child's attribute, which must be there.
double required_number(const XMLElement& parent, const char* child, const char* attribute,
                       const XmlOwner& owner) {
  const XMLElement* element = parent.FirstChildElement(child);
  const std::vector<double> value =
      element == nullptr ? std::vector<double>{} : xml_numbers(*element, attribute, 1, owner);
  if (value.empty()) {
    throw bad_input(
        xml_place(parent, owner.source),
        fmt::format("{}: <{}> has no <{} {}=\"..\">", owner.owner, parent.Name(), child, attribute),
        "add it, or leave the whole element out");
  }
  return value[0];
}

/// Fixed-axis angles: R = Rz(yaw) Ry(pitch) Rx(roll).
Pose read_origin(const XMLElement& parent, const XmlOwner& owner) {
  Pose pose;
  const XMLElement* origin = parent.FirstChildElement("origin");
  if (origin == nullptr) return pose;
  if (const auto xyz = xml_numbers(*origin, "xyz", 3, owner); !xyz.empty()) {
    pose.translation = {xyz[0], xyz[1], xyz[2]};
  }
  if (const auto rpy = xml_numbers(*origin, "rpy", 3, owner); !rpy.empty()) {
    pose.rotation = exp_rotation(Eigen::Vector3d::UnitZ() * rpy[2]) *
                    exp_rotation(Eigen::Vector3d::UnitY() * rpy[1]) *
                    exp_rotation(Eigen::Vector3d::UnitX() * rpy[0]);
  }
  return pose;
}

/// No body of a robot comes near 1e6 kg, kg m^2, m or N m: beyond it is a slip of the pen (1e300),
/// or grams and millimetres, and covariances made of it are no longer positive definite.
void check_size(const XMLElement& element, const char* what, double value, const XmlOwner& owner) {
  constexpr double kLargest = 1e6;
  if (std::abs(value) <= kLargest) return;
  throw bad_input(xml_place(element, owner.source),
                  fmt::format("{}: {} is {:g}, more than {:g}", owner.owner, what, value, kLargest),
                  "URDF is in kg, m and s: correct it");
}

InertialParameters read_inertial(const XMLElement& inertial, const XmlOwner& owner) {
  CentralInertia central{.mass_kg = required_number(inertial, "mass", "value", owner)};
  if (central.mass_kg < 0.0) {
    throw bad_input(xml_place(inertial, owner.source),
                    fmt::format("{}: the mass is {} kg", owner.owner, central.mass_kg),
                    "a mass is not negative");
  }
  check_size(inertial, "the mass", central.mass_kg, owner);
  const auto moment = [&](const char* name) {
    const double value = required_number(inertial, "inertia", name, owner);
    check_size(inertial, name, value, owner);
    return value;
  };
  const double xx = moment("ixx");
  const double yy = moment("iyy");
  const double zz = moment("izz");
  const double xy = moment("ixy");
  const double xz = moment("ixz");
  const double yz = moment("iyz");
  central.inertia_kgm2 << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  // Rounding may leave a rod's own axis slightly below nothing.
  constexpr double kRounding = 1e-3;
  const Eigen::Vector3d principal =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(central.inertia_kgm2, Eigen::EigenvaluesOnly)
          .eigenvalues();
  if (principal[0] < -kRounding * principal.cwiseAbs().maxCoeff()) {
    throw bad_input(xml_place(inertial, owner.source),
                    fmt::format("{}: a principal moment of inertia is {:.3g} kg m^2", owner.owner,
                                principal[0]),
                    "a moment of inertia is not negative");
  }
  const Pose origin = read_origin(inertial, owner);
  check_size(inertial, "a coordinate of the centre of mass",
             origin.translation.lpNorm<Eigen::Infinity>(), owner);
  return in_frame(origin, from_central(central));
}

/// Adds the link's inertia to the link of the tree that it is, or that carries it as a marker.
void add_inertial(DynamicModel& model, const std::string& link, const InertialParameters& inertia) {
  if (const auto id = model.tree.link(link)) {
    model.links[id->index()] += inertia;
    return;
  }
  for (const Marker& marker : model.tree.markers) {
    if (fmt::format("tag_{}", marker.id.value) != link) continue;
    model.links[marker.link.index()] += in_frame(marker.T_link_marker, inertia);
  }
}

double not_negative(const XMLElement& dynamics, const char* attribute, const XmlOwner& owner) {
  const std::vector<double> value = xml_numbers(dynamics, attribute, 1, owner);
  if (value.empty()) return 0.0;
  if (value[0] < 0.0) {
    throw bad_input(xml_place(dynamics, owner.source),
                    fmt::format("{}: {} is {}", owner.owner, attribute, value[0]),
                    "it takes energy out: use a value of 0 or more");
  }
  check_size(dynamics, attribute, value[0], owner);
  return value[0];
}

void read_joint(DynamicModel& model, const XMLElement& element, const std::string& source) {
  const std::string name = element.Attribute("name");
  const auto id = model.tree.joint(name);
  if (!id || model.tree.joints[id->index()].type == JointType::kFixed) return;
  const XmlOwner owner{.source = source, .owner = fmt::format("joint '{}'", name)};
  if (const XMLElement* mimic = element.FirstChildElement("mimic")) {
    throw bad_input(
        xml_place(*mimic, source),
        fmt::format("{} follows another joint (mimic), so it has no torque of its own",
                    owner.owner),
        "make it a fixed joint, or take the mimic element away if it has its own drive");
  }
  const XMLElement* dynamics = element.FirstChildElement("dynamics");
  if (dynamics == nullptr) return;
  model.joints[id->index()] = {.viscous = not_negative(*dynamics, "damping", owner),
                               .coulomb = not_negative(*dynamics, "friction", owner),
                               .motor_inertia = not_negative(*dynamics, "armature", owner)};
}

}  // namespace

DynamicModel parse_dynamic_urdf(std::string_view text, const std::string& source) {
  DynamicModel model = without_masses(parse_urdf(text, source));
  tinyxml2::XMLDocument document;
  const bool parsed = document.Parse(text.data(), text.size()) == tinyxml2::XML_SUCCESS;
  KINESCOPE_CHECK(parsed, "parse_urdf has checked the text");
  const XMLElement& robot = *document.FirstChildElement("robot");
  for (const auto* link = robot.FirstChildElement("link"); link != nullptr;
       link = link->NextSiblingElement("link")) {
    const XMLElement* inertial = link->FirstChildElement("inertial");
    if (inertial == nullptr) continue;
    const std::string name = link->Attribute("name");
    add_inertial(model, name, read_inertial(*inertial, {source, fmt::format("link '{}'", name)}));
  }
  for (const auto* joint = robot.FirstChildElement("joint"); joint != nullptr;
       joint = joint->NextSiblingElement("joint")) {
    read_joint(model, *joint, source);
  }
  check_model(model);
  return model;
}

DynamicModel read_dynamic_urdf(const std::filesystem::path& path) {
  return parse_dynamic_urdf(read_text_file(path), path.string());
}

}  // namespace kinescope
