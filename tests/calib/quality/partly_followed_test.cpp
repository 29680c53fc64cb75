// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/partly_followed.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr int kFrames = 200;
constexpr double kFrameS = 0.05;
constexpr int kChange = 120;

// A joint that no channel drives; channels "a" and "b".
struct World {
  Calibration calibration;
  JointLog log;

  explicit World(const auto& value) {
    Joint joint;
    joint.name = "joint1";
    joint.type = JointType::kRevolute;
    calibration.tree.joints.push_back(joint);
    calibration.corrected_values.resize(kFrames, 1);
    log.source = "joints.csv";
    log.channels = {"a", "b"};
    log.values.resize(kFrames, 2);
    for (int i = 0; i < kFrames; ++i) {
      const double t = i * kFrameS;
      calibration.times_s.push_back(t);
      log.times_s.push_back(t);
      log.values.row(i) << std::sin(1.3 * t), 0.5 * std::cos(2.1 * t) + 0.1 * t;
      calibration.corrected_values(i, 0) = value(i, log.values(i, 0), log.values(i, 1));
    }
  }
  [[nodiscard]] std::vector<PartlyFollowed> followed() const {
    return partly_followed(calibration, log, {0, 1});
  }
};

double slight(int i) { return 1e-4 * ((i * 7919) % 13 - 6); }

TEST(PartlyFollowed, AFrozenReadingIsFollowedUpToThere) {
  World world([](int i, double a, double) { return a + 0.3 + slight(i); });
  for (int i = kChange; i < kFrames; ++i) world.log.values(i, 0) = world.log.values(kChange, 0);
  const std::vector<PartlyFollowed> followed = world.followed();
  ASSERT_EQ(followed.size(), 1U);
  ASSERT_EQ(followed[0].before.size(), 1U);
  EXPECT_TRUE(followed[0].after.empty());
  EXPECT_EQ(followed[0].before[0].channel, 0);
  EXPECT_NEAR(followed[0].before[0].scale, 1.0, 1e-3);
  EXPECT_NEAR(followed[0].before[0].offset, 0.3, 1e-3);
  EXPECT_NEAR(followed[0].before[0].to_s, kChange * kFrameS, 4.0 * kFrameS);
  EXPECT_FALSE(with_readings_mended(world.log, followed));
  EXPECT_NE(
      words_of(followed[0], world.calibration, world.log).find("joint1 follows 'a' up to t = "),
      std::string::npos);
}

TEST(PartlyFollowed, AnExchangeIsMended) {
  const World world(
      [](int i, double a, double b) { return (i < kChange ? a : -b) + 0.3 + slight(i); });
  const std::vector<PartlyFollowed> followed = world.followed();
  ASSERT_EQ(followed.size(), 1U);
  const std::optional<JointLog> mended = with_readings_mended(world.log, followed);
  ASSERT_TRUE(mended);
  for (int i = 0; i < kFrames; ++i) {
    if (std::abs(i - kChange) < 4) continue;
    EXPECT_NEAR(mended->values(i, 0) + 0.3, world.calibration.corrected_values(i, 0), 2e-3) << i;
  }
  EXPECT_EQ(mended->values.col(1), world.log.values.col(1));
}

TEST(PartlyFollowed, FramesThatDoNotShowTheJointDoNotCount) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const World world([](int i, double a, double b) {
    return i % 10 == 3 ? kNone : (i < kChange ? a : b) + slight(i);
  });
  ASSERT_EQ(world.followed().size(), 1U);
  EXPECT_EQ(world.followed()[0].after.size(), 1U);
}

TEST(PartlyFollowed, AMotionOfItsOwnFollowsNothing) {
  const World world([](int i, double a, double b) {
    return std::sin(0.17 * i + 0.5) + 0.2 * a + 0.1 * b + slight(i);
  });
  EXPECT_TRUE(world.followed().empty());
}

}  // namespace
}  // namespace kinescope
