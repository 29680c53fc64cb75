// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>

namespace kinescope {

/// Calls `body(i)` for i = 0 .. count - 1, on as many threads as the machine has, or on `threads`.
/// What a body writes must be its own; then the result does not depend on who did what when. Waits
/// for all, and throws the error of the first index that failed.
void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body, int threads = 0);

}  // namespace kinescope
