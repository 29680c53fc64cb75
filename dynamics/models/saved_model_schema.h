// SPDX-License-Identifier: Apache-2.0
//
// Names that writer and reader of app/io/schema/torque_model.schema.json share; not installed.
#pragma once

#include <array>

namespace kinescope::saved_model {

inline constexpr const char* kSchema = "kinescope.torque_model";
inline constexpr int kVersion = 1;
/// In the order of SavedProcess::Features.
inline constexpr std::array<const char*, 3> kFeatures = {"none", "friction", "terms"};

}  // namespace kinescope::saved_model
