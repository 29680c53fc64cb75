// SPDX-License-Identifier: Apache-2.0
//
// FFmpeg's objects as values that free themselves, and its pictures as grey values.
#pragma once

#include <memory>
#include <string>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libswscale/swscale.h>
}

#include "calib/vision/image_view.h"

namespace kinescope {

struct FreeAv {
  void operator()(AVFormatContext* p) const { avformat_close_input(&p); }
  void operator()(AVCodecContext* p) const { avcodec_free_context(&p); }
  void operator()(AVPacket* p) const { av_packet_free(&p); }
  void operator()(AVFrame* p) const { av_frame_free(&p); }
  void operator()(SwsContext* p) const { sws_freeContext(p); }
};
template <typename T>
using Av = std::unique_ptr<T, FreeAv>;

/// The brightness of a decoded picture. `scaler` is made where it is needed, and kept. Throws
/// bad_input, naming `source`, for a format that cannot be turned to grey.
[[nodiscard]] GreyImage grey_of(const AVFrame& frame, Av<SwsContext>& scaler,
                                const std::string& source);

}  // namespace kinescope
