// SPDX-License-Identifier: Apache-2.0
//
// residuals.csv of a run folder, frame by frame.
#pragma once

#include <filesystem>
#include <map>
#include <optional>

#include "calib/bundle/calibration.h"

namespace kinescope {

/// What the calibration leaves in one frame: rms of the distances observed - predicted, px of
/// corners, m of poses and points. Of what was used.
struct FrameResidual {
  std::optional<double> rms;    ///< none: nothing of the frame was used
  Sigma held_out_rms;           ///< by the fit that has not seen the frame
  std::map<int, double> of_id;  ///< by marker
  int used = 0;                 ///< corners, or sightings
  int rejected = 0;
};

struct FrameResiduals {
  bool in_px = false;                  ///< else m
  std::map<double, FrameResidual> at;  ///< by t, s
};

/// Of the calibration's (reference) camera alone. Throws bad_input: missing, columns or numbers
/// that are none.
[[nodiscard]] FrameResiduals read_frame_residuals(const std::filesystem::path& residuals_csv,
                                                  const Calibration& calibration);

}  // namespace kinescope
