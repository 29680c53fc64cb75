// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace kinescope {

/// Valid UTF-8 with what is not replaced by U+FFFD; control characters become spaces.
[[nodiscard]] std::string clean_text(std::string_view text);

/// Appends those of `more` that `said` does not hold yet: what two readers of one file warn of.
void append_unsaid(std::vector<std::string>& said, const std::vector<std::string>& more);

}  // namespace kinescope
