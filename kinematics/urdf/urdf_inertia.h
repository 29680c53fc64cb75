// SPDX-License-Identifier: Apache-2.0
//
// The elements of a URDF that hold masses and friction.
#pragma once

#include <string>

#include "kinematics/model/dynamic_model.h"

namespace tinyxml2 {
class XMLElement;
}

namespace kinescope::urdf_document {

/// Shortest text that reads back as the same double.
[[nodiscard]] std::string number_text(double value);
/// Three of them with spaces between.
[[nodiscard]] std::string number_text(const Eigen::Vector3d& v);

/// <inertial> about the centre of mass; nothing for a body without mass. Throws bad_request for
/// moments without a positive mass.
void add_inertial(tinyxml2::XMLElement& link, const std::string& name,
                  const InertialParameters& parameters);

/// <dynamics>; nothing where all are zero.
void add_joint_dynamics(tinyxml2::XMLElement& joint, const JointDynamics& dynamics);

}  // namespace kinescope::urdf_document
