// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/carrying_link.h"

#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr int kObservedFrames = 60;

Pose pose(double turn, const Eigen::Vector3d& at) {
  return {exp_rotation(Eigen::Vector3d(0.3, -0.2, 1.0).normalized() * turn), at};
}

// Two turns about axes that are not parallel, no markers.
Calibration robot() {
  Calibration out;
  out.tree.links = {{"base"}, {"upper"}, {"lower"}};
  for (int j = 0; j < 2; ++j) {
    Joint& joint = out.tree.joints.emplace_back();
    joint.type = JointType::kRevolute;
    joint.parent = LinkId{j};
    joint.child = LinkId{j + 1};
    joint.T_parent_joint = pose(0.9 * (j + 1), {0.3, 0.05 * j, 0.1});
  }
  out.T_camera_base = pose(-0.7, {0.1, 0.2, 1.5});
  out.joint_values.resize(kObservedFrames, 2);
  Rng rng = Rng::from_name("carrying link");
  for (int f = 0; f < kObservedFrames; ++f) {
    out.joint_values.row(f) << rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0);
    out.times_s.push_back(f);
  }
  return out;
}

class CarryingLink : public ::testing::TestWithParam<int> {};

// Places err by millimetres, and every third pose is of the other planar branch.
TEST_P(CarryingLink, IsTheOneInWhoseFrameTheMarkerStandsMostStill) {
  const Calibration of = robot();
  const Pose T_link_marker = pose(0.4, {0.08, -0.03, 0.02});
  PoseTrack track{TagId{7}, {}};
  Rng rng = Rng::from_name("bent marker");
  for (int f = 0; f < kObservedFrames; ++f) {
    const Pose link = of.T_camera_base * forward_kinematics(of.tree, of.joint_values.row(f))
                                             .at(static_cast<std::size_t>(GetParam()));
    PoseSample sample;
    sample.frame = f;
    sample.T_camera_marker = link * T_link_marker;
    sample.T_camera_marker.translation += rng.normal3(0.002);
    if (f % 3 == 0)
      sample.T_camera_marker.rotation =
          sample.T_camera_marker.rotation * exp_rotation({0.25 * std::numbers::pi, 0.0, 0.0});
    track.samples.push_back(sample);
  }
  const std::vector<Marker> found = on_carrying_links(of, track);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found.front().id, TagId{7});
  EXPECT_EQ(found.front().link, LinkId{GetParam()});
  const Pose error = found.front().T_link_marker.inverse() * T_link_marker;
  EXPECT_LT(error.translation.norm(), 0.002);
  EXPECT_LT(log_rotation(error.rotation).norm(), 1e-6);
}

INSTANTIATE_TEST_SUITE_P(EveryLink, CarryingLink, ::testing::Values(0, 1, 2));

TEST(CarryingLinks, FramesWithoutJointValuesSayNothing) {
  Calibration of = robot();
  of.joint_values.setConstant(std::numeric_limits<double>::quiet_NaN());
  PoseTrack track{TagId{7}, {}};
  track.samples.emplace_back();
  EXPECT_TRUE(on_carrying_links(of, track).empty());
}

}  // namespace
}  // namespace kinescope
