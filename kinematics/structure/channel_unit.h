// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace kinescope {

/// What the values of a channel count.
enum class ChannelUnit { kUnknown, kRadian, kMetre, kTicks };

}  // namespace kinescope
