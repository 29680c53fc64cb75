// SPDX-License-Identifier: Apache-2.0
#include "kinematics/urdf/urdf_inertia.h"

#include <fmt/format.h>
#include <tinyxml2.h>

#include "kinematics/core/error.h"

namespace kinescope::urdf_document {

std::string number_text(double value) { return fmt::format("{}", value == 0.0 ? 0.0 : value); }

std::string number_text(const Eigen::Vector3d& v) {
  return fmt::format("{} {} {}", number_text(v.x()), number_text(v.y()), number_text(v.z()));
}

void add_inertial(tinyxml2::XMLElement& link, const std::string& name,
                  const InertialParameters& parameters) {
  if (parameters.vector().isZero(0.0)) return;
  if (!(parameters.mass_kg > 0.0)) {
    throw bad_request(
        fmt::format("link '{}'", name),
        fmt::format("has moments but a mass of {} kg, which URDF cannot say", parameters.mass_kg),
        "write the physically consistent parameters");
  }
  const CentralInertia central = to_central(parameters);
  tinyxml2::XMLElement& inertial = *link.InsertNewChildElement("inertial");
  tinyxml2::XMLElement& origin = *inertial.InsertNewChildElement("origin");
  origin.SetAttribute("xyz", number_text(central.centre_m).c_str());
  origin.SetAttribute("rpy", "0 0 0");
  inertial.InsertNewChildElement("mass")->SetAttribute("value",
                                                       number_text(central.mass_kg).c_str());
  tinyxml2::XMLElement& inertia = *inertial.InsertNewChildElement("inertia");
  const Eigen::Matrix3d& I = central.inertia_kgm2;
  inertia.SetAttribute("ixx", number_text(I(0, 0)).c_str());
  inertia.SetAttribute("ixy", number_text(I(0, 1)).c_str());
  inertia.SetAttribute("ixz", number_text(I(0, 2)).c_str());
  inertia.SetAttribute("iyy", number_text(I(1, 1)).c_str());
  inertia.SetAttribute("iyz", number_text(I(1, 2)).c_str());
  inertia.SetAttribute("izz", number_text(I(2, 2)).c_str());
}

void add_joint_dynamics(tinyxml2::XMLElement& joint, const JointDynamics& dynamics) {
  if (dynamics == JointDynamics{}) return;
  tinyxml2::XMLElement& element = *joint.InsertNewChildElement("dynamics");
  element.SetAttribute("damping", number_text(dynamics.viscous).c_str());
  element.SetAttribute("friction", number_text(dynamics.coulomb).c_str());
  if (dynamics.motor_inertia != 0.0) {
    element.SetAttribute("armature", number_text(dynamics.motor_inertia).c_str());
  }
}

}  // namespace kinescope::urdf_document
