// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace kinescope {

/// While one of these lives, OpenBLAS uses one thread a call: it cuts a product by its number of
/// threads, and so changes the last bits. May nest and be used by many threads.
class SingleThreadedBlas {
 public:
  SingleThreadedBlas();
  ~SingleThreadedBlas();
  SingleThreadedBlas(const SingleThreadedBlas&) = delete;
  SingleThreadedBlas& operator=(const SingleThreadedBlas&) = delete;
};

}  // namespace kinescope
