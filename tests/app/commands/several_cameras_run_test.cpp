// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "kinematics/core/file.h"
#include "tests/truth/rig_world.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using truth::RigCamera;
using truth::RigOptions;

RigOptions scara_before(std::vector<RigCamera> cameras) {
  RigOptions out;
  out.robot.seed = 7001;
  out.robot.kind = truth::RobotKind::kScara;
  out.robot.duration_s = 12.0;
  out.robot.tag_size_m = 0.06;
  out.robot.scale = 1.5;
  out.robot.distance_m = 1.6;
  out.cameras = std::move(cameras);
  return out;
}

std::vector<RigCamera> front_and_left() {
  return {{.name = "front", .clock_s = 0.05},
          {.name = "left", .azimuth_rad = 0.5, .clock_s = -0.3, .rate_hz = 25.0}};
}

struct Ran {
  int code = 0;
  std::string error;
  fs::path folder;
  [[nodiscard]] json read(const char* name) const {
    return json::parse(read_text_file(folder / name));
  }
};

Ran run_on(const fs::path& recording, bool trace = true) {
  RunOptions options;
  options.recording.folder = recording;
  options.output = recording.string() + "_run";
  options.trace = trace;
  Console console;
  console.quiet = true;
  Ran out{0, {}, options.output};
  try {
    out.code = static_cast<int>(run_command(options, console));
  } catch (const Error& error) {
    out.code = static_cast<int>(error.code());
    out.error = error.what();
  }
  return out;
}

std::vector<std::string> effects_of(const json& trace) {
  std::vector<std::string> out;
  for (const json& effect : trace.at("accepted"))
    out.push_back(fmt::format("{} at {}", effect.at("effect").get<std::string>(),
                              effect.at("place").get<std::string>()));
  return out;
}

fs::path written(const std::string& name, const RigOptions& options) {
  fs::path folder = truth::temporary_path(name);
  truth::write_rig(truth::make_rig_worlds(options), options, folder);
  return folder;
}

TEST(RunSeveralCameras, GivesTheRobotAndEachCamera) {
  const Ran run = run_on(written("rig_clean", scara_before(front_and_left())));
  ASSERT_EQ(run.code, 0) << run.error;
  const json calibration = run.read("calibration.json");
  EXPECT_EQ(calibration.at("robot").at("joints").size(), 4U);
  ASSERT_EQ(calibration.at("further_cameras").size(), 1U);
  const json result = run.read("result.json");
  const json& cameras = result.at("calibration").at("cameras");
  ASSERT_EQ(cameras.size(), 2U);
  for (const json& camera : cameras) {
    EXPECT_GT(camera.at("sightings_used").get<int>(), 300);
    // Noise of 0.1 px in two coordinates.
    EXPECT_NEAR(camera.at("held_out_px").get<double>(), 0.141, 0.02);
  }
  // The clocks' offset is known to be there, and nothing else is found.
  EXPECT_EQ(effects_of(run.read("trace.json")), (std::vector<std::string>{"time_offset at clock"}));
  EXPECT_TRUE(read_text_file(run.folder / "residuals.csv").starts_with("camera,t,tag"));
  EXPECT_TRUE(fs::exists(run.folder / "observations_left.csv"));
  EXPECT_NE(read_text_file(run.folder / "report.html").find("cameras-table"), std::string::npos);
}

// Whichever camera the log goes with; the one that is off is named.
TEST(RunSeveralCameras, AClockThatIsSecondsOffIsNamedAndTaken) {
  for (const std::size_t off : {0U, 1U}) {
    std::vector<RigCamera> cameras = front_and_left();
    cameras[off].clock_s += 3.0;
    const Ran run = run_on(
        written(fmt::format("rig_clock_{}", cameras[off].name), scara_before(cameras)), false);
    ASSERT_EQ(run.code, 0) << run.error;
    const json result = run.read("result.json");
    EXPECT_NE(result.dump().find(fmt::format("camera {}: its stamps are ", cameras[off].name)),
              std::string::npos);
    for (const json& camera : result.at("calibration").at("cameras"))
      EXPECT_NEAR(camera.at("held_out_px").get<double>(), 0.141, 0.03);
  }
}

// Beside the clocks' offset an effect of the second camera, which is given back.
json effect_of_left(const std::string& name, const std::vector<RigCamera>& cameras,
                    const std::string& effect) {
  const Ran run = run_on(written(name, scara_before(cameras)));
  EXPECT_EQ(run.code, 0) << run.error;
  if (run.code != 0) return {};
  const json trace = run.read("trace.json");
  EXPECT_EQ(effects_of(trace),
            (std::vector<std::string>{"time_offset at clock", effect + " at camera left"}));
  return trace.at("accepted").back();
}

// Seconds of the first camera's clock at one of the second's.
double by_first_clock(const std::vector<RigCamera>& cameras, double left_s) {
  return left_s + cameras[1].clock_s - cameras[0].clock_s;
}

TEST(RunSeveralCameras, ABumpIsOfTheCameraThatWasBumped) {
  std::vector<RigCamera> cameras = front_and_left();
  cameras[1].bumped_s = 6.0;
  cameras[1].bump_rad = 0.003;
  const json bump = effect_of_left("rig_bump", cameras, "camera_bump");
  ASSERT_FALSE(bump.is_null());
  EXPECT_NEAR(bump.at("at").at("value").get<double>(), by_first_clock(cameras, 6.0),
              1.5 / cameras[1].rate_hz);
}

TEST(RunSeveralCameras, AnotherFocusIsOfTheCameraThatHasIt) {
  std::vector<RigCamera> cameras = front_and_left();
  cameras[1].refocused_s = 6.0;
  cameras[1].refocus = 0.004;
  const json jump = effect_of_left("rig_focus", cameras, "focal_jump");
  ASSERT_FALSE(jump.is_null());
  EXPECT_NEAR(jump.at("size").get<double>(), cameras[1].refocus, 0.02 * cameras[1].refocus);
  EXPECT_NEAR(jump.at("at").at("value").get<double>(), by_first_clock(cameras, 6.0),
              1.5 / cameras[1].rate_hz);
}

TEST(RunSeveralCameras, ACameraThatSharesNothingIsNamedAndLeftOut) {
  const fs::path folder = written("rig_strange", scara_before(front_and_left()));
  std::string text = read_text_file(folder / "corners_left.csv");
  std::string other;
  std::size_t line = 0;
  for (std::size_t begin = 0; begin < text.size(); ++line) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::string row = text.substr(begin, end - begin);
    if (line > 0) row.insert(row.find(',') + 1, "2");  // tag 10 is now tag 210
    other += row + "\n";
    begin = end + 1;
  }
  write_file_atomically(folder / "corners_left.csv", other);
  const Ran run = run_on(folder, false);
  ASSERT_EQ(run.code, 0) << run.error;
  EXPECT_FALSE(run.read("calibration.json").contains("further_cameras"));
  EXPECT_NE(run.read("result.json").dump().find("camera left is left out"), std::string::npos);
}

TEST(RunSeveralCameras, BadFoldersAreRefusedWithAName) {
  const fs::path folder = written("rig_bad", scara_before(front_and_left()));
  fs::rename(folder / "camera_left.yaml", folder / "camera_lft.yaml");
  Ran run = run_on(folder, false);
  EXPECT_EQ(run.code, 3);
  EXPECT_NE(run.error.find("camera_left.yaml"), std::string::npos) << run.error;
  fs::rename(folder / "camera_lft.yaml", folder / "camera_left.yaml");
  write_file_atomically(folder / "recording.yaml", "gravity: [0, 1, 0]\n");
  run = run_on(folder, false);
  EXPECT_EQ(run.code, 3);
  EXPECT_NE(run.error.find("gravity_camera"), std::string::npos) << run.error;
  write_file_atomically(folder / "recording.yaml", "gravity: [0, 1, 0]\ngravity_camera: lefft\n");
  run = run_on(folder, false);
  EXPECT_EQ(run.code, 3);
  EXPECT_NE(run.error.find("lefft"), std::string::npos) << run.error;
  fs::remove(folder / "recording.yaml");
  fs::remove(folder / "joints.csv");
  run = run_on(folder, false);
  EXPECT_EQ(run.code, 3);
  EXPECT_NE(run.error.find("joints.csv"), std::string::npos) << run.error;
}

}  // namespace
}  // namespace kinescope
