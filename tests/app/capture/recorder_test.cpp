// SPDX-License-Identifier: Apache-2.0
#include "app/capture/recorder.h"

#include <csignal>
#include <fstream>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "app/io/recording.h"
#include "calib/vision/live_camera.h"
#include "calib/vision/video.h"
#include "kinematics/core/error.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

fs::path empty_folder(const std::string& name) {
  const fs::path folder = truth::temporary_path(name);
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder;
}

std::vector<std::uint8_t> small_jpeg() {
  const GreyImage image{64, 48, std::vector<std::uint8_t>(std::size_t{64} * 48, 90)};
  return jpeg_of(image.view(), 95);
}

RecordingHead small_head() {
  RecordingHead head;
  head.markers.default_size_m = 0.04;
  return head;
}

Recording made_recording(const fs::path& folder) {
  RecordingPaths paths;
  paths.folder = folder;
  return read_recording(paths);
}

std::vector<double> times_of(const fs::path& folder) {
  const Recording recording = made_recording(folder);
  const auto video = open_video(recording.video);
  std::vector<double> out;
  while (const auto frame = video->next()) out.push_back(frame->time_s);
  return out;
}

TEST(Recorder, TheFolderIsARecordingAtEveryMoment) {
  const fs::path folder = empty_folder("recorder_moment");
  Recorder recorder(folder, small_head());
  recorder.add_frame(0.0, small_jpeg());
  recorder.add_joints({"arm"}, std::vector<JointRow>{{10.0, {0.5}}, {10.25, {0.75}}}, 10.0);
  EXPECT_EQ(times_of(folder), std::vector{0.0});
  recorder.add_frame(0.04, small_jpeg());
  // Killed while it wrote an image.
  std::ofstream(folder / "images" / "000002.jpg") << "\xff\xd8";
  EXPECT_EQ(times_of(folder), (std::vector{0.0, 0.04}));
  const Recording recording = made_recording(folder);
  EXPECT_EQ(recording.log.channels, std::vector<std::string>{"arm"});
  EXPECT_EQ(recording.log.times_s, (std::vector{0.0, 0.25}));
  EXPECT_DOUBLE_EQ(recording.markers.default_size_m, 0.04);
}

TEST(Recorder, WhatWasRecordedIsKeptWhenTheDiskIsFull) {
  const fs::path folder = empty_folder("recorder_full");
  Recorder recorder(folder, small_head());
  recorder.add_frame(0.0, small_jpeg());
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{100'000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  EXPECT_THROW(recorder.add_frame(0.04, std::vector<std::uint8_t>(200'000)), Error);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(times_of(folder), std::vector{0.0});
  EXPECT_FALSE(fs::exists(folder / "images" / "000001.jpg")) << "half an image";
}

TEST(Recorder, ARecordingIsReplacedByForceAlone) {
  const fs::path folder = empty_folder("recorder_force");
  {
    Recorder recorder(folder, small_head());
    for (const double time_s : {0.0, 0.1, 0.2}) recorder.add_frame(time_s, small_jpeg());
  }
  EXPECT_THROW(require_room_for_recording(folder, false), Error);
  EXPECT_EQ(times_of(folder).size(), 3U);
  require_room_for_recording(folder, true);
  EXPECT_EQ(times_of(folder).size(), 3U) << "nothing is removed before there is something new";
  Recorder again(folder, small_head());
  again.add_frame(0.0, small_jpeg());
  EXPECT_EQ(times_of(folder), std::vector{0.0});
}

TEST(Recorder, AnotherFormOfRecordingIsNeverMixedWith) {
  const fs::path folder = empty_folder("recorder_other");
  std::ofstream(folder / "video.mp4") << "x";
  EXPECT_THROW(require_room_for_recording(folder, true), Error);
}

}  // namespace
}  // namespace kinescope
