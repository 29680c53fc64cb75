// SPDX-License-Identifier: Apache-2.0
//
// The hand-eye equation as a model that can be traced: what may stand beside it. Internal to the
// room.
//   position_scale, controller   the log's positions are too short or long as a whole (or the
//                                markers' size is: the two are one)
//   time_offset, clock           the log is ahead of the camera, or behind; of a motion
//   clock_drift, clock           the log's clock runs faster than the camera's, or slower; likewise
//   camera_bump, camera          the camera moved on its mount, once
//   tag_slip, tag_<id>           a marker moved, once
#pragma once

#include <vector>

#include "calib/hand_eye/fit.h"

namespace kinescope::hand_eye {

/// Rows are the pose of each target in each used frame: its shift (m), then its turn, seen less
/// predicted, in the target's frame. Frames and weights stay those of `fit`, whatever is added.
class TracedHandEye final : public TracedModel {
 public:
  /// `jumps`: whether what happens once is among the candidates.
  TracedHandEye(const Model& model, const Fit& fit, std::vector<int> fold, bool jumps = true);
  [[nodiscard]] TracedFit fit(const std::vector<AddedEffect>& effects) const override;

 private:
  const Model& model_;
  const Fit& fit_;
  std::vector<int> fold_;  // of every frame of the data
  bool jumps_;
};

}  // namespace kinescope::hand_eye
