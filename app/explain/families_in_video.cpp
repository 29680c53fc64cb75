// SPDX-License-Identifier: Apache-2.0
#include "app/explain/families_in_video.h"

#include <algorithm>
#include <utility>

#include "calib/vision/tag_detector.h"
#include "calib/vision/video.h"

namespace kinescope {
namespace {

std::vector<GreyImage> three_frames(const std::filesystem::path& video) {
  constexpr int kFrames = 300;
  const std::unique_ptr<VideoReader> reader = open_video(video);
  const int declared_frames = reader->info().frame_count;
  const int frames = declared_frames > 0 ? std::min(declared_frames, kFrames) : kFrames;
  const int every = std::max(1, (frames - 1) / 2);
  std::vector<GreyImage> images;
  for (int k = 0; k < frames; ++k) {
    std::optional<VideoFrame> frame = reader->next();
    if (!frame) break;
    if (k % every == 0) images.push_back(std::move(frame->image));
  }
  return images;
}

}  // namespace

std::vector<std::string> other_families(const std::vector<GreyImage>& images,
                                        const std::string& declared) {
  std::vector<std::pair<std::string, std::size_t>> seen;
  std::size_t most = 0;
  for (const std::string& family : known_families()) {
    if (family == declared) continue;
    const auto detector = make_tag_detector(family, {.decimate = 2.0, .max_hamming = 0});
    std::size_t count = 0;
    for (const GreyImage& image : images) count += detector->detect(image.view()).size();
    if (count > 0) seen.emplace_back(family, count);
    most = std::max(most, count);
  }
  std::vector<std::string> found;  // without those that see a pattern in a corner of another's
  for (const auto& [family, count] : seen) {
    if (2 * count >= most) found.push_back(family);
  }
  return found;
}

std::vector<std::string> other_families(const std::filesystem::path& video,
                                        const std::string& declared) {
  return other_families(three_frames(video), declared);
}

bool is_mirrored(const std::filesystem::path& video, const std::string& family) {
  const auto detector = make_tag_detector(family, {.max_hamming = 0});
  return std::ranges::any_of(three_frames(video), [&](GreyImage image) {
    const ImageView view = image.view();
    for (int y = 0; y < view.height; ++y) {
      const auto row = image.pixels.begin() + std::ptrdiff_t{y} * view.stride;
      std::reverse(row, row + view.width);
    }
    return !detector->detect(image.view()).empty();
  });
}

}  // namespace kinescope
