// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace kinescope {

/// Of `known` the one that is a few letters from the name, in any case; empty: none is.
[[nodiscard]] std::string nearest_name(std::string_view name, std::span<const std::string> known);

/// "did you mean 'x'? known: x, y" for a name that is none of `known`.
[[nodiscard]] std::string did_you_mean(std::string_view name, std::span<const std::string> known);

}  // namespace kinescope
