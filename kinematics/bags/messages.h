// SPDX-License-Identifier: Apache-2.0
//
// Takes   a message's bytes and its topic.
// Gives   the messages that make a recording, as values. Stamps are those of the header, ns.
// Source  sensor_msgs, apriltag_msgs (ROS 2), foxglove_msgs; their definitions have not changed
//         since 2010, 2021 and 2023.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/bags/bag.h"
#include "kinematics/bags/message_reader.h"

namespace kinescope::bags {

inline constexpr std::string_view kJointStateType = "sensor_msgs/JointState";
inline constexpr std::string_view kImageType = "sensor_msgs/Image";
inline constexpr std::string_view kCompressedImageType = "sensor_msgs/CompressedImage";
inline constexpr std::string_view kCompressedVideoType = "foxglove_msgs/CompressedVideo";
inline constexpr std::string_view kCameraInfoType = "sensor_msgs/CameraInfo";
inline constexpr std::string_view kDetectionsType = "apriltag_msgs/AprilTagDetectionArray";

struct JointState {
  std::int64_t stamp_ns = 0;
  std::vector<std::string> name;
  std::vector<double> position, velocity, effort;  ///< each as long as name, or empty
};

struct Image {
  std::int64_t stamp_ns = 0;
  std::uint32_t height = 0, width = 0;
  std::string encoding;  ///< mono8, rgb8, bayer_rggb8, ..
  bool big_endian = false;
  std::uint32_t step = 0;  ///< bytes a row
  std::string_view pixels;
};

/// A JPEG or PNG picture, or a piece of a stream of H.264.
struct PackedImage {
  std::int64_t stamp_ns = 0;
  std::string format;
  std::string_view data;
};

struct CameraInfo {
  std::int64_t stamp_ns = 0;
  std::uint32_t height = 0, width = 0;
  std::string distortion_model;
  std::vector<double> d;
  std::array<double, 9> k{};   ///< of the image as the lens makes it, row by row
  std::array<double, 12> p{};  ///< of the rectified image
  std::uint32_t binning_x = 0, binning_y = 0;
  std::uint32_t roi_x = 0, roi_y = 0, roi_height = 0, roi_width = 0;
  bool operator==(const CameraInfo&) const = default;
};

struct TagDetection {
  std::string family;
  std::int32_t id = 0;
  std::int32_t hamming = 0;
  float decision_margin = 0.0F;
  std::array<std::array<double, 2>, 4> corners{};  ///< px, in the detector's order
};

struct TagDetections {
  std::int64_t stamp_ns = 0;
  std::vector<TagDetection> tags;
};

/// All throw MessageFault.
[[nodiscard]] JointState read_joint_state(std::string_view data, Encoding encoding);
[[nodiscard]] Image read_image(std::string_view data, Encoding encoding);
[[nodiscard]] PackedImage read_compressed_image(std::string_view data, Encoding encoding);
[[nodiscard]] PackedImage read_compressed_video(std::string_view data, Encoding encoding);
[[nodiscard]] CameraInfo read_camera_info(std::string_view data, Encoding encoding);
[[nodiscard]] TagDetections read_tag_detections(std::string_view data, Encoding encoding);

}  // namespace kinescope::bags
