// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/tag_pattern.h"

#include <memory>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "calib/vision/apriltag_families.h"
#include "calib/vision/aruco_dictionaries.h"
#include "calib/vision/tag_detector.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

void require_id(const std::string& family, int id, int count) {
  if (id >= 0 && id < count) return;
  throw bad_request(family, fmt::format("has no marker {}", id),
                    fmt::format("its markers are 0 to {}", count - 1));
}

// Of an ArUco marker, which OpenCV draws without a margin, with one white cell around it.
TagPattern aruco_pattern(const cv::aruco::Dictionary& dictionary, int id) {
  constexpr int kMargin = 1;
  TagPattern out;
  out.edge = dictionary.markerSize + 2;
  out.cells = out.edge + 2 * kMargin;
  cv::Mat marker;
  dictionary.drawMarker(id, out.edge, marker);
  cv::Mat1b whole(out.cells, out.cells, std::uint8_t{255});
  marker.copyTo(whole(cv::Rect(kMargin, kMargin, out.edge, out.edge)));
  for (const std::uint8_t grey : whole) out.bright.push_back(grey > 0);
  return out;
}

TagPattern april_pattern(apriltag_family_t& family, int id) {
  const std::unique_ptr<image_u8_t, void (*)(image_u8_t*)> image(apriltag_to_image(&family, id),
                                                                 image_u8_destroy);
  TagPattern out;
  out.cells = family.total_width;
  out.edge = family.width_at_border;
  for (int y = 0; y < out.cells; ++y) {
    for (int x = 0; x < out.cells; ++x) out.bright.push_back(image->buf[y * image->stride + x] > 0);
  }
  return out;
}

}  // namespace

TagPattern tag_pattern(const std::string& family, int id) {
  if (const auto aruco = aruco_dictionary(family)) {
    require_id(family, id, aruco->bytesList.rows);
    return aruco_pattern(*aruco, id);
  }
  const AprilTagFamily april = make_apriltag_family(family);
  if (!april) throw unknown_family(family);
  require_id(family, id, static_cast<int>(april->ncodes));
  return april_pattern(*april, id);
}

}  // namespace kinescope
