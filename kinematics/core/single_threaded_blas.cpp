// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/single_threaded_blas.h"

#include <mutex>

#include <cblas.h>

namespace kinescope {
namespace {

std::mutex guard_mutex;
int guard_depth = 0;
int threads_before = 0;

}  // namespace

SingleThreadedBlas::SingleThreadedBlas() {
  const std::scoped_lock lock(guard_mutex);
  if (guard_depth++ == 0) {
    threads_before = openblas_get_num_threads();
    openblas_set_num_threads(1);
  }
}

SingleThreadedBlas::~SingleThreadedBlas() {
  const std::scoped_lock lock(guard_mutex);
  if (--guard_depth == 0) openblas_set_num_threads(threads_before);
}

}  // namespace kinescope
