// SPDX-License-Identifier: Apache-2.0
#include "app/io/dynamics_settings.h"

#include <filesystem>

#include <gtest/gtest.h>

#include "app/io/recording.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

std::filesystem::path write_settings(const std::string& text) {
  const auto folder = truth::temporary_path("dynamics_settings");
  std::filesystem::create_directories(folder);
  write_file_atomically(folder / "recording.yaml", text);
  return folder / "recording.yaml";
}

std::string refusal(const std::string& text) {
  try {
    static_cast<void>(read_dynamics_settings(write_settings(text)));
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(DynamicsSettings, FillTheMappingAndTheFilter) {
  const auto path = write_settings(
      "name: arm\n"
      "dynamics:\n"
      "  position: qm*\n"
      "  torque: [a, b]\n"
      "  position_unit: deg\n"
      "  torque_factor: [1.5, -2]\n"
      "  joints: {shoulder: hip}\n"
      "  time_unit: ms\n"
      "  filter: butterworth\n"
      "  source: velocity\n"
      "  cutoff_hz: 7\n"
      "  max_gap_s: 0.2\n");
  const TorqueDataOptions options = read_dynamics_settings(path);
  EXPECT_EQ(options.mapping.position, std::vector<std::string>{"qm*"});
  EXPECT_EQ(options.mapping.torque, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(options.mapping.position_unit, std::vector<std::string>{"deg"});
  EXPECT_EQ(options.mapping.torque_factor, (std::vector<double>{1.5, -2.0}));
  EXPECT_EQ(options.mapping.joints.at("shoulder"), "hip");
  EXPECT_EQ(options.mapping.time_unit, "ms");
  EXPECT_EQ(options.motion.filter, LowPass::kButterworth);
  EXPECT_EQ(options.motion.source, MotionSource::kVelocity);
  EXPECT_EQ(options.motion.cutoff_hz, 7.0);
  EXPECT_EQ(options.checks.max_gap_s, 0.2);
  EXPECT_EQ(read_recording_settings(path).name, "arm")
      << "the key is known to the rest of the program";
}

TEST(DynamicsSettings, TorquesNamedForTheCalibrationAreTorquesHere) {
  const TorqueDataOptions options = read_dynamics_settings(write_settings("torques: [m1, m2]\n"));
  EXPECT_EQ(options.mapping.torque, (std::vector<std::string>{"m1", "m2"}));
}

TEST(DynamicsSettings, RefuseWhatTheyDoNotKnow) {
  EXPECT_NE(refusal("dynamics: {positon: q*}\n").find("position"), std::string::npos);
  EXPECT_NE(refusal("dynamics: {filter: splin}\n").find("spline"), std::string::npos);
  EXPECT_NE(refusal("dynamics: {cutoff_hz: -3}\n"), "accepted");
  EXPECT_NE(refusal("dynamics: {torque_factor: [one]}\n"), "accepted");
}

}  // namespace
}  // namespace kinescope
