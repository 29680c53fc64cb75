// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/rotation_between.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "kinematics/core/pose.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

// Exact algebra on unit vectors: some tens of roundings.
constexpr double kExactAngle = 1e-13;
// Where the vectors are so nearly opposite that 1 + cosine has 4 digits left, 1.4e-6 of a
// quaternion's scalar part keeps them: 1e-10, and some roundings.
constexpr double kNearOpposite = 1e-9;

// Turns `from` to `to`, is of unit length, and turns by the angle between them and no more.
void expect_shortest(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double tolerance) {
  const Eigen::Quaterniond q = rotation_between(from, to);
  const Eigen::Vector3d a = from.normalized();
  const Eigen::Vector3d b = to.normalized();
  EXPECT_NEAR(q.norm(), 1.0, kExactAngle);
  EXPECT_LT((q * a - b).norm(), tolerance) << from.transpose() << " to " << to.transpose();
  const double angle = std::atan2(a.cross(b).norm(), a.dot(b));
  EXPECT_NEAR(log_rotation(q).norm(), angle, tolerance);
  EXPECT_NEAR(q.vec().dot(a), 0.0, tolerance);
}

RC_GTEST_PROP(RotationBetween, IsShortestForAnyDirectionsAndLengths, (unsigned seed)) {
  Rng rng(seed);
  const Eigen::Vector3d from = std::exp(rng.uniform(-5.0, 5.0)) * rng.unit3();
  const Eigen::Vector3d to = std::exp(rng.uniform(-5.0, 5.0)) * rng.unit3();
  // Within 0.01 rad of opposite a rounding is a hundred times as large in the axis.
  RC_PRE(from.normalized().dot(to.normalized()) > -0.99995);
  const double kAnyLengths = 100.0 * kExactAngle;
  expect_shortest(from, to, kAnyLengths);
}

RC_GTEST_PROP(RotationBetween, AgreesWithEigen, (unsigned seed)) {
  Rng rng(seed);
  const Eigen::Vector3d from = rng.unit3();
  const Eigen::Vector3d to = rng.unit3();
  RC_PRE(from.dot(to) > -0.99995);
  const Eigen::Quaterniond q = rotation_between(from, to);
  RC_ASSERT(angle_between(q, Eigen::Quaterniond::FromTwoVectors(from, to).normalized()) <
            kExactAngle);
}

// Both sides of the switch, and where the product of the vectors is rounding alone.
RC_GTEST_PROP(RotationBetween, IsShortestNearOpposite, (unsigned seed)) {
  Rng rng(seed);
  const Eigen::Vector3d from = rng.unit3();
  const Eigen::Vector3d across = from.cross(rng.unit3()).normalized();
  for (const double off : {1e-4, 1e-5, 1.5e-6, 1.4e-6, 1e-7, 1e-9, 1e-11, 1e-14}) {
    expect_shortest(from, exp_rotation((std::numbers::pi - off) * across) * from, kNearOpposite);
  }
}

TEST(RotationBetween, OppositeIsAHalfTurn) {
  for (int seed = 0; seed < 100; ++seed) {
    Rng rng = Rng::from_name("opposite", static_cast<std::uint64_t>(seed));
    const Eigen::Vector3d from = rng.normal3();
    expect_shortest(from, -2.0 * from, kExactAngle);
  }
  for (int k = 0; k < 3; ++k) {
    expect_shortest(Eigen::Vector3d::Unit(k), -Eigen::Vector3d::Unit(k), kExactAngle);
  }
}

TEST(RotationBetween, ZTurnsOverAboutX) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  EXPECT_LT((rotation_between(z, -z) * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitX()).norm(),
            kExactAngle);
}

TEST(RotationBetween, SameOrNoDirectionIsIdentity) {
  const Eigen::Vector3d v(1.0, -2.0, 0.5);
  const Eigen::Quaterniond identity = Eigen::Quaterniond::Identity();
  EXPECT_LT(angle_between(rotation_between(v, 3.0 * v), identity), kExactAngle);
  EXPECT_EQ(rotation_between(Eigen::Vector3d::Zero(), v).coeffs(), identity.coeffs());
  EXPECT_EQ(rotation_between(v, Eigen::Vector3d::Zero()).coeffs(), identity.coeffs());
}

}  // namespace
}  // namespace kinescope
