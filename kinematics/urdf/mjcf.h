// SPDX-License-Identifier: Apache-2.0
//
// Takes   a DynamicModel.
// Gives   MJCF text, as MuJoCo reads it: bodies with inertias, hinges and slides with range,
//         damping, frictionloss, armature and springs, one motor a joint.
// Frames  a body's frame is its link's; links that fixed joints tie to a body become sites of it.
// Not here: geometry (nothing collides), what MuJoCo has no element for.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "kinematics/model/dynamic_model.h"

namespace kinescope {

/// A torque that pulls a joint back: stiffness (q - rest).
struct JointSpring {
  double stiffness = 0.0;  ///< N m/rad or N/m
  double rest = 0.0;       ///< rad or m
};

/// What a link carries: a body without a joint, welded to it.
struct CarriedBody {
  std::string name;
  std::string link;
  InertialParameters inertia;  ///< in the link's frame; where no body has it, a point mass instead
};

struct MjcfOptions {
  double step_s = 1e-3;                             ///< of MuJoCo's integrator
  std::map<std::string, JointSpring> springs = {};  ///< by joint
  std::vector<CarriedBody> carried = {};            ///< beside the links' own masses
  std::vector<std::string> notes = {};              ///< for the reader, as comments
};

/// Throws bad_request for a moving body that MuJoCo refuses: without a mass, or with moments of
/// inertia that no body has.
[[nodiscard]] std::string write_mjcf(const DynamicModel& model, const MjcfOptions& options = {});

}  // namespace kinescope
