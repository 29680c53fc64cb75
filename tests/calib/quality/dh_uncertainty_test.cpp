// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/dh_uncertainty.h"

#include <array>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"
#include "tests/truth/camera_world.h"

namespace kinescope {
namespace {

constexpr std::array<double DhStep::*, 5> kDhNumbers{&DhStep::theta, &DhStep::d, &DhStep::a,
                                                     &DhStep::alpha, &DhStep::beta};

truth::World dh_world(std::uint64_t seed) {
  truth::WorldOptions options;
  options.seed = 7000 + seed;
  options.link_length_m = 0.2;
  options.joints = {JointType::kRevolute, JointType::kRevolute,
                    seed % 2 == 0 ? JointType::kRevolute : JointType::kPrismatic,
                    JointType::kRevolute};
  return truth::make_world(options);
}

Calibration calibrated_dh(const truth::World& world) {
  CalibrateOptions options;
  options.folds = 0;
  return calibrate(world.measurements, world.markers, world.log,
                   truth::perturbed_start(world, 0.01, 0.002, 1), options);
}

LinkId last_link(const KinematicTree& tree) {
  return LinkId{static_cast<int>(tree.links.size()) - 1};
}

double dh_error(const DhStep& found, const DhStep& truth, std::size_t number) {
  const double error = found.*kDhNumbers[number] - truth.*kDhNumbers[number];
  return number == 1 || number == 2 ? error : std::remainder(error, 2.0 * std::numbers::pi);
}

// Twice the claimed uncertainty holds the error in 95 of 100 numbers.
TEST(DhUncertainty, ClaimsHoldAgainstTheScatterOfCalibrations) {
  constexpr std::uint64_t kWorlds = 24;
  int count = 0, held = 0;
  double square = 0.0;
  for (std::uint64_t seed = 0; seed < kWorlds; ++seed) {
    const truth::World world = dh_world(seed);
    const DhChain expected = dh_chain(world.tree, last_link(world.tree));
    const Calibration found = calibrated_dh(world);
    const DhChain chain = dh_chain(found.tree, expected);
    const DhUncertainty uncertainty = dh_uncertainty(found, chain);
    for (std::size_t k = 0; k < chain.steps.size(); ++k) {
      for (std::size_t i = 0; i < kDhNumbers.size(); ++i) {
        const DhNumber& number = uncertainty.steps[k][i];
        if (!number.sigma) continue;
        const double z = dh_error(chain.steps[k], expected.steps[k], i) / *number.sigma;
        square += z * z;
        held += std::abs(z) < 2.0 ? 1 : 0;
        ++count;
      }
    }
  }
  EXPECT_GT(count, static_cast<int>(8 * kWorlds));
  // Noise is shared within a world: about 24 x 6 independent numbers.
  EXPECT_NEAR(static_cast<double>(held) / count, 0.95, 0.04) << count;
  EXPECT_NEAR(std::sqrt(square / count), 1.0, 0.2);
}

// The propagation alone: the robot moved by draws of the parameters.
TEST(DhUncertainty, IsThatOfDrawsOfTheParameters) {
  const Calibration calibration = calibrated_dh(dh_world(3));
  const DhChain chain = dh_chain(calibration.tree, last_link(calibration.tree));
  const DhUncertainty uncertainty = dh_uncertainty(calibration, chain);
  const Eigen::MatrixXd L = calibration.covariance.llt().matrixL();
  ASSERT_TRUE(L.allFinite());
  constexpr int kDraws = 2000;
  Rng rng(5);
  std::vector<std::array<double, 5>> square(chain.steps.size());
  for (int draw = 0; draw < kDraws; ++draw) {
    Eigen::VectorXd by(L.rows());
    for (double& value : by) value = rng.normal();
    by = L * by;
    KinematicTree moved = calibration.tree;
    for (std::size_t p = 0; p < calibration.parameters.size(); ++p)
      static_cast<void>(move_robot(moved, calibration, calibration.parameters[p],
                                   by[static_cast<Eigen::Index>(p)]));
    const DhChain other = dh_chain(moved, chain);
    for (std::size_t k = 0; k < chain.steps.size(); ++k)
      for (std::size_t i = 0; i < 5; ++i)
        square[k][i] += std::pow(dh_error(other.steps[k], chain.steps[k], i), 2);
  }
  for (std::size_t k = 0; k < chain.steps.size(); ++k) {
    for (std::size_t i = 0; i < 5; ++i) {
      const double scatter = std::sqrt(square[k][i] / kDraws);
      const DhNumber& number = uncertainty.steps[k][i];
      if (number.sigma) {
        EXPECT_NEAR(scatter / *number.sigma, 1.0, 0.07) << k << " " << i;
      } else {
        EXPECT_LT(scatter, 1e-12) << k << " " << i;
      }
    }
  }
}

TEST(DhUncertainty, WhatIsNotKnownHasNone) {
  Calibration calibration = calibrated_dh(dh_world(2));
  const DhChain chain = dh_chain(calibration.tree, last_link(calibration.tree));
  calibration.tree.joints[1].channel.clear();
  const DhUncertainty uncertainty = dh_uncertainty(calibration, chain);
  EXPECT_EQ(uncertainty.steps[1][0].state, NumberState::kNoChannel);
  EXPECT_FALSE(uncertainty.steps[1][0].sigma);
  EXPECT_EQ(uncertainty.steps[0][0].state, NumberState::kHeld) << "so by construction";
  for (Parameter& parameter : calibration.parameters)
    if (parameter.block == calibration.tree.joints[2].name) parameter.sigma.reset();
  EXPECT_EQ(dh_uncertainty(calibration, chain).steps[1][3].state, NumberState::kUndetermined);
}

}  // namespace
}  // namespace kinescope
