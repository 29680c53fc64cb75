// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace kinescope::parquet {

/// What is wrong with a file's bytes; who knows the file's name makes an Error of it.
struct Damage {
  std::string what;  ///< "a page goes on beyond its column"
};

/// What is in order, and not read: an encoding, a compression.
struct NotRead {
  std::string what;  ///< "compression brotli"
};

}  // namespace kinescope::parquet
