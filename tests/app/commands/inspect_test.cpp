// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "app/commands/inspection.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

bool says(const std::vector<Finding>& findings, std::string_view words) {
  for (const Finding& finding : findings) {
    if (finding.text.find(words) != std::string::npos) return true;
  }
  return false;
}

std::string all(const std::vector<Finding>& findings) {
  std::string text;
  for (const Finding& finding : findings) text += finding.text + "\n";
  return text;
}

/// Four channels at 100 Hz: a turn in rad, one that rests, ticks, degrees.
JointLog sample_log() {
  JointLog log;
  log.channels = {"turn", "rest", "counts", "angle"};
  log.values.resize(300, 4);
  for (int i = 0; i < 300; ++i) {
    log.times_s.push_back(0.01 * i);
    const double s = std::sin(0.05 * i);
    log.values.row(i) << s, 0.25, std::round(2000.0 * s), 90.0 * s;
  }
  return log;
}

TEST(InspectLog, RangesRatesAndUnits) {
  std::vector<Finding> findings;
  const LogFacts facts = look_at_log(sample_log(), {}, findings);
  EXPECT_EQ(facts.samples, 300);
  EXPECT_NEAR(facts.rate_hz, 100.0, 1e-6);
  EXPECT_NEAR(facts.jitter_s, 0.0, 1e-12);
  EXPECT_EQ(facts.channels[0].unit, "rad or m");
  EXPECT_NEAR(facts.channels[0].upper, 1.0, 1e-3);
  EXPECT_FALSE(facts.channels[1].moves);
  EXPECT_EQ(facts.channels[2].unit, "ticks?");
  EXPECT_EQ(facts.channels[3].unit, "deg or mm?");
  EXPECT_TRUE(says(findings, "channel 'rest' never changes")) << all(findings);
  EXPECT_TRUE(says(findings, "channel 'angle' looks like degrees")) << all(findings);
  EXPECT_EQ(findings.size(), 2U) << all(findings);
}

TEST(InspectLog, DeclaredUnitsAreNotGuessed) {
  std::vector<Finding> findings;
  RecordingSettings settings;
  settings.units["angle"] = "ticks";
  EXPECT_EQ(look_at_log(sample_log(), settings, findings).channels[3].unit, "ticks");
  EXPECT_FALSE(says(findings, "degrees"));
}

TEST(InspectLog, GapsAndUnevenSteps) {
  JointLog log = sample_log();
  for (std::size_t i = 100; i < log.size(); ++i) log.times_s[i] += 2.0;
  std::vector<Finding> findings;
  const LogFacts facts = look_at_log(log, {}, findings);
  EXPECT_NEAR(facts.longest_gap_s, 2.01, 1e-9);
  EXPECT_NEAR(facts.longest_gap_at_s, 0.99, 1e-9);
  EXPECT_TRUE(says(findings, "a gap of 2.01 s behind t = 0.990 s")) << all(findings);
  findings.clear();
  for (std::size_t i = 0; i < log.size(); ++i) {
    log.times_s[i] = 0.01 * static_cast<double>(i) + (i % 2 == 0 ? 0.0 : 0.008);
  }
  static_cast<void>(look_at_log(log, {}, findings));
  EXPECT_TRUE(says(findings, "steps are uneven")) << all(findings);
}

TEST(InspectLog, OneSample) {
  JointLog log;
  log.channels = {"a"};
  log.times_s = {1.0};
  log.values = Eigen::MatrixXd::Ones(1, 1);
  std::vector<Finding> findings;
  EXPECT_EQ(look_at_log(log, {}, findings).rate_hz, 0.0);
  EXPECT_TRUE(says(findings, "1 samples only"));
}

TEST(Inspect, NamesEveryProblemAndEndsWithThree) {
  const RecordingFolder folder;
  folder.write("video.mp4", "no video")
      .write("tags.yaml", "family: tag99\n")
      .write("joints.csv", "t a b\n0 1\n");
  const Inspection inspection = inspect_recording(folder.paths());
  EXPECT_FALSE(inspection.ready());
  EXPECT_TRUE(says(inspection.findings, "'tag99' is not known")) << all(inspection.findings);
  EXPECT_TRUE(says(inspection.findings, "separated by ' '")) << all(inspection.findings);
  EXPECT_TRUE(says(inspection.findings, "video.mp4")) << all(inspection.findings);
  testing::internal::CaptureStdout();
  EXPECT_EQ(inspect_command({.recording = folder.paths(), .data = {}, .robot = {}}, {}),
            ExitCode::kBadInput);
  const std::string text = testing::internal::GetCapturedStdout();
  EXPECT_NE(text.find("verdict   not ready: 3 problems\n"), std::string::npos) << text;
}

TEST(Inspect, AFolderThatIsNotThere) {
  RecordingPaths paths;
  paths.folder = "no/such/folder";
  const Inspection inspection = inspect_recording(paths);
  ASSERT_EQ(inspection.findings.size(), 1U);
  EXPECT_EQ(inspection.findings[0].text, "no/such/folder: no such folder (check the path)");
}

TEST(Inspect, AContradictionIsTheCommandLinesFault) {
  const RecordingFolder folder;
  folder.write("a.csv", "").write("b.csv", "");
  RecordingPaths paths = folder.paths();
  paths.poses = folder.path() / "a.csv";
  paths.points = folder.path() / "b.csv";
  EXPECT_NE(folder.refusal_of([&] { static_cast<void>(inspect_recording(paths)); },
                              ExitCode::kBadRequest),
            "accepted");
}

TEST(Inspect, PosesAreReadyAndSayWhatIsMissing) {
  const RecordingFolder folder;
  folder.write("poses.csv", "t,body,x,y,z,qx,qy,qz,qw\n0,1,0,0,1,0,0,0,1\n");
  const Inspection inspection = inspect_recording(folder.paths());
  EXPECT_TRUE(inspection.ready()) << all(inspection.findings);
  EXPECT_TRUE(says(inspection.findings, "no joints.csv"));
  EXPECT_FALSE(says(inspection.findings, "camera"));
}

TEST(Inspect, PointsNeedANominalRobot) {
  const RecordingFolder folder;
  folder.write("points.csv", "t,point,x,y,z\n0,1,0,0,1\n");
  EXPECT_FALSE(inspect_recording(folder.paths()).ready());
}

class InspectVideo : public testing::Test {
 protected:
  void SetUp() override {
    const auto folder = shared_data("synthetic/scara4_none");
    if (!folder) GTEST_SKIP() << "shared recordings are not on this machine";
    paths_.folder = *folder;
  }
  RecordingPaths paths_;
  RecordingFolder scratch_;
};

TEST_F(InspectVideo, AGoodRecording) {
  const Inspection inspection = inspect_recording(paths_);
  EXPECT_TRUE(inspection.ready()) << all(inspection.findings);
  ASSERT_TRUE(inspection.video);
  EXPECT_EQ(inspection.video->info.width, 1280);
  EXPECT_NEAR(inspection.video->frame_rate_hz, 30.0, 0.1);
  EXPECT_TRUE(inspection.video->decoded_to_end);
  ASSERT_EQ(inspection.video->markers.size(), 5U) << all(inspection.findings);
  for (const MarkerFacts& marker : inspection.video->markers) {
    EXPECT_GT(marker.edge_px, 20.0);
    EXPECT_GT(marker.contrast, 60.0);
    // Rendered with a blur of about 0.7 px; interpolation and the video codec widen it.
    EXPECT_GT(marker.blur_px, 0.4);
    EXPECT_LT(marker.blur_px, 2.0);
  }
}

TEST_F(InspectVideo, JsonSaysTheSame) {
  testing::internal::CaptureStdout();
  EXPECT_EQ(inspect_command({.recording = paths_, .data = {}, .robot = {}},
                            {.json = true, .quiet = true, .progress = {}}),
            ExitCode::kDone);
  const nlohmann::json json = nlohmann::json::parse(testing::internal::GetCapturedStdout());
  EXPECT_TRUE(json["ready"]);
  EXPECT_EQ(json["video"]["markers"].size(), 5U);
  EXPECT_EQ(json["log"]["channels"].size(), 4U);
  EXPECT_TRUE(json["problems"].empty());
}

TEST_F(InspectVideo, TheWrongFamilyIsNamed) {
  scratch_.write("tags.yaml", "family: tag25h9\ndefault_size: 0.06\n");
  paths_.tags = scratch_.path() / "tags.yaml";
  const Inspection inspection = inspect_recording(paths_);
  EXPECT_FALSE(inspection.ready());
  EXPECT_TRUE(says(inspection.findings, "no marker of family tag25h9 is seen"))
      << all(inspection.findings);
  EXPECT_TRUE(says(inspection.findings, "tag36h11")) << all(inspection.findings);
}

TEST_F(InspectVideo, ALogOfAnotherTimeAndACameraOfAnotherSize) {
  scratch_.write("joints.csv", "t,a\n1000,0\n1000.1,1\n");
  std::string camera = read_text_file(paths_.folder / "camera.yaml");
  camera.replace(camera.find("1280"), 4, "1920");
  scratch_.write("camera.yaml", camera);
  paths_.joints = scratch_.path() / "joints.csv";
  paths_.camera = scratch_.path() / "camera.yaml";
  const Inspection inspection = inspect_recording(paths_);
  EXPECT_FALSE(inspection.ready());
  EXPECT_TRUE(says(inspection.findings, "no common time")) << all(inspection.findings);
  EXPECT_TRUE(says(inspection.findings, "1920")) << all(inspection.findings);
}

TEST_F(InspectVideo, TagsThatAreNotListedAndTagsThatAreNotSeen) {
  scratch_.write("tags.yaml", "tags: [{id: 259, size: 0.06}, {id: 1, size: 0.06}]\n");
  paths_.tags = scratch_.path() / "tags.yaml";
  const Inspection inspection = inspect_recording(paths_);
  EXPECT_TRUE(says(inspection.findings, "tag 265 is seen but not listed"))
      << all(inspection.findings);
  EXPECT_TRUE(says(inspection.findings, "tag 1 is listed in tags.yaml but was not seen"))
      << all(inspection.findings);
}

}  // namespace
}  // namespace kinescope
