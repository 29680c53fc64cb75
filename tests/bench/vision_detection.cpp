// SPDX-License-Identifier: Apache-2.0
//
// Markers in 720p frames of a sample recording (seven of them), time a frame on one thread (and of
// ours on two): the packaged detector at decimate 2, OpenCV's, ours (search, gaps, refined corners,
// decoding of the video), and the parts of ours.
#include <algorithm>
#include <filesystem>
#include <optional>
#include <vector>

#include <benchmark/benchmark.h>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>

#include "calib/camera/camera_file.h"
#include "calib/vision/detect.h"
#include "calib/vision/pattern_shift.h"
#include "calib/vision/refine_corners.h"
#include "calib/vision/tag_detector.h"
#include "calib/vision/video.h"

namespace kinescope {
namespace {

const std::filesystem::path kFolder =
    std::filesystem::path(KINESCOPE_SOURCE_DIR) / "sample_videos" / "ur6_none";
const std::filesystem::path kRecording = kFolder / "video.mp4";
const std::filesystem::path kCamera = kFolder / "camera.yaml";
constexpr const char* kFamily = "tag36h11";
constexpr std::size_t kFrames = 60;
constexpr double kDetectorSigmaPx = 0.3;

const std::vector<GreyImage>& frames() {
  static const std::vector<GreyImage> kAll = [] {
    std::vector<GreyImage> out;
    const auto reader = open_video(kRecording);
    while (out.size() < kFrames) {
      std::optional<VideoFrame> frame = reader->next();
      if (!frame) break;
      out.push_back(std::move(frame->image));
    }
    return out;
  }();
  return kAll;
}

MarkerSet markers() {
  MarkerSet out;
  out.family = kFamily;
  out.default_size_m = 0.05;
  return out;
}

void per_frame(benchmark::State& state, std::size_t count, double tags) {
  state.counters["frame"] =
      benchmark::Counter(static_cast<double>(count), benchmark::Counter::kIsIterationInvariantRate |
                                                         benchmark::Counter::kInvert);
  state.counters["tags/frame"] = tags / static_cast<double>(count);
}

void BM_Decode(benchmark::State& state) {
  std::size_t count = 0;
  for (auto _ : state) {
    const auto reader = open_video(kRecording);
    count = 0;
    while (reader->next()) ++count;
  }
  per_frame(state, count, 0.0);
}

void BM_PackagedDetector(benchmark::State& state) {
  const auto detector =
      make_tag_detector(kFamily, {.decimate = static_cast<double>(state.range(0))});
  double tags = 0.0;
  for (auto _ : state) {
    tags = 0.0;
    for (const GreyImage& image : frames())
      tags += static_cast<double>(detector->detect(image.view()).size());
  }
  per_frame(state, frames().size(), tags);
}

void BM_OpenCv(benchmark::State& state) {
  cv::setNumThreads(1);
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11);
  double tags = 0.0;
  for (auto _ : state) {
    tags = 0.0;
    for (const GreyImage& image : frames()) {
      const cv::Mat input(image.height, image.width, CV_8UC1,
                          const_cast<std::uint8_t*>(image.pixels.data()));  // it only reads
      std::vector<std::vector<cv::Point2f>> corners;
      std::vector<int> ids;
      cv::aruco::detectMarkers(input, dictionary, corners, ids);
      tags += static_cast<double>(ids.size());
    }
  }
  per_frame(state, frames().size(), tags);
}

// Corners of all frames: by the border; by the cells; and whether anything covers them.
void BM_Refine(benchmark::State& state) {
  const auto detector = make_tag_detector(kFamily, {.decimate = 2.0});
  const TagLayout layout = tag_layout(kFamily);
  std::vector<std::vector<Corners>> starts;
  double tags = 0.0;
  for (const GreyImage& image : frames()) {
    starts.emplace_back();
    for (const TagObservation& tag : detector->detect(image.view())) {
      Corners start;
      std::ranges::copy(tag.corners_px, start.begin());
      starts.back().push_back(start);
      tags += 1.0;
    }
  }
  const CameraModel lens = read_camera(kCamera);
  const CameraModel* declared = state.range(0) > 0 ? &lens : nullptr;
  const bool look_for_covers = state.range(0) > 1;
  for (auto _ : state) {
    for (std::size_t f = 0; f < frames().size(); ++f) {
      for (const Corners& start : starts[f]) {
        const RefinedCorners refined =
            refine_corners(frames()[f].view(), start, layout, ToneCurve(), declared);
        benchmark::DoNotOptimize(refined);
        if (look_for_covers) {
          benchmark::DoNotOptimize(
              is_partly_hidden(frames()[f].view(), refined, layout, kDetectorSigmaPx));
        }
      }
    }
  }
  per_frame(state, frames().size(), tags);
}

void BM_DetectTags(benchmark::State& state) {
  DetectOptions options;
  options.threads = static_cast<int>(state.range(1));
  if (state.range(0) > 0) options.lens = read_camera(kCamera);
  std::size_t count = 0;
  double tags = 0.0;
  for (auto _ : state) {
    const Detection found = detect_tags(kRecording, markers(), options);
    count = found.observations.times_s.size();
    tags = static_cast<double>(found.observations.observations.size());
  }
  per_frame(state, count, tags);
}

BENCHMARK(BM_Decode)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_PackagedDetector)->Arg(2)->Arg(1)->ArgName("decimate")->Unit(benchmark::kMillisecond);
BENCHMARK(BM_OpenCv)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_Refine)->DenseRange(0, 2)->ArgName("to covers")->Unit(benchmark::kMillisecond);
BENCHMARK(BM_DetectTags)
    ->Args({0, 1})
    ->Args({1, 1})
    ->ArgNames({"lens", "threads"})
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);
// On the clock: goal 4 ms a frame on two cores.
BENCHMARK(BM_DetectTags)
    ->Args({0, 2})
    ->Args({1, 2})
    ->ArgNames({"lens", "threads"})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace kinescope
