// SPDX-License-Identifier: Apache-2.0
//
// Allocations and locks of the calling thread: operator new is the test program's own, and the
// linker sends every malloc, calloc, realloc, aligned_alloc, posix_memalign and pthread_mutex_lock
// of the libraries here first (--wrap, CMakeLists.txt). Eigen allocates by malloc.
#pragma once

namespace kinescope::test {

struct Calls {
  long allocations = 0;
  long locks = 0;
};

/// Since the thread began.
[[nodiscard]] Calls calls();

}  // namespace kinescope::test
