// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glog/logging.h>

namespace kinescope {

/// Ceres reports failed evaluations through glog to standard error; its summary says the same.
/// Safe in any thread.
inline void silence_glog() {
  [[maybe_unused]] static const bool done = [] {
    FLAGS_minloglevel = google::GLOG_FATAL;
    return true;
  }();
}

}  // namespace kinescope
