// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace kinescope {

/// A grey image somebody else owns: height rows of width bytes, `stride` bytes apart.
struct ImageView {
  const std::uint8_t* data = nullptr;
  int width = 0;
  int height = 0;
  int stride = 0;
};

/// A grey image.
struct GreyImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;  ///< row by row
  [[nodiscard]] ImageView view() const { return {pixels.data(), width, height, width}; }
};

}  // namespace kinescope
