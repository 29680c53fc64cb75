// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/image_folder.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/log/header_units.h"
#include "kinematics/log/joint_log_table.h"

namespace kinescope {
namespace {

constexpr std::string_view kTimesFile = "times.csv";

bool is_image_name(const std::filesystem::path& path) {
  constexpr std::array<std::string_view, 11> kExtensions = {
      ".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".pnm", ".webp", ".jp2"};
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::ranges::find(kExtensions, extension) != kExtensions.end();
}

std::filesystem::path find_times(const std::filesystem::path& folder) {
  std::filesystem::path inside = folder / kTimesFile;
  if (std::filesystem::exists(inside)) return inside;
  const std::filesystem::path clean = (folder / "").parent_path();
  std::filesystem::path beside = clean.parent_path() / kTimesFile;
  if (std::filesystem::exists(beside)) return beside;
  throw bad_input(folder.string(),
                  "a folder of images needs their times, and there is no times.csv",
                  "put a times.csv with the columns image,t (file name, s) into the folder");
}

// EuRoC writes filename.
std::size_t image_column(const CsvTable& table) {
  const auto filename = table.column("filename");
  return filename && !table.column("image") ? *filename : table.require_column("image");
}

struct TimedImage {
  double time_s = 0.0;
  std::filesystem::path path;
};

class ImageFolderReader final : public VideoReader {
 public:
  explicit ImageFolderReader(const std::filesystem::path& folder) : folder_(folder) {
    collect(list_images(folder));
    while (!first_ && next_ < images_.size()) first_ = decode_next();
    if (!first_) {
      throw bad_input(folder.string(), "none of the images can be decoded",
                      "check that the files are images, not something renamed");
    }
    info_.width = first_->image.width;
    info_.height = first_->image.height;
    info_.frame_count = static_cast<int>(images_.size());
    info_.duration_s = images_.back().time_s - images_.front().time_s;
    info_.codec = "images";
  }

  const VideoInfo& info() const override { return info_; }
  const std::vector<std::string>& warnings() const override { return warnings_; }

  std::optional<VideoFrame> next() override {
    if (first_) return std::exchange(first_, std::nullopt);
    while (next_ < images_.size()) {
      std::optional<VideoFrame> frame = decode_next();
      if (frame) return frame;
    }
    return std::nullopt;
  }

 private:
  void collect(const std::vector<std::filesystem::path>& files) {
    if (files.empty()) {
      throw bad_input(folder_.string(), "no images in this folder",
                      "name a video file or a folder of png or jpg images");
    }
    const CsvTable table = read_csv(find_times(folder_));
    const std::size_t names = image_column(table);
    const std::size_t stamps = time_column(table);
    const double unit_s = header_factor(table.header[stamps]);
    std::map<std::string, double> times;
    for (std::size_t row = 0; row < table.rows.size(); ++row) {
      const std::string name = std::filesystem::path(table.rows[row][names]).filename().string();
      if (!times.emplace(name, unit_s * table.number(row, stamps)).second) {
        throw bad_input(table.place(row), fmt::format("image '{}' has two times", name),
                        "give every image one line");
      }
    }
    int without_time = 0;
    for (const std::filesystem::path& file : files) {
      const auto found = times.find(file.filename().string());
      if (found == times.end()) {
        ++without_time;
        continue;
      }
      images_.push_back({found->second, file});
    }
    std::ranges::stable_sort(images_, {}, &TimedImage::time_s);
    check_times(table.source);
    if (without_time > 0) {
      warnings_.push_back(fmt::format("{}: {} images have no time in {} and are left out",
                                      folder_.string(), without_time, table.source));
    }
    if (times.size() > images_.size()) {
      warnings_.push_back(fmt::format("{}: {} images listed are not in the folder", table.source,
                                      times.size() - images_.size()));
    }
  }

  void check_times(const std::string& source) const {
    if (images_.empty()) {
      throw bad_input(source, "no image of the folder is listed here",
                      "the column image must hold the file names");
    }
    const auto twin = std::ranges::adjacent_find(images_, {}, &TimedImage::time_s);
    if (twin != images_.end()) {
      throw bad_input(
          source,
          fmt::format("'{}' and '{}' have the same time {}", twin->path.filename().string(),
                      std::next(twin)->path.filename().string(), twin->time_s),
          "every image needs its own time in s");
    }
  }

  std::optional<VideoFrame> decode_next() {
    const TimedImage& timed = images_[next_++];
    std::optional<GreyImage> image = read_grey_image(timed.path);
    if (!image) {
      warnings_.push_back(
          fmt::format("{}: cannot be decoded and is left out", timed.path.string()));
      return std::nullopt;
    }
    if (info_.width > 0 && (image->width != info_.width || image->height != info_.height)) {
      throw bad_input(timed.path.string(),
                      fmt::format("the image is {} x {}, those before it are {} x {}", image->width,
                                  image->height, info_.width, info_.height),
                      "all images of a recording must have one size");
    }
    return VideoFrame{index_++, timed.time_s, std::move(*image)};
  }

  std::filesystem::path folder_;
  std::vector<TimedImage> images_;
  std::size_t next_ = 0;
  int index_ = 0;
  std::optional<VideoFrame> first_;
  VideoInfo info_;
  std::vector<std::string> warnings_;
};

}  // namespace

std::vector<std::filesystem::path> list_images(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    std::error_code unreachable;  // a link to itself, say
    if (entry.is_regular_file(unreachable) && is_image_name(entry.path()))
      files.push_back(entry.path());
  }
  if (error) throw bad_input(folder.string(), "the folder cannot be read", "check its permissions");
  std::ranges::sort(files);
  return files;
}

std::optional<GreyImage> read_grey_image(const std::filesystem::path& path) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  cv::Mat image;
  try {
    image = cv::imread(path.string(), cv::IMREAD_GRAYSCALE);
  } catch (const cv::Exception&) {
    return std::nullopt;  // over OpenCV's size limits
  }
  if (image.empty()) return std::nullopt;
  return copy_of({image.data, image.cols, image.rows, static_cast<int>(image.step)});
}

std::unique_ptr<VideoReader> open_image_folder(const std::filesystem::path& folder) {
  return std::make_unique<ImageFolderReader>(folder);
}

}  // namespace kinescope
