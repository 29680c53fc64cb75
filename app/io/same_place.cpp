// SPDX-License-Identifier: Apache-2.0
#include "app/io/same_place.h"

#include <system_error>

namespace kinescope {

namespace fs = std::filesystem;

bool same_place(const fs::path& a, const fs::path& b) {
  std::error_code error;
  if (fs::equivalent(a, b, error)) return true;
  const auto whole = [](const fs::path& path) {
    std::error_code ignored;
    fs::path out = fs::weakly_canonical(fs::absolute(path), ignored);
    if (!out.has_filename()) out = out.parent_path();  // a slash at the end
    return out;
  };
  return whole(a) == whole(b);
}

}  // namespace kinescope
