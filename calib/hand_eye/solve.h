// SPDX-License-Identifier: Apache-2.0
//
// The Ceres problem of a model over some frames. Internal to the room.
#pragma once

#include <vector>

#include "calib/hand_eye/noise.h"

namespace kinescope::hand_eye {

struct Solved {
  State state;
  bool converged = false;
};

/// Least squares over the frames named, each whitened by `noise` at the start. `robust`: Cauchy's
/// loss on a frame's squares.
[[nodiscard]] Solved solve(const Model& model, const State& start, const Noise& noise,
                           const std::vector<std::size_t>& frames, bool robust);

/// Rows of every frame; nothing for those whose target lies behind the camera.
[[nodiscard]] std::vector<std::optional<FrameRows>> rows_of_all(const Model& model,
                                                                const State& state);

}  // namespace kinescope::hand_eye
