// SPDX-License-Identifier: Apache-2.0
//
// Takes   a LeRobot dataset.
// Gives   what `inspect` prints of it before it looks at the recording or log in it.
#pragma once

#include <nlohmann/json.hpp>

#include "kinematics/datasets/dataset.h"

namespace kinescope {

/// "dataset ..", "episodes ..", a line a camera and feature, and what is missing for a recording.
void print_dataset(const datasets::Dataset& dataset, const datasets::Source& source);
[[nodiscard]] nlohmann::json dataset_json(const datasets::Dataset& dataset);

}  // namespace kinescope
