// SPDX-License-Identifier: Apache-2.0
#include "app/torque/model_of_robot.h"

#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "dynamics/rigid/rigid_model.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> joint_names(const RigidModel& rigid) {
  std::vector<std::string> out;
  for (const RigidBody& body : rigid.bodies) out.push_back(body.joint);
  return out;
}

/// Links and joints as another URDF places them; files of robots are rounded to six digits.
bool same_geometry(const RigidBody& a, const RigidBody& b) {
  constexpr double kRounding = 1e-5;  // m, and of directions
  return (a.p_parent_joint - b.p_parent_joint).norm() <= kRounding &&
         (a.R_parent_joint - b.R_parent_joint).norm() <= kRounding &&
         (a.axis - b.axis).norm() <= kRounding;
}

}  // namespace

void require_model_of(const fs::path& path, const SavedTorqueModel& model,
                      const DynamicModel& robot, const fs::path& urdf) {
  const RigidModel own = make_rigid_model(robot);
  const std::vector<std::string> model_joints = joint_names(model.rigid);
  const std::vector<std::string> joints = joint_names(own);
  if (model_joints != joints) {
    throw bad_input(
        path.string(),
        fmt::format("the model has the joints {}, {} has {}", fmt::join(model_joints, ", "),
                    urdf.filename().string(), fmt::join(joints, ", ")),
        "give the URDF that the model was learned with");
  }
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (model.rigid.bodies[j].type == own.bodies[j].type &&
        model.rigid.bodies[j].parent == own.bodies[j].parent &&
        same_geometry(model.rigid.bodies[j], own.bodies[j])) {
      continue;
    }
    throw bad_input(path.string(),
                    fmt::format("joint '{}' is another one, or elsewhere, in {}", joints[j],
                                urdf.filename().string()),
                    "give the URDF that the model was learned with");
  }
  if (model.robot == robot.tree.name) return;
  throw bad_input(path.string(),
                  fmt::format("the model is of robot '{}', {} of '{}'", model.robot,
                              urdf.filename().string(), robot.tree.name),
                  "give the URDF that the model was learned with");
}

}  // namespace kinescope
