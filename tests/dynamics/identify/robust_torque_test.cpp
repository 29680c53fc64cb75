// SPDX-License-Identifier: Apache-2.0
//
// A learned torque that bad samples do not bend, and its parts.
#include "dynamics/identify/robust_torque.h"

#include <gtest/gtest.h>

#include "dynamics/data/splits.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

DynamicModel arm() {
  Rng rng = Rng::from_name("robust torque test");
  return random_masses(random_robot({.joints = 2, .prismatic_share = 0.0}, rng).tree,
                       {.every_direction = false}, rng);
}

TorqueSamples log_of(const DynamicModel& model, const char* name, double noise, double outliers) {
  Rng rng = Rng::from_name(name);
  return torque_log_of(
      model, {.samples = 1500, .noise = noise, .outliers = outliers, .trajectories = 10}, rng);
}

RobustTorqueOptions few() {
  RobustTorqueOptions out;
  out.samples = 250;
  return out;
}

Eigen::VectorXd errors(const RobustTorque& learned, RobustMethod method,
                       const TorqueSamples& truth) {
  const TorquePrediction p = learned.predict(method, truth.q, truth.dq, truth.ddq);
  return (truth.torque - p.mean).colwise().norm().transpose() / std::sqrt(truth.size());
}

TEST(RobustTorque, OutliersBendThePlainFitOnly) {
  const DynamicModel model = arm();
  const TorqueSamples bad = log_of(model, "with outliers", 0.01, 0.08);
  const TorqueSamples truth = log_of(model, "unseen", 0.0, 0.0);
  const RobustTorque learned = learn_robust_torque(model, bad, few());
  const Eigen::VectorXd plain = errors(learned, RobustMethod::kPlain, truth);
  for (const RobustMethod method : {RobustMethod::kTrimmed, RobustMethod::kStudent}) {
    const Eigen::VectorXd robust = errors(learned, method, truth);
    for (Eigen::Index j = 0; j < 2; ++j) {
      EXPECT_LT(robust[j], 0.6 * plain[j]) << to_string(method) << ", joint " << j;
    }
  }
  EXPECT_EQ(learned.folds, 10);
  EXPECT_TRUE(learned.by_trajectory);
  for (const RobustJoint& joint : learned.joints) {
    EXPECT_GT(joint.down_weighted, 0.03) << "outliers are seen";
    EXPECT_LT(joint.down_weighted, 0.4);
  }
}

TEST(RobustTorque, TheBandHoldsUnseenSamples) {
  const DynamicModel model = arm();
  const RobustTorque learned = learn_robust_torque(model, log_of(model, "band", 0.02, 0.0), few());
  const TorqueSamples unseen = log_of(model, "band, unseen", 0.02, 0.0);
  const TorquePrediction p =
      learned.predict(RobustMethod::kStudent, unseen.q, unseen.dq, unseen.ddq);
  const double held =
      ((unseen.torque - p.mean).array().abs() <= 1.96 * p.sigma.array()).cast<double>().mean();
  EXPECT_GT(held, 0.90);
  EXPECT_LT(held, 0.99);
}

TEST(RobustTorque, PartsAddUpAndAreWhatTheyAreCalled) {
  const DynamicModel model = arm();
  const RobustTorque learned =
      learn_robust_torque(model, log_of(model, "parts", 0.002, 0.0), few());
  const TorqueSamples truth = log_of(model, "parts, unseen", 0.0, 0.0);
  const auto& fits = learned.fits[static_cast<std::size_t>(RobustMethod::kStudent)];
  const TorqueSplit split = split_torque(fits, truth.q, truth.dq, truth.ddq);
  const Eigen::MatrixXd sum = split.friction + split.gravity + split.inertia;
  const Eigen::MatrixXd whole =
      learned.predict(RobustMethod::kStudent, truth.q, truth.dq, truth.ddq).mean;
  const double size = truth.torque.cwiseAbs().maxCoeff();
  EXPECT_LT((sum - whole).cwiseAbs().maxCoeff(), 1e-9 * size);
  const std::vector<JointId> joints = moving_joints(model.tree);
  for (Eigen::Index j = 0; j < 2; ++j) {
    const JointDynamics& drive = model.joints[joints[static_cast<std::size_t>(j)].index()];
    const Eigen::VectorXd friction = (drive.viscous * truth.dq.col(j).array() +
                                      drive.coulomb * (truth.dq.col(j).array() / 0.01).tanh())
                                         .matrix();
    const double rms = (split.friction.col(j) - friction).norm() / friction.norm();
    EXPECT_LT(rms, 0.1) << "of the friction, joint " << j;
  }
}

TEST(RobustTorque, BlocksOfOneMotionAreLeftOutWithAGap) {
  const DynamicModel model = arm();
  Rng rng = Rng::from_name("one motion");
  const TorqueSamples log = torque_log_of(model, {.samples = 1500, .trajectories = 1}, rng);
  RobustTorqueOptions options = few();
  options.samples = 120;
  const RobustTorque learned = learn_robust_torque(model, log, options);
  ASSERT_FALSE(learned.by_trajectory);
  SplitOptions split;
  split.folds = options.folds;
  const Folds folds = split_folds(learned.samples, split);
  ASSERT_EQ(learned.folds, static_cast<int>(folds.folds.size()));
  const Fold& fold = folds.folds[1];
  ASSERT_LT(fold.train.size() + fold.test.size(), 120U);
  EXPECT_EQ(without_fold(learned, 1)[0].samples, static_cast<Eigen::Index>(fold.train.size()));
}

TEST(RobustTorque, TheSameForAnyNumberOfThreads) {
  const DynamicModel model = arm();
  const TorqueSamples log = log_of(model, "threads", 0.02, 0.02);
  RobustTorqueOptions options = few();
  options.samples = 120;
  options.threads = 1;
  const RobustTorque one = learn_robust_torque(model, log, options);
  options.threads = 3;
  const RobustTorque three = learn_robust_torque(model, log, options);
  EXPECT_EQ(one.weight, three.weight);
  EXPECT_EQ(one.predict(RobustMethod::kTrimmed, log.q, log.dq, log.ddq).mean,
            three.predict(RobustMethod::kTrimmed, log.q, log.dq, log.ddq).mean);
}

TEST(FrictionProfile, MeansOfTheBins) {
  Eigen::VectorXd velocity(4);
  velocity << -1.0, -0.9, 0.9, 1.0;
  Eigen::VectorXd friction(4);
  friction << -2.0, -4.0, 3.0, 3.0;
  const std::vector<FrictionBin> bins = friction_profile(velocity, friction, 4);
  ASSERT_EQ(bins.size(), 2U);
  EXPECT_DOUBLE_EQ(bins[0].velocity, -0.95);
  EXPECT_DOUBLE_EQ(bins[0].friction, -3.0);
  EXPECT_DOUBLE_EQ(bins[0].spread, 1.0);
  EXPECT_EQ(bins[1].samples, 2);
  EXPECT_DOUBLE_EQ(bins[1].spread, 0.0);
  EXPECT_TRUE(friction_profile(Eigen::VectorXd::Zero(3), Eigen::VectorXd::Zero(3)).empty());
}

}  // namespace
}  // namespace kinescope
