// SPDX-License-Identifier: Apache-2.0
//
// Files that are built into the program: the page's style, the bundled viewer, the licence of what
// it bundles.
#pragma once

#include <string_view>

namespace kinescope::report {

[[nodiscard]] std::string_view page_style();
[[nodiscard]] std::string_view viewer_script();
[[nodiscard]] std::string_view three_licence();

}  // namespace kinescope::report
