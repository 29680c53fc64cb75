// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/unknown_axes.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

Calibration with_joints(const std::vector<std::string>& names) {
  Calibration out;
  for (const std::string& name : names) {
    Joint joint;
    joint.name = name;
    joint.type = JointType::kRevolute;
    out.tree.joints.push_back(joint);
    out.joints.emplace_back();
    Parameter turn;
    turn.name = name + " turn x";
    turn.block = name;
    out.parameters.push_back(turn);
  }
  return out;
}

TEST(UnknownAxes, AreThoseOfARobotOfWhichNoneIsKnown) {
  Calibration calibration = with_joints({"q1", "q2"});
  EXPECT_EQ(unknown_axes(calibration), (std::vector<std::string>{"q1", "q2"}));
  calibration.joints[1].direction_sigma_rad = 1e-4;
  EXPECT_TRUE(unknown_axes(calibration).empty());
}

TEST(UnknownAxes, AreNoneWhereTheGeometryIsHeld) {
  Calibration calibration = with_joints({"q1"});
  calibration.parameters.clear();
  EXPECT_FALSE(is_axis_estimated(calibration, calibration.tree.joints.front()));
  EXPECT_TRUE(unknown_axes(calibration).empty());
}

}  // namespace
}  // namespace kinescope
