// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/chain.h"

#include <gtest/gtest.h>

#include "calib/bundle/folds.h"
#include "calib/bundle/pose_block.h"
#include "kinematics/core/rng.h"
#include "tests/calib/bundle/random_pose.h"

namespace kinescope::bundle {
namespace {

constexpr double kStep = 1e-6;
constexpr double kSlopeTolerance = 1e-8;  // central differences of functions of order one

struct Chain {
  Pose camera_base;
  std::vector<ChainJoint> joints;
  Pose mount;
  [[nodiscard]] Pose end() const {
    return differentiate_chain(camera_base, joints, mount).T_camera_marker;
  }
};

Chain random_chain(Rng& rng) {
  Chain chain{random_pose(rng, 1.0, 0.5), {}, random_pose(rng, 1.0, 0.5)};
  for (const JointType type :
       {JointType::kRevolute, JointType::kPrismatic, JointType::kFixed, JointType::kRevolute}) {
    chain.joints.push_back({type, rng.unit3(), random_pose(rng, 1.0, 0.5), rng.normal()});
  }
  return chain;
}

// The 6-vector by which the end moves when `change(h)` is applied, per h.
template <typename Change>
Vector6d slope(const Chain& chain, Change change) {
  Chain plus = chain;
  Chain minus = chain;
  change(plus, kStep);
  change(minus, -kStep);
  return log_pose(minus.end().inverse() * plus.end()) / (2.0 * kStep);
}

TEST(Chain, DerivativesAgreeWithDifferences) {
  Rng rng = Rng::from_name("chain derivatives");
  for (int trial = 0; trial < 20; ++trial) {
    const Chain chain = random_chain(rng);
    const auto exact = differentiate_chain(chain.camera_base, chain.joints, chain.mount);
    for (int i = 0; i < 6; ++i) {
      const Vector6d axis = Vector6d::Unit(i);
      EXPECT_LT(
          (slope(chain,
                 [&](Chain& c, double h) { c.camera_base = c.camera_base * exp_pose(h * axis); }) -
           exact.d_camera_base.col(i))
              .norm(),
          kSlopeTolerance);
      EXPECT_LT(
          (slope(chain, [&](Chain& c, double h) { c.mount = c.mount * exp_pose(h * axis); }) - axis)
              .norm(),
          kSlopeTolerance);
      for (std::size_t k = 0; k < chain.joints.size(); ++k) {
        const auto move = [&](Chain& c, double h) {
          c.joints[k].T_parent_joint = c.joints[k].T_parent_joint * exp_pose(h * axis);
        };
        EXPECT_LT((slope(chain, move) - exact.d_joint[k].col(i)).norm(), kSlopeTolerance);
      }
    }
    for (std::size_t k = 0; k < chain.joints.size(); ++k) {
      const auto move = [&](Chain& c, double h) { c.joints[k].value += h; };
      EXPECT_LT((slope(chain, move) - exact.d_value[k]).norm(), kSlopeTolerance) << k;
    }
  }
}

TEST(Chain, ItsPoseAloneIsTheSame) {
  Rng rng = Rng::from_name("chain alone");
  for (int trial = 0; trial < 20; ++trial) {
    Chain chain = random_chain(rng);
    for (ChainJoint& joint : chain.joints) {
      joint.upward = rng.uniform() < 0.5;
      for (int i = 0; i < 6; ++i) joint.correction[i] = 0.1 * rng.normal();
    }
    chain.joints.front().correction.setZero();
    const Pose alone = compose_chain(chain.camera_base, chain.joints, chain.mount);
    EXPECT_LT(log_pose(chain.end().inverse() * alone).norm(), 1e-12);
  }
}

TEST(PoseManifold, PlusAndMinusAreInverse) {
  Rng rng = Rng::from_name("pose manifold");
  const PoseManifold full({true, true, true, true, true, true});
  for (int trial = 0; trial < 50; ++trial) {
    const PoseBlock x = to_block(random_pose(rng, 1.0, 0.5));
    Vector6d d;
    d << rng.normal3(0.3), rng.normal3(0.3);
    PoseBlock y{};
    ASSERT_TRUE(full.Plus(x.data(), d.data(), y.data()));
    Vector6d back;
    ASSERT_TRUE(full.Minus(y.data(), x.data(), back.data()));
    EXPECT_LT((back - d).norm(), 1e-12);
    // The step is a right perturbation by the full angle.
    EXPECT_LT(
        log_pose((from_block(x.data()) * exp_pose(d)).inverse() * from_block(y.data())).norm(),
        1e-12);
  }
}

TEST(PoseManifold, JacobiansAgreeWithDifferences) {
  Rng rng = Rng::from_name("pose manifold jacobians");
  const TangentMask mask{true, true, false, true, true, false};
  const PoseManifold manifold(mask);
  ASSERT_EQ(manifold.TangentSize(), 4);
  for (int trial = 0; trial < 20; ++trial) {
    const PoseBlock x = to_block(random_pose(rng, 1.0, 0.5));
    Eigen::Matrix<double, 7, 4, Eigen::RowMajor> plus;
    Eigen::Matrix<double, 4, 7, Eigen::RowMajor> minus;
    ASSERT_TRUE(manifold.PlusJacobian(x.data(), plus.data()));
    ASSERT_TRUE(manifold.MinusJacobian(x.data(), minus.data()));
    EXPECT_LT((minus * plus - Eigen::Matrix4d::Identity()).norm(), 1e-12);
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector4d h = kStep * Eigen::Vector4d::Unit(i);
      const Eigen::Vector4d opposite = -h;
      PoseBlock a{};
      PoseBlock b{};
      ASSERT_TRUE(manifold.Plus(x.data(), h.data(), a.data()));
      ASSERT_TRUE(manifold.Plus(x.data(), opposite.data(), b.data()));
      for (int r = 0; r < 7; ++r) {
        const auto row = static_cast<std::size_t>(r);
        EXPECT_NEAR((a[row] - b[row]) / (2.0 * kStep), plus(r, i), kSlopeTolerance);
      }
    }
  }
}

TEST(Folds, AreBoxesOfPostureOfEqualSize) {
  Eigen::MatrixXd features(400, 2);
  Rng rng = Rng::from_name("folds");
  for (Eigen::Index i = 0; i < features.rows(); ++i) {
    features.row(i) << rng.uniform(), rng.uniform(0.0, 100.0);
  }
  const std::vector<int> fold = assign_folds(features, 5);
  std::vector<int> count(5, 0);
  // Neighbours in posture share a fold far more often than chance (1 in 5).
  int same = 0;
  int neighbours = 0;
  for (std::size_t i = 0; i < fold.size(); ++i) {
    ++count[static_cast<std::size_t>(fold[i])];
    for (std::size_t k = 0; k < i; ++k) {
      const auto a = static_cast<Eigen::Index>(i);
      const auto b = static_cast<Eigen::Index>(k);
      const double distance =
          std::hypot(features(a, 0) - features(b, 0), (features(a, 1) - features(b, 1)) / 100.0);
      if (distance > 0.03) continue;
      ++neighbours;
      same += fold[i] == fold[k] ? 1 : 0;
    }
  }
  for (const int c : count) EXPECT_NEAR(c, 80, 10);
  EXPECT_GT(static_cast<double>(same) / neighbours, 0.7);
  EXPECT_EQ(assign_folds(Eigen::MatrixXd(10, 0), 5).size(), 10U);
}

}  // namespace
}  // namespace kinescope::bundle
