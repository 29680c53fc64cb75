// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/torque_model.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "dynamics/data/splits.h"
#include "dynamics/models/comparison.h"
#include "dynamics/models/support_vectors.h"
#include "kinematics/core/error.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

constexpr double kNoise = 0.01;  // share of each joint's rms torque
// The noise alone leaves kNoise^2 of the variance; a model with the right parameters little more.
constexpr double kNoiseFloorPercent = 100.0 * kNoise * kNoise;

struct Experiment {
  DynamicModel model;
  TorqueSamples train;
  TorqueSamples test;
};

// A two-joint arm: the last trajectory is held out.
Experiment two_joints() {
  Rng rng = Rng::from_name("torque models");
  const RandomRobot robot = random_robot({.joints = 2, .prismatic_share = 0.0}, rng);
  Experiment out;
  out.model = random_masses(robot.tree, {}, rng);
  const TorqueSamples all = torque_log_of(
      out.model, {.samples = 600, .rate_hz = 50.0, .noise = kNoise, .trajectories = 2}, rng);
  const Fold fold = split_last(all, 0.4);
  out.train = select_rows(all, fold.train);
  out.test = select_rows(all, fold.test);
  return out;
}

TorqueModelOptions quick() {
  TorqueModelOptions options;
  options.samples = 250;
  options.samples_of_all_joints = 120;
  options.hyperparameter_samples = 150;
  options.starts = 1;
  options.network.epochs = 150;
  return options;
}

TEST(TorqueModel, NamesGoBothWays) {
  std::set<std::string_view> names;
  for (const TorqueModelKind kind : all_torque_models()) {
    EXPECT_EQ(torque_model_kind(to_string(kind)), kind);
    names.insert(to_string(kind));
  }
  EXPECT_EQ(names.size(), all_torque_models().size());
  EXPECT_FALSE(torque_model_kind("perceptron"));
  for (const TorqueModelKind kind : usual_torque_models()) {
    EXPECT_EQ(std::ranges::count(all_torque_models(), kind), 1);
  }
}

TEST(TorqueModel, EveryKindExplainsUnseenMotion) {
  const Experiment e = two_joints();
  const auto scores = compare_torque_models(all_torque_models(), e.model, e.train, e.test, quick());
  ASSERT_EQ(scores.size(), all_torque_models().size());
  for (const TorqueScore& score : scores) {
    SCOPED_TRACE(to_string(score.kind));
    EXPECT_EQ(score.failure, "");
    EXPECT_EQ(score.test_samples, e.test.size());
    EXPECT_LT(score.nmse_percent.maxCoeff(), 100.0) << "better than a constant";
  }
  const auto nmse = [&](TorqueModelKind kind) {
    return std::ranges::find(scores, kind, &TorqueScore::kind)->nmse_percent.mean();
  };
  EXPECT_LT(nmse(TorqueModelKind::kParametric), 2.0 * kNoiseFloorPercent);
  EXPECT_LT(nmse(TorqueModelKind::kModelBased), 2.0 * kNoiseFloorPercent);
  EXPECT_LT(nmse(TorqueModelKind::kGip), 5.0);
  EXPECT_LT(nmse(TorqueModelKind::kLip), 5.0);
  EXPECT_LT(nmse(TorqueModelKind::kSemiParametric), nmse(TorqueModelKind::kRbf));
  EXPECT_LT(nmse(TorqueModelKind::kGip), nmse(TorqueModelKind::kRbf));
}

// Neighbouring samples that err alike look like a function of the motion to a likelihood that takes
// them for independent.
TEST(TorqueModel, NoiseThatLastsIsNoFunctionOfTheMotion) {
  constexpr double kMemory = 0.95;  // from one sample to the next
  constexpr double kSlow = 0.2;     // share of each joint's rms torque
  Experiment e = two_joints();
  Rng rng = Rng::from_name("noise that lasts");
  for (Eigen::Index j = 0; j < e.train.joints(); ++j) {
    const double rms = e.train.torque.col(j).norm() / std::sqrt(double(e.train.size()));
    double slow = rng.normal();
    for (Eigen::Index i = 0; i < e.train.size(); ++i) {
      slow = kMemory * slow + std::sqrt(1.0 - kMemory * kMemory) * rng.normal();
      e.train.torque(i, j) += kSlow * rms * slow;
    }
  }
  const FittedTorqueModel semi =
      fit_torque_model(TorqueModelKind::kSemiParametric, e.model, e.train, quick());
  const FittedTorqueModel plain =
      fit_torque_model(TorqueModelKind::kParametric, e.model, e.train, quick());
  ASSERT_FALSE(semi.plainer_joints.empty());
  const TorqueScore semi_score = score_torque_model(semi, e.test);
  EXPECT_EQ(semi_score.plainer_joints, semi.plainer_joints);
  const Eigen::VectorXd plain_nmse = score_torque_model(plain, e.test).nmse_percent;
  for (Eigen::Index j = 0; j < e.test.joints(); ++j) {
    EXPECT_LT(semi_score.nmse_percent[j], 1.1 * plain_nmse[j]) << j;
  }
}

TEST(TorqueModel, SameSamplesSameNumbersWithAnyThreads) {
  const Experiment e = two_joints();
  TorqueModelOptions options = quick();
  options.threads = 1;
  const auto one = fit_torque_model(TorqueModelKind::kGip, e.model, e.train, options);
  options.threads = 2;
  const auto two = fit_torque_model(TorqueModelKind::kGip, e.model, e.train, options);
  const auto a = one.predict(e.test.q, e.test.dq, e.test.ddq);
  const auto b = two.predict(e.test.q, e.test.dq, e.test.ddq);
  EXPECT_EQ(a.mean, b.mean);
  EXPECT_EQ(a.sigma, b.sigma);
}

// What is saved is the fit itself; joints are fitted side by side.
TEST(TorqueModel, InducingPointsGiveSameNumbersWithAnyThreads) {
  const Experiment e = two_joints();
  for (const TorqueModelKind kind : {TorqueModelKind::kGip, TorqueModelKind::kSemiParametric}) {
    TorqueModelOptions options = quick();
    options.inducing_points = 60;
    options.inducing_samples = 200;
    options.threads = 1;
    const auto one = fit_torque_model(kind, e.model, e.train, options);
    options.threads = 3;
    const auto three = fit_torque_model(kind, e.model, e.train, options);
    EXPECT_EQ(one.samples, 200);
    EXPECT_GT(one.inducing_points, 0);
    EXPECT_LE(one.inducing_points, 60);
    const auto a = one.predict(e.test.q, e.test.dq, e.test.ddq);
    const auto b = three.predict(e.test.q, e.test.dq, e.test.ddq);
    EXPECT_EQ(a.mean, b.mean);
    EXPECT_EQ(a.sigma, b.sigma);
    const auto saved = predict_torque(*one.saved, e.test.q, e.test.dq, e.test.ddq, 2);
    EXPECT_EQ(a.mean, saved.mean);
    EXPECT_EQ(a.sigma, saved.sigma);
  }
}

// Bits of a batch of products and of one sample after another differ, their numbers do not; the
// doubt of exact processes is kept through 256 points.
TEST(TorqueModel, SavedModelsAreTheFit) {
  const Experiment e = two_joints();
  TorqueModelOptions options = quick();
  options.keep_saved = true;
  for (const TorqueModelKind kind : {TorqueModelKind::kParametric, TorqueModelKind::kRbf,
                                     TorqueModelKind::kGip, TorqueModelKind::kSemiParametric}) {
    SCOPED_TRACE(to_string(kind));
    const FittedTorqueModel fitted = fit_torque_model(kind, e.model, e.train, options);
    ASSERT_TRUE(fitted.saved);
    const auto expected = fitted.predict(e.test.q, e.test.dq, e.test.ddq);
    const auto saved = predict_torque(*fitted.saved, e.test.q, e.test.dq, e.test.ddq);
    const double size = e.test.torque.cwiseAbs().maxCoeff();
    EXPECT_LT((saved.mean - expected.mean).cwiseAbs().maxCoeff(), 1e-8 * size);
    // Both sigmas are calibrated on the same residuals, with doubts of another shape.
    constexpr double kShape = 0.3;
    EXPECT_LT((saved.sigma.array() / expected.sigma.array()).log().abs().mean(), kShape);
    const Eigen::ArrayXXd error = (e.test.torque - saved.mean).array().abs();
    const BandFactors& bands = fitted.saved->bands;
    for (Eigen::Index j = 0; j < e.test.joints(); ++j) {
      const double held =
          (error.col(j) <= bands.width_90(j) * saved.sigma.col(j).array()).cast<double>().mean();
      EXPECT_NEAR(held, score_torque_model(fitted, e.test).coverage_90[j], 0.1) << j;
    }
  }
  options.keep_saved = false;
  EXPECT_FALSE(fit_torque_model(TorqueModelKind::kRbf, e.model, e.train, options).saved);
  EXPECT_FALSE(fit_torque_model(TorqueModelKind::kSupportVectors, e.model, e.train, options).saved);
}

TEST(TorqueModel, ProgressCountsWhatIsDone) {
  const Experiment e = two_joints();
  std::vector<int> done;
  int total = 0;
  TorqueModelOptions options = quick();
  options.threads = 1;
  (void)fit_torque_model(TorqueModelKind::kSemiParametric, e.model, e.train, options,
                         [&](std::string_view stage, int now, int of) {
                           EXPECT_EQ(stage, "semi_parametric model");
                           done.push_back(now);
                           total = of;
                         });
  ASSERT_FALSE(done.empty());
  EXPECT_TRUE(std::ranges::is_sorted(done));
  EXPECT_LE(done.back(), total);
  EXPECT_GE(static_cast<int>(done.size()), total / 2);  // fewer folds where there are few paths
}

TEST(TorqueModel, LearnsFromMoreSamples) {
  const Experiment e = two_joints();
  const auto curve =
      learning_curve(TorqueModelKind::kGip, e.model, e.train, e.test, {20, 250}, quick());
  ASSERT_EQ(curve.size(), 2U);
  EXPECT_EQ(curve[0].samples, 20);
  EXPECT_LT(curve[1].nmse_percent, curve[0].nmse_percent);
}

TEST(TorqueModel, WhatCannotBeFittedIsSaid) {
  const Experiment e = two_joints();
  const TorqueSamples few = select_rows(e.train, {0, 1, 2});
  const auto scores =
      compare_torque_models({TorqueModelKind::kParametric}, e.model, few, e.test, quick());
  EXPECT_NE(scores[0].failure, "");
}

TEST(TorqueModel, InducingPointsStandForAllSamples) {
  const Experiment e = two_joints();
  TorqueModelOptions options = quick();
  for (const TorqueModelKind kind : {TorqueModelKind::kRbf, TorqueModelKind::kGip}) {
    SCOPED_TRACE(to_string(kind));
    options.inducing_points = 0;
    options.samples = static_cast<int>(e.train.size());
    const FittedTorqueModel exact = fit_torque_model(kind, e.model, e.train, options);
    options.samples = 50;  // does not count
    options.inducing_points = 150;
    const FittedTorqueModel sparse = fit_torque_model(kind, e.model, e.train, options);
    EXPECT_EQ(sparse.samples, e.train.size());
    const Eigen::VectorXd close = score_torque_model(exact, e.test).nmse_percent;
    const Eigen::VectorXd got = score_torque_model(sparse, e.test).nmse_percent;
    // Per cent of the variance, and a share of what is left anyway.
    EXPECT_LT((got - 1.3 * close).maxCoeff(), 0.5) << got.transpose() << " / " << close.transpose();
  }
}

TEST(TorqueModel, TooLittleMemoryIsSaidBeforeAnyWork) {
  const Experiment e = two_joints();
  TorqueModelOptions options = quick();
  options.memory_limit_bytes = 100'000;  // 111 samples squared
  const auto message = [&](TorqueModelKind kind) -> std::string {
    try {
      check_torque_memory({TorqueModelKind::kParametric, kind}, e.train.size(), e.train.joints(),
                          options);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(message(TorqueModelKind::kRbf).find("at most 111 samples"), std::string::npos)
      << message(TorqueModelKind::kRbf);
  EXPECT_NE(message(TorqueModelKind::kGip).find("27 inducing points"), std::string::npos);
  EXPECT_NE(message(TorqueModelKind::kLip).find("at most 55 samples"), std::string::npos);
  EXPECT_EQ(message(TorqueModelKind::kModelBased), "");
  EXPECT_THROW((void)fit_torque_model(TorqueModelKind::kRbf, e.model, e.train, options), Error);
  // What was offered fits.
  options.inducing_points = 27;
  EXPECT_EQ(message(TorqueModelKind::kGip), "");
  options.inducing_points = 28;
  EXPECT_NE(message(TorqueModelKind::kGip), "");
  options.inducing_points = 0;
  options.samples = 111;
  EXPECT_EQ(message(TorqueModelKind::kGip), "");
}

TEST(EvenlyChosen, SpreadsOverAll) {
  EXPECT_EQ(evenly_chosen(10, 5), (std::vector<Eigen::Index>{0, 2, 4, 6, 8}));
  EXPECT_EQ(evenly_chosen(3, 5), (std::vector<Eigen::Index>{0, 1, 2}));
  EXPECT_TRUE(evenly_chosen(0, 5).empty());
}

TEST(SupportVectors, DoNotJudgeThemselvesByARepeat) {
  // The same sweep twice: the repeat of a posture tells its torque, other postures do not.
  constexpr Eigen::Index kRows = 150;
  TorqueSamples samples;
  samples.t_s.resize(2 * kRows);
  samples.q.resize(2 * kRows, 1);
  samples.trajectory.resize(2 * kRows);
  for (Eigen::Index i = 0; i < 2 * kRows; ++i) {
    samples.t_s[i] = 0.05 * static_cast<double>(i % kRows);
    samples.q(i, 0) = samples.t_s[i];
    samples.trajectory[i] = i < kRows ? 0 : 1;
  }
  samples.dq = Eigen::MatrixXd::Ones(2 * kRows, 1);
  samples.ddq = Eigen::MatrixXd::Zero(2 * kRows, 1);
  samples.torque = (2.5 * samples.q).array().sin() + 0.5 * (4.0 * samples.q).array().sin();
  const FittedTorqueModel fitted = models::fit_support_vectors(samples);
  const double sigma = fitted.predict(samples.q, samples.dq, samples.ddq).sigma(0, 0);
  const double spread = std::sqrt(samples.torque.squaredNorm() / (2.0 * kRows));
  EXPECT_GT(sigma, 0.8 * spread);
}

}  // namespace
}  // namespace kinescope
