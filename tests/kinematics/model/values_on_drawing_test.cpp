// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/values_on_drawing.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

KinematicTree chain_of(const std::vector<JointType>& types, Rng& rng, bool right_angles) {
  KinematicTree tree;
  tree.links.push_back({"base"});
  for (std::size_t k = 0; k < types.size(); ++k) {
    Joint joint;
    joint.name = "q" + std::to_string(k + 1);
    joint.type = types[k];
    joint.parent = LinkId{static_cast<int>(k)};
    joint.child = LinkId{static_cast<int>(k) + 1};
    const double quarter = 0.5 * std::numbers::pi * rng.index(4);
    const Eigen::Vector3d turn =
        right_angles ? Eigen::Vector3d(quarter, 0.0, 0.0) : rng.unit3() * rng.uniform(0.4, 2.7);
    joint.T_parent_joint = {exp_rotation(turn), rng.normal3(0.2)};
    tree.joints.push_back(joint);
    tree.links.push_back({joint.name + "_link"});
  }
  return tree;
}

std::vector<PlacedAxis> axes_at(const KinematicTree& tree, const Eigen::VectorXd& values) {
  std::vector<JointId> joints;
  return placed_axes(tree, values, joints);
}

// The same robot, counted from these values, some joints the other way, seen from anywhere, and
// found slightly wrong.
std::vector<PlacedAxis> found_at(const KinematicTree& tree, const Eigen::VectorXd& values,
                                 const std::vector<double>& directions, double error, Rng& rng) {
  std::vector<PlacedAxis> out = axes_at(tree, values);
  const Pose seen{exp_rotation(rng.unit3()), rng.normal3(1.0)};
  for (std::size_t k = 0; k < out.size(); ++k) {
    out[k].point = seen * out[k].point + rng.normal3(error);
    const Eigen::Vector3d tilted = seen.rotation * out[k].direction + rng.normal3(error);
    out[k].direction = directions[k] * tilted.normalized();
  }
  return out;
}

void expect_the_values(const std::vector<JointType>& types, bool right_angles, double error,
                       const std::string& name) {
  Rng rng = Rng::from_name(name);
  const auto joints = static_cast<Eigen::Index>(types.size());
  for (int k = 0; k < 10; ++k) {
    const KinematicTree tree = chain_of(types, rng, right_angles);
    Eigen::VectorXd zeros(joints);
    std::vector<double> directions;
    for (Eigen::Index j = 0; j < joints; ++j) {
      zeros[j] = rng.uniform(-3.0, 3.0) *
                 (types[static_cast<std::size_t>(j)] == JointType::kRevolute ? 1.0 : 0.1);
      directions.push_back(rng.index(2) == 0 ? 1.0 : -1.0);
    }
    const std::vector<ValueOnDrawing> values = values_on_drawing(
        found_at(tree, zeros, directions, error, rng), axes_at(tree, Eigen::VectorXd::Zero(joints)),
        std::vector<bool>(types.size(), true));
    for (std::size_t j = 0; j < types.size(); ++j) {
      const ValueOnDrawing& value = values[j];
      if (value.direction_told) {
        EXPECT_EQ(value.direction, directions[j]) << name << " " << k << " joint " << j;
      }
      const bool inner = j > 0 && j + 1 < types.size();
      if (!value.zero_told || !inner) continue;
      if (value.direction != directions[j]) continue;
      const double off = value.zero - zeros[static_cast<Eigen::Index>(j)];
      EXPECT_LT(std::abs(std::remainder(off, 2.0 * std::numbers::pi)), 0.02 + 30.0 * error)
          << name << " " << k << " joint " << j;
    }
  }
}

TEST(ValuesOnDrawing, AreThoseThatTheReadingsWereMadeOf) {
  const std::vector<JointType> turns(6, JointType::kRevolute);
  expect_the_values(turns, false, 0.0, "values on drawing");
  expect_the_values(turns, false, 1e-3, "values on drawing, found with errors");
  std::vector<JointType> slides = turns;
  slides[2] = JointType::kPrismatic;
  expect_the_values(slides, false, 1e-3, "values on drawing, one slides");
  expect_the_values(turns, true, 1e-3, "values on drawing, right angles");
}

// Directions and zeros of an arm whose axes are oblique are told but for the ends.
TEST(ValuesOnDrawing, AreToldWhereNothingIsRegular) {
  Rng rng = Rng::from_name("values on drawing told");
  const std::vector<JointType> turns(5, JointType::kRevolute);
  const KinematicTree tree = chain_of(turns, rng, false);
  const Eigen::VectorXd zeros = Eigen::VectorXd::Constant(5, 0.7);
  const std::vector<double> directions{1.0, -1.0, -1.0, 1.0, -1.0};
  const auto values =
      values_on_drawing(found_at(tree, zeros, directions, 1e-4, rng),
                        axes_at(tree, Eigen::VectorXd::Zero(5)), std::vector<bool>(5, true));
  for (std::size_t j = 1; j < 4; ++j) {
    EXPECT_TRUE(values[j].direction_told) << j;
    EXPECT_EQ(values[j].direction, directions[j]) << j;
    EXPECT_TRUE(values[j].zero_told) << j;
    EXPECT_NEAR(values[j].zero, 0.7, 0.01) << j;
  }
  EXPECT_FALSE(values.front().zero_told);
  EXPECT_FALSE(values.back().zero_told);
}

// One of parallel axes that counts the other way is told by its neighbours.
TEST(ValuesOnDrawing, TellWhichOfParallelAxesCountsTheOtherWay) {
  Rng rng = Rng::from_name("values on drawing parallel");
  KinematicTree tree = chain_of(std::vector<JointType>(4, JointType::kRevolute), rng, false);
  for (Joint& joint : tree.joints) joint.T_parent_joint.rotation.setIdentity();
  const std::vector<double> directions{1.0, 1.0, -1.0, 1.0};
  const auto values =
      values_on_drawing(found_at(tree, Eigen::VectorXd::Constant(4, 0.4), directions, 1e-4, rng),
                        axes_at(tree, Eigen::VectorXd::Zero(4)), std::vector<bool>(4, true));
  for (std::size_t j = 0; j < 4; ++j) EXPECT_EQ(values[j].direction, directions[j]) << j;
  EXPECT_NEAR(values[1].zero, 0.4, 0.01);
  EXPECT_NEAR(values[2].zero, 0.4, 0.01);
}

// Of what is declared only the unit is known to be right: its direction stays as drawn.
TEST(ValuesOnDrawing, LeaveDirectionsThatAreNotAskedFor) {
  Rng rng = Rng::from_name("values on drawing closed");
  const KinematicTree tree = chain_of(std::vector<JointType>(3, JointType::kRevolute), rng, false);
  const auto values =
      values_on_drawing(found_at(tree, Eigen::VectorXd::Zero(3), {1.0, -1.0, 1.0}, 0.0, rng),
                        axes_at(tree, Eigen::VectorXd::Zero(3)), {false, true, false});
  EXPECT_EQ(values[0].direction, 1.0);
  EXPECT_EQ(values[1].direction, -1.0);
  EXPECT_EQ(values[2].direction, 1.0);
  EXPECT_FALSE(values[0].direction_told);
}

}  // namespace
}  // namespace kinescope
