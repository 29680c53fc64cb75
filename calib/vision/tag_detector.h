// SPDX-License-Identifier: Apache-2.0
//
// Takes   one grey image.
// Gives   the markers in it: id, four corners (px, centre of pixel at 0, AprilTag order), decoding
// margin. Method  AprilTag 3 (Krogius et al. 2019) through the packaged library; ArUco dictionaries
// through OpenCV.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera/tag_observations.h"
#include "calib/vision/image_view.h"
#include "kinematics/core/error.h"

namespace kinescope {

struct DetectorOptions {
  double decimate =
      1.0;  ///< search at 1/decimate of the resolution; more is faster and misses small tags
  double blur_sigma = 0.0;  ///< px, smoothing before the search
  bool refine_edges = true;
  /// Bits corrected at most; more finds more and invents more. Without it 1, and 2 of ArUco
  /// dictionaries whose codes are as far apart as those of tag36h11.
  std::optional<int> max_hamming = std::nullopt;
  double min_margin = 20.0;  ///< least decision margin (AprilTag families)
};

class TagDetector {
 public:
  virtual ~TagDetector() = default;
  /// `frame` of the result is 0. Not thread-safe: one detector a thread.
  [[nodiscard]] virtual std::vector<TagObservation> detect(const ImageView& image) = 0;
};

/// Names of all families this build knows.
[[nodiscard]] std::vector<std::string> known_families();

/// What the refinement of corners must know of a family.
struct TagLayout {
  int cells = 8;            ///< along an edge between two corners
  bool dark_inside = true;  ///< the border is dark inside and bright outside
};

/// Names those that this build knows.
[[nodiscard]] Error unknown_family(const std::string& family);

/// Throws unknown_family().
[[nodiscard]] TagLayout tag_layout(const std::string& family);

/// Puts detections into the one order results have: frame, id, place of the first corner.
void sort_detections(std::vector<TagObservation>& tags);

/// Throws unknown_family().
[[nodiscard]] std::unique_ptr<TagDetector> make_tag_detector(const std::string& family,
                                                             const DetectorOptions& options = {});

/// What either of them finds; where both do, the first one's. At full resolution small markers are
/// seen, at a reduced one large markers with rough edges.
[[nodiscard]] std::vector<TagObservation> detect_with_both(TagDetector& fine, TagDetector& coarse,
                                                           const ImageView& image);

}  // namespace kinescope
