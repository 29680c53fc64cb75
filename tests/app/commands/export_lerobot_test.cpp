// SPDX-License-Identifier: Apache-2.0
//
// The calibration file of a LeRobot arm: with the new one the driver's values are the angles of the
// nominal robot. How the driver makes counts values is written here anew, as LeRobot does it
// (lerobot/motors/motors_bus.py, _normalize).
#include <cmath>
#include <filesystem>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/urdf/urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/filmed_robot.h"
#include "tests/truth/recorded_world.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const std::vector<std::string> kMotors = {"shoulder_pan", "shoulder_lift", "elbow_flex",
                                          "wrist_flex", "wrist_roll"};
// The count at which each joint of the true robot is at zero; the middles of the ranges below are
// 2048, 2100, 1950, 2050, 2047.5.
constexpr std::array kZeroCounts = {2110.0, 2060.0, 1975.0, 2000.0, 2070.0};
// Of the first and the last joint no recording shows the zero: the base and the last markers may
// sit as they like.
constexpr std::array<std::size_t, 3> kShown = {1, 2, 3};
constexpr std::array<std::size_t, 2> kNotShown = {0, 4};
constexpr const char* kArmFile = R"({
    "shoulder_pan": {"id": 1, "drive_mode": 0, "homing_offset": -12, "range_min": 848, "range_max": 3248},
    "shoulder_lift": {"id": 2, "drive_mode": 0, "homing_offset": 5, "range_min": 900, "range_max": 3300},
    "elbow_flex": {"id": 3, "drive_mode": 0, "homing_offset": 0, "range_min": 950, "range_max": 2950},
    "wrist_flex": {"id": 4, "drive_mode": 0, "homing_offset": 7, "range_min": 1000, "range_max": 3100},
    "wrist_roll": {"id": 5, "drive_mode": 0, "homing_offset": 0, "range_min": 0, "range_max": 4095},
    "gripper": {"id": 6, "drive_mode": 0, "homing_offset": 100, "range_min": 2000, "range_max": 3500}
}
)";

constexpr double kCountDeg = 360.0 / 4096.0;

double count_of_joint(std::size_t joint, double angle_rad) {
  return std::round(kZeroCounts[joint] + angle_rad * 4096.0 / (2.0 * std::numbers::pi));
}

double value_in_degrees(const json& motor, double count) {
  const double middle =
      (motor.at("range_min").get<double>() + motor.at("range_max").get<double>()) / 2.0;
  return (count - middle) * 360.0 / 4095.0;
}

double value_in_percent(const json& motor, double count) {
  const double low = motor.at("range_min").get<double>(),
               high = motor.at("range_max").get<double>();
  return (count - low) / (high - low) * 200.0 - 100.0;
}

KinematicTree servo_arm() {
  truth::FilmedRobotOptions options;
  options.seed = 3;
  options.kind = truth::RobotKind::kArm6;
  KinematicTree out = truth::draw_filmed_robot(options).tree;
  out.joints.resize(kMotors.size());
  out.links.resize(kMotors.size() + 1);
  std::erase_if(out.markers,
                [&](const Marker& marker) { return marker.link.index() >= out.links.size(); });
  for (std::size_t j = 0; j < kMotors.size(); ++j) {
    out.joints[j].name = out.joints[j].channel = kMotors[j];
    out.joints[j].limits = JointLimits{-1.6, 1.5};
  }
  return out;
}

// The true arm as its driver logs it with the old file, and its drawing.
void write_arm(const fs::path& folder, double (*value_of_count)(const json&, double),
               const std::string& unit) {
  truth::WorldOptions options;
  options.seed = 1;
  options.robot = servo_arm();
  options.frames = 240;
  options.sigma_px = 0.05;
  truth::World world = truth::make_world(options);
  KinematicTree drawing = world.tree;
  drawing.markers.clear();
  const json arm = json::parse(kArmFile);
  for (Eigen::Index i = 0; i < world.log.values.rows(); ++i)
    for (std::size_t j = 0; j < kMotors.size(); ++j) {
      double& value = world.log.values(i, static_cast<Eigen::Index>(j));
      value = value_of_count(arm.at(kMotors[j]), count_of_joint(j, value));
    }
  truth::write_world(world, folder);
  write_file_atomically(folder / "nominal.urdf", write_urdf(drawing));
  std::string units = "units: {";
  for (const std::string& motor : kMotors) units += fmt::format("{}: {}, ", motor, unit);
  write_file_atomically(folder / "recording.yaml", units + "}\n");
}

class ExportLerobot : public testing::Test {
 protected:
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  json exported(const std::string& run_folder) {
    folder_.write("old.json", kArmFile);
    const Outcome outcome = run({"export", run_folder, "--lerobot", path("new.json"),
                                 "--lerobot-from", path("old.json"), "--json"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    told_ = outcome.err;
    said_ = json::parse(outcome.out, nullptr, false);
    return json::parse(read_text_file(path("new.json")));
  }
  // As the export says it of the zero, which must be worth having.
  double three_sigma_deg(std::size_t joint) {
    for (const json& motor : said_.at("lerobot").at("motors")) {
      if (motor.at("motor") != kMotors[joint]) continue;
      const double expanded_deg = motor.at("U_zero_deg").get<double>();
      EXPECT_LT(expanded_deg, 0.25) << kMotors[joint];
      return 1.5 * expanded_deg;
    }
    ADD_FAILURE() << kMotors[joint] << " is not among the motors";
    return 0.0;
  }
  RecordingFolder folder_;
  json said_;
  std::string told_;
};

TEST_F(ExportLerobot, DegreesBecomeTheDrawingsAngles) {
  write_arm(folder_.path() / "arm", value_in_degrees, "deg");
  const Outcome made = run({"run", path("arm"), "--output", path("arm_run"), "--quiet"});
  ASSERT_EQ(made.code, 0) << made.err;
  const json arm = exported(path("arm_run"));
  const json before = json::parse(kArmFile);
  EXPECT_EQ(said_.at("lerobot").at("values"), "degrees");
  ASSERT_EQ(said_.at("lerobot").at("motors").size(), kShown.size());
  for (const std::size_t j : kShown) {
    const double within = 0.5 * kCountDeg + three_sigma_deg(j);
    const json &motor = arm.at(kMotors[j]), &old = before.at(kMotors[j]);
    for (const double angle_deg : {-50.0, 0.0, 40.0}) {
      const double count = count_of_joint(j, angle_deg * std::numbers::pi / 180.0);
      EXPECT_NEAR(value_in_degrees(motor, count), angle_deg, within) << kMotors[j];
      EXPECT_GT(std::abs(value_in_degrees(old, count) - angle_deg), 2.0) << "of the old file";
    }
    EXPECT_GE(motor.at("range_min").get<int>(), old.at("range_min").get<int>());
    EXPECT_LE(motor.at("range_max").get<int>(), old.at("range_max").get<int>());
    for (const char* key : {"id", "drive_mode", "homing_offset"})
      EXPECT_EQ(motor.at(key), old.at(key));
  }
  EXPECT_EQ(arm.at("gripper"), before.at("gripper"));
  for (const std::size_t j : kNotShown) {
    EXPECT_EQ(arm.at(kMotors[j]), before.at(kMotors[j]));
    EXPECT_NE(told_.find(kMotors[j] + " stays as it was: its zero is not seen"), std::string::npos)
        << told_;
  }
}

TEST_F(ExportLerobot, PerCentBecomeTheDrawingsRange) {
  write_arm(folder_.path() / "arm", value_in_percent, "deg");
  const Outcome made =
      run({"run", path("arm"), "--output", path("arm_run"), "--scales", "--quiet"});
  ASSERT_EQ(made.code, 0) << made.err;
  const json arm = exported(path("arm_run"));
  EXPECT_EQ(said_.at("lerobot").at("values"), "percent");
  ASSERT_EQ(said_.at("lerobot").at("motors").size(), kShown.size());
  for (const std::size_t j : kShown) {
    const double low = -1.6, high = 1.5;                       // rad, as drawn
    const double within_deg = kCountDeg + three_sigma_deg(j);  // both ends are rounded
    const double within = 200.0 * within_deg * std::numbers::pi / 180.0 / (high - low);
    for (const double angle : {-0.8, 0.0, 0.7}) {
      const double percent = 200.0 * (angle - low) / (high - low) - 100.0;
      EXPECT_NEAR(value_in_percent(arm.at(kMotors[j]), count_of_joint(j, angle)), percent, within)
          << kMotors[j];
    }
  }
}

TEST_F(ExportLerobot, WhatDoesNotFitIsRefused) {
  write_arm(folder_.path() / "arm", value_in_degrees, "deg");
  ASSERT_EQ(run({"run", path("arm"), "--output", path("arm_run"), "--quiet", "--no-trace"}).code,
            0);
  const auto refused = [&](const std::string& file, const std::string& part) {
    folder_.write("other.json", file);
    expect_refusal({"export", path("arm_run"), "--lerobot", path("x.json"), "--lerobot-from",
                    path("other.json")},
                   ExitCode::kBadInput, part);
    EXPECT_FALSE(fs::exists(path("x.json")));
  };
  refused("{", "is no JSON");
  refused("[]", "is no JSON with a motor a key");
  refused(R"({"homing_offset": [1], "motor_names": ["a"]})", "before 2025");
  refused(R"({"a": 3})", "'a' is no motor");
  const auto motor = [](const char* name, const char* min, const char* max) {
    return fmt::format(
        R"({{"{}": {{"id": 1, "drive_mode": 0, "homing_offset": 0, "range_min": {}, "range_max": {}}}}})",
        name, min, max);
  };
  refused(motor("shoulder_pan", "5", "5"), "has the range 5 to 5");
  refused(motor("shoulder_pan", "-1e300", "5"), "no whole number 'range_min'");
  refused(motor("shoulder_pan", "18446744073709551615", "5"), "range_min is not from 0 to 4095");
  refused(motor("wrist", "0", "4095"), "no calibrated joint is driven by one of its motors: wrist");
  // Per cent of 200 degrees are degrees.
  folder_.write("other.json", motor("shoulder_pan", "900", "3175"));
  expect_refusal({"export", path("arm_run"), "--lerobot", path("x.json"), "--lerobot-from",
                  path("other.json")},
                 ExitCode::kUndetermined, "a degree is a per cent");
  folder_.write("other.json", motor("shoulder_pan", "848", "3248"));
  expect_refusal({"export", path("arm_run"), "--lerobot", path("x.json"), "--lerobot-from",
                  path("other.json")},
                 ExitCode::kUndetermined, "the zero of no joint");
  expect_refusal({"export", path("arm_run"), "--lerobot", path("x.json")}, ExitCode::kBadRequest,
                 "--lerobot-from");
  fs::remove(folder_.path() / "arm/nominal.urdf");
  ASSERT_EQ(run({"run", path("arm"), "--output", path("bare_run"), "--quiet", "--no-trace"}).code,
            0);
  folder_.write("old.json", kArmFile);
  expect_refusal(
      {"export", path("bare_run"), "--lerobot", path("x.json"), "--lerobot-from", path("old.json")},
      ExitCode::kBadInput, "without a nominal robot");
}

}  // namespace
}  // namespace kinescope
