// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/packet_decoder.h"

#include <array>
#include <cstring>
#include <utility>

#include <fmt/format.h>

#include "calib/vision/av_frame.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

AVCodecID codec_named(const std::string& format) {
  constexpr std::array<std::pair<const char*, AVCodecID>, 5> kCodecs{{{"h264", AV_CODEC_ID_H264},
                                                                      {"h265", AV_CODEC_ID_HEVC},
                                                                      {"hevc", AV_CODEC_ID_HEVC},
                                                                      {"vp9", AV_CODEC_ID_VP9},
                                                                      {"av1", AV_CODEC_ID_AV1}}};
  for (const auto& [name, codec] : kCodecs)
    if (format == name) return codec;
  return AV_CODEC_ID_NONE;
}

}  // namespace

struct PacketDecoder::Impl {
  std::string source;
  Av<AVCodecContext> decoder;
  Av<AVPacket> packet;
  Av<AVFrame> frame;
  Av<SwsContext> scaler;
};

PacketDecoder::PacketDecoder(const std::string& format, const std::string& source)
    : impl_(std::make_unique<Impl>()) {
  av_log_set_level(AV_LOG_QUIET);
  impl_->source = source;
  const AVCodec* codec = avcodec_find_decoder(codec_named(format));
  if (codec == nullptr) {
    throw bad_input(source, fmt::format("no decoder for '{}'", format),
                    "h264, h265, vp9 and av1 are read");
  }
  impl_->decoder.reset(avcodec_alloc_context3(codec));
  impl_->decoder->thread_count = 1;  // frames are the unit of parallel work
  if (avcodec_open2(impl_->decoder.get(), codec, nullptr) < 0)
    throw bad_input(source, "the video's decoder does not start", "record JPEG images");
  impl_->packet.reset(av_packet_alloc());
  impl_->frame.reset(av_frame_alloc());
}

PacketDecoder::~PacketDecoder() = default;

void PacketDecoder::feed(std::size_t number, std::string_view packet) {
  AVPacket* out = impl_->packet.get();
  KINESCOPE_CHECK(av_new_packet(out, static_cast<int>(packet.size())) == 0, "memory for a packet");
  std::memcpy(out->data, packet.data(), packet.size());
  out->pts = static_cast<std::int64_t>(number);
  out->dts = out->pts;
  avcodec_send_packet(impl_->decoder.get(), out);  // a damaged one gives no picture
  av_packet_unref(out);
}

void PacketDecoder::finish() { avcodec_send_packet(impl_->decoder.get(), nullptr); }

std::optional<DecodedPicture> PacketDecoder::next() {
  while (avcodec_receive_frame(impl_->decoder.get(), impl_->frame.get()) == 0) {
    const AVFrame& frame = *impl_->frame;
    const bool damaged =
        (frame.flags & AV_FRAME_FLAG_CORRUPT) != 0 || frame.decode_error_flags != 0;
    if (damaged || frame.pts == AV_NOPTS_VALUE) continue;
    return DecodedPicture{static_cast<std::size_t>(frame.pts),
                          grey_of(frame, impl_->scaler, impl_->source)};
  }
  return std::nullopt;
}

}  // namespace kinescope
