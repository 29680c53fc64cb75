// SPDX-License-Identifier: Apache-2.0
#include "kinematics/bags/messages.h"

namespace kinescope::bags {

JointState read_joint_state(std::string_view data, Encoding encoding) {
  MessageReader reader(data, encoding);
  JointState out;
  out.stamp_ns = reader.header();
  out.name = reader.strings();
  for (std::vector<double>* values : {&out.position, &out.velocity, &out.effort}) {
    *values = reader.f64s();
    if (!values->empty() && values->size() != out.name.size()) throw MessageFault{};
  }
  return out;
}

Image read_image(std::string_view data, Encoding encoding) {
  MessageReader reader(data, encoding);
  Image out;
  out.stamp_ns = reader.header();
  out.height = reader.u32();
  out.width = reader.u32();
  out.encoding = reader.string();
  out.big_endian = reader.u8() != 0;
  out.step = reader.u32();
  out.pixels = reader.bytes();
  return out;
}

PackedImage read_compressed_image(std::string_view data, Encoding encoding) {
  MessageReader reader(data, encoding);
  PackedImage out;
  out.stamp_ns = reader.header();
  out.format = reader.string();
  out.data = reader.bytes();
  return out;
}

PackedImage read_compressed_video(std::string_view data, Encoding encoding) {
  MessageReader reader(data, encoding);
  PackedImage out;
  out.stamp_ns = reader.time_ns();
  static_cast<void>(reader.string());  // frame
  out.data = reader.bytes();
  out.format = reader.string();
  return out;
}

CameraInfo read_camera_info(std::string_view data, Encoding encoding) {
  MessageReader reader(data, encoding);
  CameraInfo out;
  out.stamp_ns = reader.header();
  out.height = reader.u32();
  out.width = reader.u32();
  out.distortion_model = reader.string();
  out.d = reader.f64s();
  out.k = reader.f64_array<9>();
  static_cast<void>(reader.f64_array<9>());  // rectification
  out.p = reader.f64_array<12>();
  out.binning_x = reader.u32();
  out.binning_y = reader.u32();
  out.roi_x = reader.u32();
  out.roi_y = reader.u32();
  out.roi_height = reader.u32();
  out.roi_width = reader.u32();
  return out;
}

TagDetections read_tag_detections(std::string_view data, Encoding encoding) {
  MessageReader reader(data, encoding);
  TagDetections out;
  out.stamp_ns = reader.header();
  constexpr std::size_t kLeast = 100;  // bytes of a detection: its corners and homography
  out.tags.resize(reader.count(kLeast));
  for (TagDetection& tag : out.tags) {
    tag.family = reader.string();
    tag.id = reader.i32();
    tag.hamming = reader.i32();
    static_cast<void>(reader.f32());  // goodness
    tag.decision_margin = reader.f32();
    static_cast<void>(reader.f64_array<2>());  // centre
    for (std::array<double, 2>& corner : tag.corners) corner = reader.f64_array<2>();
    static_cast<void>(reader.f64_array<9>());  // homography
  }
  return out;
}

}  // namespace kinescope::bags
