// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "dynamics/gp/gaussian_process.h"
#include "dynamics/policy/kernel_matrix.h"
#include "kinematics/core/error.h"
#include "tests/dynamics/policy/cart_pole.h"
#include "tests/dynamics/policy/policy_world.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

Controller random_force(std::uint64_t seed) {
  return [rng = Rng(seed)](const Eigen::VectorXd&, int) mutable {
    return Eigen::VectorXd::Constant(1, rng.uniform(-10.0, 10.0));
  };
}

std::vector<Trial> explorations(int count, int steps) {
  std::vector<Trial> out;
  const CartPole plant;
  for (int k = 0; k < count; ++k) {
    out.push_back(plant.run(random_force(static_cast<std::uint64_t>(k + 1)), steps, 5, k));
  }
  return out;
}

ModelOptions quick(VelocityKernel kernel) {
  ModelOptions out;
  out.kernel = kernel;
  out.starts = 1;
  out.threads = 1;
  if (kernel == VelocityKernel::kSemiParametric) out.physics = std::make_shared<TestPhysics>();
  return out;
}

// Without friction and force: what the integration of ten steps of 5 ms loses.
TEST(CartPole, KeepsItsEnergy) {
  const CartPoleNumbers n{.friction = 0.0, .noise = 0.0, .start_sigma = 1.0};
  const CartPole plant(n);
  const Trial trial =
      plant.run([](const Eigen::VectorXd&, int) { return Eigen::VectorXd::Zero(1); }, 60, 3, 0);
  const auto energy = [&](Index k) {
    const Eigen::Vector4d x = trial.truth.row(k);
    const double swing = 0.5 * n.length_m * x[3];
    return 0.5 * (n.cart_kg + n.pole_kg) * x[2] * x[2] + n.pole_kg * x[2] * swing * std::cos(x[1]) +
           2.0 / 3.0 * n.pole_kg * swing * swing -
           0.5 * n.pole_kg * 9.81 * n.length_m * std::cos(x[1]);
  };
  for (Index k = 1; k <= 60; ++k) EXPECT_NEAR(energy(k), energy(0), 1e-5);
}

// What a model of a kernel of dynamics/gp with the same numbers says of the samples.
double log_likelihood(const VelocityProcess& process, const PhysicsFeatures* physics) {
  Eigen::MatrixXd a = kernel_matrix(process.kernel, process.inputs, process.inputs, physics);
  a.diagonal().array() += process.kernel.noise_variance;
  const Eigen::LLT<Eigen::MatrixXd> factor(a);
  const double half_log = Eigen::MatrixXd(factor.matrixL()).diagonal().array().log().sum();
  return -0.5 * process.targets.dot(factor.solve(process.targets)) - half_log -
         0.5 * static_cast<double>(process.targets.size()) * std::log(2.0 * std::numbers::pi);
}

// Also that the parameters of dynamics/gp are read in their order: with another one the
// likelihood would be another.
TEST(VelocityModel, HasTheLikelihoodThatTheSearchFound) {
  const std::vector<Trial> trials = explorations(1, 60);
  for (const VelocityKernel kernel :
       {VelocityKernel::kSquaredExponential, VelocityKernel::kPolynomial2,
        VelocityKernel::kSemiParametric}) {
    ModelOptions options = quick(kernel);
    options.subset_threshold = 0.0;
    const VelocityModel model = learn_model(cart_pole_layout(), trials, options);
    ASSERT_EQ(model.processes.size(), 2U);
    for (const VelocityProcess& process : model.processes) {
      ASSERT_EQ(process.inputs.rows(), 60);
      EXPECT_NEAR(log_likelihood(process, model.physics.get()), process.log_likelihood,
                  1e-6 * std::abs(process.log_likelihood))
          << name_of(kernel);
    }
  }
}

TEST(VelocityModel, FindsTheNoiseOfTheSpeedsAndPredictsUnseenMotion) {
  const std::vector<Trial> trials = explorations(3, 60);
  const VelocityModel model =
      learn_model(cart_pole_layout(), trials, quick(VelocityKernel::kPolynomial2));
  const double noise_of_a_difference = 0.01 * std::sqrt(2.0);
  for (const VelocityProcess& process : model.processes) {
    const double sigma = process.target_scale * std::sqrt(process.kernel.noise_variance);
    // The noise of inputs adds to that of targets.
    EXPECT_GT(sigma, 0.7 * noise_of_a_difference);
    EXPECT_LT(sigma, 3.0 * noise_of_a_difference);
  }
  PolicyTask task = cart_pole_task();
  const CartPole plant;
  const Trial truth = plant.run(random_force(77), 60, 9, 0);
  const auto prediction = [&](Index k) {
    Eigen::MatrixXd z(1, 6);
    state_features(model.layout, truth.truth.row(k), z.leftCols(5));
    z(0, 5) = truth.inputs(k, 0);
    Eigen::VectorXd out(2);
    for (std::size_t p = 0; p < 2; ++p) {
      const VelocityProcess& process = model.processes[p];
      Eigen::MatrixXd a = kernel_matrix(process.kernel, process.inputs, process.inputs, nullptr);
      a.diagonal().array() += process.kernel.noise_variance;
      out[static_cast<Index>(p)] =
          process.target_scale * (kernel_matrix(process.kernel, z, process.inputs, nullptr) *
                                  a.llt().solve(process.targets))[0];
    }
    return out;
  };
  double error = 0.0;
  double size = 0.0;
  for (Index k = 0; k < 60; k += 3) {
    const Eigen::VectorXd increment =
        (truth.truth.row(k + 1) - truth.truth.row(k)).tail(2).transpose();
    error += (prediction(k) - increment).squaredNorm();
    size += increment.squaredNorm();
  }
  EXPECT_LT(error, 0.01 * size);
}

TEST(VelocityModel, KeepsTheSamplesThatSayMost) {
  const std::vector<Trial> trials = explorations(3, 60);
  ModelOptions options = quick(VelocityKernel::kSquaredExponential);
  options.max_samples = 40;
  const VelocityModel model = learn_model(cart_pole_layout(), trials, options);
  EXPECT_EQ(model.processes[0].inputs.rows(), 40);
  EXPECT_EQ(model.processes[0].samples, 180);
  // The same sample again says nothing: less than half a sigma of the noise with four copies.
  KernelValues kernel = model.processes[0].kernel;
  kernel.noise_variance = 0.1;
  const Eigen::MatrixXd copies = model.processes[0].inputs.topRows(1).replicate(30, 1);
  EXPECT_LE(informative_samples(kernel, copies, nullptr, 0.5, 30).size(), 5U);
}

TEST(VelocityModel, IsTheSameAgainAndStartsFromTheLast) {
  const std::vector<Trial> trials = explorations(1, 60);
  const ModelOptions options = quick(VelocityKernel::kSquaredExponential);
  const VelocityModel a = learn_model(cart_pole_layout(), trials, options);
  const VelocityModel b = learn_model(cart_pole_layout(), trials, options);
  EXPECT_EQ(a.processes[0].kernel.length_scales, b.processes[0].kernel.length_scales);
  const VelocityModel c = learn_model(cart_pole_layout(), trials, options, &a);
  EXPECT_GE(c.processes[0].log_likelihood, a.processes[0].log_likelihood - 1e-9);
}

TEST(VelocityModel, RefusesWhatItCannotLearnFrom) {
  const StateLayout layout = cart_pole_layout();
  const std::vector<Trial> good = explorations(1, 60);
  const ModelOptions options = quick(VelocityKernel::kSquaredExponential);
  const auto message = [&](const std::vector<Trial>& trials, const ModelOptions& o) {
    try {
      static_cast<void>(learn_model(layout, trials, o));
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("no error");
  };
  EXPECT_NE(message({}, options).find("explore for longer"), std::string::npos);
  std::vector<Trial> trials = good;
  trials[0].smoothed(3, 2) = std::nan("");
  EXPECT_NE(message(trials, options).find("trial 0: a state or input is not finite"),
            std::string::npos);
  trials = good;
  trials[0].inputs = Eigen::MatrixXd::Zero(60, 2);
  EXPECT_NE(message(trials, options).find("give K x 1 inputs"), std::string::npos);
  trials = good;
  trials[0].smoothed.col(3).setConstant(0.5);
  EXPECT_NE(message(trials, options).find("the speed of 'pole' never changes"), std::string::npos);
  ModelOptions bad = options;
  bad.kernel = VelocityKernel::kSemiParametric;
  EXPECT_NE(message(good, bad).find("give the system's features"), std::string::npos);
  bad = options;
  bad.subset_threshold = std::nan("");
  EXPECT_NE(message(good, bad).find("subset threshold nan"), std::string::npos);
}

}  // namespace
}  // namespace kinescope::policy
