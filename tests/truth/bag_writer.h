// SPDX-License-Identifier: Apache-2.0
//
// Bags as a test makes them: MCAP without chunks, messages in little-endian CDR.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace kinescope::truth {

/// Fields of a message, one after the other, each aligned to its size.
class CdrWriter {
 public:
  CdrWriter& u8(std::uint8_t value) { return put(&value, 1); }
  CdrWriter& u32(std::uint32_t value) { return put(&value, sizeof value); }
  CdrWriter& f32(float value) { return put(&value, sizeof value); }
  CdrWriter& f64(double value) { return put(&value, sizeof value); }
  CdrWriter& string(std::string_view text);
  CdrWriter& bytes(std::string_view bytes);
  CdrWriter& strings(const std::vector<std::string>& texts);
  CdrWriter& f64s(const std::vector<double>& values);
  CdrWriter& time(std::int64_t stamp_ns);
  CdrWriter& header(std::int64_t stamp_ns) { return time(stamp_ns).string("frame"); }
  [[nodiscard]] const std::string& data() const { return data_; }

 private:
  CdrWriter& put(const void* value, std::size_t size);
  std::string data_{"\x00\x01\x00\x00", 4};
};

[[nodiscard]] std::string joint_state(std::int64_t stamp_ns, const std::vector<std::string>& names,
                                      const std::vector<double>& position,
                                      const std::vector<double>& velocity = {},
                                      const std::vector<double>& effort = {});
[[nodiscard]] std::string image(std::int64_t stamp_ns, int width, int height,
                                const std::string& encoding, std::uint32_t step,
                                std::string_view pixels);
[[nodiscard]] std::string compressed_image(std::int64_t stamp_ns, const std::string& format,
                                           std::string_view data);
struct CameraInfoFields {
  int width = 0, height = 0;
  std::string model = "plumb_bob";
  std::vector<double> d = {0.0, 0.0, 0.0, 0.0, 0.0};
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;
  std::uint32_t binning = 0;
  std::array<std::uint32_t, 4> roi{};  ///< x, y, height, width
};
[[nodiscard]] std::string camera_info(std::int64_t stamp_ns, const CameraInfoFields& camera);

struct DetectionFields {
  std::string family = "36h11";
  int id = 0;
  std::array<std::array<double, 2>, 4> corners{};
};
[[nodiscard]] std::string tag_detections(std::int64_t stamp_ns,
                                         const std::vector<DetectionFields>& tags);

class BagWriter {
 public:
  explicit BagWriter(const std::filesystem::path& path);
  /// `type`: "sensor_msgs/msg/JointState".
  void write(const std::string& topic, const std::string& type, std::int64_t received_ns,
             std::string_view data);
  /// Ends the file; without it the bag is one whose recorder was killed.
  void finish();

 private:
  void record(std::uint8_t opcode, std::string_view content);
  std::ofstream file_;
  std::map<std::string, std::uint16_t> topics_;
};

}  // namespace kinescope::truth
