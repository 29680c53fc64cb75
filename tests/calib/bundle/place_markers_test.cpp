// SPDX-License-Identifier: Apache-2.0
//
// The start against a nominal robot whose axes leave something free: parallel turns, slides alone.
#include "calib/bundle/place_markers.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"
#include "tests/calib/bundle/random_pose.h"

namespace kinescope {
namespace {

constexpr int kPostures = 60;
constexpr double kMarkerSigmaRad = 2e-4;
constexpr double kMarkerSigmaM = 1e-4;

struct Robot {
  KinematicTree tree;
  Eigen::MatrixXd values;  // postures x joints
  Pose T_camera_base;
  PoseTracks tracks;
};

Joint joint_on(int parent, int child, JointType type, const Eigen::Vector3d& axis,
               const Eigen::Vector3d& place) {
  Joint joint;
  joint.name = fmt::format("j{}", child);
  joint.type = type;
  joint.parent = LinkId{parent};
  joint.child = LinkId{child};
  joint.axis = axis;
  joint.T_parent_joint.translation = place;
  return joint;
}

// One joint a letter: R turns about z, X, Y and Z slide along that axis.
KinematicTree chain(std::string_view letters) {
  KinematicTree tree;
  tree.links.push_back({"base"});
  for (const char letter : letters) {
    const int parent = static_cast<int>(tree.links.size()) - 1;
    const Eigen::Vector3d axis = letter == 'X'   ? Eigen::Vector3d::UnitX()
                                 : letter == 'Y' ? Eigen::Vector3d::UnitY()
                                                 : Eigen::Vector3d::UnitZ();
    tree.joints.push_back(joint_on(parent, parent + 1,
                                   letter == 'R' ? JointType::kRevolute : JointType::kPrismatic,
                                   axis, {0.3, 0.0, 0.05}));
    tree.links.push_back({fmt::format("l{}", parent + 1)});
  }
  return tree;
}

// With markers on these links (tag 0 on the first of them, ..).
Robot make_robot(const KinematicTree& tree, const std::vector<int>& links, std::string_view name) {
  Rng rng = Rng::from_name(name);
  Robot robot{tree, Eigen::MatrixXd(kPostures, tree.joints.size()), random_pose(rng, 1.5, 0.7), {}};
  for (int f = 0; f < kPostures; ++f) {
    robot.tracks.times_s.push_back(f);
    for (Eigen::Index j = 0; j < robot.values.cols(); ++j) {
      const double most =
          tree.joints[static_cast<std::size_t>(j)].type == JointType::kRevolute ? 1.2 : 0.15;
      robot.values(f, j) = rng.uniform(-most, most);
    }
  }
  for (std::size_t m = 0; m < links.size(); ++m) {
    const Pose mount = random_pose(rng, 1.0, 0.05);
    PoseTrack track{TagId{static_cast<int>(m)}, {}};
    for (int f = 0; f < kPostures; ++f) {
      PoseSample sample;
      sample.frame = f;
      const auto at = forward_kinematics(tree, robot.values.row(f));
      sample.T_camera_marker = robot.T_camera_base * at[static_cast<std::size_t>(links[m])] *
                               mount * random_pose(rng, kMarkerSigmaRad, kMarkerSigmaM);
      track.samples.push_back(sample);
    }
    robot.tracks.tracks.push_back(track);
  }
  return robot;
}

// Every marker is on its link, and base and mounts together predict what was measured.
Placement expect_placed(const Robot& robot, const std::vector<int>& links) {
  const Placement placement = place_markers(robot.tree, robot.values, robot.tracks);
  EXPECT_EQ(placement.markers.size(), links.size());
  for (std::size_t m = 0; m < placement.markers.size(); ++m) {
    const Marker& marker = placement.markers[m];
    EXPECT_EQ(marker.link, LinkId{links[m]}) << "tag " << m;
    Vector6d squares = Vector6d::Zero();
    for (const PoseSample& sample : robot.tracks.tracks[m].samples) {
      const auto at = forward_kinematics(robot.tree, robot.values.row(sample.frame));
      const Pose predicted =
          placement.T_camera_base * at[marker.link.index()] * marker.T_link_marker;
      squares += log_pose(predicted.inverse() * sample.T_camera_marker).array().square().matrix();
    }
    const Vector6d rms = (squares / kPostures).cwiseSqrt();
    EXPECT_LT(rms.head<3>().maxCoeff(), 1.5 * kMarkerSigmaRad) << "tag " << m;
    EXPECT_LT(rms.tail<3>().maxCoeff(), 1.5 * kMarkerSigmaM) << "tag " << m;
  }
  return placement;
}

double turned(const Robot& robot, const Placement& placement) {
  return angle_between(placement.T_camera_base.rotation, robot.T_camera_base.rotation);
}

// Angle between where the base's axis is and where it was placed.
double tilted(const Robot& robot, const Placement& placement, const Eigen::Vector3d& axis) {
  return std::acos(std::min(
      1.0, (robot.T_camera_base.rotation * axis).dot(placement.T_camera_base.rotation * axis)));
}

TEST(PlaceMarkers, ScaraWithMarkersOnEveryLink) {
  const std::vector<int> links = {0, 1, 2, 3, 4};
  const Robot robot = make_robot(chain("RRZR"), links, "scara");
  EXPECT_LT(turned(robot, expect_placed(robot, links)), 2e-3);
}

TEST(PlaceMarkers, ScaraWithAMarkerAtItsEndOnly) {
  const std::vector<int> links = {4};
  const Robot robot = make_robot(chain("RRZR"), links, "end of a scara");
  EXPECT_LT(turned(robot, expect_placed(robot, links)), 2e-3);
}

TEST(PlaceMarkers, PlanarArm) {
  const std::vector<int> links = {1, 2};
  const Robot robot = make_robot(chain("RR"), links, "planar arm");
  EXPECT_LT(turned(robot, expect_placed(robot, links)), 2e-3);
}

TEST(PlaceMarkers, GantryOfSlides) {
  const std::vector<int> links = {0, 1, 2, 3};
  const Robot robot = make_robot(chain("XYZ"), links, "slides");
  EXPECT_LT(turned(robot, expect_placed(robot, links)), 2e-3);
}

TEST(PlaceMarkers, GantryWithAWrist) {
  const std::vector<int> links = {0, 1, 2, 3, 4};
  const Robot robot = make_robot(chain("XYZR"), links, "gantry with a wrist");
  EXPECT_LT(turned(robot, expect_placed(robot, links)), 2e-3);
}

// What two slides' markers cannot tell alone they tell together: each shows one direction.
TEST(PlaceMarkers, SlidesOnTwoBranches) {
  KinematicTree tree;
  tree.links = {{"base"}, {"l1"}, {"l2"}};
  tree.joints = {joint_on(0, 1, JointType::kPrismatic, Eigen::Vector3d::UnitX(), {0.1, 0, 0}),
                 joint_on(0, 2, JointType::kPrismatic, Eigen::Vector3d::UnitY(), {0, 0.2, 0})};
  const std::vector<int> links = {2, 1};
  const Robot robot = make_robot(tree, links, "two slides");
  EXPECT_LT(turned(robot, expect_placed(robot, links)), 2e-3);
}

// Two hinges side by side: either leaves the turn about its axis free, their places do not.
TEST(PlaceMarkers, HingesOnTwoBranches) {
  KinematicTree tree;
  tree.links = {{"base"}, {"l1"}, {"l2"}};
  tree.joints = {joint_on(0, 1, JointType::kRevolute, Eigen::Vector3d::UnitZ(), {0.3, 0.0, 0.0}),
                 joint_on(0, 2, JointType::kRevolute, Eigen::Vector3d::UnitZ(), {-0.3, 0.1, 0.0})};
  const std::vector<int> links = {1, 2};
  const Robot robot = make_robot(tree, links, "two hinges");
  EXPECT_LT(turned(robot, expect_placed(robot, links)), 2e-3);
}

// The turn about the only direction is anybody's: base and mounts agree with each other.
TEST(PlaceMarkers, OneSlide) {
  const std::vector<int> links = {1, 0};
  const Robot robot = make_robot(chain("X"), links, "one slide");
  EXPECT_LT(tilted(robot, expect_placed(robot, links), Eigen::Vector3d::UnitX()), 2e-3);
}

TEST(PlaceMarkers, OneHinge) {
  const std::vector<int> links = {0, 1};
  const Robot robot = make_robot(chain("R"), links, "one hinge");
  EXPECT_LT(tilted(robot, expect_placed(robot, links), Eigen::Vector3d::UnitZ()), 2e-3);
}

TEST(PlaceMarkers, OfARobotAtRestIsRefused) {
  Robot robot = make_robot(chain("XYZR"), {4}, "at rest");
  robot.values *= 1e-3;
  for (PoseSample& sample : robot.tracks.tracks[0].samples)
    sample.T_camera_marker = robot.tracks.tracks[0].samples[0].T_camera_marker;
  EXPECT_THROW((void)place_markers(robot.tree, robot.values, robot.tracks), Error);
}

}  // namespace
}  // namespace kinescope
