// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/bag_video.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/vision/packet_decoder.h"
#include "kinematics/bags/bag_contents.h"
#include "kinematics/core/error.h"
#include "kinematics/core/longest_increasing.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

using bags::MessageFault;

/// What turns an encoding of sensor_msgs into grey values.
struct Encoding {
  const char* name;
  int type;        ///< of OpenCV
  int conversion;  ///< of cv::cvtColor, or one of these
};
constexpr int kIsGrey = -1;
constexpr int kUpperByte = -2;  ///< sensors of 10 or 12 bits are published shifted up

// OpenCV names a Bayer pattern by its second row, ROS by its first.
constexpr std::array kEncodings = {Encoding{"mono8", CV_8UC1, kIsGrey},
                                   Encoding{"8UC1", CV_8UC1, kIsGrey},
                                   Encoding{"mono16", CV_8UC2, kUpperByte},
                                   Encoding{"rgb8", CV_8UC3, cv::COLOR_RGB2GRAY},
                                   Encoding{"bgr8", CV_8UC3, cv::COLOR_BGR2GRAY},
                                   Encoding{"8UC3", CV_8UC3, cv::COLOR_BGR2GRAY},
                                   Encoding{"rgba8", CV_8UC4, cv::COLOR_RGBA2GRAY},
                                   Encoding{"bgra8", CV_8UC4, cv::COLOR_BGRA2GRAY},
                                   Encoding{"8UC4", CV_8UC4, cv::COLOR_BGRA2GRAY},
                                   Encoding{"bayer_rggb8", CV_8UC1, cv::COLOR_BayerBG2GRAY},
                                   Encoding{"bayer_bggr8", CV_8UC1, cv::COLOR_BayerRG2GRAY},
                                   Encoding{"bayer_gbrg8", CV_8UC1, cv::COLOR_BayerGR2GRAY},
                                   Encoding{"bayer_grbg8", CV_8UC1, cv::COLOR_BayerGB2GRAY},
                                   Encoding{"uyvy", CV_8UC2, cv::COLOR_YUV2GRAY_UYVY},
                                   Encoding{"yuv422", CV_8UC2, cv::COLOR_YUV2GRAY_UYVY},
                                   Encoding{"yuyv", CV_8UC2, cv::COLOR_YUV2GRAY_YUY2},
                                   Encoding{"yuv422_yuy2", CV_8UC2, cv::COLOR_YUV2GRAY_YUY2}};

const Encoding* find_encoding(const std::string& name) {
  const auto found =
      std::ranges::find_if(kEncodings, [&](const Encoding& known) { return name == known.name; });
  return found == kEncodings.end() ? nullptr : &*found;
}

ImageView view_of(const cv::Mat& grey) {
  return {grey.data, grey.cols, grey.rows, static_cast<int>(grey.step)};
}

/// Throws MessageFault where the pixels are fewer than the size says.
GreyImage grey_of(const bags::Image& image, const Encoding& encoding) {
  const std::size_t row_bytes =
      std::size_t{image.width} * static_cast<std::size_t>(CV_ELEM_SIZE(encoding.type));
  const bool fits = image.width > 0 && image.height > 0 && image.step >= row_bytes &&
                    image.pixels.size() / image.step >= image.height;
  constexpr std::uint32_t kWidest = 1U << 16U;
  if (!fits || image.width > kWidest || image.height > kWidest) throw MessageFault{};
  const cv::Mat pixels(static_cast<int>(image.height), static_cast<int>(image.width), encoding.type,
                       const_cast<char*>(image.pixels.data()),  // NOLINT(*-const-cast): read only
                       image.step);
  if (encoding.conversion == kIsGrey) return copy_of(view_of(pixels));
  cv::Mat grey;
  if (encoding.conversion == kUpperByte) {
    cv::extractChannel(pixels, grey, image.big_endian ? 0 : 1);
  } else {
    cv::cvtColor(pixels, grey, encoding.conversion);
  }
  return copy_of(view_of(grey));
}

GreyImage unpacked(const bags::PackedImage& image) {
  const cv::Mat bytes(1, static_cast<int>(image.data.size()), CV_8UC1,
                      const_cast<char*>(image.data.data()));  // NOLINT(*-const-cast): read only
  cv::Mat grey;
  try {
    grey = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  } catch (const cv::Exception&) {
    throw MessageFault{};
  }
  if (grey.empty()) throw MessageFault{};
  return copy_of(view_of(grey));
}

class BagVideoReader final : public VideoReader {
 public:
  explicit BagVideoReader(const bags::Source& source)
      : series_(bags::choose_images(bags::look_into(source.bag), source.topic)),
        name_(source.bag.string() + ":" + series_.topic),
        bag_(bags::open(source.bag)) {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    require_known_encoding();
    // Packets of a stream come in the order in which they are decoded; pictures leave it in theirs.
    in_order_.resize(series_.times_s.size(), stream_ ? 1 : 0);
    if (!stream_) {
      for (const Eigen::Index k : longest_increasing(series_.times_s))
        in_order_[static_cast<std::size_t>(k)] = 1;
    }
    first_ = decode_next();
    if (!first_) {
      throw bad_input(name_, "none of the images can be decoded",
                      "check what the camera's driver publishes");
    }
    info_.width = first_->image.width;
    info_.height = first_->image.height;
    info_.frame_count = static_cast<int>(series_.times_s.size());
    const auto [begin, end] = std::ranges::minmax(series_.times_s);
    info_.duration_s = end - begin;
    info_.codec = series_.encoding.empty() ? "images" : series_.encoding;
  }

  const VideoInfo& info() const override { return info_; }
  const std::vector<std::string>& warnings() const override { return warnings_; }

  std::optional<VideoFrame> next() override {
    if (first_) return std::exchange(first_, std::nullopt);
    if (finished_) return std::nullopt;
    std::optional<VideoFrame> frame = decode_next();
    if (!frame) finish();
    return frame;
  }

 private:
  void require_known_encoding() {
    if (series_.type == bags::kCompressedVideoType) stream_.emplace(series_.encoding, name_);
    if (series_.type != bags::kImageType) return;
    encoding_ = find_encoding(series_.encoding);
    if (encoding_ != nullptr) return;
    throw bad_input(name_, fmt::format("images of encoding '{}'", series_.encoding),
                    "mono8, rgb8, bgr8, bayer_rggb8 and their like, mono16, yuv422 are read");
  }

  GreyImage decode(const bags::Message& message, const bags::Topic& topic) {
    if (series_.type != bags::kImageType)
      return unpacked(bags::read_compressed_image(message.data, topic.encoding));
    const bags::Image image = bags::read_image(message.data, topic.encoding);
    if (encoding_ == nullptr || image.encoding != encoding_->name)
      encoding_ = find_encoding(image.encoding);
    if (encoding_ == nullptr) throw MessageFault{};
    try {
      return grey_of(image, *encoding_);
    } catch (const cv::Exception&) {  // a Bayer pattern or YUV of an odd or tiny size
      throw MessageFault{};
    }
  }

  /// The next message that has a time in the series.
  std::optional<bags::Message> next_message() {
    while (const auto message = bag_->next()) {
      const bags::Topic& topic = bag_->topics()[message->topic];
      if (topic.name != series_.topic || topic.type != series_.type) continue;
      try {
        static_cast<void>(bags::image_stamp_ns(topic, message->data));
        return message;
      } catch (const MessageFault&) {
        continue;
      }
    }
    return std::nullopt;
  }

  /// The next picture, and the number of its message.
  std::optional<DecodedPicture> next_picture() {
    while (true) {
      if (stream_) {
        if (auto picture = stream_->next()) return picture;
      }
      const auto message = next_message();
      if (!message) {
        if (!stream_ || drained_) return std::nullopt;
        drained_ = true;
        stream_->finish();
        continue;
      }
      const std::size_t number = read_++;
      const bags::Topic& topic = bag_->topics()[message->topic];
      try {
        if (!stream_) return DecodedPicture{number, decode(*message, topic)};
        stream_->feed(number, bags::read_compressed_video(message->data, topic.encoding).data);
      } catch (const MessageFault&) {
        ++damaged_;
      }
    }
  }

  /// The next image with a stamp after its predecessor's.
  std::optional<VideoFrame> decode_next() {
    while (auto picture = next_picture()) {
      if (picture->number >= series_.times_s.size()) continue;
      const double time_s = series_.times_s[picture->number];
      ++decoded_;
      if (in_order_[picture->number] == 0 || (index_ > 0 && !(time_s > last_s_))) {
        ++unordered_;
        continue;
      }
      const GreyImage& image = picture->image;
      if (info_.width > 0 && (image.width != info_.width || image.height != info_.height)) {
        ++other_size_;
        continue;
      }
      if (index_ > 0) steps_.push_back(time_s - last_s_);
      last_s_ = time_s;
      return VideoFrame{index_++, time_s, std::move(picture->image)};
    }
    if (stream_) damaged_ = static_cast<int>(read_) - decoded_;
    return std::nullopt;
  }

  void finish() {
    finished_ = true;
    for (const std::string& warning : bag_->warnings()) warnings_.push_back(warning);
    if (damaged_ > 0) {
      warnings_.push_back(
          fmt::format("{}: {} images cannot be decoded and are left out", name_, damaged_));
    }
    if (!series_.stamps.of_header) {
      warnings_.push_back(fmt::format(
          "{}: the images have no stamps of their own: those of the recorder are used", name_));
    } else if (series_.stamps.moved_s != 0.0) {
      warnings_.push_back(
          fmt::format("{}: the stamps are {:.3f} s from the recorder's clock, and are moved to it",
                      name_, -series_.stamps.moved_s));
    }
    if (other_size_ > 0) {
      warnings_.push_back(fmt::format("{}: {} images are not of {} x {} px and are left out", name_,
                                      other_size_, info_.width, info_.height));
    }
    if (unordered_ > 0) {
      warnings_.push_back(
          fmt::format("{}: the stamps of {} images do not increase; these images are left out",
                      name_, unordered_));
    }
    constexpr double kSteps = 4.0;
    if (steps_.empty()) return;
    const double step = median_of(steps_);
    const auto gaps = std::ranges::count_if(steps_, [&](double s) { return s > kSteps * step; });
    if (gaps > 0) {
      warnings_.push_back(fmt::format("{}: {} gaps between images, the longest of {:.3f} s", name_,
                                      gaps, std::ranges::max(steps_)));
    }
  }

  bags::ImageSeries series_;
  std::string name_;
  std::unique_ptr<bags::Reader> bag_;
  const Encoding* encoding_ = nullptr;
  std::optional<PacketDecoder> stream_;  // of H.264 and its like
  bool drained_ = false;
  std::size_t read_ = 0;  // messages of the series
  int decoded_ = 0;
  int index_ = 0;
  double last_s_ = 0.0;
  bool finished_ = false;
  std::optional<VideoFrame> first_;
  VideoInfo info_;
  std::vector<double> steps_;
  int damaged_ = 0;
  std::vector<char> in_order_;  // one a message
  int unordered_ = 0;
  int other_size_ = 0;
  std::vector<std::string> warnings_;
};

}  // namespace

std::unique_ptr<VideoReader> open_bag_video(const bags::Source& source) {
  return std::make_unique<BagVideoReader>(source);
}

}  // namespace kinescope
