// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/simulated_system.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "dynamics/policy/systems/ball_plate.h"
#include "dynamics/policy/systems/cart_pole.h"
#include "dynamics/policy/systems/double_pendulum.h"
#include "dynamics/policy/systems/furuta.h"
#include "dynamics/policy/systems/smoothing.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope::policy {
namespace {

SimulatedTrials cart_trials(Sensing sensing, double sigma) {
  SimulatedTrials out;
  out.start = {Eigen::MatrixXd::Zero(1, 4), Eigen::VectorXd::Constant(4, 0.01)};
  out.sensors.sensing = sensing;
  out.sensors.noise_sigma = Eigen::VectorXd::Constant(4, sigma);
  if (sensing == Sensing::kPositionsOnly) out.sensors.speed_cutoff_hz = 5.0;
  out.smoothing_cutoff_hz = 5.0;
  return out;
}

Controller random_pushes(double limit) {
  return [limit](const Eigen::VectorXd&, int step) {
    Rng rng = Rng::from_name("pushes", static_cast<std::uint64_t>(step));
    return Eigen::VectorXd(Eigen::VectorXd::Constant(1, rng.uniform(-limit, limit)));
  };
}

TEST(SimulatedSystem, SameSeedSameTrial) {
  const SimulatedSystem system(cart_pole(), cart_trials(Sensing::kFullState, 0.01));
  const Trial a = system.run(random_pushes(10.0), 20, 3, 1);
  const Trial b = system.run(random_pushes(10.0), 20, 3, 1);
  EXPECT_EQ(a.seen, b.seen);
  EXPECT_EQ(a.truth, b.truth);
  EXPECT_NE(a.truth, system.run(random_pushes(10.0), 20, 3, 2).truth);
  EXPECT_NE(a.truth, system.run(random_pushes(10.0), 20, 4, 1).truth);
}

TEST(SimulatedSystem, MeasuresWithTheNoiseItIsGiven) {
  const double sigma = 0.02;
  const SimulatedSystem system(cart_pole(), cart_trials(Sensing::kFullState, sigma));
  const Trial trial = system.run(random_pushes(1.0), 1000, 1, 0);
  const Eigen::MatrixXd noise = trial.seen - trial.truth;
  // 4004 draws: the mean square is within 4 of its own standard deviations.
  const double relative = noise.squaredNorm() / (static_cast<double>(noise.size()) * sigma * sigma);
  EXPECT_NEAR(relative, 1.0, 4.0 * std::sqrt(2.0 / static_cast<double>(noise.size())));
  EXPECT_EQ(trial.smoothed, trial.seen);
}

TEST(SimulatedSystem, HoldsInputsWithinTheirLimits) {
  const SimulatedSystem system(cart_pole(), cart_trials(Sensing::kFullState, 0.0));
  const Trial trial = system.run(random_pushes(100.0), 30, 1, 0);
  EXPECT_DOUBLE_EQ(trial.inputs.cwiseAbs().maxCoeff(), 10.0);
}

TEST(SimulatedSystem, StartsFromEveryMode) {
  SimulatedTrials trials = cart_trials(Sensing::kFullState, 0.0);
  trials.start.means = Eigen::MatrixXd::Zero(2, 4);
  trials.start.means(0, 0) = -1.0;
  trials.start.means(1, 0) = 1.0;
  const SimulatedSystem system(cart_pole(), trials);
  int right = 0;
  for (int trial = 0; trial < 64; ++trial) {
    const double start = system.run(random_pushes(1.0), 1, 1, trial).truth(0, 0);
    EXPECT_NEAR(std::abs(start), 1.0, 0.06);
    right += start > 0.0 ? 1 : 0;
  }
  EXPECT_NEAR(right, 32, 16);  // four standard deviations of 64 coins
}

// Speeds from positions alone: afterwards better than on line, both better than differences.
TEST(SimulatedSystem, EstimatesSpeedsFromPositions) {
  CartPole values;
  values.step_s = 1.0 / 30.0;
  SimulatedTrials trials = cart_trials(Sensing::kPositionsOnly, 3e-3);
  trials.sensors.speed_cutoff_hz = kSpeedCutoffShare / values.step_s;
  trials.smoothing_cutoff_hz = kSpeedCutoffShare / values.step_s;
  const SimulatedSystem system(cart_pole(values), trials);
  double on_line = 0.0;
  double afterwards = 0.0;
  for (int trial = 0; trial < 40; ++trial) {
    const Trial run = system.run(random_pushes(10.0), 90, 1, trial);
    const Eigen::MatrixXd truth = run.truth.rightCols(2);
    on_line += (run.seen.rightCols(2) - truth).squaredNorm();
    afterwards += (run.smoothed.rightCols(2) - truth).squaredNorm();
  }
  std::printf("speeds: %.3f on line, %.3f afterwards\n", std::sqrt(on_line / (40 * 182)),
              std::sqrt(afterwards / (40 * 182)));
  EXPECT_LT(afterwards, 0.5 * on_line);
}

TEST(SimulatedSystem, IntegratesFinelyEnough) {
  const auto moved = [](const Mechanism& mechanism, int substeps) {
    Eigen::VectorXd state = Eigen::VectorXd::Zero(mechanism.layout.state_count());
    for (int k = 0; k < 60; ++k) {
      Rng rng = Rng::from_name("input", static_cast<std::uint64_t>(k));
      const Eigen::VectorXd input = mechanism.layout.input_limit * rng.uniform(-1.0, 1.0);
      state = move(mechanism, state, input, mechanism.layout.step_s, substeps);
    }
    return state;
  };
  for (const Mechanism& mechanism :
       {cart_pole(), furuta(), ball_plate(), double_pendulum(MotorAt::kElbow)}) {
    const int used = static_cast<int>(std::ceil(mechanism.layout.step_s / 1.25e-3));
    const double apart = (moved(mechanism, used) - moved(mechanism, 2 * used)).norm();
    std::printf("%s: half the step moves it by %.1e\n", mechanism.name.c_str(), apart);
    EXPECT_LT(apart, 1e-5) << mechanism.name;
  }
}

TEST(SimulatedSystem, SaysWhatIsWrong) {
  const auto message = [](const auto& act) {
    try {
      act();
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  SimulatedTrials trials = cart_trials(Sensing::kFullState, 0.01);
  trials.start.sigma.resize(3);
  EXPECT_NE(message([&] { SimulatedSystem(cart_pole(), trials); }).find("start"),
            std::string::npos);
  const SimulatedSystem system(cart_pole(), cart_trials(Sensing::kFullState, 0.01));
  const Controller broken = [](const Eigen::VectorXd&, int step) {
    return Eigen::VectorXd(
        Eigen::VectorXd::Constant(1, step < 3 ? 0.0 : std::numeric_limits<double>::quiet_NaN()));
  };
  EXPECT_NE(message([&] { (void)system.run(broken, 10, 1, 0); }).find("step 3 is no number"),
            std::string::npos);
}

}  // namespace
}  // namespace kinescope::policy
