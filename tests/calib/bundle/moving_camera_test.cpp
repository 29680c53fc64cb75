// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/moving_camera.h"

#include <cmath>

#include <gtest/gtest.h>

#include "calib/bundle/calibrate.h"
#include "calib/bundle/chain.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"
#include "tests/truth/axis_errors.h"
#include "tests/truth/moving_camera_world.h"

namespace kinescope {
namespace {

using truth::CameraCarrier;
using truth::MovingCameraOptions;
using truth::MovingCameraWorld;
using truth::RobotKind;

MovingCameraOptions moving(CameraCarrier carrier, RobotKind kind, std::uint64_t seed) {
  MovingCameraOptions out;
  out.robot.seed = seed;
  out.robot.kind = kind;
  out.robot.duration_s = 6.0;
  out.robot.tag_size_m = 0.08;
  out.robot.amplitude_rad = carrier == CameraCarrier::kRobot ? 0.5 : 1.0;
  out.wall_tags = 5;
  out.wall_step_m = 0.3;
  out.rate_hz = 10.0;
  out.carrier = carrier;
  return out;
}

// Only what is seen, so that every marker is a start.
KinematicTree seen_part(const MovingCameraWorld& filmed) {
  KinematicTree tree = filmed.world.tree;
  std::erase_if(tree.markers, [&](const Marker& marker) {
    return std::ranges::find(filmed.world.measurements.corners, marker.id, &TagObservation::id) ==
           filmed.world.measurements.corners.end();
  });
  return tree;
}

CalibrationStart start_of(MovingCameraWorld filmed, double off, std::uint64_t seed) {
  filmed.world.tree = seen_part(filmed);
  CalibrationStart start = truth::perturbed_start(filmed.world, off, off, seed);
  Rng rng = Rng::from_name("start of a moving camera", seed);
  const auto moved = [&](const Pose& T) {
    return T * Pose{exp_rotation(rng.normal3(off)), rng.normal3(off)};
  };
  start.moving = MovingCamera{filmed.camera_link, moved(filmed.T_link_camera.inverse()), {}};
  if (filmed.camera_link.value == 0)
    for (const Pose& T : filmed.path) start.moving->path.push_back(moved(T));
  return start;
}

Calibration calibrated(const MovingCameraWorld& filmed, double off, std::uint64_t seed) {
  CalibrateOptions options;
  options.folds = 2;
  const truth::World& world = filmed.world;
  return calibrate(world.measurements, world.markers, world.log, start_of(filmed, off, seed),
                   options);
}

bundle::ChainJoint any_joint(Rng& rng, JointType type, bool upward) {
  bundle::ChainJoint out;
  out.type = type;
  out.axis = rng.unit3();
  out.T_parent_joint = {exp_rotation(rng.normal3(1.0)), rng.normal3(0.3)};
  out.value = rng.normal(0.8);
  out.correction << rng.normal3(0.05), rng.normal3(0.05);
  out.upward = upward;
  return out;
}

// Every derivative against a difference of poses.
TEST(MovingCamera, ChainsUpwardHaveTheirDerivatives) {
  constexpr double kStep = 1e-6;
  constexpr double kClose = 1e-7;  // the step's square, of values about 1
  Rng rng = Rng::from_name("upward chain", 1);
  const Pose T_camera_link{exp_rotation(rng.normal3(1.0)), rng.normal3(0.3)};
  const Pose mount{exp_rotation(rng.normal3(1.0)), rng.normal3(0.3)};
  std::vector<bundle::ChainJoint> joints;
  for (const bool upward : {true, true, false})
    for (const JointType type : {JointType::kRevolute, JointType::kPrismatic})
      joints.push_back(any_joint(rng, type, upward));
  const bundle::ChainDerivatives at = bundle::differentiate_chain(T_camera_link, joints, mount);
  const auto moved = [&](auto change) {
    std::vector<bundle::ChainJoint> other = joints;
    change(other);
    const Pose T = bundle::differentiate_chain(T_camera_link, other, mount).T_camera_marker;
    return Vector6d(log_pose(at.T_camera_marker.inverse() * T) / kStep);
  };
  for (std::size_t k = 0; k < joints.size(); ++k) {
    const Vector6d by_value = moved([&](auto& other) { other[k].value += kStep; });
    EXPECT_LT((by_value - at.d_value[k]).norm(), kClose) << k;
    for (int i = 0; i < 6; ++i) {
      const Pose step = exp_pose(kStep * Vector6d::Unit(i));
      const Vector6d by_frame =
          moved([&](auto& other) { other[k].T_parent_joint = other[k].T_parent_joint * step; });
      EXPECT_LT((by_frame - at.d_joint[k].col(i)).norm(), kClose) << k << " frame " << i;
      const Vector6d by_link = moved([&](auto& other) {
        other[k].correction = log_pose(exp_pose(other[k].correction) * step);
      });
      EXPECT_LT((by_link - at.d_link[k].col(i)).norm(), kClose) << k << " link " << i;
    }
  }
}

class MovingCameraOf : public testing::TestWithParam<CameraCarrier> {};

TEST_P(MovingCameraOf, IsExactWithoutNoise) {
  constexpr double kExact_m = 1e-7;  // where the solver stops, and the log is interpolated
  MovingCameraOptions options = moving(GetParam(), RobotKind::kArm3, 3);
  options.sigma_px = 0.0;
  options.log_rate_hz = 2000.0;
  const MovingCameraWorld filmed = make_moving_camera_world(options);
  const Calibration found = calibrated(filmed, 1e-3, 3);
  ASSERT_EQ(found.status, CalibrationStatus::kConverged);
  ASSERT_TRUE(found.moving.has_value());
  EXPECT_LT(found.final_rms, 1e-3);
  KinematicTree truth = seen_part(filmed);
  const auto differences = truth::axis_differences(truth, found);
  for (const truth::AxisDifference& axis : differences.among)
    EXPECT_LT(axis.position_m.value_or(0.0), kExact_m);
}

// Axes among each other, over recordings: as often within twice the uncertainty as is claimed.
TEST_P(MovingCameraOf, ScattersAsItClaims) {
  constexpr int kRecordings = 40;
  int within = 0, count = 0;
  for (int k = 0; k < kRecordings; ++k) {
    const auto seed = static_cast<std::uint64_t>(300 + k);
    const MovingCameraWorld filmed = make_moving_camera_world(
        moving(GetParam(), k % 2 == 0 ? RobotKind::kArm3 : RobotKind::kScara, seed));
    const Calibration found = calibrated(filmed, 1e-3, seed);
    ASSERT_EQ(found.status, CalibrationStatus::kConverged) << seed;
    const auto differences = truth::axis_differences(seen_part(filmed), found);
    for (std::size_t j = 0; j < found.joints.size(); ++j) {
      if (!found.joints[j].among_direction_sigma_rad) continue;
      within += differences.among[j].direction_rad <=
                2.0 * value_of(found.joints[j].among_direction_sigma_rad);
      ++count;
      if (!differences.among[j].position_m || !found.joints[j].among_position_sigma_m) continue;
      within += *differences.among[j].position_m <=
                2.0 * value_of(found.joints[j].among_position_sigma_m);
      ++count;
    }
  }
  // 95 % of about 250, of which those of one robot go together: three deviations of 80 alone.
  EXPECT_GT(within, 0.88 * count) << count;
  EXPECT_LT(within, count);
}

INSTANTIATE_TEST_SUITE_P(Carriers, MovingCameraOf,
                         testing::Values(CameraCarrier::kRobot, CameraCarrier::kPerson),
                         [](const auto& carrier) {
                           return carrier.param == CameraCarrier::kRobot ? "Robot" : "Person";
                         });

// The pose on the link, and in every frame.
TEST(MovingCamera, StandsWhereTheTruthHasIt) {
  const MovingCameraWorld on_robot =
      make_moving_camera_world(moving(CameraCarrier::kRobot, RobotKind::kArm3, 5));
  const Calibration found = calibrated(on_robot, 1e-3, 5);
  const MovingCamera& moving_camera = value_of(found.moving);
  EXPECT_EQ(moving_camera.link, on_robot.camera_link);
  // In the frame of the first base marker, at a frame in the middle.
  const KinematicTree truth = seen_part(on_robot);
  const auto frame = static_cast<int>(on_robot.path.size()) / 2;
  const std::vector<Pose> links =
      forward_kinematics(found.tree, found.joint_values.row(frame).transpose());
  const Pose seen = camera_from_base(found, frame, links) * found.tree.markers[0].T_link_marker;
  const Pose true_pose = on_robot.path[static_cast<std::size_t>(frame)] *
                         truth.marker(found.tree.markers[0].id)->T_link_marker;
  // Of a marker at the wall's edge, seen in a part of the frames with 0.1 px.
  EXPECT_LT(log_pose(true_pose.inverse() * seen).norm(), 5e-3);

  const MovingCameraWorld carried =
      make_moving_camera_world(moving(CameraCarrier::kPerson, RobotKind::kArm3, 5));
  const Calibration path = calibrated(carried, 1e-3, 5);
  ASSERT_EQ(value_of(path.moving).path.size(), carried.path.size());
  const Pose T_truth_found = carried.world.tree.marker(path.tree.markers[0].id)->T_link_marker *
                             path.tree.markers[0].T_link_marker.inverse();
  for (std::size_t f = 0; f < carried.path.size(); ++f) {
    const Pose T = path.moving->path[f] * T_truth_found.inverse();
    EXPECT_LT(log_pose(carried.path[f].inverse() * T).norm(), 5e-3) << f;
  }
}

}  // namespace
}  // namespace kinescope
