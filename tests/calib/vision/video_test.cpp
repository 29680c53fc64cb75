// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/video.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "tests/calib/vision/temporary_folder.h"
#include "tests/calib/vision/write_video.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

constexpr double kStampTolerance = 1e-9;  // s, one rounding of a stamp in ms
constexpr int kGreyTolerance = 6;         // levels, MPEG-4 at its second best quality

class Video : public TemporaryFolder {
 protected:
  // Frames that say their number by their brightness.
  static VideoSpec numbered(std::vector<int> stamps_ms, int b_frames) {
    VideoSpec spec;
    spec.b_frames = b_frames;
    for (std::size_t i = 0; i < stamps_ms.size(); ++i) {
      GreyImage image{64, 48, {}};
      image.pixels.assign(64 * 48, grey_of(static_cast<int>(i)));
      spec.frames.push_back(std::move(image));
    }
    spec.stamps_ms = std::move(stamps_ms);
    return spec;
  }
  static std::uint8_t grey_of(int index) {
    return static_cast<std::uint8_t>(40 + (index * 37) % 160);
  }

  static std::vector<int> uneven_stamps(int count) {
    std::vector<int> stamps;
    int t = 0;
    for (int i = 0; i < count; ++i) {
      stamps.push_back(t);
      t += 20 + (i * 7) % 31;
    }
    return stamps;
  }

  static std::string complaint(const std::filesystem::path& path) {
    try {
      const auto reader = open_video(path);
      while (reader->next()) {
      }
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadInput);
      const std::string text = error.what();
      EXPECT_EQ(text.find('\n'), std::string::npos);
      EXPECT_NE(text.find(path.filename().string()), std::string::npos) << text;
      return text;
    }
    return "no complaint";
  }

  void write_image(const std::string& name, std::uint8_t grey, int width = 32) const {
    ASSERT_TRUE(
        cv::imwrite((folder_ / name).string(), cv::Mat(24, width, CV_8UC1, cv::Scalar(grey))));
  }
};

TEST_F(Video, StampsOfUnevenFramesAreTheContainers) {
  for (const char* name : {"v.mp4", "v.mkv"}) {
    for (const int b_frames : {0, 2}) {
      const std::vector<int> stamps = uneven_stamps(40);
      write_video(folder_ / name, numbered(stamps, b_frames));
      const auto reader = open_video(folder_ / name);
      EXPECT_EQ(reader->info().width, 64);
      EXPECT_EQ(reader->info().height, 48);
      for (std::size_t i = 0; i < stamps.size(); ++i) {
        const auto frame = reader->next();
        ASSERT_TRUE(frame) << name << " " << i;
        EXPECT_EQ(frame->index, static_cast<int>(i));
        EXPECT_NEAR(frame->time_s, 1e-3 * stamps[i], kStampTolerance) << name << " b " << b_frames;
        EXPECT_NEAR(frame->image.pixels[700], grey_of(static_cast<int>(i)), kGreyTolerance);
      }
      EXPECT_FALSE(reader->next());
      EXPECT_TRUE(reader->warnings().empty()) << reader->warnings().front();
    }
  }
}

// Matroska counts in ms; a video that begins at 5 s is not cut off.
TEST_F(Video, RoundedStampsOfEvenFramesAreEven) {
  constexpr double kRate_hz = 30.0;
  constexpr int kFirst_ms = 5000;
  std::vector<int> stamps;
  for (int i = 0; i < 60; ++i)
    stamps.push_back(kFirst_ms + static_cast<int>(std::lround(1000.0 * i / kRate_hz)));
  write_video(folder_ / "v.mkv", numbered(stamps, 2));
  const auto reader = open_video(folder_ / "v.mkv");
  int count = 0;
  while (const auto frame = reader->next()) {
    EXPECT_NEAR(frame->time_s, 1e-3 * kFirst_ms + frame->index / kRate_hz, 1e-9);
    ++count;
  }
  EXPECT_EQ(count, 60);
  EXPECT_TRUE(reader->warnings().empty()) << reader->warnings().front();
}

TEST_F(Video, AviHasEvenStamps) {
  std::vector<int> stamps;
  for (int i = 0; i < 20; ++i) stamps.push_back(40 * i);
  write_video(folder_ / "v.avi", numbered(stamps, 0));
  const auto reader = open_video(folder_ / "v.avi");
  int count = 0;
  while (const auto frame = reader->next()) {
    EXPECT_NEAR(frame->time_s, 0.04 * frame->index, kStampTolerance);
    ++count;
  }
  EXPECT_EQ(count, 20);
}

TEST_F(Video, ATruncatedFileGivesWhatIsThereAndSaysSo) {
  write_video(folder_ / "whole.mkv", numbered(uneven_stamps(60), 0));
  const std::string bytes = read_text_file(folder_ / "whole.mkv");
  write_file_atomically(folder_ / "cut.mkv", bytes.substr(0, bytes.size() * 6 / 10));
  const auto reader = open_video(folder_ / "cut.mkv");
  int count = 0;
  while (const auto frame = reader->next()) {
    EXPECT_NEAR(frame->image.pixels[700], grey_of(frame->index), kGreyTolerance);
    ++count;
  }
  EXPECT_GT(count, 10);
  EXPECT_LT(count, 60);
  ASSERT_FALSE(reader->warnings().empty());
  EXPECT_NE(reader->warnings().front().find("ends early"), std::string::npos);
}

TEST_F(Video, ATruncatedSyntheticRecordingToo) {
  const auto whole = shared_data("synthetic/scara4_none/video.mp4");
  if (!whole) GTEST_SKIP() << "no synthetic recordings on this machine";
  const auto reader = open_video(*whole);
  int count = 0;
  while (const auto frame = reader->next()) {
    EXPECT_NEAR(frame->time_s, frame->index / 30.0, 1e-6);  // the container counts in 1/15360 s
    ++count;
  }
  EXPECT_EQ(count, 330);
  EXPECT_TRUE(reader->warnings().empty());
}

TEST_F(Video, AnMp4CutOffBeforeItsIndexIsRefused) {
  write_video(folder_ / "whole.mp4", numbered(uneven_stamps(60), 0));
  const std::string bytes = read_text_file(folder_ / "whole.mp4");
  write_file_atomically(folder_ / "cut.mp4", bytes.substr(0, bytes.size() / 2));
  EXPECT_NE(complaint(folder_ / "cut.mp4").find("cut off"), std::string::npos);
}

TEST_F(Video, DamageInTheMiddleLeavesFramesOut) {
  write_video(folder_ / "whole.mkv", numbered(uneven_stamps(60), 0));
  std::string bytes = read_text_file(folder_ / "whole.mkv");
  for (std::size_t i = bytes.size() / 3; i < bytes.size() / 3 + 400; ++i) bytes[i] = 0x5a;
  write_file_atomically(folder_ / "hurt.mkv", bytes);
  const auto reader = open_video(folder_ / "hurt.mkv");
  int count = 0;
  double last = -1.0;
  while (const auto frame = reader->next()) {
    EXPECT_GT(frame->time_s, last);
    last = frame->time_s;
    ++count;
  }
  EXPECT_LT(count, 60);
  EXPECT_FALSE(reader->warnings().empty());
}

TEST_F(Video, WhatIsNoVideoIsRefused) {
  write_file_atomically(folder_ / "notes.txt", "this is a text\nwith two lines\n");
  write_file_atomically(folder_ / "renamed.mp4", "this is a text\nwith two lines\n");
  write_file_atomically(folder_ / "empty.mp4", "");
  write_file_atomically(folder_ / "list.m3u8", "#EXTM3U\n#EXTINF:1,\nhttp://localhost:1/a.ts\n");
  for (const char* name : {"notes.txt", "renamed.mp4", "empty.mp4", "list.m3u8", "absent.mp4"}) {
    const std::string text = complaint(folder_ / name);
    EXPECT_NE(text.find('('), std::string::npos) << name << ": " << text;
  }
  std::filesystem::create_directory(folder_ / "nothing");
  EXPECT_NE(complaint(folder_ / "nothing").find("no images"), std::string::npos);
}

TEST_F(Video, AFolderOfImagesIsReadByTime) {
  // Names without leading zeros sort wrongly; times do not.
  write_image("img_2.png", 20);
  write_image("img_10.png", 100);
  write_image("img_1.png", 10);
  write_image("extra.png", 1);
  write_file_atomically(folder_ / "times.csv",
                        "image,t\nimg_1.png,0.5\nimg_2.png,0.75\nimg_10.png,2\n");
  const auto reader = open_video(folder_);
  const std::array<double, 3> times = {0.5, 0.75, 2.0};
  const std::array<int, 3> greys = {10, 20, 100};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto frame = reader->next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->time_s, times[i]);
    EXPECT_EQ(frame->image.pixels[5], greys[i]);
  }
  EXPECT_FALSE(reader->next());
  ASSERT_EQ(reader->warnings().size(), 1U);
  EXPECT_NE(reader->warnings()[0].find("no time"), std::string::npos);
}

TEST_F(Video, TimesOfImagesHaveTheUnitOfTheirHeader) {
  write_image("a.png", 20);
  write_image("b.png", 30);
  for (const char* times :
       {"image,t\na.png,1.5\nb.png,2\n", "image,t_ms\na.png,1500\nb.png,2000\n",
        "image,t [ms]\na.png,1500\nb.png,2000\n", "filename,timestamp\na.png,1.5\nb.png,2\n",
        "image,Time (s)\na.png,1.5\nb.png,2\n",
        "#timestamp [ns],filename\n1500000000,a.png\n2000000000,b.png\n"}) {
    write_file_atomically(folder_ / "times.csv", times);
    const auto reader = open_video(folder_);
    for (const double time_s : {1.5, 2.0}) {
      const auto frame = reader->next();
      ASSERT_TRUE(frame) << times;
      EXPECT_NEAR(frame->time_s, time_s, 1e-12) << times;
    }
  }
}

TEST_F(Video, AFolderOfImagesWithoutTimesOrWithBadOnesIsRefused) {
  write_image("a.png", 20);
  write_image("b.png", 30);
  EXPECT_NE(complaint(folder_).find("times.csv"), std::string::npos);
  const auto with = [&](const std::string& content) {
    write_file_atomically(folder_ / "times.csv", content);
    try {
      const auto reader = open_video(folder_);
      while (reader->next()) {
      }
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no complaint");
  };
  EXPECT_NE(with("image,t\na.png,1\nb.png,1\n").find("same time"), std::string::npos);
  EXPECT_NE(with("image,t\na.png,1\na.png,2\n").find("two times"), std::string::npos);
  EXPECT_NE(with("image,t\na.png,nan\nb.png,2\n").find(":2"), std::string::npos);
  EXPECT_NE(with("image,when\na.png,1\nb.png,2\n").find("'t'"), std::string::npos);
  EXPECT_NE(with("picture,t\na.png,1\nb.png,2\n").find("'image'"), std::string::npos);
  EXPECT_NE(with("image,t\nc.png,1\n").find("listed"), std::string::npos);
  write_image("b.png", 30, 40);
  EXPECT_NE(with("image,t\na.png,1\nb.png,2\n").find("40 x 24"), std::string::npos);
}

TEST_F(Video, AnImageThatDoesNotDecodeIsLeftOut) {
  write_image("a.png", 20);
  write_file_atomically(folder_ / "b.png", "not an image");
  write_file_atomically(folder_ / "times.csv", "image,t\na.png,1\nb.png,2\n");
  const auto reader = open_video(folder_);
  EXPECT_TRUE(reader->next());
  EXPECT_FALSE(reader->next());
  EXPECT_EQ(reader->warnings().size(), 1U);
}

}  // namespace
}  // namespace kinescope
