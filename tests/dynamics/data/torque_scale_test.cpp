// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/torque_scale.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/data/torque_data.h"
#include "tests/dynamics/data/log_world.h"

namespace kinescope {
namespace {

/// Samples of the made-up robot and the torque of a rough model of it: inertia and gravity, no
/// friction, 20 % off.
struct Scene {
  TorqueSamples samples;
  Eigen::MatrixXd predicted;
};

Scene make_scene(double torque_lag_s = 0.0) {
  LogWorldOptions options{.duration_s = 20.0, .torque_noise = 0.02, .torque_lag_s = torque_lag_s};
  const LogWorld world = make_log_world(options);
  TorqueDataOptions reading;
  reading.motion.cutoff_hz = 10.0;
  Scene scene;
  scene.samples =
      read_torque_data({write_log("scale.csv", world.csv())}, world.joints, reading).samples;
  const TorqueSamples& s = scene.samples;
  scene.predicted.resize(s.size(), 3);
  scene.predicted.col(0) = 0.8 * (1.2 * s.ddq.col(0).array() + 9.0 * s.q.col(0).array().sin());
  scene.predicted.col(1) = 1.2 * (0.6 * s.ddq.col(1).array() + 3.0 * s.q.col(1).array().cos());
  scene.predicted.col(2) = 3.0 * s.ddq.col(2).array() + 20.0;
  return scene;
}

TEST(TorqueScale, FrictionAndARoughModelAreNoScale) {
  const Scene scene = make_scene();
  const TorqueScales scales = compare_torque_scale(scene.samples, scene.predicted);
  EXPECT_TRUE(scales.findings.empty()) << to_line(scales.findings.front());
  constexpr double kFit = 0.05;  // the friction's smooth sign is not the fit's
  EXPECT_NEAR(scales.joints[0].factor, 1.0 / 0.8, kFit);
  EXPECT_NEAR(scales.joints[1].factor, 1.0 / 1.2, kFit);
  EXPECT_NEAR(scales.joints[2].factor, 1.0, kFit);
  for (const TorqueScale& scale : scales.joints) EXPECT_EQ(scale.lag_s, 0.0);
}

TEST(TorqueScale, NamesUnitsSignsAndGains) {
  Scene scene = make_scene();
  const TorqueSamples sound = scene.samples;
  scene.samples.torque = 1000.0 * sound.torque;
  auto scales = compare_torque_scale(scene.samples, scene.predicted);
  ASSERT_EQ(findings_of(scales.findings, LogFault::kTorqueScale).size(), 3U);
  EXPECT_EQ(scales.findings[0].weight, FaultWeight::kRefusal);
  EXPECT_NE(scales.findings[0].remedy.find("torque_unit: [mNm]"), std::string::npos);
  scene.samples.torque = 0.001 * sound.torque;
  scales = compare_torque_scale(scene.samples, scene.predicted);
  EXPECT_NE(scales.findings[0].remedy.find("torque_unit: [kNm]"), std::string::npos);
  scene.samples.torque = sound.torque;
  scene.samples.torque.col(1) *= -1.0;
  scales = compare_torque_scale(scene.samples, scene.predicted);
  ASSERT_EQ(scales.findings.size(), 1U);
  EXPECT_EQ(scales.findings[0].channel, "joint2");
  EXPECT_NE(scales.findings[0].what.find("other sign"), std::string::npos);
  // The joint concerned alone.
  EXPECT_NE(scales.findings[0].remedy.find("torque_factor: [1, -1, 1]"), std::string::npos)
      << scales.findings[0].remedy;
  scene.predicted.col(0) /= 0.8;
  scene.predicted.col(1) /= 1.2;
  scene.samples.torque = sound.torque / 12.0;
  scales = compare_torque_scale(scene.samples, scene.predicted);
  ASSERT_EQ(scales.findings.size(), 1U);
  EXPECT_NEAR(scales.findings[0].value, 1.0 / 12.0, 0.01);
}

bool refuses(const TorqueScales& scales) {
  return std::ranges::any_of(scales.findings, [](const LogFinding& finding) {
    return finding.weight == FaultWeight::kRefusal;
  });
}

// A model that hardly loads a joint (a stand-in for masses, an axis that gravity does not turn):
// what friction leaves may follow the acceleration and be a million times the model's.
TEST(TorqueScale, WhereFrictionIsFarMoreTheScaleIsNotJudged) {
  Scene scene = make_scene();
  scene.predicted *= 1e-5;
  const TorqueSamples sound = scene.samples;
  const Eigen::Vector3d drive_scale{1.0, 1.0, 10.0};  // N m, N
  for (const double sign : {1.0, -1.0}) {
    scene.samples.torque = sign * sound.torque;
    EXPECT_TRUE(refuses(compare_torque_scale(scene.samples, scene.predicted)));
    const auto scales = compare_torque_scale(scene.samples, scene.predicted, drive_scale);
    EXPECT_FALSE(refuses(scales)) << to_line(scales.findings.front());
    EXPECT_EQ(findings_of(scales.findings, LogFault::kTorqueScale).size(), 3U);
  }
  // No drive of this robot has a thousand times that.
  scene.samples.torque = 1000.0 * sound.torque;
  EXPECT_TRUE(refuses(compare_torque_scale(scene.samples, scene.predicted, drive_scale)));
}

// A light wrist: what a wrong law of friction leaves may go against the little that it lifts.
TEST(TorqueScale, WhereFrictionIsFarMoreOfOneJointItsSignIsNotJudged) {
  Scene scene = make_scene();
  scene.predicted.col(1) *= -0.01;
  const TorqueScales scales = compare_torque_scale(scene.samples, scene.predicted);
  EXPECT_TRUE(scales.joints[1].of_friction);
  EXPECT_FALSE(scales.joints[0].of_friction);
  EXPECT_FALSE(refuses(scales)) << to_line(scales.findings.front());
  ASSERT_EQ(scales.findings.size(), 1U);
  EXPECT_EQ(scales.findings[0].weight, FaultWeight::kNote);
  // As much of all joints is another unit.
  scene.predicted *= 1e-3;
  EXPECT_TRUE(refuses(compare_torque_scale(scene.samples, scene.predicted)));
}

TEST(TorqueScale, FindsATorqueThatComesLate) {
  constexpr double kLag = 0.03;
  const Scene scene = make_scene(kLag);
  const TorqueScales scales = compare_torque_scale(scene.samples, scene.predicted);
  for (const TorqueScale& scale : scales.joints) EXPECT_NEAR(scale.lag_s, kLag, 0.004);
  EXPECT_EQ(findings_of(scales.findings, LogFault::kLag).size(), 3U);
}

TEST(TorqueScale, AJointWithoutLoadSaysNothing) {
  Scene scene = make_scene();
  scene.predicted.col(2).setZero();
  const TorqueScales scales = compare_torque_scale(scene.samples, scene.predicted);
  EXPECT_EQ(scales.joints[2].factor, 0.0);
  EXPECT_TRUE(scales.findings.empty());
}

}  // namespace
}  // namespace kinescope
