// SPDX-License-Identifier: Apache-2.0
//
// Which model is relied on, and models that are worse than a constant.
#include "dynamics/models/comparison.h"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

TorqueScore score_of(TorqueModelKind kind, double on_test, double left_out) {
  TorqueScore out;
  out.kind = kind;
  out.nmse_percent = Eigen::Vector2d(on_test, on_test);
  out.left_out_nmse_percent = Eigen::Vector2d(left_out, left_out);
  return out;
}

TEST(BestScore, IsChosenByWhatTheTestHasNoPartIn) {
  std::vector<TorqueScore> scores{score_of(TorqueModelKind::kParametric, 1.0, 3.0),
                                  score_of(TorqueModelKind::kGip, 2.0, 2.0),
                                  score_of(TorqueModelKind::kRbf, 0.5, 4.0)};
  EXPECT_EQ(best_score(scores), 1);
  scores[1].failure = "no";
  EXPECT_EQ(best_score(scores), 0);
  scores[0].left_out_nmse_percent.resize(0);
  scores[2].left_out_nmse_percent.resize(0);
  EXPECT_EQ(best_score(scores), 0) << "nothing was left out: the plainest";
  EXPECT_EQ(best_score({}), 0);
}

TEST(BestScore, TheTestNamesAModelThatIsWorseThanAConstantAndChoosesNone) {
  std::vector<TorqueScore> scores{score_of(TorqueModelKind::kParametric, 3.0, 60.0),
                                  score_of(TorqueModelKind::kRbf, 0.5, 1.0)};
  scores[1].nmse_percent[0] = 18183.0;
  EXPECT_EQ(worse_than_constant(scores[1]), std::vector<int>{0});
  EXPECT_EQ(best_score(scores), 1);
  scores[1].left_out_nmse_percent[0] = 101.0;
  EXPECT_EQ(best_score(scores), 0) << "worse than a constant on motion left out of the training";
  scores[1].left_out_nmse_percent[0] = 1.0;
  scores[1].constant_joints = {0};  // it gave way there
  EXPECT_TRUE(worse_than_constant(scores[1]).empty());
  EXPECT_EQ(best_score(scores), 1);
  scores[1].nmse_percent[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(worse_than_constant(scores[1]).empty());
}

TEST(ScoreName, TheTracedModelIsOfNoKind) {
  TorqueScore score = score_of(TorqueModelKind::kParametric, 1.0, 1.0);
  EXPECT_EQ(name_of(score), "parametric");
  score.traced = true;
  EXPECT_EQ(name_of(score), "traced");
}

// A torque that no motion explains, at one of two joints.
TEST(ConstantJoints, WhoLearnedNothingGivesWayInEveryKind) {
  constexpr int kRows = 400;
  Rng rng = Rng::from_name("constant joints");
  const RandomRobot robot = random_robot({.joints = 2, .prismatic_share = 0.0}, rng);
  const DynamicModel model = random_masses(robot.tree, {}, rng);
  TorqueSamples log = torque_log_of(
      model, {.samples = kRows, .rate_hz = 50.0, .noise = 0.01, .trajectories = 8}, rng);
  for (Eigen::Index i = 0; i < log.size(); ++i) log.torque(i, 1) = 5.0 + rng.normal();
  const Eigen::VectorXd noise = log.torque.col(1);
  TorqueModelOptions options;
  options.samples = 150;
  options.hyperparameter_samples = 80;
  options.starts = 1;
  options.network.epochs = 30;
  for (const TorqueModelKind kind : all_torque_models()) {
    SCOPED_TRACE(to_string(kind));
    const FittedTorqueModel fitted = fit_torque_model(kind, model, log, options);
    ASSERT_EQ(fitted.left_out_nmse_percent.size(), 2);
    // The mean of some samples and the others': a little above.
    EXPECT_LT(fitted.left_out_nmse_percent[1], 110.0);
    const TorquePrediction prediction = fitted.predict(log.q, log.dq, log.ddq);
    const bool gave_way = std::ranges::count(fitted.constant_joints, 1) > 0;
    if (!gave_way) continue;  // near the constant as it is
    EXPECT_EQ(prediction.mean.col(1).maxCoeff(), prediction.mean.col(1).minCoeff());
    EXPECT_NEAR(prediction.mean(0, 1), 5.0, 0.3);
    EXPECT_NEAR(prediction.sigma(0, 1), 1.0, 0.2);
    const TorqueScore score = score_torque_model(fitted, log);
    EXPECT_TRUE(worse_than_constant(score).empty());
    EXPECT_NEAR(score.coverage_90[1], 0.9, 0.05);
  }
}

TEST(ConstantJoints, TheMeanOfTheOthersIsWhatIsHeldAgainst) {
  LeftOutTorques left;
  left.residual = Eigen::MatrixXd::Ones(10, 2);
  left.constant_residual = Eigen::MatrixXd::Constant(10, 2, 0.5);
  left.constant_residual.col(0).setConstant(2.0);
  left.model_sigma = left.sigma = Eigen::MatrixXd::Ones(10, 2);
  left.torque = Eigen::MatrixXd::Identity(10, 2);
  const ConstantJoints constants =
      give_way_to_constant(left, Eigen::MatrixXd::Constant(10, 2, 7.0));
  EXPECT_EQ(constants.joints, std::vector<int>{1});
  EXPECT_EQ(constants.torque[0], 7.0);
  EXPECT_EQ(constants.sigma[0], 0.5);
  EXPECT_EQ(left.residual(0, 0), 1.0);
  EXPECT_EQ(left.residual(0, 1), 0.5);
  EXPECT_EQ(left.model_sigma(0, 1), 0.0);
}

}  // namespace
}  // namespace kinescope
