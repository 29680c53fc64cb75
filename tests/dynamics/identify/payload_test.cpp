// SPDX-License-Identifier: Apache-2.0
//
// What a robot carries, from its torques.
#include "dynamics/identify/payload.h"

#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

constexpr double kMass = 0.7;
const Eigen::Vector3d kCentre(0.02, -0.03, 0.1);
// Rounding of 4000 samples through the normal equations.
constexpr double kExact = 1e-6;
// About four claimed sigmas hold the error but for one log in 10 000.
constexpr double kSigmas = 4.0;

DynamicModel arm(int joints) {
  Rng rng = Rng::from_name("payload test");
  return random_masses(random_robot({.joints = joints, .prismatic_share = 0.0}, rng).tree,
                       {.every_direction = false}, rng);
}

std::size_t hand_of(const DynamicModel& model) {
  const std::string name = make_rigid_model(model).bodies.back().name;
  for (std::size_t l = 0; l < model.links.size(); ++l) {
    if (model.tree.links[l].name == name) return l;
  }
  return 0;
}

DynamicModel with_load(DynamicModel model) {
  model.links[hand_of(model)] += from_central(
      {.mass_kg = kMass, .centre_m = kCentre, .inertia_kgm2 = 1e-3 * Eigen::Matrix3d::Identity()});
  return model;
}

TorqueSamples log_of(const DynamicModel& model, const char* name,
                     const TorqueWorldOptions& options) {
  Rng rng = Rng::from_name(name);
  return torque_log_of(model, options, rng);
}

TEST(Payload, ExactWithoutNoiseEitherWay) {
  const DynamicModel bare = arm(4);
  const TorqueSamples loaded = log_of(with_load(bare), "loaded", {.noise = 0.0});
  const TorqueSamples unloaded = log_of(bare, "unloaded", {.noise = 0.0});
  for (const PayloadEstimate& found :
       {estimate_payload(bare, loaded), estimate_payload(bare, loaded, unloaded)}) {
    EXPECT_NEAR(found.mass_kg, kMass, kExact);
    EXPECT_LT((found.centre_m - kCentre).norm(), kExact);
  }
}

TEST(Payload, TwoLogsNeedNoMasses) {
  const DynamicModel bare = arm(4);
  DynamicModel unknown = bare;
  for (InertialParameters& link : unknown.links) link = {};
  const TorqueSamples loaded = log_of(with_load(bare), "loaded", {.noise = 0.0});
  const TorqueSamples unloaded = log_of(bare, "unloaded", {.noise = 0.0});
  EXPECT_NEAR(estimate_payload(unknown, loaded, unloaded).mass_kg, kMass, kExact);
}

TEST(Payload, NoiseAndOutliersStayWithinTheInterval) {
  const DynamicModel bare = arm(4);
  const TorqueSamples loaded =
      log_of(with_load(bare), "noisy", {.noise = 0.02, .noise_memory = 0.8, .outliers = 0.02});
  const PayloadEstimate found = estimate_payload(bare, loaded);
  EXPECT_NEAR(found.mass_kg, kMass, kSigmas * found.sigma_kg);
  EXPECT_LT(found.sigma_kg, 0.1 * kMass);
  EXPECT_TRUE(found.is_seen());
  EXPECT_LT(found.lower_kg, found.mass_kg);
  EXPECT_FALSE(found.joints.empty());
}

TEST(Payload, TheIntervalHoldsTheTruthAsOftenAsItSays) {
  constexpr int kPayloadSeeds = 150;
  // 95 % less four sigmas of a count of 150. More is no fault: the joints' disagreement can only
  // widen.
  constexpr double kFewest = 0.88;
  const DynamicModel bare = arm(4);
  const DynamicModel full = with_load(bare);
  int held = 0;
  double error = 0.0;
  double claimed = 0.0;
  for (int seed = 0; seed < kPayloadSeeds; ++seed) {
    Rng rng = Rng::from_name("payload scatter", static_cast<std::uint64_t>(seed));
    const TorqueSamples loaded = torque_log_of(
        full, {.samples = 1000, .noise = 0.02, .noise_memory = 0.7, .common_noise = 0.3}, rng);
    const PayloadEstimate found = estimate_payload(bare, loaded);
    held += found.lower_kg <= kMass && kMass <= found.upper_kg ? 1 : 0;
    error += std::pow(found.mass_kg - kMass, 2);
    claimed += std::pow(found.sigma_kg, 2);
  }
  EXPECT_GE(held, kFewest * kPayloadSeeds);
  const double ratio = std::sqrt(claimed / error);
  EXPECT_GT(ratio, 0.8);
  EXPECT_LT(ratio, 1.6) << "an interval that is too wide says nothing";
}

TEST(Payload, NoLoadIsNotSeen) {
  const DynamicModel bare = arm(4);
  const PayloadEstimate found =
      estimate_payload(bare, log_of(bare, "no load", {.noise = 0.02, .noise_memory = 0.8}));
  EXPECT_NEAR(found.mass_kg, 0.0, kSigmas * found.sigma_kg);
}

TEST(Payload, WrongDriveGainsMakeTheJointsDisagree) {
  const DynamicModel bare = arm(4);
  TorqueSamples loaded = log_of(with_load(bare), "gains", {.noise = 0.01});
  TorqueSamples unloaded = log_of(bare, "gains without", {.noise = 0.01});
  const PayloadEstimate right = estimate_payload(bare, loaded, unloaded);
  for (TorqueSamples* log : {&loaded, &unloaded}) log->torque.col(1) *= 1.3;
  const PayloadEstimate wrong = estimate_payload(bare, loaded, unloaded);
  EXPECT_LT(right.disagreement, 3.0);
  EXPECT_GT(wrong.disagreement, 3.0 * right.disagreement);
  EXPECT_GT(wrong.sigma_kg, right.sigma_kg);
}

TEST(Payload, AtRestFromTheLearnedTorque) {
  const DynamicModel bare = arm(3);
  RobustTorqueOptions few;
  few.samples = 250;
  const TorqueWorldOptions world{
      .samples = 2000, .noise = 0.02, .outliers = 0.03, .trajectories = 10};
  const RobustTorque loaded =
      learn_robust_torque(bare, log_of(with_load(bare), "at rest", world), few);
  const PayloadEstimate one = payload_at_rest(bare, loaded, nullptr);
  EXPECT_NEAR(one.mass_kg, kMass, kSigmas * one.sigma_kg);
  EXPECT_LT(one.sigma_kg, 0.2 * kMass);
  EXPECT_EQ(one.freedom, loaded.folds - 1);
  const RobustTorque unloaded =
      learn_robust_torque(bare, log_of(bare, "at rest without", world), few);
  const PayloadEstimate two = payload_at_rest(bare, loaded, &unloaded);
  EXPECT_NEAR(two.mass_kg, kMass, kSigmas * two.sigma_kg);
}

TEST(Payload, RefusesWhatCannotBe) {
  const DynamicModel bare = arm(3);
  TorqueSamples log = log_of(bare, "refusals", {.samples = 500});
  EXPECT_THROW((void)estimate_payload(bare, log, {.link = "no such link"}), Error);
  TorqueSamples currents = log;
  currents.torque_unit = "A";
  EXPECT_THROW((void)estimate_payload(bare, currents), Error);
  // Without gravity, a load on the axis of a robot that only turns about it shows no mass.
  DynamicModel one = arm(1);
  one.gravity_m_s2.setZero();
  EXPECT_THROW((void)estimate_payload(one, log_of(one, "one joint", {.samples = 500})), Error);
}

TEST(Payload, StudentPointsAreThoseOfTheTable) {
  // Abramowitz and Stegun, table 26.10.
  EXPECT_NEAR(student_point(9), 2.262, 0.003);
  EXPECT_NEAR(student_point(19), 2.093, 0.001);
  EXPECT_NEAR(student_point(100), 1.984, 0.001);
}

}  // namespace
}  // namespace kinescope
