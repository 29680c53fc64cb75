// SPDX-License-Identifier: Apache-2.0
//
// Not installed.
#pragma once

namespace kinescope {

// Two-sided quantiles of the normal distribution.
inline constexpr double kNormal90 = 1.6448536;
inline constexpr double kNormal95 = 1.9599640;

}  // namespace kinescope
