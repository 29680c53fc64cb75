// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/robot_difference.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <gtest/gtest.h>

#include "tests/truth/camera_world.h"
#include "tests/truth/filmed_robot.h"

namespace kinescope {
namespace {

constexpr double kSameDifference =
    1e-7;  // central differences and products of numbers of order one

// The first of the random arms of which no axis is nearly parallel to the next.
KinematicTree arm_of_four() {
  truth::WorldOptions options;
  options.joints.assign(4, JointType::kRevolute);
  for (options.seed = 1;; ++options.seed) {
    KinematicTree out = truth::make_world(options).tree;
    std::vector<JointId> joints;
    const AxisLayout layout =
        axis_layout(placed_axes(out, Eigen::VectorXd::Constant(4, 0.25), joints));
    if (std::count(layout.steps.begin(), layout.steps.end(), AxisStep::kNormal) == 3) return out;
  }
}

// A calibration of which every joint's four numbers and its ratio are known that well.
Calibration known_to(const KinematicTree& tree, double sigma) {
  Calibration out;
  out.tree = tree;
  for (const Joint& joint : tree.joints) {
    JointEstimate estimate;
    estimate.range = {-0.5 * std::abs(joint.scale), 1.0 * std::abs(joint.scale)};
    out.joints.push_back(estimate);
    for (const char* words : {"turn x", "turn y", "shift x", "shift y", "scale"})
      out.parameters.push_back({joint.name + " " + words, joint.name, "", 0.0, sigma, sigma});
  }
  const auto n = std::ssize(out.parameters);
  out.covariance = sigma * sigma * Eigen::MatrixXd::Identity(n, n);
  return out;
}

std::vector<QuantityDifference> differences(const Calibration& first, const Calibration& second) {
  const std::vector<Calibration> runs{first, second};
  const std::vector<RobotMatch> matches{match_robots(first.tree, first.tree),
                                        match_robots(first.tree, second.tree)};
  const RobotLayout layout = robot_layout(runs, matches);
  return robot_differences(layout, robot_numbers(layout, first, matches[0]),
                           robot_numbers(layout, second, matches[1]));
}

double largest(const std::vector<QuantityDifference>& all, const std::string& but = "") {
  double out = 0.0;
  for (const QuantityDifference& one : all)
    if (one.of.name != but) out = std::max(out, std::abs(one.difference));
  return out;
}

const QuantityDifference& named(const std::vector<QuantityDifference>& all,
                                const std::string& name) {
  for (const QuantityDifference& one : all)
    if (one.of.name == name) return one;
  throw std::runtime_error("no quantity " + name);
}

TEST(RobotDifference, AZeroALengthAndARatioAreEachOneNumber) {
  const KinematicTree tree = arm_of_four();
  const Calibration first = known_to(tree, 1e-4);
  Calibration zero = first;
  Joint& moved = zero.tree.joints[1];
  moved.T_parent_joint = moved.T_parent_joint * joint_motion(moved.type, moved.axis, 3e-3);
  const auto by_zero = differences(first, zero);
  EXPECT_NEAR(named(by_zero, "zero of q2 (towards q3)").difference, 3e-3, kSameDifference);
  EXPECT_LT(largest(by_zero, "zero of q2 (towards q3)"), kSameDifference);

  Calibration ratio = first;
  ratio.tree.joints[1].scale = 1.001;
  const auto by_ratio = differences(first, ratio);
  EXPECT_NEAR(named(by_ratio, "ratio of q2").difference, std::log(1.001), kSameDifference);
}

TEST(RobotDifference, ZerosOfTheFirstAndTheLastJointBelongToTheRecordings) {
  const Calibration first = known_to(arm_of_four(), 1e-4);
  for (const std::size_t end : {0U, 3U}) {
    Calibration other = first;
    Joint& moved = other.tree.joints[end];
    moved.T_parent_joint = moved.T_parent_joint * joint_motion(moved.type, moved.axis, 0.1);
    EXPECT_LT(largest(differences(first, other)), kSameDifference) << end;
  }
}

// Which way a channel counts along its axis is how the robot is written down.
TEST(RobotDifference, AnAxisThatPointsTheOtherWayWithANegativeScaleIsTheSame) {
  const Calibration first = known_to(arm_of_four(), 1e-4);
  Calibration other = first;
  const Pose over{exp_rotation({std::numbers::pi, 0.0, 0.0}), Eigen::Vector3d::Zero()};
  other.tree.joints[1].T_parent_joint = other.tree.joints[1].T_parent_joint * over;
  other.tree.joints[2].T_parent_joint = over.inverse() * other.tree.joints[2].T_parent_joint;
  other.tree.joints[1].scale = -1.0;
  EXPECT_LT(largest(differences(first, other)), kSameDifference);
}

// The same robot as its log in another unit shows it; `shift` is of the channels' zeros, rad.
Calibration counted_in(const Calibration& run, double unit, double shift) {
  Calibration out = run;
  for (Joint& joint : out.tree.joints) {
    joint.scale *= unit;
    joint.T_parent_joint =
        joint.T_parent_joint * joint_motion(joint.type, joint.axis, -joint.scale / unit * shift);
  }
  for (JointEstimate& joint : out.joints)
    joint.range = {joint.range.lower + shift, joint.range.upper + shift};
  return out;
}

TEST(RobotDifference, DegreesAndRadiansAreOneRobot) {
  const KinematicTree tree = arm_of_four();
  const Calibration rad = known_to(tree, 1e-4);
  const Calibration deg = counted_in(rad, kRadPerDegree, 0.0);
  for (const auto& [one, two] : {std::pair{rad, deg}, std::pair{deg, rad}}) {
    const auto found = differences(one, two);
    EXPECT_LT(largest(found), kSameDifference);
    for (const QuantityDifference& quantity : found) EXPECT_TRUE(quantity.sigma);
  }
  Calibration moved = deg;
  Joint& joint = moved.tree.joints[1];
  joint.T_parent_joint = joint.T_parent_joint * joint_motion(joint.type, joint.axis, 3e-3);
  joint.scale *= 1.001;
  const auto found = differences(rad, moved);
  EXPECT_NEAR(named(found, "ratio of q2").difference, std::log(1.001), kSameDifference);
  EXPECT_NEAR(named(found, "zero of q2 (towards q3)").difference, 3e-3, 0.5 * 1e-3);
}

TEST(RobotDifference, TicksBesideRadiansSayNothingOfZerosAndRatios) {
  const Calibration rad = known_to(arm_of_four(), 1e-4);
  const Calibration ticks = counted_in(rad, 2.0 * std::numbers::pi / 4096.0, 0.7);
  for (const auto& [one, two] : {std::pair{rad, ticks}, std::pair{ticks, rad}}) {
    for (const QuantityDifference& quantity : differences(one, two)) {
      const bool of_log =
          quantity.of.name.starts_with("zero") || quantity.of.name.starts_with("ratio");
      EXPECT_EQ(quantity.sigma.has_value(), !of_log) << quantity.of.name;
      if (of_log) continue;
      EXPECT_LT(std::abs(quantity.difference), kSameDifference) << quantity.of.name;
    }
  }
}

// One joint's log in degrees: by design it follows another one to one, in rad.
TEST(RobotDifference, ACouplingIsTheSameInAnyUnit) {
  KinematicTree first = arm_of_four();
  first.joints[2].couplings.push_back({first.joints[1].channel, -1.0});
  KinematicTree other = first;
  other.joints[1].scale *= kRadPerDegree;
  other.joints[2].couplings.front().ratio *= kRadPerDegree;
  EXPECT_TRUE(match_robots(first, other).differences.empty());
  EXPECT_TRUE(match_robots(other, first).differences.empty());
  other.joints[2].couplings.front().ratio *= -1.0;
  EXPECT_EQ(match_robots(first, other).differences.size(), 1U);
}

TEST(RobotDifference, UncertaintyIsThatOfBothAndTwiceTheNoiseIsTwiceTheUncertainty) {
  const KinematicTree tree = arm_of_four();
  const auto one = differences(known_to(tree, 1e-4), known_to(tree, 1e-4));
  const auto two = differences(known_to(tree, 2e-4), known_to(tree, 2e-4));
  const auto uneven = differences(known_to(tree, 1e-4), known_to(tree, 1e-9));
  for (std::size_t i = 0; i < one.size(); ++i) {
    ASSERT_TRUE(one[i].sigma && two[i].sigma && uneven[i].sigma);
    EXPECT_NEAR(*two[i].sigma / *one[i].sigma, 2.0, 1e-6) << one[i].of.name;
    EXPECT_NEAR(*one[i].sigma / *uneven[i].sigma, std::sqrt(2.0), 1e-6) << one[i].of.name;
  }
  EXPECT_NEAR(*named(one, "ratio of q3").sigma, std::sqrt(2.0) * 1e-4, 1e-9);
}

TEST(RobotDifference, WhatWasHeldOrNotDeterminedIsNotCompared) {
  const KinematicTree tree = arm_of_four();
  const Calibration first = known_to(tree, 1e-4);
  Calibration held = first;
  held.parameters.clear();
  held.covariance.resize(0, 0);
  for (const QuantityDifference& one : differences(first, held)) {
    EXPECT_FALSE(one.sigma) << one.of.name;
    EXPECT_EQ(one.not_compared, "held as declared");
  }
  Calibration unknown = first;
  unknown.parameters[5].sigma.reset();  // turn x of q2
  const auto found = differences(first, unknown);
  EXPECT_EQ(named(found, "twist q1 - q2").not_compared, "not determined by the recording");
  EXPECT_TRUE(named(found, "twist q3 - q4").sigma);
  Calibration silent = first;
  silent.tree.joints[3].channel.clear();
  EXPECT_EQ(match_robots(first.tree, silent.tree).differences.size(), 2U);
}

// Turns and shifts are of the frame at a value of the joint: that frame is where the noise acts.
TEST(RobotDifference, TurnsAreOfTheFrameThatTheCalibrationNames) {
  Calibration one = known_to(arm_of_four(), 1e-4);
  one.covariance.setZero();
  one.covariance(10, 10) = 1e-8;  // turn x of q3
  Calibration turned = one;
  turned.joints[2].parameters_at = 0.5 * std::numbers::pi;  // there x is y
  Calibration as_y = one;
  as_y.covariance.setZero();
  as_y.covariance(11, 11) = 1e-8;
  const auto a = differences(one, turned), b = differences(one, as_y);
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(*a[i].sigma, *b[i].sigma, 1e-9);
}

TEST(RobotDifference, HolmIsStepwiseAndNeverFalls) {
  std::vector<QuantityDifference> all(4);
  const double p[] = {0.01, 0.04, 0.03, 0.005};
  std::vector<QuantityDifference*> pointers;
  for (std::size_t i = 0; i < 4; ++i) {
    all[i].sigma = 1.0;
    all[i].p_value = p[i];
    pointers.push_back(&all[i]);
  }
  judge_together(pointers, 0.05);
  EXPECT_DOUBLE_EQ(all[3].p_holm, 0.02);
  EXPECT_DOUBLE_EQ(all[0].p_holm, 0.03);
  EXPECT_DOUBLE_EQ(all[2].p_holm, 0.06);
  EXPECT_DOUBLE_EQ(all[1].p_holm, 0.06);
  EXPECT_TRUE(all[3].changed && all[0].changed);
  EXPECT_FALSE(all[2].changed || all[1].changed);
}

// All axes nearly parallel: the frames stand at other heights, and one link is longer.
TEST(RobotDifference, HeightsOfFramesAreNoChangeAndALongerLinkIs) {
  truth::FilmedRobotOptions options;
  options.kind = truth::RobotKind::kPlanar;
  KinematicTree tree = truth::draw_filmed_robot(options).tree;
  for (Joint& joint : tree.joints) joint.channel = joint.name;
  const Calibration first = known_to(tree, 1e-5);
  Calibration other = first;
  const Pose up{Eigen::Quaterniond::Identity(), {0.0, 0.0, 0.2}};
  Joint& base = other.tree.joints[0];
  base.T_parent_joint = base.T_parent_joint * up;
  other.tree.joints[1].T_parent_joint = up.inverse() * other.tree.joints[1].T_parent_joint;
  for (const QuantityDifference& one : differences(first, other))
    EXPECT_LT(std::abs(one.difference), 3.0 * *one.sigma) << one.of.name;
  Eigen::Vector3d& place = other.tree.joints[2].T_parent_joint.translation;
  place.head<2>() += 1e-3 * place.head<2>().normalized();
  const QuantityDifference longer = named(
      differences(first, other), "distance " + tree.joints[1].name + " - " + tree.joints[2].name);
  EXPECT_NEAR(longer.difference, 1e-3, 3.0 * *longer.sigma);
  EXPECT_GT(longer.difference, 5.0 * *longer.sigma);
}

TEST(RobotDifference, JointsAreFoundByTheirChannelsInAnyOrder) {
  const KinematicTree first = arm_of_four();
  KinematicTree other = first;
  std::swap(other.joints[1].channel, other.joints[2].channel);
  const RobotMatch match = match_robots(first, other);
  EXPECT_EQ(match.joint_of, (std::vector<int>{0, 2, 1, 3}));
  EXPECT_EQ(match.differences.size(), 3U) << "q2 and q3 carry one another the other way round";
  EXPECT_FALSE(match.by_order);
  other = first;
  for (Joint& joint : other.joints) joint.channel += "_measured";
  EXPECT_TRUE(match_robots(first, other).by_order);
  other.joints[0].type = JointType::kPrismatic;
  EXPECT_TRUE(match_robots(first, other).joint_of.empty());
}

}  // namespace
}  // namespace kinescope
