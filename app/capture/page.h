// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace kinescope {

/// The page of a capture: complete but for its picture and state, which its script asks this server
/// for.
[[nodiscard]] std::string capture_page(const std::string& source, const std::string& folder);

}  // namespace kinescope
