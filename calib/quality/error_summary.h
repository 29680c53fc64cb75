// SPDX-License-Identifier: Apache-2.0
//
// Takes   a Calibration.
// Gives   its errors in px, m and rad: before, training and held out apart; overall, per link, per
// marker.
#pragma once

#include <string>
#include <vector>

#include "calib/bundle/calibration.h"

namespace kinescope {

/// Of the length of an error vector (2-D px of one corner, 3-D m or rad of one sighting).
struct ErrorStatistics {
  int count = 0;
  double rms = 0.0;
  double median = 0.0;
  double p95 = 0.0;
  double max = 0.0;
};

[[nodiscard]] ErrorStatistics statistics(std::vector<double> lengths);

/// One row of the before/after table. Pixels are empty for poses and points, rotations for points.
struct ErrorRow {
  std::string name;  ///< "all", a link's name, "tag_12"
  ErrorStatistics before_px, training_px, held_out_px;
  ErrorStatistics before_m, training_m,
      held_out_m;  ///< displacement of the marker, across the line of sight for corners
  ErrorStatistics before_rad, training_rad, held_out_rad;  ///< turn of the marker
};

struct ErrorSummary {
  ErrorRow all;
  std::vector<ErrorRow> links;  ///< links that carry a marker
  std::vector<ErrorRow> markers;
};

[[nodiscard]] ErrorSummary summarise_errors(const Calibration& calibration);

}  // namespace kinescope
