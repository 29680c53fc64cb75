// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/axis_geometry.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr double kSameNumber = 1e-9;  // some tens of products of numbers of order one

// One chain by Denavit and Hartenberg: distance, twist, offset and angle at each axis.
struct GivenStep {
  double distance = 0.0, twist = 0.0, offset = 0.0, angle = 0.0;
};

Pose moved(double angle, double along_z, double along_x, double twist) {
  Pose about_z{exp_rotation({0, 0, angle}), {0, 0, along_z}};
  Pose about_x{exp_rotation({twist, 0, 0}), {along_x, 0, 0}};
  return about_z * about_x;
}

std::vector<PlacedAxis> chain_of(const std::vector<GivenStep>& steps,
                                 const std::vector<JointType>& types) {
  std::vector<PlacedAxis> out;
  Pose T;
  for (std::size_t k = 0; k < types.size(); ++k) {
    if (k > 0) {
      const GivenStep& s = steps[k - 1];
      T = T * moved(s.angle, s.offset, s.distance, s.twist);
    }
    out.push_back(
        {types[k], T.translation, T.rotation * Eigen::Vector3d::UnitZ(), static_cast<int>(k) - 1});
  }
  return out;
}

std::vector<GivenStep> random_steps(std::size_t axes, Rng& rng) {
  std::vector<GivenStep> out;
  for (std::size_t k = 0; k + 1 < axes; ++k)
    out.push_back({rng.uniform(0.1, 0.4), rng.uniform(0.5, 2.5), rng.uniform(-0.3, 0.3),
                   rng.uniform(-3.0, 3.0)});
  return out;
}

double value_at(const AxisLayout& layout, const Eigen::VectorXd& values, AxisQuantity of) {
  for (std::size_t i = 0; i < layout.quantities.size(); ++i)
    if (layout.quantities[i] == of) return values[static_cast<Eigen::Index>(i)];
  ADD_FAILURE() << "no such quantity";
  return std::nan("");
}

const std::vector<JointType> kFiveTurns(5, JointType::kRevolute);

TEST(AxisGeometry, GivesBackTheNumbersThatAChainWasMadeOf) {
  Rng rng = Rng::from_name("axis geometry dh");
  const std::vector<GivenStep> steps = random_steps(5, rng);
  const std::vector<PlacedAxis> axes = chain_of(steps, kFiveTurns);
  const AxisLayout layout = axis_layout(axes);
  const Eigen::VectorXd values = axis_values(layout, axes);
  for (int k = 0; k < 4; ++k) {
    const GivenStep& step = steps[static_cast<std::size_t>(k)];
    EXPECT_NEAR(value_at(layout, values, {AxisQuantityKind::kDistance, k, k + 1}), step.distance,
                kSameNumber);
    EXPECT_NEAR(value_at(layout, values, {AxisQuantityKind::kTwist, k, k + 1}), step.twist,
                kSameNumber);
    if (k == 0) continue;  // where frames hide the first axis' offset and zero
    EXPECT_NEAR(value_at(layout, values, {AxisQuantityKind::kOffset, k, k + 1}), step.offset,
                kSameNumber);
    EXPECT_NEAR(value_at(layout, values, {AxisQuantityKind::kAngle, k, k + 1}), step.angle,
                kSameNumber);
  }
}

// 4 numbers a line, 2 a direction, less the 6 of the frame (Everett, Driels and Mooring 1987).
TEST(AxisGeometry, HasAsManyNumbersAsTheRobotHasFreedoms) {
  Rng rng = Rng::from_name("axis geometry count");
  using enum JointType;
  const auto count = [&](const std::vector<JointType>& types) {
    return axis_layout(chain_of(random_steps(types.size(), rng), types)).quantities.size();
  };
  EXPECT_EQ(count({kRevolute, kRevolute}), 2U);
  std::vector<GivenStep> begins_parallel = random_steps(5, rng);
  begins_parallel[0].twist = 0.1;
  begins_parallel[0].distance = 0.1;
  EXPECT_EQ(axis_layout(chain_of(begins_parallel, kFiveTurns)).quantities.size(), 14U);
  EXPECT_EQ(count(kFiveTurns), 14U);
  EXPECT_EQ(count({kRevolute, kRevolute, kPrismatic, kRevolute}), 8U);
  EXPECT_EQ(count({kPrismatic, kPrismatic, kRevolute, kRevolute}), 6U);
  EXPECT_EQ(count({kPrismatic, kPrismatic, kPrismatic}), 3U);
  EXPECT_TRUE(axis_layout({}).quantities.empty());
  EXPECT_EQ(count({kRevolute}), 0U);
}

std::vector<PlacedAxis> seen_from_elsewhere(std::vector<PlacedAxis> axes, Rng& rng) {
  const Pose T{exp_rotation(rng.unit3() * rng.uniform(0.0, 3.0)), rng.unit3()};
  for (PlacedAxis& axis : axes) {
    axis.direction = T.rotation * axis.direction;
    axis.point = T * axis.point + rng.uniform(-0.5, 0.5) * axis.direction;
    if (axis.type == JointType::kPrismatic) axis.point += rng.unit3();
  }
  return axes;
}

TEST(AxisGeometry, KnowsNeitherTheBaseNorWhereOnItsAxisAFrameStands) {
  Rng rng = Rng::from_name("axis geometry frames");
  using enum JointType;
  std::vector<GivenStep> parallel = random_steps(4, rng);
  parallel[0].twist = 0.02;
  parallel[1].twist = std::numbers::pi - 0.01;
  const std::vector<std::vector<PlacedAxis>> robots{
      chain_of(random_steps(5, rng), kFiveTurns), chain_of(parallel, {4, kRevolute}),
      chain_of(random_steps(4, rng), {kRevolute, kPrismatic, kRevolute, kRevolute}),
      chain_of(random_steps(4, rng), {kPrismatic, kPrismatic, kRevolute, kRevolute})};
  for (const auto& axes : robots) {
    const AxisLayout layout = axis_layout(axes);
    const auto other = seen_from_elsewhere(axes, rng);
    const AxisLayout there = axis_layout(other);
    EXPECT_EQ(layout.quantities, there.quantities);
    const Eigen::VectorXd one = axis_values(layout, axes), two = axis_values(layout, other);
    for (Eigen::Index i = 0; i < one.size(); ++i)
      EXPECT_NEAR(std::remainder(one[i] - two[i], 2.0 * std::numbers::pi), 0.0, 1e-8) << i;
    EXPECT_TRUE(axis_values_by_height(layout, axes).isZero(0.0));
  }
}

// Nothing says at which height the distance of axes is meant that are all nearly parallel.
TEST(AxisGeometry, DistancesOfParallelAxesFollowTheHeightByTheirTilt) {
  constexpr double kTilt = 0.01;
  std::vector<PlacedAxis> axes{
      {JointType::kRevolute, {0, 0, 0}, {0, 0, 1}, -1},
      {JointType::kRevolute, {0.3, 0, 0}, {std::sin(kTilt), 0, std::cos(kTilt)}, 0}};
  const AxisLayout layout = axis_layout(axes);
  const Eigen::VectorXd by = axis_values_by_height(layout, axes);
  EXPECT_NEAR(value_at(layout, by, {AxisQuantityKind::kDistance, 0, 1}), std::tan(kTilt), 1e-6);
  axes[1].direction = Eigen::Vector3d::UnitZ();
  EXPECT_NEAR(axis_values_by_height(axis_layout(axes), axes).norm(), 0.0, 1e-8);
}

// Both descriptions of a pair agree on the distance at its nearest, and stay smooth in between.
TEST(AxisGeometry, AShiftOfAnAxisIsAShiftOfItsDistanceInEitherDescription) {
  for (const double degrees : {0.0, 5.0, 10.0, 20.0, 90.0}) {
    GivenStep step{0.3, degrees * std::numbers::pi / 180.0, 0.1, 0.4};
    const std::vector<GivenStep> steps{step, {0.2, 1.5, 0.0, 0.3}, {0.2, 1.5, 0.1, 0.2}};
    std::vector<GivenStep> longer = steps;
    longer[0].distance += 1e-3;
    const std::vector<JointType> types(4, JointType::kRevolute);
    const auto axes = chain_of(steps, types);
    const AxisLayout layout = axis_layout(axes);
    const Eigen::VectorXd change =
        axis_values(layout, chain_of(longer, types)) - axis_values(layout, axes);
    EXPECT_NEAR(value_at(layout, change, {AxisQuantityKind::kDistance, 0, 1}), 1e-3, 5e-5)
        << degrees;
  }
}

TEST(AxisGeometry, TwoJointsOnOneLineHaveNoZeroOfTheirOwn) {
  const std::vector<PlacedAxis> axes{{JointType::kRevolute, {0, 0, 0}, {0, 0, 1}, -1},
                                     {JointType::kRevolute, {1e-4, 0, 1}, {0, 0, 1}, 0},
                                     {JointType::kRevolute, {0, 0.2, 1}, {1, 0, 0}, 1}};
  const AxisLayout layout = axis_layout(axes);
  EXPECT_EQ(layout.steps[1], AxisStep::kCoaxial);
  for (const AxisQuantity& q : layout.quantities)
    EXPECT_NE(q, (AxisQuantity{AxisQuantityKind::kAngle, 0, 1}));
  EXPECT_TRUE(axis_values(layout, axes).allFinite());
}

TEST(AxisGeometry, AxesOfATreeStandByThatOfTheirParent) {
  KinematicTree tree;
  tree.links = {{"base"}, {"trunk"}, {"plate"}, {"left"}, {"right"}};
  const auto joint = [](const char* name, JointType type, int parent, int child,
                        const Eigen::Vector3d& place, const Eigen::Vector3d& axis) {
    Joint out;
    out.name = name;
    out.type = type;
    out.parent = LinkId{parent};
    out.child = LinkId{child};
    out.T_parent_joint.translation = place;
    out.axis = axis;
    return out;
  };
  tree.joints = {joint("a", JointType::kRevolute, 0, 1, {0, 0, 0.1}, {0, 0, 1}),
                 joint("weld", JointType::kFixed, 1, 2, {0, 0, 0.2}, {0, 0, 1}),
                 joint("b", JointType::kRevolute, 2, 3, {0.1, 0, 0}, {1, 0, 0}),
                 joint("c", JointType::kPrismatic, 2, 4, {-0.1, 0, 0}, {0, 1, 0})};
  std::vector<JointId> joints;
  const auto axes = placed_axes(tree, Eigen::VectorXd::Zero(4), joints);
  ASSERT_EQ(axes.size(), 3U);
  EXPECT_EQ(joints, (std::vector<JointId>{JointId{0}, JointId{2}, JointId{3}}));
  EXPECT_EQ(axes[1].parent, 0);
  EXPECT_EQ(axes[2].parent, 0);
  EXPECT_NEAR((axes[1].point - Eigen::Vector3d(0.1, 0, 0.3)).norm(), 0.0, kSameNumber);
}

}  // namespace
}  // namespace kinescope
