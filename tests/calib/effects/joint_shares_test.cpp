// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/joint_shares.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "calib/effects/camera_effects.h"

namespace kinescope::effects {
namespace {

constexpr double kExact = 1e-12;  // sums and products of a few doubles

Eigen::VectorXd values(std::initializer_list<double> list) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(list.size()));
  std::ranges::copy(list, out.begin());
  return out;
}

TEST(PlayState, StandsBehindTheDriveWhicheverWayItMoves) {
  // Forwards from the start: the link lags; back: the gap of 0.2 is crossed in two steps.
  const Eigen::VectorXd state = play_state(values({0.0, 0.1, 0.5, 0.4, 0.3, 0.1, 0.2, 0.3}), 0.2);
  EXPECT_LT((state - values({-0.5, -0.5, -0.5, 0.0, 0.5, 0.5, 0.0, -0.5})).norm(), kExact);
}

TEST(PlayState, TheFirstMotionTellsTheSideAlsoAfterARest) {
  const Eigen::VectorXd down = play_state(values({1.0, 1.0, 1.0, 0.9}), 0.1);
  EXPECT_LT((down - Eigen::VectorXd::Constant(4, 0.5)).norm(), kExact);
  EXPECT_EQ(play_state(values({}), 0.1).size(), 0);
  EXPECT_EQ(play_state(values({0.3, 0.3}), 0.1), values({0.0, 0.0}));
}

TEST(PlayState, LinkFollowsWithinTheGapAndStandsStillWhileItIsCrossed) {
  constexpr double kWidth = 0.05;
  Eigen::VectorXd drive(400);
  for (Eigen::Index i = 0; i < drive.size(); ++i) {
    const double t = 0.05 * static_cast<double>(i);
    drive[i] = std::sin(t) + 0.4 * std::sin(2.7 * t);
  }
  const Eigen::VectorXd state = play_state(drive, kWidth);
  const Eigen::VectorXd link = drive + kWidth * state;
  int crossing = 0;
  for (Eigen::Index i = 1; i < drive.size(); ++i) {
    EXPECT_LE(std::abs(state[i]), 0.5 + kExact);
    const bool inside = std::abs(state[i]) < 0.5 - kExact;
    if (inside) {
      EXPECT_NEAR(link[i], link[i - 1], kExact);
      ++crossing;
    } else {
      // Pushed: from behind when moving forwards.
      EXPECT_EQ(state[i]<0.0, drive[i]> drive[i - 1]);
    }
  }
  EXPECT_GT(crossing, 5);
}

// Hysteresis: the same place from both sides, the gap's width apart.
TEST(PlayState, TheSamePlaceFromBothSidesDiffersByTheWidth) {
  constexpr double kWidth = 0.3;
  const Eigen::VectorXd drive = values({-1.0, 0.0, 1.0, 0.0, -1.0, 0.0});
  const Eigen::VectorXd link = drive + kWidth * play_state(drive, kWidth);
  EXPECT_NEAR(link[3] - link[1], kWidth, kExact);
  EXPECT_NEAR(link[5], link[1], kExact);
}

// With the place in its gap at which it began beside it, a play that begins in the middle is exact
// at every instant, from whichever side the first motion comes.
TEST(PlayState, WithTheShareOfItsStartAPlayMayBeginInTheMiddle) {
  constexpr double kWidth = 0.2;
  for (const double sign : {1.0, -1.0}) {
    const Eigen::VectorXd drive =
        sign * values({0.0, 0.0, 0.04, 0.08, 0.15, 0.4, 0.3, 0.1, 0.0, 0.2});
    double link = 0.0;
    const Eigen::VectorXd state = play_state(drive, kWidth);
    const Eigen::VectorXd start = share_of_start(drive, kWidth);
    for (Eigen::Index i = 0; i < drive.size(); ++i) {
      link = std::clamp(link, drive[i] - 0.5 * kWidth, drive[i] + 0.5 * kWidth);
      EXPECT_NEAR(drive[i] + kWidth * state[i] + sign * 0.5 * kWidth * start[i], link, kExact) << i;
    }
  }
}

// Linear in where it began, until the drive comes to push.
TEST(PlayState, ALinkStaysWhereItBeganUntilItIsPushed) {
  constexpr double kWidth = 0.2;
  constexpr double kStart = 0.06;
  const Eigen::VectorXd drive = values({1.0, 1.0, 1.1, 1.15, 1.2, 1.0, 0.9});
  const StartedPlay play = play_from(drive, kWidth, kStart);
  const Eigen::VectorXd link = drive + kWidth * play.state;
  EXPECT_LT((link - values({1.06, 1.06, 1.06, 1.06, 1.1, 1.1, 1.0})).norm(), kExact);
  EXPECT_EQ(play.unmoved, values({1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0}));
  const StartedPlay pushed = play_from(drive, kWidth, -0.5 * kWidth);
  EXPECT_EQ(pushed.unmoved, values({1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0}));
  EXPECT_LT((pushed.state - play_state(drive, kWidth)).norm(), kExact);
}

TEST(PlayState, TheShareOfTheStartEndsOnceTheGapIsCrossed) {
  const Eigen::VectorXd start = share_of_start(values({1.0, 1.0, 1.05, 1.2, 1.0, 1.0}), 0.2);
  EXPECT_LT((start - values({1.0, 1.0, 0.5, 0.0, 0.0, 0.0})).norm(), kExact);
}

TEST(ReadAt, IsLinearBetweenStampsAndKeepsTheEnds) {
  const std::vector<double> from{0.0, 1.0, 3.0};
  const Eigen::VectorXd read =
      read_at(from, values({2.0, 4.0, 0.0}), {-1.0, 0.0, 0.25, 1.0, 2.5, 3.0, 9.0});
  EXPECT_LT((read - values({2.0, 2.0, 2.5, 4.0, 1.0, 0.0, 0.0})).norm(), kExact);
}

// One joint about `axis_base`, its link's mass (a marker) 0.4 m from the axis, along the link's x.
KinematicTree pendulum(const Eigen::Quaterniond& R_base_joint) {
  KinematicTree tree;
  tree.links = {{"base"}, {"arm"}};
  Joint joint;
  joint.name = "q1";
  joint.type = JointType::kRevolute;
  joint.parent = LinkId{0};
  joint.parent = LinkId{0};
  joint.child = LinkId{1};
  joint.T_parent_joint.rotation = R_base_joint;
  joint.T_parent_joint.translation = {0.3, -0.2, 0.5};
  tree.joints = {joint};
  Marker marker;
  marker.id = TagId{11};
  marker.link = LinkId{1};
  marker.T_link_marker.translation = {0.4, 0.0, 0.0};
  tree.markers = {marker};
  return tree;
}

constexpr double kArm = 0.2;  // m: half of the way to the marker, as the link's origin counts too

JointMotion motion_over(const Eigen::VectorXd& angle) {
  JointMotion motion;
  for (Eigen::Index i = 0; i < angle.size(); ++i)
    motion.times_s.push_back(0.1 * static_cast<double>(i));
  motion.value = angle;
  motion.rate = Eigen::MatrixXd::Zero(angle.size(), 1);
  return motion;
}

const Eigen::VectorXd kAngles = Eigen::VectorXd::LinSpaced(25, -2.5, 3.0);

// z of the joint along -y of the base: x of the link at zero points along x of the base, and at
// angle q along (cos q, 0, sin q); gravity along -x pulls with sin q times the arm.
const Eigen::Quaterniond kLevelAxis =
    Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitX()));

TEST(GravityLoads, APendulumIsPulledWithTheSineOfItsAngle) {
  const std::vector<Load> loads =
      gravity_loads(pendulum(kLevelAxis), motion_over(kAngles), 0, -Eigen::Vector3d::UnitX());
  ASSERT_EQ(loads.size(), 2U);
  for (Eigen::Index i = 0; i < kAngles.size(); ++i) {
    // A kilogram at 1 m along x of the link, and across it.
    EXPECT_NEAR(loads[0].arm_m[i], std::sin(kAngles[i]), kExact);
    EXPECT_NEAR(loads[1].arm_m[i], std::cos(kAngles[i]), kExact);
  }
}

TEST(GravityLoads, WithoutGravitysDirectionThereIsOneLoadAnAxis) {
  const std::vector<Load> loads =
      gravity_loads(pendulum(kLevelAxis), motion_over(kAngles), 0, std::nullopt);
  ASSERT_EQ(loads.size(), 3U);
  for (Eigen::Index i = 0; i < kAngles.size(); ++i) {
    EXPECT_NEAR(loads[0].arm_m[i], -kArm * std::sin(kAngles[i]), kExact);
    EXPECT_NEAR(loads[1].arm_m[i], 0.0, kExact);
    EXPECT_NEAR(loads[2].arm_m[i], kArm * std::cos(kAngles[i]), kExact);
  }
}

TEST(GravityLoads, AnUprightAxisCarriesNothing) {
  const KinematicTree tree = pendulum(Eigen::Quaterniond::Identity());
  for (const Load& load : gravity_loads(tree, motion_over(kAngles), 0, -Eigen::Vector3d::UnitZ()))
    EXPECT_LT(load.arm_m.norm(), kExact) << load.what;
  const std::vector<Load> each = gravity_loads(tree, motion_over(kAngles), 0, std::nullopt);
  EXPECT_LT(each[2].arm_m.norm(), kExact);
  EXPECT_GT(each[0].arm_m.norm(), 0.1);
}

TEST(GravityLoads, ASlideIsPulledAlongItsAxisWhereverItStands) {
  KinematicTree tree = pendulum(Eigen::Quaterniond::Identity());
  tree.joints.front().type = JointType::kPrismatic;
  const std::vector<Load> loads =
      gravity_loads(tree, motion_over(kAngles), 0, -Eigen::Vector3d::UnitZ());
  ASSERT_EQ(loads.size(), 1U);
  EXPECT_LT((loads[0].arm_m + Eigen::VectorXd::Ones(kAngles.size())).norm(), kExact);
}

// Where the second joint is on the first arm is a place on that arm, and tells nothing more.
TEST(GravityLoads, LinksBehindPullFromTheirOwnPlaces) {
  KinematicTree tree = pendulum(kLevelAxis);
  Joint elbow = tree.joints.front();
  elbow.name = "q2";
  elbow.parent = LinkId{1};
  elbow.child = LinkId{2};
  elbow.T_parent_joint = Pose{};
  elbow.T_parent_joint.translation = {0.5, 0.0, 0.0};
  tree.links.push_back({"fore"});
  tree.joints.push_back(elbow);
  JointMotion motion = motion_over(kAngles);
  motion.value = Eigen::MatrixXd(kAngles.size(), 2);
  motion.value << kAngles, 0.7 * kAngles;
  motion.rate = Eigen::MatrixXd::Zero(kAngles.size(), 2);
  const std::vector<Load> loads = gravity_loads(tree, motion, 0, -Eigen::Vector3d::UnitX());
  ASSERT_EQ(loads.size(), 4U);
  for (Eigen::Index i = 0; i < kAngles.size(); ++i) {
    EXPECT_NEAR(loads[0].arm_m[i], std::sin(kAngles[i]), kExact);
    EXPECT_NEAR(loads[2].arm_m[i], std::sin(1.7 * kAngles[i]), kExact);
  }
  // Where a slide is, none of the others says.
  tree.joints.back().type = JointType::kPrismatic;
  tree.joints.back().axis = Eigen::Vector3d::UnitX();
  const std::vector<Load> slid = gravity_loads(tree, motion, 0, -Eigen::Vector3d::UnitX());
  ASSERT_EQ(slid.size(), 3U);
  for (Eigen::Index i = 0; i < kAngles.size(); ++i)
    EXPECT_NEAR(slid[2].arm_m[i], (0.5 + 0.7 * kAngles[i]) * std::sin(kAngles[i]), kExact);
  tree.joints.back().type = JointType::kRevolute;
  EXPECT_EQ(gravity_loads(tree, motion, 1, -Eigen::Vector3d::UnitX()).size(), 2U);
}

// A hinge that turns to and fro over `turns`, once in 30 s, filmed and logged at 30 Hz.
EffectWorld hinge(double turns) {
  EffectWorld world;
  Joint joint;
  joint.name = "q1";
  joint.type = JointType::kRevolute;
  joint.parent = LinkId{0};
  joint.child = LinkId{1};
  world.tree.links = {{"base"}, {"arm"}};
  world.tree.joints = {joint};
  world.driven = {0};
  world.moving = {0};
  constexpr Eigen::Index kFrames = 900;
  world.frames.value.resize(kFrames, 1);
  world.frames.rate.setZero(kFrames, 1);
  for (Eigen::Index i = 0; i < kFrames; ++i) {
    const double t = static_cast<double>(i) / 30.0;
    world.frames.times_s.push_back(t);
    world.frames.value(i, 0) =
        std::numbers::pi * turns * std::sin(2.0 * std::numbers::pi * t / 30.0);
  }
  world.loaded = world.frames;
  world.log = world.frames;
  return world;
}

Candidate candidate_of(const EffectWorld& world, const std::string& effect) {
  for (const CameraEffect& known : joint_effects(world)) {
    if (known.candidate.id.effect == effect) return known.candidate;
  }
  throw std::logic_error("no " + effect);
}

// A link ahead of its drive has no play: its reading is late.
TEST(JointEffects, PlayIsPositive) {
  const Candidate backlash = candidate_of(hinge(0.4), "backlash");
  EXPECT_TRUE(backlash.possible(values({0.01})));
  EXPECT_FALSE(backlash.possible(values({-0.01})));
  EXPECT_FALSE(backlash.possible(values({1.0})));
}

// Waves further apart than half of what the range tells apart fall between the values.
TEST(JointEffects, WavesAreLookedForWithoutGaps) {
  for (const double turns : {0.5, 1.0, 2.0}) {
    const std::vector<double> scan = candidate_of(hinge(turns), "gear_error").scan;
    ASSERT_GT(scan.size(), 2U);
    for (std::size_t i = 1; i < scan.size(); ++i) {
      ASSERT_LT(scan[i] - scan[i - 1], 0.5 / turns) << turns << " turns";
    }
  }
}

// Gravity nearly along the hinge: a turn of it by half of what pulls halves the sag that the same
// parameters stand for.
TEST(JointEffects, ASagIsAsLargeAsGravityIsFoundToPull) {
  constexpr double kPull = 0.04;  // of gravity across the axis
  EffectWorld world = hinge(0.4);
  Marker marker;
  marker.link = LinkId{1};
  marker.T_link_marker.translation = {0.4, 0.0, 0.0};
  world.tree.markers = {marker};
  world.gravity_base = Eigen::Vector3d(kPull, 0.0, -1.0).normalized();
  const auto sag_in = [](const EffectWorld& of) {
    for (CameraEffect& known : joint_effects(of))
      if (known.candidate.id.effect == "compliance") return known;
    throw std::logic_error("no compliance");
  };
  const Eigen::VectorXd theta = values({0.01, -0.004});
  const CameraEffect alone = sag_in(world);
  EXPECT_FALSE(alone.size_beside);
  Eigen::VectorXd sags = theta;
  const std::vector<Correction> corrections = alone.corrections(0.0);
  for (Eigen::Index k = 0; k < sags.size(); ++k)
    sags[k] /= corrections[static_cast<std::size_t>(k)].reference;
  world.sags[0] = sags;
  const CameraEffect sag = sag_in(world);
  ASSERT_TRUE(sag.size_beside);
  const double as_declared = sag.candidate.size(theta);
  EXPECT_NEAR(sag.size_beside(Eigen::Vector2d::Zero())(theta), as_declared, kExact);
  for (const Eigen::Vector2d& turns :
       {Eigen::Vector2d(0.02, 0.0), Eigen::Vector2d(0.0, -0.02), Eigen::Vector2d(-0.01, 0.015)}) {
    EffectWorld turned = world;
    turned.gravity_base = sag.gravity_base(turns);
    Eigen::VectorXd there = sags;
    const std::vector<Correction> loads = sag_in(turned).corrections(0.0);
    for (Eigen::Index k = 0; k < there.size(); ++k)
      there[k] *= loads[static_cast<std::size_t>(k)].reference;
    const double truth = sag_in(turned).candidate.size(there);
    EXPECT_GT(std::abs(truth - as_declared), 0.05 * as_declared) << turns.transpose();
    // A turn is a straight line, and lengthens what it turns.
    EXPECT_NEAR(sag.size_beside(turns)(theta), truth, 1e-3 * truth) << turns.transpose();
  }
}

}  // namespace
}  // namespace kinescope::effects
