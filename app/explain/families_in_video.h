// SPDX-License-Identifier: Apache-2.0
//
// Which families of markers a video shows, where nothing of the declared one is seen.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/vision/image_view.h"

namespace kinescope {

/// Families but `declared` of which markers are seen in the images, at least half as many as of the
/// one that is seen most. Some seconds for three images.
[[nodiscard]] std::vector<std::string> other_families(const std::vector<GreyImage>& images,
                                                      const std::string& declared);
/// The same of three frames of a video: the first, and two of the next ten seconds.
[[nodiscard]] std::vector<std::string> other_families(const std::filesystem::path& video,
                                                      const std::string& declared);

/// Whether markers of the family are seen in the same frames once they are mirrored.
[[nodiscard]] bool is_mirrored(const std::filesystem::path& video, const std::string& family);

}  // namespace kinescope
