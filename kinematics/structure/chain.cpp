// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/chain.h"

#include "kinematics/structure/chain_kinematics.h"

namespace kinescope::structure_search {

double chain_coordinate(const ChainJoint& joint, const Eigen::MatrixXd& readings, int instant) {
  double value = 0.0;
  for (const ChainTerm& term : joint.terms) value += term.scale * readings(instant, term.channel);
  return value;
}

Pose chain_pose_at(const ChainModel& model, const std::vector<double>& coordinates) {
  return ChainKinematics(model).pose(coordinates.data());
}

Pose chain_pose(const ChainModel& model, const Eigen::MatrixXd& readings, int instant) {
  std::vector<double> coordinates;
  coordinates.reserve(model.joints.size());
  for (const ChainJoint& joint : model.joints) {
    coordinates.push_back(chain_coordinate(joint, readings, instant));
  }
  return chain_pose_at(model, coordinates);
}

Vector6d axis_in_child(const ChainModel& model) { return ChainKinematics(model).last_axis(); }

}  // namespace kinescope::structure_search
