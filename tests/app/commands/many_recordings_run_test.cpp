// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "kinematics/core/file.h"
#include "tests/truth/recorded_world.h"
#include "tests/truth/recordings_world.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using truth::FilmedRobotOptions;
using truth::RecordingOptions;

FilmedRobotOptions small_scara() {
  FilmedRobotOptions out;
  out.seed = 7001;
  out.kind = truth::RobotKind::kScara;
  out.duration_s = 10.0;
  out.tag_size_m = 0.06;
  out.scale = 1.5;
  out.distance_m = 1.6;
  return out;
}

// The second with twice the noise, its clock off by 0.25 s, its camera turned by 28 degrees.
std::vector<RecordingOptions> monday_and_tuesday() {
  std::vector<RecordingOptions> out(2);
  out[0].name = "monday";
  out[0].camera.clock_s = 0.05;
  out[1].name = "tuesday";
  out[1].motion = 2;
  out[1].camera.azimuth_rad = 0.5;
  out[1].camera.clock_s = -0.25;
  out[1].camera.rate_hz = 25.0;
  out[1].camera.sigma_px = 0.2;
  return out;
}

struct RanTogether {
  int code = 0;
  std::string error;
  fs::path folder;
  [[nodiscard]] json read(const char* name) const {
    return json::parse(read_text_file(folder / name));
  }
};

RanTogether run_together(const std::vector<fs::path>& recordings, bool trace = true,
                         RunOptions options = {}) {
  options.recording.folder = recordings.front();
  options.further.assign(recordings.begin() + 1, recordings.end());
  options.output = recordings.front().parent_path() /
                   fmt::format("run_of_{}_{}", recordings.size(), trace ? "all" : "plain");
  options.trace = trace;
  Console console;
  console.quiet = true;
  RanTogether out{0, {}, options.output};
  try {
    out.code = static_cast<int>(run_command(options, console));
  } catch (const Error& error) {
    out.code = static_cast<int>(error.code());
    out.error = error.what();
  }
  return out;
}

std::vector<fs::path> recorded(const std::string& name,
                               const std::vector<RecordingOptions>& recordings) {
  return truth::write_recordings(truth::make_recordings(small_scara(), recordings), recordings,
                                 truth::temporary_path(name));
}

std::vector<std::string> named_effects(const json& trace) {
  std::vector<std::string> out;
  for (const json& effect : trace.at("accepted"))
    out.push_back(fmt::format("{} at {}", effect.at("effect").get<std::string>(),
                              effect.at("place").get<std::string>()));
  return out;
}

TEST(RunManyRecordings, OfOneRobotAreOneRobot) {
  const RanTogether run = run_together(recorded("many_clean", monday_and_tuesday()));
  ASSERT_EQ(run.code, 0) << run.error;
  const json calibration = run.read("calibration.json");
  EXPECT_EQ(calibration.at("robot").at("joints").size(), 4U);
  EXPECT_EQ(calibration.at("robot").at("markers").size(), 5U);
  const json each = calibration.at("recordings").at("each");
  ASSERT_EQ(each.size(), 2U);
  for (const json& recording : each) {
    // Noise in two coordinates, each recording's own.
    const bool noisy = recording.at("name") == "tuesday";
    const double noise = std::sqrt(2.0) * (noisy ? 0.2 : 0.1);
    EXPECT_NEAR(recording.at("held_out_rms").get<double>(), noise, 0.1 * noise);
    EXPECT_NEAR(recording.at("by_others_rms").get<double>(), noise, 0.15 * noise);
    EXPECT_NEAR(recording.at("time_offset_s").get<double>(), noisy ? -0.25 : 0.05, 1e-3);
    EXPECT_TRUE(recording.at("markers_anew").empty());
  }
  EXPECT_EQ(named_effects(run.read("trace.json")),
            (std::vector<std::string>{"time_offset at clock"}));
  EXPECT_TRUE(read_text_file(run.folder / "residuals.csv").starts_with("recording,t,tag"));
  EXPECT_TRUE(fs::exists(run.folder / "observations_tuesday.csv"));
  EXPECT_NE(read_text_file(run.folder / "report.html").find("recordings-table"), std::string::npos);
}

TEST(RunManyRecordings, AZeroThatMovedBetweenThemIsNamed) {
  constexpr double kZero = 0.01;  // rad
  std::vector<RecordingOptions> recordings = monday_and_tuesday();
  recordings[1].zeros[1] = kZero;
  const RanTogether run = run_together(recorded("many_zero", recordings));
  ASSERT_EQ(run.code, 0) << run.error;
  const json trace = run.read("trace.json");
  ASSERT_EQ(named_effects(trace),
            (std::vector<std::string>{"time_offset at clock", "recording_zero at q2"}));
  const json& zero = trace.at("accepted").at(1);
  EXPECT_NEAR(std::abs(zero.at("size").get<double>()), kZero, 0.02 * kZero);
  EXPECT_TRUE(
      run.read("calibration.json").at("recordings").at("each").at(1).at("markers_anew").empty());
}

TEST(RunManyRecordings, AMarkerThatWasStuckOnAnewIsAnotherOneThere) {
  std::vector<RecordingOptions> recordings = monday_and_tuesday();
  Pose elsewhere;
  elsewhere.rotation = exp_rotation({0.05, -0.1, 0.7});
  elsewhere.translation = {0.02, -0.01, 0.003};
  recordings[1].moved[12] = elsewhere;
  const RanTogether run = run_together(recorded("many_anew", recordings));
  ASSERT_EQ(run.code, 0) << run.error;
  EXPECT_EQ(named_effects(run.read("trace.json")),
            (std::vector<std::string>{"time_offset at clock"}));
  const json calibration = run.read("calibration.json");
  int anew = 0;
  for (const json& recording : calibration.at("recordings").at("each")) {
    for (const json& marker : recording.at("markers_anew")) {
      ++anew;
      EXPECT_EQ(marker.at("tag"), 12);
      const double shift = elsewhere.translation.norm();
      EXPECT_NEAR(marker.at("shift_m").get<double>(), shift,
                  2.0 * marker.at("shift_expanded_m").get<double>());
      EXPECT_LT(marker.at("shift_expanded_m").get<double>(), 0.1 * shift);
      EXPECT_NEAR(marker.at("turn_rad").get<double>(), log_rotation(elsewhere.rotation).norm(),
                  2.0 * marker.at("turn_expanded_rad").get<double>());
    }
  }
  EXPECT_EQ(anew, 1);
}

// The rows of a table from `from_s` up to before `to_s`.
void cut_table(const fs::path& table, double from_s, double to_s, const fs::path& into) {
  std::ifstream in(table);
  std::string line, out;
  for (bool head = true; std::getline(in, line); head = false) {
    const double t = head ? 0.0 : std::stod(line);
    if (head || (t >= from_s && t < to_s)) out += line + "\n";
  }
  write_file_atomically(into, out);
}

TEST(RunManyRecordings, PiecesOfOneRecordingGiveWhatItGives) {
  std::vector<RecordingOptions> recordings = monday_and_tuesday();
  recordings.resize(1);
  const fs::path whole = recorded("many_pieces", recordings).front();
  std::vector<fs::path> pieces;
  for (const bool second : {false, true}) {
    pieces.push_back(whole.parent_path() / (second ? "piece2" : "piece1"));
    fs::create_directories(pieces.back());
    for (const char* name : {"camera.yaml", "tags.yaml"})
      fs::copy_file(whole / name, pieces.back() / name);
    for (const char* name : {"corners.csv", "joints.csv"})
      cut_table(whole / name, second ? 5.0 : -1e9, second ? 1e9 : 5.0, pieces.back() / name);
  }
  const RanTogether cut = run_together(pieces, false);
  const RanTogether uncut = run_together({whole}, false);
  ASSERT_EQ(cut.code, 0) << cut.error;
  ASSERT_EQ(uncut.code, 0) << uncut.error;
  json of_pieces = cut.read("calibration.json");
  json of_whole = uncut.read("calibration.json");
  of_pieces.at("robot").erase("name");
  of_whole.at("robot").erase("name");
  EXPECT_EQ(of_pieces, of_whole);
  EXPECT_EQ(read_text_file(cut.folder / "residuals.csv"),
            read_text_file(uncut.folder / "residuals.csv"));
}

TEST(RunManyRecordings, WhatCannotBeCombinedIsSaidInOneLine) {
  const std::vector<fs::path> folders = recorded("many_refused", monday_and_tuesday());
  const auto refused = [&](int code, const std::string& word, RunOptions options = {}) {
    const RanTogether run = run_together(folders, false, std::move(options));
    EXPECT_EQ(run.code, code) << run.error;
    EXPECT_NE(run.error.find(word), std::string::npos) << run.error;
    EXPECT_EQ(run.error.find('\n'), std::string::npos);
    EXPECT_FALSE(fs::exists(run.folder / "calibration.json"));
  };
  RunOptions with_corners;
  with_corners.recording.corners = folders[0] / "corners.csv";
  refused(2, "--corners", with_corners);
  EXPECT_EQ(run_together({folders[0], folders[0] / "."}, false).code, 2);
  const fs::path joints = folders[1] / "joints.csv";
  const std::string log = read_text_file(joints);
  std::string other = log;
  other.replace(other.find("q2"), 2, "qq");
  write_file_atomically(joints, other);
  refused(3, "'q2'");
  write_file_atomically(joints, log);
  write_file_atomically(folders[1] / "recording.yaml", "units: {q1: deg}\n");
  refused(2, "q1");
  fs::remove(folders[1] / "recording.yaml");
  write_file_atomically(folders[1] / "tags.yaml", "family: tag36h11\ndefault_size: 0.05\n");
  refused(2, "tags.yaml");
  write_file_atomically(folders[1] / "tags.yaml", "family: tag36h11\ndefault_size: 0.06\n");
  fs::remove(joints);
  refused(2, "joints.csv");
}

}  // namespace
}  // namespace kinescope
