// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/denavit_hartenberg.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "kinematics/model/common_normal.h"
#include "tests/kinematics/model/random_tree.h"

namespace kinescope {
namespace {

constexpr double kSameDhPose = 1e-9;  // m and rad

// Elementary motions as 4x4 matrices, written down once more.
Eigen::Matrix4d turned(int axis, double angle) {
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  const int i = (axis + 1) % 3, j = (axis + 2) % 3;
  out(i, i) = out(j, j) = std::cos(angle);
  out(j, i) = std::sin(angle);
  out(i, j) = -out(j, i);
  return out;
}

Eigen::Matrix4d shifted(int axis, double by) {
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out(axis, 3) = by;
  return out;
}

// Forward kinematics by the rows of a table alone.
Eigen::Matrix4d by_table(const KinematicTree& tree, const DhChain& chain, DhConvention convention,
                         const Eigen::VectorXd& values) {
  Eigen::Matrix4d T = chain.base.matrix4();
  const std::vector<DhStep> rows = dh_rows(chain.steps, convention);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double q = values[chain.joints[k].value];
    const bool turns = tree.joints[chain.joints[k].index()].type == JointType::kRevolute;
    const Eigen::Matrix4d about =
        turned(2, rows[k].theta + (turns ? q : 0.0)) * shifted(2, rows[k].d + (turns ? 0.0 : q));
    const Eigen::Matrix4d between =
        shifted(0, rows[k].a) * turned(0, rows[k].alpha) * turned(1, rows[k].beta);
    T = T * (convention == DhConvention::kStandard ? about * between : between * about);
  }
  return T * chain.tool.matrix4();
}

double worst_dh_error(const KinematicTree& tree, Rng& rng) {
  double worst = 0.0;
  for (const LinkId tip : chain_tips(tree)) {
    const DhChain chain = dh_chain(tree, tip);
    for (int posture = 0; posture < 3; ++posture) {
      const Eigen::VectorXd q = random_values(rng, tree);
      const Eigen::Matrix4d T = forward_kinematics(tree, q)[tip.index()].matrix4();
      for (const DhConvention convention : {DhConvention::kStandard, DhConvention::kModified}) {
        worst = std::max(worst, (by_table(tree, chain, convention, q) - T).cwiseAbs().maxCoeff());
      }
    }
  }
  return worst;
}

// Two axes after each other on the way to a tip.
KinematicTree two_axes(const Pose& T_first_second, JointType second = JointType::kRevolute) {
  KinematicTree tree;
  tree.links = {{"base"}, {"link1"}, {"link2"}};
  for (int j = 0; j < 2; ++j) {
    Joint joint;
    joint.name = "joint" + std::to_string(j + 1);
    joint.type = j == 0 ? JointType::kRevolute : second;
    joint.parent = LinkId{j};
    joint.child = LinkId{j + 1};
    if (j == 1) joint.T_parent_joint = T_first_second;
    tree.joints.push_back(joint);
  }
  return tree;
}

RC_GTEST_PROP(DenavitHartenberg, TablesAloneGiveTheForwardKinematics, (unsigned seed)) {
  Rng rng(seed);
  const KinematicTree tree = random_tree(rng, 1 + rng.index(9), 0);
  RC_ASSERT(worst_dh_error(tree, rng) < kSameDhPose);
}

// Parallel, opposite, one line, and a little off all of those.
RC_GTEST_PROP(DenavitHartenberg, NearlyParallelAxesTooAreExact, (unsigned seed)) {
  Rng rng(seed);
  KinematicTree tree = random_tree(rng, 6, 0);
  for (Joint& joint : tree.joints) {
    const double off = rng.index(2) == 0 ? 0.0 : std::pow(10.0, rng.uniform(-12.0, -1.0));
    const double half_turn = rng.index(3) == 0 ? std::numbers::pi : 0.0;
    joint.axis = Eigen::Vector3d::UnitZ();
    joint.T_parent_joint.rotation =
        exp_rotation(Eigen::Vector3d::UnitX() * half_turn) * exp_rotation(rng.unit3() * off);
    const double across = rng.index(3) == 0 ? 0.0 : std::pow(10.0, rng.uniform(-9.0, 0.0));
    joint.T_parent_joint.translation =
        Eigen::Vector3d(across * rng.normal(), across * rng.normal(), rng.normal());
  }
  RC_ASSERT(worst_dh_error(tree, rng) < kSameDhPose);
}

TEST(DenavitHartenberg, ATextbookArm) {
  // Of two links of 0.3 and 0.2 m in a plane, and a wrist that turns across it.
  KinematicTree tree =
      two_axes({exp_rotation(Eigen::Vector3d::UnitX() * (0.5 * std::numbers::pi)), {0.3, 0, 0.1}});
  const DhChain chain = dh_chain(tree, LinkId{2});
  const DhStep standard = dh_rows(chain.steps, DhConvention::kStandard)[0];
  EXPECT_EQ(standard.normal, DhNormal::kCommon);
  EXPECT_NEAR(standard.a, 0.3, 1e-12);
  EXPECT_NEAR(standard.alpha, 0.5 * std::numbers::pi, 1e-12);
  EXPECT_NEAR(chain.base.translation.z(), 0.1, 1e-12);  // the foot of the normal
  const std::vector<DhStep> modified = dh_rows(chain.steps, DhConvention::kModified);
  EXPECT_EQ(modified[0].a, 0.0);
  EXPECT_NEAR(modified[1].a, 0.3, 1e-12);
  EXPECT_NEAR(modified[1].alpha, 0.5 * std::numbers::pi, 1e-12);
}

TEST(DenavitHartenberg, NearlyParallelAxesHaveAFifthNumberAndNoOffset) {
  constexpr double kTilt = 1e-3;
  const DhChain chain = dh_chain(
      two_axes({exp_rotation(Eigen::Vector3d::UnitY() * kTilt), {0.3, 0, 0.1}}), LinkId{2});
  EXPECT_EQ(chain.steps[0].normal, DhNormal::kParallel);
  EXPECT_EQ(chain.steps[0].d, 0.0);
  EXPECT_NEAR(chain.steps[0].beta, kTilt, 1e-12);
  EXPECT_NEAR(chain.steps[0].a, 0.3, 1e-3);
  const Pose line{Eigen::Quaterniond::Identity(), {1e-3, 0, 0.2}};
  EXPECT_EQ(dh_chain(two_axes(line), LinkId{2}).steps[0].normal, DhNormal::kOneLine);
  const DhChain slides = dh_chain(two_axes(line, JointType::kPrismatic), LinkId{2});
  EXPECT_EQ(slides.steps[0].normal, DhNormal::kDirection);
  EXPECT_EQ(slides.steps[0].a, 0.0);
}

TEST(DenavitHartenberg, TipsAreTheEndsThatAJointMoves) {
  KinematicTree tree = two_axes({});
  tree.links.push_back({"stand"});
  Joint fixed;
  fixed.name = "fixed";
  fixed.child = LinkId{3};
  tree.joints.push_back(fixed);
  EXPECT_EQ(chain_tips(tree), std::vector<LinkId>{LinkId{2}});
}

}  // namespace
}  // namespace kinescope
