// SPDX-License-Identifier: Apache-2.0
//
// Images of bags as videos: every layout of pixels, packed pictures, and streams.
#include "calib/vision/bag_video.h"

#include <cmath>
#include <filesystem>

extern "C" {
#include <libavcodec/bsf.h>
#include <libavformat/avformat.h>
}

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "kinematics/core/error.h"
#include "tests/truth/bag_writer.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
constexpr std::int64_t kBagStart = 1'700'000'000'000'000'000;
constexpr int kBagWidth = 8;
constexpr int kBagHeight = 6;

std::string raw_image(std::int64_t stamp, const std::string& encoding, int bytes_a_pixel,
                      const std::vector<std::uint8_t>& pixel, int padding = 0) {
  std::string pixels;
  for (int y = 0; y < kBagHeight; ++y) {
    for (int x = 0; x < kBagWidth; ++x) {
      for (int b = 0; b < bytes_a_pixel; ++b)
        pixels.push_back(static_cast<char>(pixel[static_cast<std::size_t>(b) % pixel.size()]));
    }
    pixels.append(static_cast<std::size_t>(padding), '\x7F');
  }
  return truth::image(stamp, kBagWidth, kBagHeight, encoding,
                      static_cast<std::uint32_t>(kBagWidth * bytes_a_pixel + padding), pixels);
}

fs::path bag_of(const std::string& name, const std::string& type,
                const std::vector<std::string>& messages) {
  const fs::path path = truth::temporary_path(name);
  truth::BagWriter bag(path);
  for (std::size_t i = 0; i < messages.size(); ++i)
    bag.write("/image_raw", type, kBagStart + static_cast<std::int64_t>(i) * 100'000'000,
              messages[i]);
  bag.finish();
  return path;
}

struct Layout {
  const char* encoding;
  std::vector<std::uint8_t> pixel;
  int bytes;
  int grey;
};

class Layouts : public testing::TestWithParam<Layout> {};

TEST_P(Layouts, AreReadAsBrightness) {
  const Layout& layout = GetParam();
  const fs::path bag =
      bag_of(std::string(layout.encoding) + ".mcap", "sensor_msgs/msg/Image",
             {raw_image(kBagStart, layout.encoding, layout.bytes, layout.pixel, 5)});
  const auto video = open_video(bag);
  EXPECT_EQ(video->info().width, kBagWidth);
  const auto frame = video->next();
  ASSERT_TRUE(frame);
  ASSERT_EQ(frame->image.pixels.size(), std::size_t{kBagWidth * kBagHeight});
  for (const std::uint8_t grey : frame->image.pixels) EXPECT_NEAR(grey, layout.grey, 1);
  EXPECT_FALSE(video->next());
}

INSTANTIATE_TEST_SUITE_P(
    OfSensorMsgs, Layouts,
    testing::Values(Layout{"mono8", {90}, 1, 90}, Layout{"8UC1", {90}, 1, 90},
                    Layout{"rgb8", {200, 0, 0}, 3, 60},  // 0.299 of red
                    Layout{"bgr8", {200, 0, 0}, 3, 23},  // 0.114 of blue
                    Layout{"bgra8", {0, 0, 200, 9}, 4, 60}, Layout{"rgba8", {0, 200, 0, 9}, 4, 117},
                    Layout{"mono16", {250, 70}, 2, 70}, Layout{"bayer_rggb8", {80}, 1, 80},
                    Layout{"yuv422", {128, 66}, 2, 66}, Layout{"yuv422_yuy2", {66, 128}, 2, 66}));

TEST(BagVideo, BayerPatternsBeginWhereTheirNamesSay) {
  // Green alone is lit: two pixels of four, in which ones the name tells.
  const auto green_of = [](const std::string& encoding, bool first_is_green) {
    std::string pixels;
    for (int y = 0; y < kBagHeight; ++y)
      for (int x = 0; x < kBagWidth; ++x)
        pixels.push_back(((x + y) % 2 == 0) == first_is_green ? '\xC8' : '\0');
    const auto video = open_video(
        bag_of(encoding + ".mcap", "sensor_msgs/msg/Image",
               {truth::image(kBagStart, kBagWidth, kBagHeight, encoding, kBagWidth, pixels)}));
    return static_cast<int>(video->next()->image.pixels[kBagWidth * 3 + 4]);
  };
  constexpr int kGreen = 117;  // 0.587 of 200
  EXPECT_NEAR(green_of("bayer_grbg8", true), kGreen, 2);
  EXPECT_NEAR(green_of("bayer_gbrg8", true), kGreen, 2);
  EXPECT_NEAR(green_of("bayer_rggb8", false), kGreen, 2);
  EXPECT_NEAR(green_of("bayer_bggr8", false), kGreen, 2);
}

TEST(BagVideo, BayerPatternsTellRedFromBlue) {
  // The first pixel of every other row and column is lit.
  const auto brightness = [](const std::string& encoding, int x0, int y0) {
    std::string pixels;
    for (int y = 0; y < kBagHeight; ++y)
      for (int x = 0; x < kBagWidth; ++x)
        pixels.push_back(x % 2 == x0 && y % 2 == y0 ? '\xC8' : '\0');
    const auto video = open_video(
        bag_of("lit_" + encoding + ".mcap", "sensor_msgs/msg/Image",
               {truth::image(kBagStart, kBagWidth, kBagHeight, encoding, kBagWidth, pixels)}));
    return static_cast<int>(
        video->next()->image.pixels[static_cast<std::size_t>(kBagWidth * (2 + y0) + 2 + x0)]);
  };
  constexpr int kRed = 60;   // 0.299 of 200
  constexpr int kBlue = 23;  // 0.114 of 200
  EXPECT_NEAR(brightness("bayer_rggb8", 0, 0), kRed, 2);
  EXPECT_NEAR(brightness("bayer_bggr8", 0, 0), kBlue, 2);
  EXPECT_NEAR(brightness("bayer_grbg8", 1, 0), kRed, 2);
  EXPECT_NEAR(brightness("bayer_gbrg8", 1, 0), kBlue, 2);
}

TEST(BagVideo, PackedPicturesAndStamps) {
  std::vector<std::string> messages;
  for (int i = 0; i < 3; ++i) {
    std::vector<std::uint8_t> png;
    cv::imencode(".png", cv::Mat(kBagHeight, kBagWidth, CV_8UC1, cv::Scalar(10 * i + 40)), png);
    messages.push_back(truth::compressed_image(kBagStart + i * 100'000'000LL - 20'000'000, "png",
                                               {reinterpret_cast<char*>(png.data()), png.size()}));
  }
  messages.insert(messages.begin() + 1, messages[0]);  // recorded twice
  messages.insert(messages.begin() + 2,
                  truth::compressed_image(kBagStart + 50'000'000, "png", "no"));
  const auto video = open_video(bag_of("packed.mcap", "sensor_msgs/msg/CompressedImage", messages));
  for (int i = 0; i < 3; ++i) {
    const auto frame = video->next();
    ASSERT_TRUE(frame);
    EXPECT_NEAR(frame->time_s, 0.1 * i - 0.02, 1e-6);
    EXPECT_EQ(frame->image.pixels[7], 10 * i + 40);
  }
  EXPECT_FALSE(video->next());
  ASSERT_GE(video->warnings().size(), 2U);
  EXPECT_NE(video->warnings()[0].find("1 images cannot be decoded"), std::string::npos);
  EXPECT_NE(video->warnings()[1].find("stamps of 1 images do not increase"), std::string::npos);
}

TEST(BagVideo, RefusesWhatItCannotShow) {
  const auto refusal = [](const fs::path& bag) -> std::string {
    try {
      static_cast<void>(open_video(bag));
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  const std::string image = "sensor_msgs/msg/Image";
  EXPECT_NE(refusal(bag_of("jxl.mcap", image, {raw_image(kBagStart, "jxl", 1, {1})}))
                .find("images of encoding 'jxl'"),
            std::string::npos);
  const std::string cut = truth::image(kBagStart, 4000, 4000, "mono8", 4000, "too few");
  EXPECT_NE(refusal(bag_of("few.mcap", image, {cut})).find("none of the images can be decoded"),
            std::string::npos);
  truth::CdrWriter video;
  video.time(kBagStart).string("frame").bytes("x").string("theora");
  EXPECT_NE(refusal(bag_of("theora.mcap", "foxglove_msgs/msg/CompressedVideo", {video.data()}))
                .find("no decoder for 'theora'"),
            std::string::npos);
}

/// The packets of a video file as they go into a bag (Annex B), with their stamps in s.
std::vector<std::pair<double, std::string>> packets_of(const fs::path& file) {
  AVFormatContext* container = nullptr;
  if (avformat_open_input(&container, file.c_str(), nullptr, nullptr) < 0) return {};
  avformat_find_stream_info(container, nullptr);
  const AVStream* stream = container->streams[0];
  AVBSFContext* filter = nullptr;
  av_bsf_alloc(av_bsf_get_by_name("h264_mp4toannexb"), &filter);
  avcodec_parameters_copy(filter->par_in, stream->codecpar);
  filter->time_base_in = stream->time_base;
  av_bsf_init(filter);
  AVPacket* packet = av_packet_alloc();
  std::vector<std::pair<double, std::string>> out;
  while (av_read_frame(container, packet) >= 0) {
    if (packet->stream_index != 0) {
      av_packet_unref(packet);
      continue;
    }
    av_bsf_send_packet(filter, packet);
    while (av_bsf_receive_packet(filter, packet) == 0) {
      out.emplace_back(static_cast<double>(packet->pts) * av_q2d(stream->time_base),
                       std::string(reinterpret_cast<char*>(packet->data),
                                   static_cast<std::size_t>(packet->size)));
      av_packet_unref(packet);
    }
  }
  av_packet_free(&packet);
  av_bsf_free(&filter);
  avformat_close_input(&container);
  return out;
}

TEST(BagVideo, StreamOfH264IsTheVideoItCameFrom) {
  const fs::path file = fs::path(KINESCOPE_SOURCE_DIR) / "sample_videos/gantry_time_lag/video.mp4";
  const auto packets = packets_of(file);
  ASSERT_GT(packets.size(), 300U);
  const fs::path path = truth::temporary_path("h264.mcap");
  truth::BagWriter bag(path);
  for (const auto& [time_s, packet] : packets) {
    const std::int64_t stamp = kBagStart + std::llround(1e9 * time_s);
    truth::CdrWriter message;
    message.time(stamp).string("frame").bytes(packet).string("h264");
    bag.write("/video", "foxglove_msgs/msg/CompressedVideo", stamp, message.data());
  }
  bag.finish();
  const auto of_bag = open_video(path);
  const auto of_file = open_video(file);
  double first_s = 0.0;
  int frames = 0;
  while (const auto expected = of_file->next()) {
    const auto frame = of_bag->next();
    ASSERT_TRUE(frame) << frames;
    if (frames++ == 0) first_s = expected->time_s - frame->time_s;
    EXPECT_NEAR(frame->time_s + first_s, expected->time_s, 1e-6);
    EXPECT_EQ(frame->image.pixels, expected->image.pixels);
  }
  EXPECT_FALSE(of_bag->next());
  EXPECT_EQ(frames, static_cast<int>(packets.size()));
  EXPECT_TRUE(of_bag->warnings().empty());
}

}  // namespace
}  // namespace kinescope
