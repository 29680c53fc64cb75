// SPDX-License-Identifier: Apache-2.0
#include "tests/calib/vision/write_video.h"

#include <cstring>
#include <stdexcept>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

namespace kinescope {
namespace {

void require(bool good, const char* what) {
  if (!good) throw std::runtime_error(what);
}

void drain(AVCodecContext* encoder, AVFormatContext* file, AVStream* stream) {
  AVPacket* packet = av_packet_alloc();
  while (avcodec_receive_packet(encoder, packet) == 0) {
    packet->duration = 10;  // else the last frame ends where it begins and readers drop it
    av_packet_rescale_ts(packet, encoder->time_base, stream->time_base);
    packet->stream_index = stream->index;
    require(av_interleaved_write_frame(file, packet) == 0, "frame not written");
  }
  av_packet_free(&packet);
}

}  // namespace

void write_video(const std::filesystem::path& path, const VideoSpec& spec) {
  av_log_set_level(AV_LOG_QUIET);
  AVFormatContext* file = nullptr;
  require(avformat_alloc_output_context2(&file, nullptr, nullptr, path.c_str()) >= 0,
          "no container");
  const AVCodec* codec = avcodec_find_encoder(AV_CODEC_ID_MPEG4);
  require(codec != nullptr, "no encoder");
  AVCodecContext* encoder = avcodec_alloc_context3(codec);
  encoder->width = spec.frames.front().width;
  encoder->height = spec.frames.front().height;
  encoder->pix_fmt = AV_PIX_FMT_YUV420P;
  encoder->time_base = {1, 1000};
  encoder->framerate = {30, 1};
  encoder->max_b_frames = spec.b_frames;
  encoder->gop_size = 12;
  encoder->flags |= AV_CODEC_FLAG_QSCALE;
  encoder->global_quality = FF_QP2LAMBDA * 2;
  if ((file->oformat->flags & AVFMT_GLOBALHEADER) != 0) {
    encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  }
  require(avcodec_open2(encoder, codec, nullptr) == 0, "encoder does not open");
  AVStream* stream = avformat_new_stream(file, nullptr);
  avcodec_parameters_from_context(stream->codecpar, encoder);
  stream->time_base = encoder->time_base;
  require(avio_open(&file->pb, path.c_str(), AVIO_FLAG_WRITE) >= 0, "file does not open");
  require(avformat_write_header(file, nullptr) >= 0, "no header");
  AVFrame* frame = av_frame_alloc();
  frame->format = encoder->pix_fmt;
  frame->width = encoder->width;
  frame->height = encoder->height;
  require(av_frame_get_buffer(frame, 0) == 0, "no memory");
  for (std::size_t i = 0; i < spec.frames.size(); ++i) {
    require(av_frame_make_writable(frame) == 0, "frame is busy");
    for (int y = 0; y < frame->height; ++y) {
      std::memcpy(frame->data[0] + static_cast<std::ptrdiff_t>(frame->linesize[0]) * y,
                  spec.frames[i].pixels.data() + static_cast<std::ptrdiff_t>(frame->width) * y,
                  static_cast<std::size_t>(frame->width));
    }
    for (int y = 0; y < frame->height / 2; ++y) {
      for (int plane = 1; plane <= 2; ++plane) {
        std::memset(frame->data[plane] + static_cast<std::ptrdiff_t>(frame->linesize[plane]) * y,
                    128, static_cast<std::size_t>(frame->width / 2));
      }
    }
    frame->pts = spec.stamps_ms[i];
    require(avcodec_send_frame(encoder, frame) == 0, "frame not encoded");
    drain(encoder, file, stream);
  }
  avcodec_send_frame(encoder, nullptr);
  drain(encoder, file, stream);
  av_write_trailer(file);
  avio_closep(&file->pb);
  av_frame_free(&frame);
  avcodec_free_context(&encoder);
  avformat_free_context(file);
}

}  // namespace kinescope
