// SPDX-License-Identifier: Apache-2.0
//
// Takes   URDF text, or a DynamicModel.
// Gives   the DynamicModel with <inertial> and <dynamics damping friction>, or the text.
// Frames  as in urdf.h; a marker's inertia is added to the link that carries it.
// Not here: <mimic> (refused: its joint has no torque of its own), transmissions, gravity.
#pragma once

#include "kinematics/model/dynamic_model.h"
#include "kinematics/urdf/urdf.h"

namespace kinescope {

/// As parse_urdf(), with inertias. A link without <inertial> weighs nothing. Inertias that no body
/// can have are read as they are (is_consistent() tells). The motor inertia is read from the
/// attribute `armature` of <dynamics>, which write_urdf() writes and others pass over. Throws
/// bad_input with file, line and remedy: numbers that are none, negative masses, damping or
/// friction, mimic joints.
[[nodiscard]] DynamicModel parse_dynamic_urdf(std::string_view text, const std::string& source);
[[nodiscard]] DynamicModel read_dynamic_urdf(const std::filesystem::path& path);

/// As write_urdf(tree), with inertias about the centres of mass and joint damping and friction;
/// both read back to 1e-12. Links of no mass get no <inertial>. Throws bad_request for a link that
/// has moments but no positive mass, which URDF cannot say.
[[nodiscard]] std::string write_urdf(const DynamicModel& model,
                                     LimitSource limits = LimitSource::kRobotFile);

}  // namespace kinescope
