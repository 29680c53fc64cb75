// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/link_evidence.h"

#include <array>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr int kChainJoints = 5;
constexpr double kLevel = 0.01;
constexpr int kTrials = 2000;

Eigen::MatrixXd random_covariance(Rng& rng) {
  Eigen::MatrixXd A(kChainJoints, kChainJoints);
  for (Eigen::Index i = 0; i < A.size(); ++i) A.data()[i] = rng.normal();
  return A * A.transpose() + 0.1 * Eigen::MatrixXd::Identity(kChainJoints, kChainJoints);
}

Eigen::VectorXd normals(Rng& rng) {
  Eigen::VectorXd out(kChainJoints);
  for (double& value : out) value = rng.normal();
  return out;
}

/// A strong contact on each link: at the stated level it is put on too far a link as often as the
/// level says for each joint beyond, at most.
TEST(LinkEvidence, ErrsAtTheStatedLevel) {
  Rng rng = Rng::from_name("link_evidence");
  for (int link = 0; link < kChainJoints; ++link) {
    int too_far = 0;
    int too_near = 0;
    double probability = 0.0;
    for (int t = 0; t < kTrials; ++t) {
      const Eigen::MatrixXd S = random_covariance(rng);
      Eigen::VectorXd torque = S.llt().matrixL() * normals(rng);
      torque.head(link + 1) += 300.0 * normals(rng).head(link + 1);
      torque[link] += 300.0;
      const std::array looks{
          JointAnswers{.squares = joint_answers(torque, S).cwiseAbs2(), .count = 1}};
      const LinkEvidence evidence = link_evidence(looks, kLevel);
      too_far += evidence.link > link ? 1 : 0;
      too_near += evidence.link < link ? 1 : 0;
      probability += evidence.probability[link] / kTrials;
      ASSERT_NEAR(evidence.probability.sum(), 1.0, 1e-12);
    }
    // Four sigma of a count about (joints beyond) x level x trials.
    const double expected = (kChainJoints - 1 - link) * kLevel * kTrials;
    EXPECT_LE(too_far, expected + 4.0 * std::sqrt(expected) + 1.0) << link;
    EXPECT_LE(too_near, 0.02 * kTrials) << link;
    EXPECT_GT(probability, 0.7) << link;
  }
}

/// A torque that changes its sign has no mean; its segments tell.
TEST(LinkEvidence, SegmentsShowWhatTheMeanHides) {
  JointAnswers mean{.squares = Eigen::RowVectorXd::Zero(3), .count = 1};
  mean.squares << 400.0, 400.0, 1.0;
  JointAnswers segments{.squares = Eigen::RowVectorXd::Zero(3), .count = 6};
  segments.squares << 2000.0, 2000.0, 900.0;
  EXPECT_EQ(link_evidence(std::array{mean}, kLevel).link, 1);
  EXPECT_EQ(link_evidence(std::array{mean, segments}, kLevel).link, 2);
}

/// A trunk that carries two arms of two joints each.
TEST(LinkEvidence, FollowsTheBranchesOfATree) {
  const std::array<int, kChainJoints> parents = {-1, 0, 1, 0, 3};
  const std::array<std::vector<int>, kChainJoints> answering = {
      {{0}, {0, 1}, {0, 1, 2}, {0, 3}, {0, 3, 4}}};
  Rng rng = Rng::from_name("link_evidence tree");
  for (int link = 0; link < kChainJoints; ++link) {
    int right = 0;
    for (int t = 0; t < kTrials; ++t) {
      const Eigen::MatrixXd S = random_covariance(rng);
      Eigen::VectorXd torque = S.llt().matrixL() * normals(rng);
      for (const int joint : answering[static_cast<std::size_t>(link)]) torque[joint] += 300.0;
      const std::array looks{
          JointAnswers{.squares = joint_answers(torque, S, parents).cwiseAbs2(), .count = 1}};
      const LinkEvidence evidence = link_evidence(looks, kLevel, parents);
      right += evidence.link == link ? 1 : 0;
      ASSERT_NEAR(evidence.probability.sum(), 1.0, 1e-12);
    }
    // The link itself and those that carry it each err at the level; some torques nearly cancel.
    EXPECT_GT(right, 0.93 * kTrials) << link;
  }
}

TEST(LinkEvidence, TwoBranchesAtOnceAreNoLink) {
  const std::array<int, kChainJoints> parents = {-1, 0, 1, 0, 3};
  const Eigen::MatrixXd S = Eigen::MatrixXd::Identity(kChainJoints, kChainJoints);
  const Eigen::VectorXd torque = Eigen::VectorXd::Constant(kChainJoints, 50.0);
  const std::array looks{
      JointAnswers{.squares = joint_answers(torque, S, parents).cwiseAbs2(), .count = 1}};
  EXPECT_EQ(link_evidence(looks, kLevel, parents).link, -1);
}

TEST(LinkEvidence, ASeriesIsTheTreeWithoutBranches) {
  const std::array<int, kChainJoints> parents = {-1, 0, 1, 2, 3};
  Rng rng = Rng::from_name("link_evidence series");
  const Eigen::MatrixXd S = random_covariance(rng);
  const Eigen::VectorXd torque = normals(rng);
  EXPECT_TRUE(is_series(parents));
  EXPECT_EQ(joint_answers(torque, S), joint_answers(torque, S, parents));
}

}  // namespace
}  // namespace kinescope
