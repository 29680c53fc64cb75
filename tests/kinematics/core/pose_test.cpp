// SPDX-License-Identifier: Apache-2.0
//
// Laws, and the conventions of pose.h: these tests fail if one of them changes.
#include "kinematics/core/pose.h"

#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr double kPi = std::numbers::pi;
// Exact algebra on numbers of size 1 to 10: some tens of roundings.
constexpr double kExact = 1e-13;
// Derivatives by central differences with step 1e-6: error of second order, 1e-12, over rounding
// 1e-16 / 1e-6.
constexpr double kStep = 1e-6;
constexpr double kDifference = 1e-8;

Vector6d random_tangent(Rng& rng, double angle) {
  Vector6d d;
  d << rng.unit3() * angle, rng.normal3();
  return d;
}

double distance(const Pose& a, const Pose& b) { return (a.matrix4() - b.matrix4()).norm(); }

/// Zero, around the switch to the series, everyday, and near half a turn.
const std::vector<double> kAngles = {0.0,  1e-12, 1e-7, 0.99e-4,   1.01e-4,
                                     1e-2, 1.0,   3.0,  kPi - 1e-6};

TEST(PoseConventions, TangentIsRotationThenTranslation) {
  Vector6d d;
  d << 0, 0, 0.5 * kPi, 0, 0, 0;
  EXPECT_LT((exp_pose(d) * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0, 1, 0)).norm(), kExact);
  d << 0, 0, 0, 1, 2, 3;
  EXPECT_LT((exp_pose(d).translation - Eigen::Vector3d(1, 2, 3)).norm(), kExact);
  EXPECT_LT(angle_between(exp_pose(d).rotation, Eigen::Quaterniond::Identity()), kExact);
}

TEST(PoseConventions, InnerNamesMeet) {
  const Pose T_a_b{exp_rotation({0, 0, 0.5 * kPi}), {1, 0, 0}};
  const Pose T_b_c{Eigen::Quaterniond::Identity(), {0, 2, 0}};
  // The origin of c: two along b's y, which points along a's minus x.
  EXPECT_LT(((T_a_b * T_b_c).translation - Eigen::Vector3d(-1, 0, 0)).norm(), kExact);
  const Eigen::Vector3d p_b(0.3, 0.2, 0.1);
  EXPECT_LT((T_a_b * p_b - Eigen::Vector3d(1 - 0.2, 0.3, 0.1)).norm(), kExact);
}

TEST(PoseConventions, ExponentialCarriesTheTranslationAlongTheTurn) {
  // A quarter turn about z at unit speed along x ends at (2/pi, 2/pi), not at (1, 0).
  Vector6d d;
  d << 0, 0, 0.5 * kPi, 1, 0, 0;
  EXPECT_LT((exp_pose(d).translation - Eigen::Vector3d(2 / kPi, 2 / kPi, 0)).norm(), kExact);
}

TEST(PoseConventions, RotationToAxisTurnsZ) {
  Rng rng = Rng::from_name("PoseConventions.RotationToAxis");
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d axis = rng.unit3();
    EXPECT_LT((rotation_to_axis(3.0 * axis) * Eigen::Vector3d::UnitZ() - axis).norm(), kExact);
    // By the shortest way: the turn is about an axis at right angles to z.
    EXPECT_NEAR(log_rotation(rotation_to_axis(axis)).z(), 0.0, kExact);
  }
  EXPECT_LT((rotation_to_axis(-Eigen::Vector3d::UnitZ()) * Eigen::Vector3d::UnitZ() +
             Eigen::Vector3d::UnitZ())
                .norm(),
            kExact);
}

TEST(PoseLaws, ExponentialAndLogarithmAreInverse) {
  Rng rng = Rng::from_name("PoseLaws.ExpLog");
  for (const double angle : kAngles) {
    for (int i = 0; i < 20; ++i) {
      const Vector6d d = random_tangent(rng, angle);
      // Near half a turn the axis is lost in cos(angle/2): the error grows as 1 / (pi - angle).
      const double tolerance = angle > 3.1 ? 1e-9 : kExact;
      EXPECT_LT((log_pose(exp_pose(d)) - d).norm(), tolerance) << "angle " << angle;
      EXPECT_LT((log_rotation(exp_rotation(d.head<3>())) - d.head<3>()).norm(), tolerance);
      EXPECT_LT(distance(exp_pose(log_pose(exp_pose(d))), exp_pose(d)), kExact);
    }
  }
}

TEST(PoseLaws, LogarithmIsTheShortWay) {
  const Eigen::Vector3d long_way = log_rotation(exp_rotation({0, 0, 1.5 * kPi}));
  EXPECT_LT((long_way - Eigen::Vector3d(0, 0, -0.5 * kPi)).norm(), kExact);
  Eigen::Quaterniond q = exp_rotation({0.1, 0.2, 0.3});
  q.coeffs() *= -1.0;
  EXPECT_LT((log_rotation(q) - Eigen::Vector3d(0.1, 0.2, 0.3)).norm(), kExact) << "both signs of q";
}

TEST(PoseLaws, Group) {
  Rng rng = Rng::from_name("PoseLaws.Group");
  for (int i = 0; i < 100; ++i) {
    const Pose a = exp_pose(random_tangent(rng, rng.uniform(0, 3)));
    const Pose b = exp_pose(random_tangent(rng, rng.uniform(0, 3)));
    const Pose c = exp_pose(random_tangent(rng, rng.uniform(0, 3)));
    EXPECT_LT(distance(a * a.inverse(), Pose{}), kExact);
    EXPECT_LT(distance(a.inverse() * a, Pose{}), kExact);
    EXPECT_LT(distance((a * b) * c, a * (b * c)), kExact);
    EXPECT_LT(distance(a * Pose{}, a), kExact);
    EXPECT_LT(((a * b).matrix4() - a.matrix4() * b.matrix4()).norm(), kExact);
    EXPECT_LT(distance(pose_from_matrix(a.matrix4()), a), kExact);
  }
}

TEST(PoseLaws, AdjointMovesAPerturbationToTheLeft) {
  Rng rng = Rng::from_name("PoseLaws.Adjoint");
  for (int i = 0; i < 100; ++i) {
    const Pose T = exp_pose(random_tangent(rng, rng.uniform(0, 3)));
    const Vector6d d = random_tangent(rng, rng.uniform(0, 1));
    EXPECT_LT(distance(exp_pose(adjoint(T) * d) * T, T * exp_pose(d)), 10 * kExact);
  }
}

TEST(PoseLaws, LeftJacobianIsADerivative) {
  // exp(w + dw) = exp(V(w) dw) exp(w) to first order.
  Rng rng = Rng::from_name("PoseLaws.LeftJacobian");
  for (const double angle : kAngles) {
    if (angle > 3.1) continue;
    const Eigen::Vector3d w = rng.unit3() * angle;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d dw = Eigen::Vector3d::Unit(k) * kStep;
      const Eigen::Vector3d numeric =
          log_rotation(exp_rotation(w + dw) * exp_rotation(w - dw).conjugate()) / (2.0 * kStep);
      EXPECT_LT((numeric - left_jacobian(w).col(k)).norm(), kDifference) << "angle " << angle;
    }
  }
}

TEST(PoseLaws, SkewIsTheCrossProduct) {
  const Eigen::Vector3d v(1, 2, 3);
  const Eigen::Vector3d w(-4, 5, 0.5);
  EXPECT_EQ((skew(v) * w).eval(), v.cross(w));
}

TEST(PoseLaws, AngleBetween) {
  const Eigen::Quaterniond a = exp_rotation({0.2, -0.4, 0.1});
  EXPECT_NEAR(angle_between(a, a * exp_rotation({0, 0.3, 0})), 0.3, kExact);
  EXPECT_NEAR(angle_between(a, a * exp_rotation({0, 1e-9, 0})), 1e-9, 1e-16);
}

}  // namespace
}  // namespace kinescope
