// SPDX-License-Identifier: Apache-2.0
//
// `kinescope markers` as a function.
#pragma once

#include <filesystem>

#include "app/commands/commands.h"
#include "app/io/marker_sheet.h"

namespace kinescope {

struct MarkersOptions {
  MarkerSheet sheet{.family = "tag36h11"};
  std::filesystem::path output = "markers.pdf";
  bool force = false;  ///< replace a file that is there
};

[[nodiscard]] ExitCode markers_command(const MarkersOptions& options, const Console& console);

}  // namespace kinescope
