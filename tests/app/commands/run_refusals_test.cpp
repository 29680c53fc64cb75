// SPDX-License-Identifier: Apache-2.0
//
// `kinescope run` on what cannot give an answer: the line that it ends with, its exit code, and
// that nothing is lost.
#include <map>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "app/io/sha256.h"
#include "tests/app/commands/folder_contents.h"
#include "tests/app/commands/poses_of_arm.h"
#include "tests/app/commands/program.h"
#include "tests/truth/render.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

class RunRefusals : public testing::Test {
 protected:
  [[nodiscard]] std::string output() const { return (folder_.path() / "out").string(); }

  /// Refused with `part` in the line; products of an earlier run stay as they were.
  std::string refused(ExitCode code, const std::string& part,
                      const std::vector<std::string>& more = {}) const {
    const fs::path kept = output();
    const std::vector<std::string> earlier{"robot.urdf",       "structure.json",   "report.html",
                                           "result.json",      "tracks.csv",       "run.json",
                                           "observations.csv", "observations.json"};
    for (const std::string& name : earlier) folder_.write("out/" + name, "of an earlier run");
    const nlohmann::json run{{"schema", "kinescope.run"}, {"products", earlier}};
    folder_.write("out/run.json", run.dump());
    const auto before = contents(kept);
    std::vector<std::string> words{"run", folder_.path().string(), "--output", output(), "--quiet"};
    words.insert(words.end(), more.begin(), more.end());
    std::string line = expect_refusal(words, code, part);
    const auto after = contents(kept);
    for (const auto& [name, text] : before) {
      EXPECT_TRUE(after.contains(name) && after.at(name) == text) << name << " was touched";
    }
    for (const auto& [name, text] : after) {
      EXPECT_EQ(name.find(".tmp"), std::string::npos) << name << " was left behind";
    }
    return line;
  }

  void write_poses(const RobotRecording& recording) const {
    kinescope::write_poses(recording, folder_);
  }

  RecordingFolder folder_;
};

// As one that never moves, it is named, and the other joints are answered.
TEST_F(RunRefusals, AJointThatHardlyMovesIsNone) {
  RecordingOptions options;
  options.still_joints = {1};
  PosesOfArm still = arm("hardly", options);
  JointLog& log = still.recording.log;
  Rng rng = Rng::from_name("hardly trembles");
  auto column = log.values.col(value_of(log.channel(still.channel[1])));
  for (Eigen::Index i = 0; i < column.size(); ++i) column(i) += rng.normal(1e-5);
  write_poses(still.recording);
  const Outcome outcome = run({"run", folder_.path().string(), "--output", output(), "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find(fmt::format("Channel '{}' hardly moves", still.channel[1])),
            std::string::npos)
      << outcome.out;
}

TEST_F(RunRefusals, TwoJointsThatMoveTogether) {
  RecordingOptions options;
  options.together = {{0, 2}};
  const PosesOfArm together = arm("together", options, 4);
  write_poses(together.recording);
  const std::string line = refused(ExitCode::kUndetermined, together.channel[0]);
  EXPECT_NE(line.find(together.channel[2]), std::string::npos) << line;
  EXPECT_NE(line.find("if one column is a copy of the other, remove it"), std::string::npos)
      << line;
}

// What a robot's controller logs in place of joint values.
TEST_F(RunRefusals, PosesOfTheHand) {
  Rng rng = Rng::from_name("hand");
  const RandomRobot robot =
      random_robot({.joints = 6, .prismatic_share = 0.0, .unmarked_links = {1, 2, 3, 4, 5}}, rng);
  RobotRecording recording = record(robot, {.frames = 200, .amplitude_rad = 0.3}, rng);
  JointLog poses;
  poses.times_s = recording.tracks.times_s;
  poses.channels = {"x", "y", "z", "qx", "qy", "qz", "qw"};
  poses.values.resize(recording.joint_values.rows(), 7);
  for (Eigen::Index f = 0; f < poses.values.rows(); ++f) {
    const Pose hand =
        forward_kinematics(robot.tree, recording.joint_values.row(f).transpose()).back();
    poses.values.row(f) << hand.translation.transpose(), hand.rotation.coeffs().transpose();
  }
  recording.log = poses;
  write_poses(recording);
  const std::string line = refused(ExitCode::kUndetermined, "joints.csv: 'qx', 'qy', 'qz', 'qw'");
  EXPECT_NE(line.find("(quaternion, w last) beside 'x', 'y', 'z' are poses, not joint values"),
            std::string::npos)
      << line;
}

TEST_F(RunRefusals, MarkersThatNeverMove) {
  RecordingOptions options;
  options.still_joints = {0, 1, 2};
  write_poses(arm("never", options).recording);
  refused(ExitCode::kUndetermined, "move");
}

TEST_F(RunRefusals, ANominalRobotThatCannotBeRead) {
  write_poses(arm("nominal", {}).recording);
  folder_.write("broken.urdf", "<robot name='r'><link name='a'/><joint");
  refused(ExitCode::kBadInput, "broken.urdf:1",
          {"--nominal", (folder_.path() / "broken.urdf").string()});
  refused(ExitCode::kBadInput, "none.urdf", {"--nominal", "none.urdf"});
  folder_.write("other.urdf",
                "<robot name='r'><link name='a'/><link name='b'/><joint name='elbow' "
                "type='continuous'><parent link='a'/><child link='b'/></joint></robot>");
  refused(ExitCode::kBadInput, "name the columns elbow",
          {"--nominal", (folder_.path() / "other.urdf").string()});
}

// A calibration without an answer says so in a report of its own: where the folder holds an answer
// the products stay, where it holds none they are written.
TEST_F(RunRefusals, AnAnswerIsNotReplacedByNone) {
  RecordingOptions few;
  few.frames = 200;
  const PosesOfArm good = arm("answer", few, 3);
  write_poses(good.recording);
  const fs::path kept = output();
  std::vector<std::string> words{
      "run", folder_.path().string(), "--output", output(), "--quiet", "--no-trace"};
  ASSERT_EQ(run(words).code, 0);
  words.insert(words.end(), {"--free", "placement"});
  folder_.write("nominal.urdf", read_text_file(kept / "robot.urdf"));
  // The last body is mostly not where the robot says, though not as far off as another robot's.
  RobotRecording astray = good.recording;
  Rng rng = Rng::from_name("astray");
  for (PoseSample& sample : astray.tracks.tracks.back().samples) {
    if (rng.uniform() < 0.35) continue;
    for (double& x : sample.T_camera_marker.translation) x += rng.uniform(-0.02, 0.02);
  }
  write_poses(astray);
  auto before = contents(kept);
  before.erase(".kinescope_products");
  for (int time = 0; time < 2; ++time) {
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.code, static_cast<int>(ExitCode::kUndetermined)) << outcome.err;
    EXPECT_NE(outcome.err.find("the earlier answer stays"), std::string::npos) << outcome.err;
    EXPECT_EQ(outcome.out.find("robot.urdf"), std::string::npos) << outcome.out;
    auto after = contents(kept);
    EXPECT_EQ(after.erase("failed_report.html"), 1U);
    EXPECT_EQ(after.erase(".kinescope_products"), 1U);
    EXPECT_EQ(after, before);
  }
  fs::remove_all(kept);
  for (int time = 0; time < 2; ++time) {
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.code, static_cast<int>(ExitCode::kUndetermined)) << outcome.err;
    EXPECT_EQ(outcome.err.find("the earlier answer stays"), std::string::npos) << outcome.err;
    EXPECT_TRUE(fs::exists(kept / "report.html"));
    EXPECT_FALSE(fs::exists(kept / "failed_report.html"));
  }
}

// A path that is empty, as of a shell's variable that is not set.
TEST_F(RunRefusals, AnEmptyPath) {
  expect_refusal({"run", ""}, ExitCode::kBadRequest, "RECORDING");
  expect_refusal({"inspect", ""}, ExitCode::kBadRequest, "RECORDING");
  expect_refusal({"run", folder_.path().string(), "--video", ""}, ExitCode::kBadRequest, "--video");
}

// What an earlier run wrote and this one does not goes; what others put there stays.
TEST_F(RunRefusals, StaleProductsGo) {
  RecordingOptions few;
  few.frames = 200;
  write_poses(arm("answer", few, 2).recording);
  const fs::path out = output();
  std::vector<std::string> words{
      "run", folder_.path().string(), "--output", output(), "--quiet", "--no-trace"};
  ASSERT_EQ(run(words).code, 0);
  nlohmann::json earlier = nlohmann::json::parse(read_text_file(out / "run.json"));
  EXPECT_EQ(
      earlier.at("products"),
      nlohmann::json({"calibration.json", "joint_values.csv", "report.html", "residuals.csv",
                      "result.json", "robot.urdf", "run.json", "structure.json", "tracks.csv"}));
  for (const char* name :
       {"trace.json", "dynamics.json", "failed_report.html", "../nominal.urdf", "notes.txt"}) {
    earlier["products"].push_back(name);
  }
  folder_.write("out/run.json", earlier.dump());
  for (const char* name : {"trace.json", "dynamics.json", "failed_report.html", "notes.txt"}) {
    folder_.write(std::string("out/") + name, "of an earlier run");
  }
  folder_.write("nominal.urdf", read_text_file(out / "robot.urdf"));
  words.insert(words.end(), {"--free", "placement"});
  ASSERT_EQ(run(words).code, 0);
  for (const char* name : {"structure.json", "trace.json", "dynamics.json", "failed_report.html"}) {
    EXPECT_FALSE(fs::exists(out / name)) << name;
  }
  for (const char* name : {"notes.txt", "robot.urdf", "report.html", "run.json", "tracks.csv"}) {
    EXPECT_TRUE(fs::exists(out / name)) << name;
  }
  EXPECT_TRUE(fs::exists(folder_.path() / "nominal.urdf"));
}

TEST_F(RunRefusals, AFolderThatCannotBeWritten) {
  write_poses(arm("unwritable", {}).recording);
  folder_.write("a_file", "text");
  const std::string inside = (folder_.path() / "a_file" / "out").string();
  expect_refusal({"run", folder_.path().string(), "--output", inside, "--quiet"},
                 ExitCode::kBadRequest, "a_file");
  expect_refusal({"run", folder_.path().string(), "--output", "/proc/kinescope", "--quiet"},
                 ExitCode::kBadRequest, "/proc/kinescope");
  EXPECT_EQ(read_text_file(folder_.path() / "a_file"), "text");
}

TEST_F(RunRefusals, AGeometryToHoldWithoutANominalRobot) {
  write_poses(arm("no nominal", {}).recording);
  for (const char* level : {"placement", "offsets"}) {
    refused(ExitCode::kBadRequest, "--nominal", {"--free", level});
  }
}

TEST_F(RunRefusals, ALimitThatIsNoLimit) {
  write_poses(arm("limit", {}).recording);
  refused(ExitCode::kBadRequest, "held_out_pxx", {"--fail-on", "held_out_pxx>1"});
}

// Recordings as images: one marker at rest, or two of which one moves, or none.
class RunRefusalsOfImages : public RunRefusals {
 protected:
  void film(bool moving, const std::string& family = "tag36h11", bool twice = false) const {
    const CameraModel camera = pinhole_guess(320, 240, 500.0);
    Rng rng = Rng::from_name("film");
    std::string times = "image,t\n";
    fs::create_directories(folder_.path() / "images");
    for (int f = 0; f < 20; ++f) {
      PlacedMarker marker;
      marker.art = apriltag_art("tag36h11", 4);
      const double turn = moving ? 0.05 * f : 0.0;
      marker.T_camera_tag =
          pose_showing(camera, {150.0, 110.0}, 70.0, marker.size_m, 0.3, 0.2, turn);
      std::vector<PlacedMarker> markers{marker};
      if (twice) {
        marker.T_camera_tag = pose_showing(camera, {270.0, 50.0}, 50.0, marker.size_m, 0.3, 0.2, 0);
        markers.push_back(marker);
      }
      const GreyImage image = render_markers(camera, markers, {.supersample = 3}, rng);
      const cv::Mat picture(image.height, image.width, CV_8UC1,
                            const_cast<std::uint8_t*>(image.pixels.data()));
      const std::string name = fmt::format("{:03d}.png", f);
      ASSERT_TRUE(cv::imwrite((folder_.path() / "images" / name).string(), picture));
      times += fmt::format("{},{}\n", name, 0.1 * f);
    }
    folder_.write("images/times.csv", times);
    folder_.write("tags.yaml", "family: " + family + "\ndefault_size: 0.05\n");
    folder_.write("camera.yaml",
                  "image_width: 320\nimage_height: 240\ncamera_matrix: {rows: 3, cols: 3, data: "
                  "[500, 0, 159.5, 0, 500, 119.5, 0, 0, 1]}\ndistortion_model: plumb_bob\n"
                  "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n");
  }
};

TEST_F(RunRefusalsOfImages, NoMarkerOfTheDeclaredFamily) {
  film(false, "tag25h9");
  const std::string line =
      refused(ExitCode::kBadInput,
              "no marker of family tag25h9 was found in 20 frames, but markers of tag36h11");
  EXPECT_NE(line.find("(correct the family in tags.yaml)"), std::string::npos) << line;
}

TEST_F(RunRefusalsOfImages, AMirroredVideo) {
  film(false);
  for (const auto& entry : fs::directory_iterator(folder_.path() / "images")) {
    if (entry.path().extension() != ".png") continue;
    cv::Mat picture = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
    cv::flip(picture, picture, 1);
    ASSERT_TRUE(cv::imwrite(entry.path().string(), picture));
  }
  refused(ExitCode::kBadInput,
          "no marker of family tag36h11 was found in 20 frames; mirrored they");
}

TEST_F(RunRefusalsOfImages, OneMarkerAtRest) {
  film(false);
  refused(ExitCode::kUndetermined, "move");
}

TEST_F(RunRefusalsOfImages, AMarkerWithoutASize) {
  film(false);
  folder_.write("tags.yaml", "family: tag36h11\nsizes: {9: 0.05}\n");
  refused(ExitCode::kBadInput, "tags.yaml");
  for (const char* size : {"0", "-0.05", ".nan", "fifty"}) {
    folder_.write("tags.yaml", fmt::format("family: tag36h11\ndefault_size: {}\n", size));
    refused(ExitCode::kBadInput, "tags.yaml:2: default_size");
  }
}

TEST_F(RunRefusalsOfImages, ACameraOfAnotherShape) {
  film(true);
  folder_.write("camera.yaml",
                "image_width: 300\nimage_height: 300\ncamera_matrix: {rows: 3, cols: 3, data: "
                "[500, 0, 149.5, 0, 500, 149.5, 0, 0, 1]}\ndistortion_model: plumb_bob\n"
                "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n");
  refused(ExitCode::kBadInput, "camera.yaml");
  const Outcome outcome = run({"run", folder_.path().string(), "--output", output() + "2"});
  EXPECT_EQ(outcome.code, static_cast<int>(ExitCode::kBadInput));
  EXPECT_EQ(outcome.err.find("finding markers"), std::string::npos)
      << "known before: " << outcome.err;
}

TEST_F(RunRefusalsOfImages, ACameraOfAnotherShapeThatWasNamed) {
  film(true);
  fs::rename(folder_.path() / "camera.yaml", folder_.path() / "other.yaml");
  std::string text = read_text_file(folder_.path() / "other.yaml");
  text.replace(text.find("320"), 3, "300");
  folder_.write("other.yaml", text);
  refused(ExitCode::kBadInput, "other.yaml: made for images of 300 x 240",
          {"--camera", (folder_.path() / "other.yaml").string()});
}

TEST_F(RunRefusalsOfImages, TwoMarkersWithOneId) {
  film(false, "tag36h11", true);
  const Outcome outcome = run({"inspect", folder_.path().string()});
  EXPECT_NE(outcome.out.find("two markers with id 4 are in view (in 20 of 20 frames): remove one"),
            std::string::npos)
      << outcome.out;
}

// A cache that is damaged is none: the video is read once more.
TEST_F(RunRefusalsOfImages, ADamagedCache) {
  film(false);
  const std::vector<std::string> words{"run", folder_.path().string(), "--output", output(),
                                       "--quiet"};
  const std::string line = expect_refusal(words, ExitCode::kUndetermined, "move");
  const auto kept = nlohmann::json::parse(read_text_file(fs::path(output()) / "observations.json"));
  for (const char* damage :
       {R"({"key": 5})", R"({"times_s": null})", R"({"times_s": []})", R"({"rejected": [{}]})",
        R"({"rejected": null, "width": "wide"})", R"({"warnings": null})",
        R"({"rejected": [{"frame": 1000000, "id": 1, "reason": "far"}]})"}) {
    nlohmann::json damaged = kept;
    damaged.merge_patch(nlohmann::json::parse(damage));
    folder_.write("out/observations.json", damaged.dump());
    EXPECT_EQ(expect_refusal(words, ExitCode::kUndetermined, "move"), line) << damage;
    EXPECT_EQ(nlohmann::json::parse(read_text_file(fs::path(output()) / "observations.json")),
              kept);
  }
}

// Also where its hash is right.
TEST_F(RunRefusalsOfImages, ATableThatIsNotWhatWasKept) {
  film(false);
  const std::vector<std::string> words{"run", folder_.path().string(), "--output", output(),
                                       "--quiet"};
  const std::string line = expect_refusal(words, ExitCode::kUndetermined, "move");
  const std::string table = read_text_file(fs::path(output()) / "observations.csv");
  const std::string header = table.substr(0, table.find('\n') + 1);
  auto kept = nlohmann::json::parse(read_text_file(fs::path(output()) / "observations.json"));
  for (const char* row :
       {"0,4,0,5,5,0.1,0", "0,4,0,5,5,0.1,0,9,1", "0,4,1,5,5,0.1,0,9", "0,1e300,0,5,5,0.1,0,9",
        "0,nan,0,5,5,0.1,0,9", "1e9,4,0,5,5,0.1,0,9", "0,4,0,u,5,0.1,0,9", ""}) {
    const std::string damaged = header + row + "\n";
    kept["sha256"] = sha256_of_text(damaged);
    folder_.write("out/observations.csv", damaged);
    folder_.write("out/observations.json", kept.dump());
    EXPECT_EQ(expect_refusal(words, ExitCode::kUndetermined, "move"), line) << row;
    EXPECT_EQ(read_text_file(fs::path(output()) / "observations.csv"), table);
  }
}

// A second run says what the first one said.
TEST_F(RunRefusalsOfImages, TheCacheKeepsTheWarnings) {
  film(false);
  folder_.write("tags.yaml", "family: tag36h11\ndefault_size: 0.05\nsizes: {99: 0.05}\n");
  const std::vector<std::string> words{"run", folder_.path().string(), "--output", output(),
                                       "--quiet"};
  for (int round = 0; round < 2; ++round) {
    expect_refusal(words, ExitCode::kUndetermined, "move");
    const auto kept =
        nlohmann::json::parse(read_text_file(fs::path(output()) / "observations.json"));
    EXPECT_EQ(kept["warnings"], nlohmann::json({"marker 99 is declared and never seen"})) << round;
  }
}

TEST_F(RunRefusalsOfImages, ALogOfAnotherTime) {
  film(true);
  folder_.write("joints.csv", "t,a\n100,0\n101,1\n102,2\n");
  const std::string line = refused(ExitCode::kBadInput, "joints.csv");
  EXPECT_NE(line.find("video_start"), std::string::npos) << line;
}

}  // namespace
}  // namespace kinescope
