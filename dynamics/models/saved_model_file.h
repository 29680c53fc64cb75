// SPDX-License-Identifier: Apache-2.0
//
// What predicts single samples of a file of `kinescope dynamics --save-model`. The whole file, with
// the effects that tracing found and the filter of the log, is read by app/io/torque_model_file.h:
// here it would bring every room of effects into a controller.
#pragma once

#include <filesystem>

#include "dynamics/models/torque_predictor.h"

namespace kinescope {

struct SavedModelFile {
  SavedTorqueModel model;
  bool traced = false;  ///< the file holds effects with a memory, too, which `model` lacks
};

/// Throws bad_input for what is no such file, or of another version, or does not fit itself.
[[nodiscard]] SavedModelFile read_saved_model(const std::filesystem::path& path);

}  // namespace kinescope
