// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/mechanics.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace kinescope::truth {
namespace {

constexpr double kExact = 1e-12;    // rad or m: a few roundings of numbers around one
constexpr double kGrid = 1e-6;      // rad: play between its memory's points, 0.5 ms apart
constexpr double kSampling = 0.02;  // of an amplitude: extremes lie between the samples
constexpr double kTwoPi = 2.0 * std::numbers::pi;

FilmedRobot robot_of_kind(RobotKind kind, std::uint64_t seed = 3) {
  FilmedRobotOptions options;
  options.kind = kind;
  options.seed = seed;
  return draw_filmed_robot(options);
}

// Of joint "q<k>".
Eigen::Index index_of(const FilmedRobot& robot, const std::string& name) {
  const auto found = std::ranges::find(robot.tree.joints, name, &Joint::name);
  return std::distance(robot.tree.joints.begin(), found);
}

// True minus logged value of a joint, every 10 ms.
Eigen::VectorXd error_of(const FilmedRobot& robot, const InjectedEffect& effect, int joint) {
  const Mechanics mechanics(robot, {effect});
  Eigen::VectorXd out(static_cast<Eigen::Index>(robot.duration_s * 100.0));
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    const double t = 0.01 * static_cast<double>(i);
    out[i] = (mechanics.values(t) - robot.encoders(t))[joint];
  }
  return out;
}

TEST(Mechanics, WithoutEffectsIsForwardKinematics) {
  for (const RobotKind kind : kRobotKinds) {
    const FilmedRobot robot = robot_of_kind(kind);
    const Mechanics mechanics(robot, {});
    const auto links = mechanics.links(7.3);
    const auto expected = forward_kinematics(robot.tree, robot.encoders(7.3));
    for (std::size_t l = 0; l < links.size(); ++l) {
      EXPECT_LT(log_pose(expected[l].inverse() * links[l]).norm(), 1e-9) << to_string(kind);
    }
  }
}

TEST(Mechanics, OnlyThePlaceNamedChanges) {
  const FilmedRobot robot = robot_of_kind(RobotKind::kScara);
  for (const std::string& name : library_effects()) {
    if (!sits_on_joint(name)) continue;
    for (const InjectedEffect& effect : weakest_effects(name, robot)) {
      const Mechanics mechanics(robot, {effect});
      const Eigen::VectorXd off = mechanics.values(5.0) - robot.encoders(5.0);
      const Eigen::Index place = index_of(robot, effect.place);
      for (Eigen::Index j = 0; j < off.size(); ++j) {
        if (j == place) continue;
        EXPECT_EQ(off[j], 0.0) << name << " at " << effect.place;
      }
    }
  }
}

TEST(Play, LagsByHalfTheGapAndRestsWhileItIsCrossed) {
  const FilmedRobot robot = robot_of_kind(RobotKind::kArm3);
  const double width = 0.02;
  const SmoothMotion& leader = robot.motions[0];
  const Play play(leader, width, robot.duration_s);
  int pushed = 0;
  int resting = 0;
  for (const double t : instants(robot.duration_s, 0.001)) {
    const double lag = leader.value(t) - play.value(t);
    ASSERT_LE(std::abs(lag), 0.5 * width + kExact);
    const double moved = play.value(t + 0.001) - play.value(t);
    if (std::abs(std::abs(lag) - 0.5 * width) < kGrid) {
      // In contact the follower goes only where it is pushed.
      EXPECT_GE(moved * lag, -kGrid * width);
      ++pushed;
    } else if (std::abs(leader.value(t + 0.001) - play.value(t)) < 0.5 * width) {
      EXPECT_NEAR(moved, 0.0, kGrid);
      ++resting;
    }
  }
  EXPECT_GT(pushed, 10000);
  EXPECT_GT(resting, 100);
}

TEST(Play, BothWaysDifferByTheWholeGap) {
  const FilmedRobot robot = robot_of_kind(RobotKind::kArm3);
  const Eigen::VectorXd error = error_of(robot, {"backlash", "q2", 0.03}, 1);
  EXPECT_NEAR(error.maxCoeff() - error.minCoeff(), 0.03, kExact);
}

TEST(Mechanics, EncoderScaleIsAShareOfTheValue) {
  const FilmedRobot robot = robot_of_kind(RobotKind::kArm3);
  const Mechanics mechanics(robot, {{"encoder_scale", "q1", 0.01}});
  EXPECT_NEAR(mechanics.values(4.0)[0], 1.01 * robot.encoders(4.0)[0], kExact);
}

TEST(Mechanics, EccentricDiscsAndUniversalJointsSwingAsFarAsTheySay) {
  FilmedRobotOptions options;
  options.amplitude_rad = 4.0;  // all round
  const FilmedRobot robot = draw_filmed_robot(options);
  for (const double periods : {1.0, 2.0}) {
    const double size = 0.004;
    const InjectedEffect effect{"eccentricity", "q1", size, periods};
    const Eigen::VectorXd error = error_of(robot, effect, 0);
    EXPECT_NEAR(error.maxCoeff(), size, kSampling * size);
    EXPECT_NEAR(error.minCoeff(), -size, kSampling * size);
    // A turn later, or half a turn for the universal joint, it is the same: to first order a sine.
    Eigen::MatrixXd design(error.size(), 2);
    for (Eigen::Index i = 0; i < error.size(); ++i) {
      const double q = robot.encoders(0.01 * static_cast<double>(i))[0];
      design.row(i) << std::sin(periods * q), std::cos(periods * q);
    }
    const Eigen::Vector2d fit =
        (design.transpose() * design).inverse() * design.transpose() * error;
    EXPECT_LT((error - design * fit).norm(), 0.01 * error.norm());
    EXPECT_NEAR(fit.norm(), size, kSampling * size);
  }
}

TEST(Mechanics, GearErrorRepeatsEveryTooth) {
  const FilmedRobot robot = robot_of_kind(RobotKind::kArm3);
  const InjectedEffect effect{"gear_error", "q1", 0.002, 17.5};
  const Eigen::VectorXd error = error_of(robot, effect, 0);
  EXPECT_NEAR(error.maxCoeff(), 0.002, kSampling * 0.002);
  int crossings = 0;
  double travel = 0.0;
  for (Eigen::Index i = 1; i < error.size(); ++i) {
    crossings += error[i] * error[i - 1] < 0.0 ? 1 : 0;
    const double t = 0.01 * static_cast<double>(i);
    travel += std::abs(robot.encoders(t)[0] - robot.encoders(t - 0.01)[0]);
  }
  // Two crossings a period; each of the turning points may cost or add one.
  EXPECT_NEAR(crossings, 2.0 * 17.5 * travel / kTwoPi, 30.0);
}

TEST(Mechanics, SagIsAsLargeAsItSaysAndFollowsGravity) {
  const FilmedRobot robot = robot_of_kind(RobotKind::kArm3);
  const InjectedEffect effect{"compliance", "q2", 0.01};
  const Eigen::VectorXd sag = error_of(robot, effect, 1);
  // The sagged posture has another torque than the one that the encoders show: second order.
  EXPECT_NEAR(sag.cwiseAbs().maxCoeff(), 0.01, 0.01 * 0.05);
  FilmedRobot turned = robot;
  turned.down = -robot.down;
  EXPECT_LT((error_of(turned, effect, 1) + sag).norm(), 0.05 * sag.norm());
}

// Virtual work: the torque is minus the slope of the potential energy, which a lift along `down`
// shows. Two roads to one number.
TEST(Masses, TorquesDoTheWorkOfFalling) {
  for (const RobotKind kind : kRobotKinds) {
    const FilmedRobot robot = robot_of_kind(kind);
    const Masses masses(robot.tree, robot.seed);
    const Eigen::VectorXd q = robot.encoders(3.0);
    const Eigen::Vector3d down = Eigen::Vector3d(0.3, -0.2, -0.9).normalized();
    const Eigen::VectorXd torques = masses.torques(robot.tree, q, down);
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      const double step = 1e-5;
      Eigen::VectorXd more = q;
      Eigen::VectorXd less = q;
      more[j] += step;
      less[j] -= step;
      const double slope = (masses.work_of_falling(robot.tree, more, down) -
                            masses.work_of_falling(robot.tree, less, down)) /
                           (2.0 * step);
      EXPECT_NEAR(torques[j], slope, 1e-6) << to_string(kind) << " joint " << j;
    }
  }
}

TEST(Mechanics, CouplingFollowsTheOtherJoint) {
  const FilmedRobot robot = robot_of_kind(RobotKind::kScara);
  const Mechanics mechanics(robot, {{"coupling", "q3", 0.002, 0.0, "q1"}});
  const Eigen::VectorXd encoders = robot.encoders(6.0);
  EXPECT_NEAR(mechanics.values(6.0)[2], encoders[2] + 0.002 * encoders[0], kExact);
}

Pose motion_of_joint(const FilmedRobot& robot, const InjectedEffect& effect, double t) {
  const Mechanics mechanics(robot, {effect});
  const auto links = mechanics.links(t);
  const Joint& joint = robot.tree.joints[static_cast<std::size_t>(index_of(robot, effect.place))];
  return (links[joint.parent.index()] * joint.T_parent_joint).inverse() *
         links[joint.child.index()];
}

TEST(Mechanics, AScrewAdvancesWithItsTurn) {
  const FilmedRobot robot = robot_of_kind(RobotKind::kArm3);
  const Pose T = motion_of_joint(robot, {"helical", "q2", 0.001}, 2.0);
  EXPECT_NEAR(T.translation.z(), 0.001 * robot.encoders(2.0)[1] / kTwoPi, kExact);
  EXPECT_NEAR(T.translation.head<2>().norm(), 0.0, kExact);
}

TEST(Mechanics, ABentSlideStaysOnItsCircleAndTurnsWithIt) {
  const FilmedRobot robot = robot_of_kind(RobotKind::kGantry);
  const double radius = 2.0;
  for (const double t : {1.0, 2.0, 5.0}) {
    const double q = robot.encoders(t)[0];
    const Pose T = motion_of_joint(robot, {"curved_slider", "q1", 1.0 / radius}, t);
    EXPECT_NEAR(log_rotation(T.rotation).norm(), std::abs(q) / radius, 1e-9);
    // The chord of an arc of length q, and its tangent.
    EXPECT_NEAR(T.translation.norm(), 2.0 * radius * std::sin(std::abs(q) / radius / 2.0), 1e-9);
    const double ahead = 1e-6;
    const Eigen::Vector3d step =
        motion_of_joint(robot, {"curved_slider", "q1", 1.0 / radius}, t + ahead).translation -
        T.translation;
    const double along = step.normalized().dot(T.rotation * Eigen::Vector3d::UnitZ());
    EXPECT_NEAR(std::abs(along), 1.0, 1e-6);
  }
}

TEST(Mechanics, AWobblingShaftDescribesItsCone) {
  const FilmedRobot robot = robot_of_kind(RobotKind::kArm3);
  const double cone = 0.003;
  const InjectedEffect effect{"axis_wobble", "q2", cone, -1.0};
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const double t : {1.0, 2.0, 3.0, 4.0}) {
    const Pose T = motion_of_joint(robot, effect, t);
    const Eigen::Vector3d shaft = T.rotation * Eigen::Vector3d::UnitZ();
    EXPECT_NEAR(std::acos(shaft.z()), cone, 1e-9);
    EXPECT_NEAR(T.translation.norm(), 0.0, kExact);
    sum += shaft / 4.0;
  }
  EXPECT_GT(1.0 - sum.norm(), 1e-9);  // it does not stay where it is
  EXPECT_ANY_THROW(Mechanics(robot, {{"axis_wobble", "q2", cone, 1.0}}));
}

TEST(Mechanics, EffectsOfTheTestsOwnMaking) {
  const FilmedRobot robot = robot_of_kind(RobotKind::kArm3);
  const Eigen::VectorXd step = error_of(robot, {"own_tanh", "q3", 0.01, 0.0, "q1"}, 2);
  EXPECT_NEAR(step.maxCoeff(), 0.01, 1e-4);
  EXPECT_NEAR(step.minCoeff(), -0.01, 1e-4);
  const Eigen::VectorXd cubic = error_of(robot, {"own_cubic", "q3", 0.01}, 2);
  EXPECT_NEAR(cubic.cwiseAbs().maxCoeff(), 0.01, 5e-4);
  const Eigen::VectorXd speed = error_of(robot, {"own_speed", "q3", 0.01, 0.0, "q1"}, 2);
  EXPECT_NEAR(speed.maxCoeff(), 0.01, 1e-4);
  EXPECT_GE(speed.minCoeff(), 0.0);
}

TEST(Mechanics, RefusesWhatCannotBe) {
  const FilmedRobot robot = robot_of_kind(RobotKind::kScara);
  EXPECT_ANY_THROW(Mechanics(robot, {{"helical", "q3", 1e-3}}));
  EXPECT_ANY_THROW(Mechanics(robot, {{"curved_slider", "q1", 0.1}}));
  EXPECT_ANY_THROW(Mechanics(robot, {{"backlash", "q9", 0.1}}));
  EXPECT_ANY_THROW(Mechanics(robot, {{"coupling", "q1", 0.1, 0.0, "q9"}}));
}

}  // namespace
}  // namespace kinescope::truth
