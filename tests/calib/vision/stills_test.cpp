// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/stills.h"

#include <cmath>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "calib/vision/video.h"
#include "tests/calib/vision/temporary_folder.h"
#include "tests/calib/vision/write_video.h"

extern "C" {
#include <libavutil/base64.h>
}

namespace kinescope {
namespace {

constexpr int kPictureTolerance = 8;  // levels: MPEG-4, then JPEG

class Stills : public TemporaryFolder {
 protected:
  // 64 x 48, brighter from frame to frame, 40 ms apart.
  [[nodiscard]] std::filesystem::path video(int frames, int b_frames = 0) const {
    VideoSpec spec;
    spec.b_frames = b_frames;
    for (int k = 0; k < frames; ++k) {
      GreyImage image{64, 48, {}};
      image.pixels.assign(64 * 48, static_cast<std::uint8_t>(grey_of(k)));
      spec.frames.push_back(std::move(image));
      spec.stamps_ms.push_back(40 * k);
    }
    write_video(folder_ / "video.mp4", spec);
    return folder_ / "video.mp4";
  }
  static int grey_of(int frame) { return 40 + 10 * (frame % 18); }

  static cv::Mat decoded(const Still& still) {
    std::vector<std::uint8_t> bytes(AV_BASE64_DECODE_SIZE(still.jpeg_base64.size()));
    const int size =
        av_base64_decode(bytes.data(), still.jpeg_base64.c_str(), static_cast<int>(bytes.size()));
    EXPECT_GT(size, 0);
    bytes.resize(static_cast<std::size_t>(std::max(0, size)));
    return cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  }
};

TEST_F(Stills, AreTheFramesOfTheTimesAsked) {
  const std::vector<Still> stills = stills_at(video(12), {0.08, 0.2, 0.44}, 32);
  ASSERT_EQ(stills.size(), 3U);
  const std::vector<int> frames{2, 5, 11};
  for (std::size_t k = 0; k < stills.size(); ++k) {
    EXPECT_EQ(stills[k].width, 64);
    EXPECT_EQ(stills[k].height, 48);
    const cv::Mat picture = decoded(stills[k]);
    EXPECT_EQ(picture.cols, 32);
    EXPECT_EQ(picture.rows, 24);
    EXPECT_NEAR(picture.at<std::uint8_t>(12, 16), grey_of(frames[k]), kPictureTolerance) << k;
  }
}

TEST_F(Stills, OfALongVideoAreThoseFramesToo) {
  for (const int b_frames : {0, 2}) {
    const std::filesystem::path file = video(1500, b_frames);
    const std::vector<int> frames{3, 700, 711, 712, 1100, 1498};
    std::vector<double> times_s;
    for (const int frame : frames) times_s.push_back(0.04 * frame);
    const std::vector<Still> stills = stills_at(file, times_s, 480);
    ASSERT_EQ(stills.size(), frames.size());
    for (std::size_t k = 0; k < stills.size(); ++k) {
      EXPECT_NEAR(decoded(stills[k]).at<std::uint8_t>(24, 32), grey_of(frames[k]),
                  kPictureTolerance)
          << frames[k];
    }
  }
}

TEST_F(Stills, AReaderSkipsToAFrameNearAndNotBeyond) {
  const auto reader = open_video(video(1500));
  reader->skip_to(2.0);  // too near to be worth it
  EXPECT_EQ(reader->next()->time_s, 0.0);
  reader->skip_to(40.0);
  const double after_s = reader->next()->time_s;
  EXPECT_GT(after_s, 30.0);
  EXPECT_LE(after_s, 40.0);
}

TEST_F(Stills, LeaveOutWhatIsNotThere) {
  const std::vector<Still> stills = stills_at(video(5), {0.05, 0.08, 0.9}, 480);
  ASSERT_EQ(stills.size(), 1U);
  EXPECT_EQ(stills.front().time_s, 0.08);
  EXPECT_EQ(decoded(stills.front()).cols, 64) << "never larger than the video";
  EXPECT_TRUE(stills_at(video(5), {}, 480).empty());
}

}  // namespace
}  // namespace kinescope
