// SPDX-License-Identifier: Apache-2.0
//
// Folders of images: what is in them, and reading them as a video.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "calib/vision/image_view.h"
#include "calib/vision/video.h"

namespace kinescope {

/// The image files (png, jpg, bmp, tif, pgm, ..) of a folder, sorted by name; empty when there are
/// none.
[[nodiscard]] std::vector<std::filesystem::path> list_images(const std::filesystem::path& folder);

/// One image as grey values, or nothing when it cannot be decoded.
[[nodiscard]] std::optional<GreyImage> read_grey_image(const std::filesystem::path& path);

/// A folder of images with times.csv. Throws bad_input as open_video().
[[nodiscard]] std::unique_ptr<VideoReader> open_image_folder(const std::filesystem::path& folder);

}  // namespace kinescope
