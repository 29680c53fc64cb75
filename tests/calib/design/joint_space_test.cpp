// SPDX-License-Identifier: Apache-2.0
#include "calib/design/joint_space.h"

#include <gtest/gtest.h>

#include "kinematics/core/error.h"

namespace kinescope::design {
namespace {

// A turning joint logged in degrees, and a slide whose drive the first one's channel moves, too.
KinematicTree coupled_robot() {
  KinematicTree tree;
  tree.links = {{"base"}, {"arm"}, {"slide"}};
  Joint turn;
  turn.name = "turn";
  turn.type = JointType::kRevolute;
  turn.parent = LinkId{0};
  turn.child = LinkId{1};
  turn.channel = "a";
  turn.scale = kRadPerDegree;
  Joint slide;
  slide.name = "slide";
  slide.type = JointType::kPrismatic;
  slide.parent = LinkId{1};
  slide.child = LinkId{2};
  slide.channel = "b";
  slide.offset = 0.01;
  slide.couplings = {{"a", 1e-3}};
  tree.joints = {turn, slide};
  return tree;
}

MotionLimits coupled_limits() {
  MotionLimits out;
  out.range = {{-1.0, 0.5}, {0.0, 0.2}};
  out.velocity = Eigen::Vector2d(1.5, 0.3);
  out.acceleration = Eigen::Vector2d(4.0, 0.5);
  return out;
}

std::vector<Eigen::VectorXd> drawn_postures(const JointSpace& space, int count) {
  Rng rng(5);
  std::vector<Eigen::VectorXd> out;
  while (std::ssize(out) < count)
    if (auto readings = space.draw(rng)) out.push_back(*readings);
  return out;
}

TEST(JointSpace, DrawsStayWithinTheRangesOfJointsAlsoOfCoupledOnes) {
  const JointSpace space(coupled_robot(), coupled_limits());
  ASSERT_EQ(space.channels(), (std::vector<std::string>{"a", "b"}));
  Eigen::Vector2d least(1e9, 1e9), most(-1e9, -1e9);
  for (const Eigen::VectorXd& readings : drawn_postures(space, 500)) {
    const Eigen::VectorXd values = space.values(readings);
    EXPECT_NEAR(values[0], kRadPerDegree * readings[0], 1e-12);
    EXPECT_NEAR(values[1], readings[1] + 1e-3 * readings[0] + 0.01, 1e-12);
    least = least.cwiseMin(values);
    most = most.cwiseMax(values);
  }
  EXPECT_GE(least[0], -1.0);
  EXPECT_LE(most[0], 0.5);
  EXPECT_GE(least[1], 0.0);
  EXPECT_LE(most[1], 0.2);
  EXPECT_LT(least[0], -0.98);  // ends are drawn often
  EXPECT_GT(most[1], 0.197);
}

TEST(JointSpace, TheMiddleIsTheMiddleOfEveryRange) {
  const JointSpace space(coupled_robot(), coupled_limits());
  const Eigen::VectorXd values = space.values(space.middle());
  EXPECT_NEAR(values[0], -0.25, 1e-12);
  EXPECT_NEAR(values[1], 0.1, 1e-12);
}

// Limits are kept to rounding, and the fastest motion reaches one of them.
TEST(RestToRestPath, KeepsSpeedsAccelerationsAndRangesAndRestsAtBothEnds) {
  const JointSpace space(coupled_robot(), coupled_limits());
  const auto postures = drawn_postures(space, 6);
  const double shortest = RestToRestPath::shortest_s(space, postures);
  const RestToRestPath path(space, postures, shortest);
  EXPECT_DOUBLE_EQ(path.duration_s(), shortest);
  EXPECT_EQ(path.readings(-1.0), postures.front());
  EXPECT_EQ(path.readings(shortest + 1.0), postures.back());
  constexpr double kStep_s = 1e-4;
  const MotionLimits limits = coupled_limits();
  double most = 0.0;  // of a limit
  for (double t = kStep_s; t < shortest - kStep_s; t += kStep_s) {
    const Eigen::VectorXd before = space.values(path.readings(t - kStep_s));
    const Eigen::VectorXd now = space.values(path.readings(t));
    const Eigen::VectorXd after = space.values(path.readings(t + kStep_s));
    for (Eigen::Index j = 0; j < 2; ++j) {
      const auto& range = limits.range[static_cast<std::size_t>(j)];
      EXPECT_GE(now[j], range.lower);
      EXPECT_LE(now[j], range.upper);
      const double speed = std::abs(after[j] - before[j]) / (2.0 * kStep_s);
      const double bend = std::abs(after[j] - 2.0 * now[j] + before[j]) / (kStep_s * kStep_s);
      most = std::max({most, speed / limits.velocity[j], bend / limits.acceleration[j]});
    }
  }
  EXPECT_LE(most, 1.0 + 1e-6);  // the differences' own rounding
  EXPECT_GE(most, 0.999);
  const double start = (space.values(path.readings(1e-3)) - space.values(postures[0])).norm();
  EXPECT_LT(start, 1e-5);
}

TEST(RestToRestPath, IsSlowedDownToItsDuration) {
  const JointSpace space(coupled_robot(), coupled_limits());
  const auto postures = drawn_postures(space, 4);
  const double shortest = RestToRestPath::shortest_s(space, postures);
  const RestToRestPath fast(space, postures, shortest);
  const RestToRestPath slow(space, postures, 3.0 * shortest);
  for (const double share : {0.1, 0.37, 0.5, 0.93})
    EXPECT_LT((fast.readings(share * shortest) - slow.readings(3.0 * share * shortest)).norm(),
              1e-9);
}

TEST(JointSpace, AShortOrderIsNoLongerAndHasTheSamePostures) {
  const JointSpace space(coupled_robot(), coupled_limits());
  const auto postures = drawn_postures(space, 12);
  const auto ordered = in_short_order(space, postures);
  EXPECT_LT(RestToRestPath::shortest_s(space, ordered),
            0.8 * RestToRestPath::shortest_s(space, postures));
  for (const Eigen::VectorXd& one : postures)
    EXPECT_NE(std::ranges::find(ordered, one), ordered.end());
  EXPECT_EQ(in_short_order(space, postures), ordered);
}

TEST(JointSpace, RefusesWhatCannotBePlanned) {
  KinematicTree undriven = coupled_robot();
  undriven.joints[1].channel.clear();
  EXPECT_THROW(JointSpace(undriven, coupled_limits()), Error);
  MotionLimits none = coupled_limits();
  none.range[0] = {0.5, 0.5};
  EXPECT_THROW(JointSpace(coupled_robot(), none), Error);
  KinematicTree foreign = coupled_robot();
  foreign.joints[1].couplings = {{"c", 1.0}};
  EXPECT_THROW(JointSpace(foreign, coupled_limits()), Error);
}

}  // namespace
}  // namespace kinescope::design
