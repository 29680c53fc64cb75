// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/av_frame.h"

extern "C" {
#include <libavutil/pixdesc.h>
}

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// The first plane holds 8-bit brightness, one byte a pixel.
bool has_luma_plane(AVPixelFormat format) {
  const AVPixFmtDescriptor* d = av_pix_fmt_desc_get(format);
  if (d == nullptr) return false;
  constexpr std::uint64_t kOther = AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_PAL |
                                   AV_PIX_FMT_FLAG_BITSTREAM | AV_PIX_FMT_FLAG_HWACCEL |
                                   AV_PIX_FMT_FLAG_BAYER;
  return (d->flags & kOther) == 0 && d->comp[0].depth == 8 && d->comp[0].step == 1 &&
         d->comp[0].plane == 0 && d->comp[0].offset == 0;
}

}  // namespace

GreyImage grey_of(const AVFrame& frame, Av<SwsContext>& scaler, const std::string& source) {
  const auto format = static_cast<AVPixelFormat>(frame.format);
  if (has_luma_plane(format))
    return copy_of({frame.data[0], frame.width, frame.height, frame.linesize[0]});
  scaler.reset(sws_getCachedContext(scaler.release(), frame.width, frame.height, format,
                                    frame.width, frame.height, AV_PIX_FMT_GRAY8, SWS_POINT, nullptr,
                                    nullptr, nullptr));
  if (!scaler) {
    throw bad_input(source, "the video's pixel format cannot be turned to grey",
                    "convert the video to H.264 with 4:2:0 colour");
  }
  const Av<AVFrame> out(av_frame_alloc());
  out->width = frame.width;
  out->height = frame.height;
  out->format = AV_PIX_FMT_GRAY8;
  KINESCOPE_CHECK(av_frame_get_buffer(out.get(), 0) == 0, "no memory for a frame");
  sws_scale(scaler.get(), frame.data, frame.linesize, 0, frame.height, out->data, out->linesize);
  return copy_of({out->data[0], out->width, out->height, out->linesize[0]});
}

}  // namespace kinescope
