// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/chain.h"

#include <cmath>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"
#include "kinematics/structure/residual_scale.h"
#include "kinematics/structure/screening.h"
#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

constexpr int kSamples = 150;
constexpr double kSigmaRad = 0.01;
constexpr double kSigmaM = 0.003;

Pose random_pose(Rng& rng) { return {exp_rotation(rng.normal3(1.0)), rng.normal3(0.3)}; }

Matrix6d whitening(double scale = 1.0) {
  Matrix6d W = Matrix6d::Zero();
  W.diagonal().head<3>().setConstant(1.0 / (scale * kSigmaRad));
  W.diagonal().tail<3>().setConstant(1.0 / (scale * kSigmaM));
  return W;
}

Vector6d noise(Rng& rng, double size) {
  Vector6d d;
  d << rng.normal3(size * kSigmaRad), rng.normal3(size * kSigmaM);
  return d;
}

// A column of readings per channel: sines of their own frequency.
Eigen::MatrixXd sines(int channels) {
  Eigen::MatrixXd q(kSamples, channels);
  for (int i = 0; i < kSamples; ++i) {
    for (int c = 0; c < channels; ++c)
      q(i, c) = std::sqrt(2.0) * std::sin(0.05 * (c + 1.3) * i + c);
  }
  return q;
}

Motion motion_of(const ChainModel& model, const Eigen::MatrixXd& q, Rng& rng, double size) {
  Motion motion;
  for (int i = 0; i < kSamples; ++i) {
    MotionSample s;
    s.instant = i;
    s.pose = chain_pose(model, q, i) * exp_pose(noise(rng, size));
    s.whitening = whitening();
    motion.push_back(std::move(s));
  }
  return motion;
}

ChainModel one_joint(JointType type, double scale, Rng& rng) {
  ChainModel model;
  model.joints.push_back({type, random_pose(rng), {{0, scale}}});
  model.mount = random_pose(rng);
  return model;
}

class OneJoint : public testing::TestWithParam<JointType> {};

TEST_P(OneJoint, IsFoundFromScreeningWithItsScaleAndAxis) {
  Rng rng = Rng::from_name("OneJoint", static_cast<std::uint64_t>(GetParam()));
  const Eigen::MatrixXd q = sines(3);
  const double scale = GetParam() == JointType::kRevolute ? 0.5 : 0.1;
  const ChainModel truth = one_joint(GetParam(), scale, rng);
  const Motion motion = motion_of(truth, q, rng, 1.0);
  const std::vector<Candidate> candidates = screen_motion(motion, q, {1, 1, 1});
  const Candidate& best = candidates.front();
  EXPECT_EQ(best.channel, 0);
  const ChainFit fit = fit_chain(motion, q, best.start);
  EXPECT_EQ(fit.model.joints.front().type, GetParam());
  // Four predicted standard deviations.
  EXPECT_NEAR(std::abs(fit.model.joints.front().terms.front().scale), scale,
              4.0 * fit.scale_sigma.front());
  EXPECT_LT(fit.scale_sigma.front(), 0.02 * scale);
  const Eigen::Vector3d axis = fit.model.joints.front().frame.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d true_axis = truth.joints.front().frame.rotation * Eigen::Vector3d::UnitZ();
  EXPECT_GT(std::abs(axis.dot(true_axis)), std::cos(0.03));
  // Chi-square of 5 and 1 degrees of freedom a sample, within 4 sigma of sqrt(2 / dof).
  EXPECT_NEAR(fit.raw_variance, 1.0, 4.0 * std::sqrt(2.0 / (5.0 * kSamples)));
  EXPECT_NEAR(fit.cost, 6.0 * kSamples, 4.0 * std::sqrt(2.0 * 6.0 * kSamples));
}

TEST_P(OneJoint, WithoutNoiseIsExact) {
  Rng rng = Rng::from_name("OneJointExact", static_cast<std::uint64_t>(GetParam()));
  const Eigen::MatrixXd q = sines(1);
  const ChainModel truth = one_joint(GetParam(), 0.7, rng);
  const Motion motion = motion_of(truth, q, rng, 0.0);
  ChainFitOptions options;
  options.max_iterations = 30;
  // Start next to the truth: the Jacobian is proved by convergence to machine precision.
  ChainModel start = truth;
  start.mount = start.mount * exp_pose(noise(rng, 3.0));
  Vector6d tilt = Vector6d::Zero();
  tilt << 0.02, -0.03, 0.0, 0.01, 0.02, 0.0;
  if (GetParam() == JointType::kPrismatic) tilt.tail<3>().setZero();
  start.joints.front().frame = start.joints.front().frame * exp_pose(tilt);
  start.joints.front().terms.front().scale = 0.68;
  const ChainFit fit = fit_chain(motion, q, start, options);
  // The fit stops where a step gains less than 0.05 of chi-square in all: 1e-3 of a sigma.
  EXPECT_NEAR(fit.model.joints.front().terms.front().scale, 0.7, 1e-3 * 0.7);
  EXPECT_LT(fit.cost, 1.0);
}

TEST(ScreenMotion, OfBodiesNeverSeenTogetherOffersNothing) {
  EXPECT_TRUE(screen_motion({}, sines(1), {1}).empty());
}

TEST_P(OneJoint, WithoutAChannelGivesItsCoordinates) {
  Rng rng = Rng::from_name("OneJointFree", static_cast<std::uint64_t>(GetParam()));
  const Eigen::MatrixXd q = sines(1);
  const double scale = GetParam() == JointType::kRevolute ? 0.6 : 0.2;
  const ChainModel truth = one_joint(GetParam(), scale, rng);
  const Motion motion = motion_of(truth, q, rng, 1.0);
  const std::vector<Candidate> candidates = screen_motion(motion, Eigen::MatrixXd(kSamples, 0), {});
  const auto free = std::ranges::find_if(candidates, [&](const Candidate& c) {
    return !c.start.joints.empty() && c.start.joints.front().type == GetParam();
  });
  ASSERT_NE(free, candidates.end());
  const ChainFit fit = fit_chain(motion, Eigen::MatrixXd(kSamples, 0), free->start);
  EXPECT_NEAR(fit.variance, 1.0, 0.3);
  // Up to sign and zero, the coordinates are those of the truth: correlation.
  double dot = 0.0;
  double aa = 0.0;
  double bb = 0.0;
  double mean = 0.0;
  for (const double c : fit.model.coordinates) mean += c / kSamples;
  for (int i = 0; i < kSamples; ++i) {
    const double a = fit.model.coordinates[static_cast<std::size_t>(i)] - mean;
    const double b = scale * (q(i, 0) - q.col(0).mean());
    dot += a * b;
    aa += a * a;
    bb += b * b;
  }
  EXPECT_GT(std::abs(dot) / std::sqrt(aa * bb), 0.995);
}

INSTANTIATE_TEST_SUITE_P(Types, OneJoint,
                         testing::Values(JointType::kRevolute, JointType::kPrismatic));

TEST(Chain, RestIsCheaperThanAnyJointWhenNothingMoves) {
  Rng rng = Rng::from_name("Rest");
  ChainModel truth;
  truth.mount = random_pose(rng);
  const Eigen::MatrixXd q = sines(2);
  const Motion motion = motion_of(truth, q, rng, 1.0);
  const std::vector<Candidate> candidates = screen_motion(motion, q, {1, 1});
  double rest = 0.0;
  double least = 1e300;
  for (const Candidate& c : candidates) {
    const ChainFit fit = fit_chain(motion, q, c.start);
    if (c.start.joints.empty()) rest = fit.cost;
    // Driven joints have 3 to 5 parameters more and gain one chi-square each.
    if (c.channel >= 0) least = std::min(least, fit.cost);
  }
  EXPECT_NEAR(rest, 6.0 * kSamples, 4.0 * std::sqrt(12.0 * kSamples));
  EXPECT_LT(rest - least, 25.0);
}

// A joint that is moved in its turn: for most of the time its marker rests, and is seen with an
// error that stays the same; when it moves, errors are many times what was declared. As outliers,
// all that it ever moved would be left out.
TEST(Chain, AJointThatMovesForAWhileIsNotAtRest) {
  constexpr double kDeclared = 0.02;  // of the other tests' noise
  for (const JointType type : {JointType::kRevolute, JointType::kPrismatic}) {
    Rng rng = Rng::from_name("for a while", static_cast<std::uint64_t>(type));
    Eigen::MatrixXd q = sines(2);
    for (int i = 0; i < kSamples; ++i) {
      if (i < 2 * kSamples / 3) q(i, 0) = 0.0;
      if (i >= kSamples / 3) q(i, 1) = 0.0;
    }
    const ChainModel truth = one_joint(type, type == JointType::kRevolute ? 0.5 : 0.1, rng);
    Motion motion;
    for (int i = 0; i < kSamples; ++i) {
      MotionSample s;
      s.instant = i;
      s.pose =
          chain_pose(truth, q, i) * exp_pose(noise(rng, (q(i, 0) == 0.0 ? 0.2 : 40.0) * kDeclared));
      s.whitening = whitening(kDeclared);
      motion.push_back(std::move(s));
    }
    std::vector<std::pair<double, int>> fits;
    for (const Candidate& c : screen_motion(motion, q, {1, 1})) {
      const bool free = c.channel < 0 && !c.start.joints.empty();
      if (!free) fits.emplace_back(fit_chain(motion, q, c.start).cost, c.channel);
    }
    ASSERT_FALSE(fits.empty());
    const auto [cost, channel] = std::ranges::min(fits);
    EXPECT_EQ(channel, 0);
    for (const auto& [other, of] : fits) {
      if (of == 0) continue;
      EXPECT_GT(other, cost + 100.0);
    }
  }
}

TEST(Chain, OutliersDoNotMoveTheFit) {
  Rng rng = Rng::from_name("Outliers");
  const Eigen::MatrixXd q = sines(1);
  const ChainModel truth = one_joint(JointType::kRevolute, 0.5, rng);
  Motion motion = motion_of(truth, q, rng, 1.0);
  for (std::size_t i = 0; i < motion.size(); i += 5) {
    motion[i].pose.rotation =
        motion[i].pose.rotation * exp_rotation(Eigen::Vector3d(0.9, 0.0, 0.0));
  }
  const std::vector<Candidate> candidates = screen_motion(motion, q, {1});
  const auto driven =
      std::ranges::find_if(candidates, [](const Candidate& c) { return c.channel == 0; });
  ASSERT_NE(driven, candidates.end());
  const ChainFit fit = fit_chain(motion, q, driven->start);
  EXPECT_NEAR(std::abs(fit.model.joints.front().terms.front().scale), 0.5,
              5.0 * fit.scale_sigma.front());
  EXPECT_LT(fit.variance, 1.5);
}

TEST(Chain, TheOtherBranchIsTakenWhereItFits) {
  Rng rng = Rng::from_name("Branch");
  const Eigen::MatrixXd q = sines(1);
  const ChainModel truth = one_joint(JointType::kRevolute, 0.5, rng);
  Motion motion = motion_of(truth, q, rng, 1.0);
  for (std::size_t i = 0; i < motion.size(); i += 4) {
    motion[i].alternative = motion[i].pose;
    motion[i].alternative_whitening = motion[i].whitening;
    motion[i].alternative_cost = 1.0;
    motion[i].pose.rotation =
        motion[i].pose.rotation * exp_rotation(Eigen::Vector3d(0.9, 0.0, 0.0));
  }
  const ChainFit fit = fit_chain(motion, q, truth);
  // Every fourth sample pays 1 for its branch; none is an outlier.
  EXPECT_NEAR(fit.cost, 6.25 * kSamples, 4.0 * std::sqrt(12.0 * kSamples));
}

TEST(Chain, TwoJointsInSeriesConverge) {
  Rng rng = Rng::from_name("TwoJoints");
  const Eigen::MatrixXd q = sines(2);
  ChainModel truth = one_joint(JointType::kRevolute, 0.4, rng);
  truth.joints.push_back({JointType::kPrismatic, random_pose(rng), {{1, 0.1}}});
  const Motion motion = motion_of(truth, q, rng, 0.0);
  ChainModel start = truth;
  for (ChainJoint& j : start.joints) {
    Vector6d tilt = Vector6d::Zero();
    tilt.head<2>() << 0.05, -0.04;
    j.frame = j.frame * exp_pose(tilt);
    j.terms.front().scale *= 0.9;
  }
  const ChainFit fit = fit_chain(motion, q, start, {.max_iterations = 40});
  EXPECT_LT(fit.cost, 1.0);
  EXPECT_NEAR(fit.model.joints[0].terms[0].scale, 0.4, 4e-4);
  EXPECT_NEAR(fit.model.joints[1].terms[0].scale, 0.1, 1e-4);
}

TEST(Chain, TurnsOfSeveralRevolutionsDoNotWrap) {
  Rng rng = Rng::from_name("Wide");
  Eigen::MatrixXd q(kSamples, 2);
  for (int i = 0; i < kSamples; ++i) {
    q(i, 0) = 3.4 * (i / (kSamples - 1.0) - 0.5);
    q(i, 1) = std::sin(0.3 * i);
  }
  ChainModel truth = one_joint(JointType::kRevolute, 4.0, rng);  // 13.6 rad in all
  const Motion motion = motion_of(truth, q, rng, 1.0);
  const std::vector<Candidate> candidates = screen_motion(motion, q, {1, 1});
  double least = 1e300;
  ChainFit best;
  for (const Candidate& c : candidates) {
    ChainFit fit = fit_chain(motion, q, c.start);
    if (c.channel >= 0 && fit.cost < least) {
      least = fit.cost;
      best = std::move(fit);
    }
  }
  EXPECT_EQ(best.model.joints.front().terms.front().channel, 0);
  EXPECT_NEAR(std::abs(best.model.joints.front().terms.front().scale), 4.0, 0.01);
}

TEST(ResidualScale, AutocorrelationIsOneForWhiteAndMoreForSlowErrors) {
  Rng rng = Rng::from_name("Autocorrelation");
  std::vector<Vector6d> white;
  std::vector<Vector6d> slow;
  Vector6d state = Vector6d::Zero();
  constexpr double kMemory = 0.9;  // (1 + a) / (1 - a) = 19 samples err alike
  for (int i = 0; i < 2000; ++i) {
    Vector6d v;
    v << rng.normal3(1.0), rng.normal3(1.0);
    white.push_back(v);
    state = kMemory * state + std::sqrt(1.0 - kMemory * kMemory) * v;
    slow.push_back(state);
  }
  EXPECT_NEAR(integrated_autocorrelation(white), 1.0, 0.1);
  EXPECT_NEAR(integrated_autocorrelation(slow), 19.0, 4.0);
}

TEST(Tangent, AgreesWithTheLogarithmOfPoses) {
  Rng rng = Rng::from_name("Tangent");
  for (const double size : {1e-9, 1e-5, 3e-3, 1e-2, 0.3, 1.0, 3.0}) {
    const Pose T{exp_rotation(size * rng.unit3()), rng.normal3(1.0)};
    EXPECT_LT((fast_log(T) - log_pose(T)).norm(), 1e-11) << size;
  }
}

}  // namespace
}  // namespace kinescope::structure_search
