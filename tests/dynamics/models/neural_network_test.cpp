// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/neural_network.h"

#include <cmath>
#include <limits>

#include <Eigen/QR>
#include <gtest/gtest.h>

#include "dynamics/data/splits.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

// Two damped pendulums of 1 kg m^2 driven along two sines, torque = ddq + 5 sin q + 0.5 dq; the
// second one feels the first one's swing. Ten samples a second.
TorqueSamples pendulums(Eigen::Index rows, double start_s, double noise_nm) {
  Rng rng = Rng::from_name("pendulums");
  TorqueSamples out;
  out.t_s = Eigen::VectorXd::LinSpaced(rows, start_s, start_s + 0.1 * double(rows - 1));
  out.q = out.dq = out.ddq = out.torque = Eigen::MatrixXd::Zero(rows, 2);
  out.trajectory = Eigen::VectorXi::Zero(rows);
  for (Eigen::Index j = 0; j < 2; ++j) {
    for (const double w : {1.1, 1.9}) {
      const Eigen::ArrayXd angle = w * out.t_s.array() + 0.7 * double(j);
      out.q.col(j).array() += 1.2 * angle.sin();
      out.dq.col(j).array() += 1.2 * w * angle.cos();
      out.ddq.col(j).array() -= 1.2 * w * w * angle.sin();
    }
    out.torque.col(j) =
        out.ddq.col(j).array() + 5.0 * out.q.col(j).array().sin() + 0.5 * out.dq.col(j).array();
  }
  out.torque.col(1).array() += out.dq.col(0).array().square();
  for (double& torque : out.torque.reshaped()) torque += rng.normal(noise_nm);
  return out;
}

NeuralNetworkOptions quick_training() {
  NeuralNetworkOptions options;
  options.epochs = 90;
  options.batch = 20;
  return options;
}

Eigen::MatrixXd predicted(const FittedTorqueModel& fitted, const TorqueSamples& at) {
  return fitted.predict(at.q, at.dq, at.ddq).mean;
}

Eigen::VectorXd linear_error_percent(const TorqueSamples& train, const TorqueSamples& unseen) {
  const auto columns = [](const TorqueSamples& at) {
    Eigen::MatrixXd out(at.size(), 7);
    out << at.q, at.dq, at.ddq, Eigen::VectorXd::Ones(at.size());
    return out;
  };
  const Eigen::MatrixXd weights = columns(train).householderQr().solve(train.torque);
  return normalised_error_percent(unseen.torque, columns(unseen) * weights);
}

TEST(NeuralNetwork, LearnsAKnownFunction) {
  const TorqueSamples train = pendulums(500, 0.0, 0.02);
  const TorqueSamples unseen = pendulums(300, 200.0, 0.0);
  const FittedTorqueModel fitted = models::fit_neural_network(train, quick_training(), 1);
  EXPECT_EQ(fitted.samples, 500);
  const TorquePrediction prediction = fitted.predict(unseen.q, unseen.dq, unseen.ddq);
  // Per cent of the variance.
  constexpr double kLearned = 2.0;
  const Eigen::VectorXd nmse = normalised_error_percent(unseen.torque, prediction.mean);
  EXPECT_LT(nmse.maxCoeff(), kLearned);
  EXPECT_LT(5.0 * nmse.maxCoeff(), linear_error_percent(train, unseen).maxCoeff());
  // What it says of its own error, on motion of the same kind.
  const Eigen::MatrixXd error = unseen.torque - prediction.mean;
  for (Eigen::Index j = 0; j < 2; ++j) {
    const double rms = error.col(j).norm() / std::sqrt(double(unseen.size()));
    EXPECT_GT(prediction.sigma(0, j), 0.3 * rms);
    EXPECT_LT(prediction.sigma(0, j), 10.0 * std::max(rms, 0.02));
  }
}

TEST(NeuralNetwork, SameSeedSameBytesOtherSeedOtherNetwork) {
  const TorqueSamples train = pendulums(300, 0.0, 0.02);
  NeuralNetworkOptions options = quick_training();
  options.epochs = 10;
  const Eigen::MatrixXd once = predicted(models::fit_neural_network(train, options, 1), train);
  const Eigen::MatrixXd again = predicted(models::fit_neural_network(train, options, 1), train);
  const Eigen::MatrixXd other = predicted(models::fit_neural_network(train, options, 2), train);
  EXPECT_EQ(once, again);
  EXPECT_NE(once, other);
}

TEST(NeuralNetwork, OneSampleIsAsGoodAsMany) {
  const TorqueSamples train = pendulums(300, 0.0, 0.02);
  NeuralNetworkOptions options = quick_training();
  options.epochs = 10;
  const FittedTorqueModel fitted = models::fit_neural_network(train, options, 1);
  const TorqueSamples one = select_rows(train, {7});
  // Floats, added up in another order.
  EXPECT_LT((predicted(fitted, one) - predicted(fitted, train).row(7)).cwiseAbs().maxCoeff(), 1e-4);
}

TEST(NeuralNetwork, WhatIsWrongIsSaid) {
  const NeuralNetworkOptions options = quick_training();
  TorqueSamples damaged = pendulums(300, 0.0, 0.02);
  damaged.torque(5, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW((void)models::fit_neural_network(damaged, options, 1), Error);
  const TorqueSamples few = select_rows(pendulums(300, 0.0, 0.02), {0, 1, 2});
  EXPECT_THROW((void)models::fit_neural_network(few, options, 1), Error);
  NeuralNetworkOptions still = options;
  still.learning_rate = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW((void)models::fit_neural_network(pendulums(300, 0.0, 0.02), still, 1), Error);
}

TEST(NeuralNetwork, AConstantChannelDoesNoHarm) {
  TorqueSamples train = pendulums(300, 0.0, 0.02);
  train.q.col(1).setConstant(0.3);
  NeuralNetworkOptions options = quick_training();
  options.epochs = 5;
  EXPECT_TRUE(predicted(models::fit_neural_network(train, options, 1), train).allFinite());
}

}  // namespace
}  // namespace kinescope
