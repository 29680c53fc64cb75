// SPDX-License-Identifier: Apache-2.0
//
// Whole folders: what is found, what is converted, and every complaint about files with its place
// and remedy.
#include "app/io/recording.h"

#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "app/io/sha256.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

constexpr std::string_view kPoses =
    "t,body,x,y,z,qx,qy,qz,qw\n0,1,0,0,1,0,0,0,1\n1,1,0,0,1,0,0,0,1\n2,1,0,0,1,0,0,0,1\n";
constexpr std::string_view kJoints = "t,a,b,tau1\n0,90,100,5\n1,180,200,6\n2,270,300,7\n";

class ReadRecording : public testing::Test {
 protected:
  ReadRecording() { folder_.write("poses.csv", kPoses).write("joints.csv", kJoints); }

  std::string with(const std::string& name, std::string_view text,
                   ExitCode code = ExitCode::kBadInput) {
    folder_.write(name, text);
    return folder_.refusal(code);
  }
  RecordingFolder folder_;
};

TEST_F(ReadRecording, PosesWithALog) {
  const Recording recording = read_recording(folder_.paths());
  EXPECT_EQ(recording.entry, RecordingEntry::kPoses);
  EXPECT_EQ(recording.poses->tracks.size(), 1U);
  EXPECT_EQ(recording.log.channels, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(recording.settings.name, folder_.path().filename().string());
  ASSERT_EQ(recording.files.size(), 2U);
  EXPECT_EQ(recording.files[0].filename(), "joints.csv");
  EXPECT_FALSE(recording.camera);
}

TEST_F(ReadRecording, UnitsAreMadeSi) {
  folder_.write("recording.yaml",
                "name: my robot\nunits: {a: deg, b: mm}\ngravity: [0, 9.81, 0]\n");
  const Recording recording = read_recording(folder_.paths());
  EXPECT_EQ(recording.settings.name, "my robot");
  EXPECT_NEAR(recording.log.values(1, 0), std::numbers::pi, 1e-15);
  EXPECT_NEAR(recording.log.values(2, 1), 0.3, 1e-15);
  EXPECT_EQ(recording.settings.units.at("a"), "rad") << "what the log holds now";
  EXPECT_EQ(recording.settings.units.at("b"), "m");
  EXPECT_EQ(*recording.settings.gravity, Eigen::Vector3d(0, 9.81, 0));
  folder_.write("recording.yaml", "units: {a: ticks}\n");
  EXPECT_EQ(read_recording(folder_.paths()).log.values(1, 0), 180.0) << "ticks stay";
}

TEST_F(ReadRecording, WhatALogLeavesOutIsAWarning) {
  folder_.write("joints.csv", "t,a,mode,b\n0,90,AUTO,100\n1,180,AUTO,200\n");
  const Recording recording = read_recording(folder_.paths());
  EXPECT_EQ(recording.log.channels, (std::vector<std::string>{"a", "b"}));
  ASSERT_EQ(recording.warnings.size(), 1U);
  EXPECT_NE(recording.warnings[0].find("column 'mode'"), std::string::npos);
}

// 20 s of both, one of the clocks in another unit.
TEST_F(ReadRecording, StampsThatAreNoSecondsAreRefused) {
  const auto table = [](const std::string& header, const std::string& cells, double step) {
    std::string text = header + "\n";
    for (int i = 0; i < 40; ++i) text += fmt::format("{},{}\n", i * step, cells);
    return text;
  };
  const auto poses = [&](double step) {
    return table("t,body,x,y,z,qx,qy,qz,qw", "1,0,0,1,0,0,0,1", step);
  };
  folder_.write("poses.csv", poses(0.513));
  for (const auto& [unit, factor] : {std::pair{"ms", 1e3}, {"us", 1e6}, {"ns", 1e9}}) {
    folder_.write("joints.csv", table("t,a", "1", 0.5 * factor));
    const std::string refusal = folder_.refusal();
    EXPECT_TRUE(refusal.starts_with("joints.csv: runs for ")) << refusal;
    EXPECT_NE(refusal.find(fmt::format("stamps in {}?", unit)), std::string::npos) << refusal;
    EXPECT_NE(refusal.find(fmt::format("by {:.0f})", factor)), std::string::npos) << refusal;
  }
  folder_.write("joints.csv", table("t,a", "1", 0.5)).write("poses.csv", poses(513.0));
  EXPECT_TRUE(folder_.refusal().starts_with("poses.csv: runs for "));
  // Postures have any steps, and a log may go on for long.
  folder_.write("joints.csv", table("t,a", "1", 10.0)).write("poses.csv", poses(10.0));
  EXPECT_EQ(folder_.refusal(), "accepted");
  folder_.write("joints.csv", table("t,a", "1", 100.0));
  EXPECT_EQ(folder_.refusal(), "accepted");
}

TEST_F(ReadRecording, WhatIsMissingIsNamed) {
  folder_.write("nominal.urdf",
                "<robot name='r'><link name='a'/><link name='b'/><joint name='elbow' "
                "type='continuous'><parent link='a'/><child link='b'/></joint></robot>");
  folder_.remove("joints.csv");
  EXPECT_EQ(folder_.refusal(),
            "joints.csv: no such file, but the nominal robot has joints (add it with the columns "
            "t, elbow)");
  folder_.remove("nominal.urdf");
  folder_.remove("poses.csv");
  folder_.write("tags.yaml", "default_size: 0.05\n");
  std::string corners = "t,tag,corner,u,v\n";
  for (int c = 0; c < 4; ++c) corners += fmt::format("0,1,{},{},{}\n", c, c, c % 2);
  const std::string refusal = with("corners.csv", corners);
  EXPECT_TRUE(refusal.starts_with("camera.yaml: no such file")) << refusal;
}

TEST_F(ReadRecording, TorquesAreLeftOut) {
  folder_.write("recording.yaml", "torques: [b]\n");
  EXPECT_EQ(read_recording(folder_.paths()).log.channels, (std::vector<std::string>{"a"}));
  EXPECT_NE(with("recording.yaml", "torques: [bb]\n")
                .find("'bb', which is not logged (did you mean 'b'?"),
            std::string::npos);
}

TEST_F(ReadRecording, SettingsRefused) {
  EXPECT_NE(with("recording.yaml", "unit: {a: deg}\n")
                .find("recording.yaml:1: unit is a key nobody reads (did you mean 'units'?"),
            std::string::npos);
  EXPECT_NE(with("recording.yaml", "units:\n  a: degrees\n")
                .find("recording.yaml:2: units.a is 'degrees', a unit nobody knows"),
            std::string::npos);
  EXPECT_NE(with("recording.yaml", "units: {A1: deg}\n").find("a channel 'A1' that is not logged"),
            std::string::npos);
  EXPECT_NE(with("recording.yaml", "gravity: [0, 0]\n").find("gravity has 2 numbers, not 3"),
            std::string::npos);
  EXPECT_NE(with("recording.yaml", "gravity: [0, 0, 0]\n").find("gravity has no length"),
            std::string::npos);
  EXPECT_NE(with("recording.yaml", "video_start: soon\n").find("is 'soon', not a finite number"),
            std::string::npos);
  EXPECT_NE(with("recording.yaml", "fixed_tags: [-3]\n").find("not a whole number from 0 up"),
            std::string::npos);
  EXPECT_NE(with("recording.yaml", "name: [a\n").find("is not YAML"), std::string::npos);
}

TEST_F(ReadRecording, JointLogsRefused) {
  EXPECT_EQ(with("joints.csv", ""), "joints.csv: is empty (record it again)");
  EXPECT_NE(with("joints.csv", "t,a\n").find("joints.csv: has a header but no rows"),
            std::string::npos);
  EXPECT_NE(with("joints.csv", "t,a\n0,1\n1,1\n0.5,1\n0.2,1\n")
                .find("joints.csv:4: time 0.500000 s does not come after"),
            std::string::npos);
  EXPECT_NE(with("joints.csv", "t,a\n0,1\n1,nan\n").find("joints.csv:3: column 'a' holds 'nan'"),
            std::string::npos);
  EXPECT_NE(with("joints.csv", "t a b\n0 1\n").find("joints.csv:1: columns are separated by ' '"),
            std::string::npos);
  EXPECT_NE(with("joints.csv", "t,a,a\n0,1,1\n").find("joints.csv:1: two columns are named 'a'"),
            std::string::npos);
  EXPECT_EQ(
      with("joints.csv", "t,a\n10,1\n12,1\n"),
      "joints.csv: runs from 10.000 to 12.000 s and poses.csv from 0.000 to 2.000 s: no "
      "common time (use one clock for both; if both began together, add 10.000 s to the times "
      "of poses.csv: of a video by video_start in recording.yaml, the log's time at its first "
      "frame)");
}

TEST_F(ReadRecording, WhatIsNamedLikeAFileAndIsNone) {
  const auto joints = folder_.path() / "joints.csv";
  folder_.remove("joints.csv");
  std::filesystem::create_directory(joints);
  EXPECT_EQ(folder_.refusal(),
            "joints.csv: is a folder, not a file (put the file there, or remove it)");
  std::filesystem::remove(joints);
  std::filesystem::create_symlink("gone.csv", joints);
  EXPECT_NE(folder_.refusal().find("joints.csv: is a link to a file that is not there"),
            std::string::npos);
  std::filesystem::remove(joints);
  std::filesystem::create_symlink("joints.csv", joints);
  EXPECT_NE(folder_.refusal().find("joints.csv: is a link that leads to itself"),
            std::string::npos);
  std::filesystem::remove(joints);
  std::filesystem::create_symlink("gone.mp4", folder_.path() / "video.mp4");
  EXPECT_NE(folder_.refusal().find("video.mp4: is a link to a file that is not there"),
            std::string::npos);
}

TEST_F(ReadRecording, AStartOfTheVideoWithoutAVideo) {
  EXPECT_EQ(with("recording.yaml", "video_start: 0.5\n"),
            "recording.yaml: video_start is 0.5 s, but the recording is read from poses.csv, whose "
            "t is on the log's clock (remove video_start, or add it to the column t)");
  EXPECT_EQ(with("recording.yaml", "video_start: 0\n"), "accepted");
}

class CornersOfACamera : public ReadRecording {
 protected:
  CornersOfACamera() {
    folder_.remove("poses.csv");
    folder_.write("tags.yaml", "default_size: 0.05\n");
    folder_.write("camera.yaml",
                  "image_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, data: "
                  "[500, 0, 320, 0, 500, 240, 0, 0, 1]}\ndistortion_model: plumb_bob\n"
                  "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n");
  }
  void sightings_at(const std::vector<double>& us) {
    std::string text = "t,tag,corner,u,v\n";
    for (std::size_t i = 0; i < us.size(); ++i) {
      for (int c = 0; c < 4; ++c) {
        text += fmt::format("{},1,{},{},{}\n", 0.1 * static_cast<double>(i), c, us[i] - c % 2,
                            100 + c / 2);
      }
    }
    folder_.write("corners.csv", text);
  }
};

TEST_F(CornersOfACamera, ALittleOutsideIsInside) {
  sightings_at({645.0, 100.0, -4.0});
  const Recording recording = read_recording(folder_.paths());
  EXPECT_EQ(recording.corners->observations.size(), 3U);
  EXPECT_TRUE(recording.warnings.empty());
}

TEST_F(CornersOfACamera, OneOutsideIsLeftOut) {
  sightings_at({100.0, 900.0, 100.0});
  const Recording recording = read_recording(folder_.paths());
  EXPECT_EQ(recording.corners->observations.size(), 2U);
  ASSERT_EQ(recording.warnings.size(), 1U);
  EXPECT_NE(recording.warnings[0].find("tag 1 at t = 0.1 has a corner at (900.0, 100.0), outside"),
            std::string::npos);
}

TEST_F(CornersOfACamera, OfOtherImagesAreRefused) {
  sightings_at({100.0, 900.0, 1000.0});
  const std::string refusal = folder_.refusal();
  EXPECT_TRUE(
      refusal.starts_with("corners.csv: tag 1 at t = 0.1 has a corner at (900.0, 100.0), "
                          "outside the images of 640 x 480 px of "))
      << refusal;
  EXPECT_NE(refusal.find("camera.yaml (give the intrinsics of the images"), std::string::npos);
}

TEST_F(ReadRecording, HugeFileRefused) {
  folder_.write("joints.csv", "t,a\n0,1\n");
  std::filesystem::resize_file(folder_.path() / "joints.csv", (std::uintmax_t{1} << 30U) + 1);
  EXPECT_NE(folder_.refusal().find("joints.csv: 1073741825 bytes, more than 1073741824"),
            std::string::npos);
}

TEST_F(ReadRecording, NominalRobot) {
  EXPECT_NE(with("nominal.urdf", "<robot name='r'><link name='a'/><link")
                .find("nominal.urdf:1: is not well-formed XML"),
            std::string::npos);
  folder_.write("nominal.urdf", "<robot name='r'><link name='a'/></robot>");
  EXPECT_EQ(read_recording(folder_.paths()).nominal->name, "r");
}

TEST_F(ReadRecording, CameraRefused) {
  const std::string message = with("camera.yaml", "image_width: 640\n");
  EXPECT_TRUE(message.starts_with("camera.yaml")) << message;
}

TEST_F(ReadRecording, FolderRefused) {
  RecordingPaths paths;
  paths.folder = folder_.path() / "none";
  EXPECT_EQ(folder_.refusal_of([&] { static_cast<void>(read_recording(paths)); }),
            "none: no such folder (check the path)");
  paths.folder = folder_.path() / "joints.csv";
  EXPECT_NE(folder_.refusal_of([&] { static_cast<void>(read_recording(paths)); })
                .find("is a file, neither a recording's folder nor a bag"),
            std::string::npos);
  folder_.remove("poses.csv");
  EXPECT_NE(
      folder_.refusal().find("holds no video, bag, dataset, corners.csv, poses.csv or points.csv"),
      std::string::npos);
}

TEST_F(ReadRecording, NamedFilesTakeThePlaceOfThoseInTheFolder) {
  folder_.write("elsewhere/log.csv", "t,q\n0,1\n1,2\n");
  RecordingPaths paths = folder_.paths();
  paths.joints = folder_.path() / "elsewhere" / "log.csv";
  EXPECT_EQ(read_recording(paths).log.channels, (std::vector<std::string>{"q"}));
  paths.joints = folder_.path() / "none.csv";
  EXPECT_EQ(folder_.refusal_of([&] { static_cast<void>(read_recording(paths)); }),
            "none.csv: no such file (correct --joints)");
  paths = folder_.paths();
  paths.poses = folder_.path() / "poses.csv";
  paths.video = folder_.path() / "joints.csv";
  EXPECT_NE(
      folder_.refusal_of([&] { static_cast<void>(read_recording(paths)); }, ExitCode::kBadRequest)
          .find("--video --poses: both say"),
      std::string::npos);
}

TEST_F(ReadRecording, ALogUnderAnotherNameIsAskedFor) {
  const std::string log = read_text_file(folder_.path() / "joints.csv");
  folder_.remove("joints.csv");
  EXPECT_TRUE(read_recording(folder_.paths()).warnings.empty());
  for (const char* name : {"joint_states.csv", "Joints.csv", "log.csv"}) {
    folder_.write(name, log);
    const std::vector<std::string> warnings = read_recording(folder_.paths()).warnings;
    ASSERT_EQ(warnings.size(), 1U) << name;
    EXPECT_EQ(warnings[0], (folder_.path() / name).string() +
                               " is not read: is it the joint log? Name it joints.csv, or give "
                               "--joints");
    folder_.remove(name);
  }
  folder_.write("Flange.csv", "t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n");
  EXPECT_NE(read_recording(folder_.paths()).warnings.at(0).find("Name it flange.csv"),
            std::string::npos);
  folder_.write("joints.csv", log);
  EXPECT_TRUE(read_recording(folder_.paths()).warnings.empty()) << "nothing is missing";
}

TEST_F(ReadRecording, PointsWithTargets) {
  folder_.remove("poses.csv");
  folder_.write("points.csv", "t,point,x,y,z,target\n0,0,,,,left\n1,0,,,,right\n");
  folder_.write("recording.yaml",
                "target_distances:\n  - {from: left, to: right, distance: 0.05}\n");
  const Recording recording = read_recording(folder_.paths());
  EXPECT_EQ(recording.entry, RecordingEntry::kPoints);
  ASSERT_EQ(recording.points->distances.size(), 1U);
  EXPECT_EQ(recording.points->distances[0].distance_m, 0.05);
  EXPECT_NE(
      with("recording.yaml", "target_distances:\n  - {from: left, to: rigth, distance: 0.05}\n")
          .find("'rigth', which holds no point (did you mean 'right'?"),
      std::string::npos);
  EXPECT_NE(with("recording.yaml", "target_distances:\n  - {from: left, to: left, distance: 1}\n")
                .find("joins a target to itself"),
            std::string::npos);
  EXPECT_NE(with("recording.yaml", "target_distances:\n  - {from: left, to: right, distance: 0}\n")
                .find("distance is 0, not above zero"),
            std::string::npos);
}

TEST_F(ReadRecording, EverythingThatIsWrongAtOnce) {
  folder_.write("recording.yaml", "nmae: x\n")
      .write("joints.csv", "t;a\n")
      .write("poses.csv", "t,body\n0,1\n");
  const ReadAttempt attempt = try_read_recording(folder_.paths());
  EXPECT_EQ(attempt.errors.size(), 3U);
}

TEST_F(ReadRecording, VideosAreFound) {
  folder_.write("tags.yaml", "default_size: 0.05\n");
  folder_.write("Robot.MP4", "x");
  EXPECT_EQ(read_recording(folder_.paths()).video.filename(), "Robot.MP4") << "the only video";
  folder_.write("second.avi", "x");
  EXPECT_NE(
      folder_.refusal().find("holds several videos: Robot.MP4, second.avi (name one with --video)"),
      std::string::npos);
  folder_.write("video.mkv", "x");
  const Recording recording = read_recording(folder_.paths());
  EXPECT_EQ(recording.video.filename(), "video.mkv") << "the one of that name";
  EXPECT_EQ(recording.entry, RecordingEntry::kVideo);
  ASSERT_EQ(recording.warnings.size(), 1U) << "poses.csv is there and not used";
  EXPECT_NE(recording.warnings[0].find("poses.csv is not used"), std::string::npos);
  folder_.write("video.avi", "x");
  EXPECT_NE(folder_.refusal().find("holds several videos: video.avi, video.mkv"),
            std::string::npos);
}

TEST_F(ReadRecording, FoldersOfImagesAreVideos) {
  folder_.write("tags.yaml", "default_size: 0.05\n");
  folder_.write("images/0.png", "x").write("images/1.png", "x").write("images/times.csv", "x");
  const Recording recording = read_recording(folder_.paths());
  EXPECT_EQ(recording.video.filename(), "images");
  EXPECT_EQ(recording.files.size(), 5U) << "its files are inputs too";
}

TEST_F(ReadRecording, AVideoNeedsTags) {
  folder_.write("video.mp4", "x");
  EXPECT_TRUE(folder_.refusal().starts_with("tags.yaml: no such file (write one with"))
      << folder_.refusal();
  folder_.write("tags.yaml", "tags: [{id: 3, size: 0.1}]\n")
      .write("recording.yaml", "fixed_tags: [4]\n");
  EXPECT_NE(
      folder_.refusal().find("recording.yaml: fixed_tags names 4, which tags.yaml does not list"),
      std::string::npos);
}

TEST(RecordingName, OfAnyWayToWriteTheFolder) {
  EXPECT_EQ(recording_name("a/b"), "b");
  EXPECT_EQ(recording_name("a/b/"), "b");
  EXPECT_EQ(recording_name("a/b/."), "b");
  EXPECT_EQ(recording_name("a/c/../b"), "b");
  EXPECT_EQ(recording_name("/"), "robot");
  EXPECT_EQ(recording_name("."), std::filesystem::current_path().filename().string());
}

TEST(ReadShared, SyntheticRecordings) {
  const auto folder = shared_data("synthetic/ur6_none");
  if (!folder) GTEST_SKIP() << "shared recordings are not on this machine";
  RecordingPaths paths;
  paths.folder = *folder;
  const Recording recording = read_recording(paths);
  EXPECT_EQ(recording.entry, RecordingEntry::kVideo);
  EXPECT_EQ(recording.log.channels.size(), 7U);
  EXPECT_EQ(recording.camera->width, 1280);
  EXPECT_EQ(recording.markers.sizes_m.size(), 7U);
  EXPECT_TRUE(recording.warnings.empty());
}

TEST(Sha256, OfKnownBytes) {
  const RecordingFolder folder;
  folder.write("empty", "").write("abc", "abc");
  // FIPS 180-2, appendix B.1.
  EXPECT_EQ(sha256_of_file(folder.path() / "abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_of_file(folder.path() / "empty"),
            "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  folder.write("long", std::string(200000, 'a'));
  EXPECT_EQ(sha256_of_file(folder.path() / "long"), sha256_of_text(std::string(200000, 'a')));
  EXPECT_NE(folder.refusal_of([&] { static_cast<void>(sha256_of_file(folder.path() / "none")); }),
            "accepted");
}

}  // namespace
}  // namespace kinescope
