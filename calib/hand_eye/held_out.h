// SPDX-License-Identifier: Apache-2.0
//
// Errors and predictive likelihood of frames whose fold no fit has seen. Internal to the room.
#pragma once

#include <vector>

#include "calib/hand_eye/fit.h"

namespace kinescope::hand_eye {

/// How far the targets of a frame are from where they are predicted, rms over the targets: all of
/// them together as one body, for a small marker alone says little of its distance.
struct ClosedLoop {
  double m = 0.0;
  double rad = 0.0;
  double px = 0.0;  ///< between corners; 0 for poses
};
[[nodiscard]] ClosedLoop closed_loop(const Frame& frame, const FrameRows& rows);

struct HeldOutFrame {
  bool known = false;  ///< false: left out as an outlier, or its fold could not be fitted
  ClosedLoop error;
  double log_density = 0.0;  ///< of its rows, whitened by the declared sigmas
};

/// A fold of every frame: neighbours in posture are held out together (calib/bundle/folds.h).
[[nodiscard]] std::vector<int> folds_of(const Data& data, const PoseLog& log, int folds);

/// Every frame, its fold held out of a refit with the weights of `fit`.
[[nodiscard]] std::vector<HeldOutFrame> hold_out(const Model& model, const Fit& fit,
                                                 const std::vector<int>& fold);

}  // namespace kinescope::hand_eye
