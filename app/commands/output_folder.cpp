// SPDX-License-Identifier: Apache-2.0
#include "app/commands/output_folder.h"

#include <utility>

#include "kinematics/core/file.h"

#ifndef KINESCOPE_VERSION
#error "KINESCOPE_VERSION is set by the build"
#endif

namespace kinescope {

std::string program_version() { return KINESCOPE_VERSION; }

OutputFolder::OutputFolder(std::filesystem::path folder) : folder_(std::move(folder)) {
  require_writable_folder(folder_);
}

void OutputFolder::write(std::string_view name, std::string_view content) const {
  write_file_atomically(folder_ / name, content);
}

}  // namespace kinescope
