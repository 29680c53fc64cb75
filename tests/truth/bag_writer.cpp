// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/bag_writer.h"

#include <cstring>

namespace kinescope::truth {
namespace {

constexpr std::string_view kMcapMagic("\x89MCAP0\r\n", 8);

template <typename Number>
std::string raw(Number value) {
  std::string out(sizeof value, '\0');
  std::memcpy(out.data(), &value, sizeof value);
  return out;
}

std::string text(std::string_view value) {
  return raw(static_cast<std::uint32_t>(value.size())) + std::string(value);
}

}  // namespace

CdrWriter& CdrWriter::put(const void* value, std::size_t size) {
  constexpr std::size_t kHeader = 4;
  while ((data_.size() - kHeader) % size != 0) data_.push_back('\0');
  data_.append(static_cast<const char*>(value), size);
  return *this;
}

CdrWriter& CdrWriter::string(std::string_view value) {
  u32(static_cast<std::uint32_t>(value.size() + 1));
  data_.append(value);
  data_.push_back('\0');
  return *this;
}

CdrWriter& CdrWriter::bytes(std::string_view bytes) {
  u32(static_cast<std::uint32_t>(bytes.size()));
  data_.append(bytes);
  return *this;
}

CdrWriter& CdrWriter::strings(const std::vector<std::string>& texts) {
  u32(static_cast<std::uint32_t>(texts.size()));
  for (const std::string& value : texts) string(value);
  return *this;
}

CdrWriter& CdrWriter::f64s(const std::vector<double>& values) {
  u32(static_cast<std::uint32_t>(values.size()));
  for (const double value : values) f64(value);
  return *this;
}

CdrWriter& CdrWriter::time(std::int64_t stamp_ns) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  u32(static_cast<std::uint32_t>(stamp_ns / kSecond));
  return u32(static_cast<std::uint32_t>(stamp_ns % kSecond));
}

std::string joint_state(std::int64_t stamp_ns, const std::vector<std::string>& names,
                        const std::vector<double>& position, const std::vector<double>& velocity,
                        const std::vector<double>& effort) {
  CdrWriter out;
  return out.header(stamp_ns).strings(names).f64s(position).f64s(velocity).f64s(effort).data();
}

std::string image(std::int64_t stamp_ns, int width, int height, const std::string& encoding,
                  std::uint32_t step, std::string_view pixels) {
  CdrWriter out;
  out.header(stamp_ns)
      .u32(static_cast<std::uint32_t>(height))
      .u32(static_cast<std::uint32_t>(width))
      .string(encoding)
      .u8(0)
      .u32(step);
  return out.bytes(pixels).data();
}

std::string compressed_image(std::int64_t stamp_ns, const std::string& format,
                             std::string_view data) {
  CdrWriter out;
  return out.header(stamp_ns).string(format).bytes(data).data();
}

std::string camera_info(std::int64_t stamp_ns, const CameraInfoFields& camera) {
  CdrWriter out;
  out.header(stamp_ns)
      .u32(static_cast<std::uint32_t>(camera.height))
      .u32(static_cast<std::uint32_t>(camera.width))
      .string(camera.model)
      .f64s(camera.d);
  for (const double k : {camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0})
    out.f64(k);
  for (const double r : {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}) out.f64(r);
  for (const double p :
       {camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0})
    out.f64(p);
  out.u32(camera.binning).u32(camera.binning);
  for (const std::uint32_t bound : camera.roi) out.u32(bound);
  return out.u8(0).data();
}

std::string tag_detections(std::int64_t stamp_ns, const std::vector<DetectionFields>& tags) {
  CdrWriter out;
  out.header(stamp_ns).u32(static_cast<std::uint32_t>(tags.size()));
  for (const DetectionFields& tag : tags) {
    out.string(tag.family).u32(static_cast<std::uint32_t>(tag.id)).u32(0).f32(0.0F).f32(80.0F);
    out.f64(0.0).f64(0.0);  // centre
    for (const auto& corner : tag.corners) out.f64(corner[0]).f64(corner[1]);
    for (int i = 0; i < 9; ++i) out.f64(i % 4 == 0 ? 1.0 : 0.0);
  }
  return out.data();
}

BagWriter::BagWriter(const std::filesystem::path& path) : file_(path, std::ios::binary) {
  file_ << kMcapMagic;
  record(0x01, text("ros2") + text("test"));
}

void BagWriter::write(const std::string& topic, const std::string& type, std::int64_t received_ns,
                      std::string_view data) {
  const auto [known, is_new] =
      topics_.try_emplace(topic, static_cast<std::uint16_t>(topics_.size() + 1));
  const std::uint16_t id = known->second;
  if (is_new) {
    record(0x03, raw(id) + text(type) + text("ros2msg") + text(""));
    record(0x04, raw(id) + raw(id) + text(topic) + text("cdr") + raw(std::uint32_t{0}));
  }
  const auto stamp = static_cast<std::uint64_t>(received_ns);
  record(0x05, raw(id) + raw(std::uint32_t{0}) + raw(stamp) + raw(stamp) + std::string(data));
}

void BagWriter::finish() {
  record(0x0F, raw(std::uint32_t{0}));
  record(0x02, raw(std::uint64_t{0}) + raw(std::uint64_t{0}) + raw(std::uint32_t{0}));
  file_ << kMcapMagic;
  file_.close();
}

void BagWriter::record(std::uint8_t opcode, std::string_view content) {
  file_.put(static_cast<char>(opcode));
  file_ << raw(static_cast<std::uint64_t>(content.size())) << content;
}

}  // namespace kinescope::truth
