// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace kinescope {

/// One path in two spellings, through links and "..", whether or not there is something.
[[nodiscard]] bool same_place(const std::filesystem::path& a, const std::filesystem::path& b);

}  // namespace kinescope
