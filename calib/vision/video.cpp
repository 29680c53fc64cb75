// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/video.h"

#include "calib/vision/bag_video.h"
#include "calib/vision/dataset_video.h"
#include "calib/vision/image_folder.h"
#include "calib/vision/video_file.h"
#include "kinematics/core/error.h"

namespace kinescope {

std::unique_ptr<VideoReader> open_video(const std::filesystem::path& path) {
  if (const auto bag = bags::bag_source(path)) return open_bag_video(*bag);
  if (const auto dataset = datasets::dataset_source(path)) return open_dataset_video(*dataset);
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    throw bad_input(path.string(), "no such video", "name a video file or a folder of images");
  }
  if (std::filesystem::is_directory(status)) return open_image_folder(path);
  return open_video_file(path);
}

}  // namespace kinescope
