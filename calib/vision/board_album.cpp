// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/board_album.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "calib/vision/image_folder.h"
#include "calib/vision/video.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr std::size_t kMinPoints = 8;
constexpr int kVideoCandidates = 200;  // frames of a video that are searched for the board

void add_view(BoardAlbum& album, BoardFinder& finder, const ImageView& image, std::string source) {
  BoardView view;
  view.source = std::move(source);
  BoardSight sight;
  if (album.width == 0) {
    album.width = image.width;
    album.height = image.height;
  }
  if (image.width != album.width || image.height != album.height) {
    throw bad_input(view.source,
                    fmt::format("the image is {} x {}, the first is {} x {}", image.width,
                                image.height, album.width, album.height),
                    "calibrate from images of one size and one camera");
  }
  sight = finder.find(image);
  album.views.push_back(std::move(view));
  album.sights.push_back(std::move(sight));
}

BoardAlbum read_folder(const std::filesystem::path& folder, BoardFinder& finder,
                       const Progress& progress) {
  BoardAlbum album;
  const std::vector<std::filesystem::path> files = list_images(folder);
  if (files.empty()) {
    throw bad_input(folder.string(), "no images in this folder",
                    "name a folder of photographs or a video");
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    const std::optional<GreyImage> image = read_grey_image(files[i]);
    if (image) {
      add_view(album, finder, image->view(), files[i].filename().string());
    } else {
      album.warnings.push_back(fmt::format("{}: cannot be decoded", files[i].string()));
    }
    report_progress(progress, "finding the board", static_cast<int>(i) + 1,
                    static_cast<int>(files.size()));
  }
  return album;
}

BoardAlbum read_video(const std::filesystem::path& path, BoardFinder& finder,
                      const Progress& progress) {
  BoardAlbum album;
  const std::unique_ptr<VideoReader> reader = open_video(path);
  const int every = std::max(1, reader->info().frame_count / kVideoCandidates);
  while (const std::optional<VideoFrame> frame = reader->next()) {
    if (frame->index % every == 0) {
      add_view(album, finder, frame->image.view(), fmt::format("frame {}", frame->index));
    }
    report_progress(progress, "finding the board", frame->index + 1, reader->info().frame_count);
  }
  album.warnings = reader->warnings();
  return album;
}

// Where a view shows the board: middle, size and slant, in units of the image's width.
Eigen::VectorXd signature(const BoardSight& sight, int width) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& p : sight.pixels) mean += p;
  mean /= static_cast<double>(sight.pixels.size());
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const auto& p : sight.pixels) spread += (p - mean) * (p - mean).transpose();
  spread /= static_cast<double>(sight.pixels.size());
  Eigen::VectorXd out(5);
  out << mean, 2.0 * std::sqrt(spread(0, 0)), 2.0 * std::sqrt(spread(1, 1)),
      2.0 * spread(0, 1) / std::sqrt(spread.trace());
  return out / width;
}

// The most different views, by farthest-point choice; the others are put aside.
void thin_out(BoardAlbum& album, std::vector<std::size_t>& usable, int most) {
  if (static_cast<int>(usable.size()) <= most) return;
  std::vector<Eigen::VectorXd> where;
  for (const std::size_t i : usable) where.push_back(signature(album.sights[i], album.width));
  std::vector<double> distance(usable.size(), std::numeric_limits<double>::infinity());
  std::vector<std::size_t> chosen;
  std::size_t next = 0;
  while (static_cast<int>(chosen.size()) < most) {
    chosen.push_back(usable[next]);
    for (std::size_t i = 0; i < usable.size(); ++i) {
      distance[i] = std::min(distance[i], (where[i] - where[next]).norm());
    }
    next = static_cast<std::size_t>(std::ranges::max_element(distance) - distance.begin());
  }
  std::ranges::sort(chosen);
  for (const std::size_t i : usable) {
    if (!std::ranges::binary_search(chosen, i)) {
      album.views[i].reason = "much like other frames";
    }
  }
  usable = std::move(chosen);
}

}  // namespace

BoardAlbum read_album(const std::filesystem::path& images_or_video, BoardFinder& finder,
                      const Progress& progress) {
  return std::filesystem::is_directory(images_or_video)
             ? read_folder(images_or_video, finder, progress)
             : read_video(images_or_video, finder, progress);
}

std::vector<std::size_t> usable_views(BoardAlbum& album, const BoardOptions& options,
                                      const std::string& source) {
  std::vector<std::size_t> usable;
  int with_board = 0;
  for (std::size_t i = 0; i < album.views.size(); ++i) {
    album.views[i].corners = static_cast<int>(album.sights[i].pixels.size());
    if (album.sights[i].pixels.size() >= kMinPoints) {
      usable.push_back(i);
      ++with_board;
    } else if (album.sights[i].pixels.empty()) {
      album.views[i].reason = "no board found";
    } else {
      album.views[i].reason = fmt::format("only {} corners", album.sights[i].pixels.size());
    }
  }
  if (with_board == 0) {
    throw bad_input(source,
                    fmt::format("the board is in none of the {} images", album.views.size()),
                    "check the board's kind, columns and rows (chessboard: inner corners)");
  }
  if (with_board < kMinBoardViews) {
    throw bad_input(source, fmt::format("only {} usable views of the board", with_board),
                    "take 15 to 30 photographs with the board tilted and moved about");
  }
  thin_out(album, usable, options.max_views);
  return usable;
}

}  // namespace kinescope
