// SPDX-License-Identifier: Apache-2.0
//
// A folder of products under their names, each whole or not there.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace kinescope {

/// The program's version.
[[nodiscard]] std::string program_version();

class OutputFolder {
 public:
  /// Makes the folder and proves that it can be written. Throws bad_request.
  explicit OutputFolder(std::filesystem::path folder);

  [[nodiscard]] std::filesystem::path file(std::string_view name) const { return folder_ / name; }
  void write(std::string_view name, std::string_view content) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace kinescope
