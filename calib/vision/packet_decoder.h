// SPDX-License-Identifier: Apache-2.0
//
// A stream of H.264, H.265, VP9 or AV1 that comes packet by packet, without a container.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "calib/vision/image_view.h"

namespace kinescope {

/// A picture, and the number that its packet came with.
struct DecodedPicture {
  std::size_t number = 0;
  GreyImage image;
};

/// Pictures come out in the order in which they are shown, some packets after they went in. What is
/// damaged is left out, with what needs it.
class PacketDecoder {
 public:
  /// `format`: "h264", "h265" (or "hevc"), "vp9", "av1". Throws bad_input, naming `source`, for
  /// another one, or where no decoder is installed.
  PacketDecoder(const std::string& format, const std::string& source);
  ~PacketDecoder();
  PacketDecoder(const PacketDecoder&) = delete;
  PacketDecoder& operator=(const PacketDecoder&) = delete;
  PacketDecoder(PacketDecoder&&) = delete;
  PacketDecoder& operator=(PacketDecoder&&) = delete;

  void feed(std::size_t number, std::string_view packet);
  /// No packet comes any more.
  void finish();
  /// The next picture that is ready.
  [[nodiscard]] std::optional<DecodedPicture> next();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace kinescope
