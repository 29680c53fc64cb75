// SPDX-License-Identifier: Apache-2.0
//
// What was seen: the corners of markers, frame by frame. observations.csv / corners.csv as a value.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "kinematics/core/ids.h"

namespace kinescope {

/// px, of a marker's edge; below, no family's cells can be told apart.
inline constexpr double kLeastEdge_px = 5.0;
/// Shortest to longest edge of a marker: seen at more than 80 degrees.
inline constexpr double kLeastEdgeRatio = 0.15;

/// One marker in one frame.
struct TagObservation {
  int frame = 0;  ///< index into TagObservations::times_s
  TagId id;
  std::vector<Eigen::Vector2d>
      corners_px;                ///< in the order of MarkerSet::corners_m; centre of pixel at 0
  double sigma_px = 0.1;         ///< standard deviation of one coordinate of one corner
  int hamming = 0;               ///< bits corrected
  double decision_margin = 0.0;  ///< contrast of the decoding; 0 where unknown
  bool partly_hidden = false;    ///< its code does not lie where its corners put it
  bool fitted = true;            ///< its corners, to the pixels; else they are the detector's own
};

/// A detection that was seen and not believed.
struct RejectedTag {
  int frame = 0;
  TagId id;
  std::string reason;
};

struct TagObservations {
  std::vector<double> times_s;  ///< of every frame of the recording, also of those without a marker
  int width = 0;                ///< px
  int height = 0;               ///< px
  std::vector<TagObservation> observations;  ///< by frame, then id
  std::vector<RejectedTag> rejected;
  std::vector<std::string> warnings = {};  ///< of the detection, one line each
  bool lens_known = false;                 ///< of the detection (DetectOptions::lens)
};

}  // namespace kinescope
