// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace kinescope {

/// Valid UTF-8 with what is not replaced by U+FFFD; control characters become spaces.
[[nodiscard]] std::string clean_text(std::string_view text);

}  // namespace kinescope
