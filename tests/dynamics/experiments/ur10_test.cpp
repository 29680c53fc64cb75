// SPDX-License-Identifier: Apache-2.0
//
// The UR10's worlds, and what its learners ask of memory and of each other.
#include "dynamics/experiments/ur10.h"

#include <cmath>
#include <numbers>
#include <string>

#include <gtest/gtest.h>

#include "dynamics/experiments/reference_arms.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "kinematics/core/error.h"

namespace kinescope::experiments {
namespace {

constexpr double kRounding = 1e-9;  // N m or m, of numbers up to 1e3

// Stretched out sideways the maker's table says where the tool is and what joint 2 carries.
TEST(Ur10, GeometryAndMassesAreTheMakers) {
  const DynamicModel arm = ur10_arm();
  const Eigen::VectorXd stretched = Eigen::VectorXd::Zero(6);
  const Eigen::Vector3d tool = forward_kinematics(arm.tree, stretched).back().translation;
  EXPECT_NEAR(tool.x(), -0.612 - 0.5723, kRounding);
  EXPECT_NEAR(tool.y(), -0.163941 - 0.0922, kRounding);
  EXPECT_NEAR(tool.z(), 0.1273 - 0.1157, kRounding);
  // Distances of the centres of mass from joint 2, along the arm.
  const double moment = 12.7 * (0.612 - 0.38) + 4.27 * (0.612 + 0.5723 - 0.24) +
                        (2.0 + 2.0 + 0.365) * (0.612 + 0.5723);
  const double torque = gravity_torque(make_rigid_model(arm), stretched)[1];
  EXPECT_NEAR(std::abs(torque), kUsualGravity_m_s2 * moment, kRounding);
}

TEST(Ur10, SpringsCarryWhatTheLinksBehindThemTake) {
  Rng rng = Rng::from_name("ur10 springs");
  const TorqueSamples motors = random_points(2000, rng);
  const DynamicModel arm = ur10_arm();
  const TorqueSamples links = links_behind_springs(arm, motors);
  const RigidModel rigid = make_rigid_model(arm);
  EXPECT_TRUE(inverse_dynamics_of_samples(rigid, links.q, links.dq, links.ddq)
                  .isApprox(links.torque, 1e-12));
  const Eigen::MatrixXd stiff = inverse_dynamics_of_samples(rigid, motors.q, motors.dq, motors.ddq);
  Eigen::MatrixXd carried = motors.q - links.q;
  for (Eigen::Index j = 0; j < 6; ++j) {
    carried.col(j) *= ur10_drives()[static_cast<std::size_t>(j)].stiffness_nm_rad;
  }
  // The last pass moves the torque by less than a hundredth of what the springs do to it.
  const double moved = (links.torque - stiff).norm();
  EXPECT_GT(moved, 1.0);
  EXPECT_LT((carried - links.torque).norm(), 0.01 * moved);
}

TEST(Ur10, TorquesBalanceWithFrictionAndNoise) {
  const ComparisonCase one = ur10_case(0, {.samples = 4000, .test_samples = 400});
  const RigidModel rigid = make_rigid_model(ur10_arm());
  const auto left = [&](const TorqueSamples& log) {
    Eigen::MatrixXd out = log.torque - inverse_dynamics_of_samples(rigid, log.q, log.dq, log.ddq);
    for (Eigen::Index j = 0; j < 6; ++j) {
      const ElasticDrive& drive = ur10_drives()[static_cast<std::size_t>(j)];
      out.col(j) -= drive.viscous_nms_rad * log.dq.col(j);
      out.col(j).array() -= drive.coulomb_nm * log.dq.col(j).array().sign();
    }
    return out;
  };
  const Eigen::MatrixXd train = left(one.train);
  const Eigen::MatrixXd test = left(one.test);
  for (Eigen::Index j = 0; j < 6; ++j) {
    const double noise = ur10_drives()[static_cast<std::size_t>(j)].noise_nm;
    const double measured = train.col(j).norm() / std::sqrt(4000.0);
    // Four sigma of a standard deviation from 4000 samples; springs add what the test shows.
    const double springs = test.col(j).norm() / std::sqrt(400.0);
    EXPECT_NEAR(measured, std::hypot(noise, springs), 4.0 * noise / std::sqrt(8000.0)) << j;
    EXPECT_GT(springs, 0.0);
    EXPECT_LT(springs, noise) << j;
  }
}

TEST(Ur10, FewSamplesAreOfTheSameMotion) {
  const ComparisonCase few = ur10_case(0, {.samples = 100, .test_samples = 50});
  const ComparisonCase more = ur10_case(0, {.samples = 400, .test_samples = 50});
  EXPECT_EQ(few.train.q.row(1), more.train.q.row(4));
  EXPECT_EQ(few.test.trajectory.sum(), 25);
  EXPECT_NE(few.train.q.row(0), ur10_case(1, {.samples = 100, .test_samples = 50}).train.q.row(0));
  // Speeds are the positions' derivatives, also on the circle.
  Rng rng = Rng::from_name("ur10 circle");
  const TorqueSamples circle = tool_circle(200, rng);
  const Eigen::MatrixXd slope = 62.5 * (circle.q.bottomRows(198) - circle.q.topRows(198));
  EXPECT_LT((slope - circle.dq.middleRows(1, 198)).cwiseAbs().maxCoeff(), 1e-3);
  const Eigen::MatrixXd bend = 62.5 * (circle.dq.bottomRows(198) - circle.dq.topRows(198));
  EXPECT_LT((bend - circle.ddq.middleRows(1, 198)).cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_GT(circle.dq.colwise().norm().minCoeff(), 0.1);  // no joint rests
}

TEST(Ur10, EachTrajectoryOfTheTestIsJudgedByItself) {
  const ComparisonCase one = ur10_case(0, {.samples = 300, .test_samples = 100});
  ComparisonPlan plan{1, 1, {Learner::kParametric}, [&](int, int) { return one; }, {}};
  const Trial together = run_comparison(plan).front();
  plan.judge_trajectories = true;
  const std::vector<Trial> apart = run_comparison(plan);
  ASSERT_EQ(apart.size(), 2U);
  EXPECT_EQ(apart[1].trajectory, 1);
  EXPECT_NE(apart[0].global_nmse_percent, apart[1].global_nmse_percent);
  EXPECT_LT(together.global_nmse_percent,
            std::max(apart[0].global_nmse_percent, apart[1].global_nmse_percent));
}

TEST(Learners, ManyInducingPointsGiveTheExactAnswer) {
  const ComparisonCase one = ur10_case(0, {.samples = 120, .test_samples = 40});
  LearnOptions options{.search = {.starts = 1, .samples = 60}, .network = {}, .threads = 1};
  options.inducing = 120;
  const auto predicted = [&](Learner learner) {
    return predict_by(learner, one.believed, one.train, one.test, options);
  };
  const Eigen::MatrixXd exact = predicted(Learner::kRbf);
  const double scale = exact.cwiseAbs().maxCoeff();
  EXPECT_LT((predicted(Learner::kRbfInducing) - exact).cwiseAbs().maxCoeff(), 1e-3 * scale);
  options.inducing = 10;
  EXPECT_GT((predicted(Learner::kRbfInducing) - exact).cwiseAbs().maxCoeff(), 1e-3 * scale);
}

TEST(Learners, WantOfMemoryIsSaidBeforeTheWork) {
  const ComparisonCase like = ur10_case(0, {.samples = 16, .test_samples = 16});
  const auto ask = [&](Learner learner, std::size_t limit) {
    require_memory({learner}, like.believed, like.train, 40000, limit);
  };
  constexpr std::size_t kEnough = 13'000'000'000;
  constexpr std::size_t kTooLittle = 12'000'000'000;
  for (const Learner learner : {Learner::kGip, Learner::kRbf, Learner::kSemiParametric}) {
    EXPECT_NO_THROW(ask(learner, kEnough));
    EXPECT_THROW(ask(learner, kTooLittle), Error);
  }
  for (const Learner learner : {Learner::kGipInducing, Learner::kModelBased, Learner::kNetwork}) {
    EXPECT_NO_THROW(ask(learner, kTooLittle));
  }
  EXPECT_THROW(ask(Learner::kLip, kEnough), Error);
}

}  // namespace
}  // namespace kinescope::experiments
