// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
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

/// The same rows, one behind the other.
[[nodiscard]] inline GreyImage copy_of(const ImageView& image) {
  GreyImage out{image.width, image.height, {}};
  out.pixels.reserve(static_cast<std::size_t>(image.width) *
                     static_cast<std::size_t>(image.height));
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* row = image.data + static_cast<std::ptrdiff_t>(image.stride) * y;
    out.pixels.insert(out.pixels.end(), row, row + image.width);
  }
  return out;
}

}  // namespace kinescope
