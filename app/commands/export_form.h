// SPDX-License-Identifier: Apache-2.0
//
// One form in which `kinescope export` gives a robot or a run to other programs: read, checked and
// made before anything is written.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "app/commands/compared_runs.h"
#include "app/io/joint_values_file.h"

namespace kinescope {

struct ExportedFile {
  std::filesystem::path path;
  std::string bytes;
};

struct ExportForm {
  std::vector<ExportedFile> files;
  std::vector<std::filesystem::path> inputs;         ///< of files that stand in `folder`
  std::filesystem::path folder;                      ///< empty: the files are named one by one
  nlohmann::json result = nlohmann::json::object();  ///< keys of what --json prints
  std::vector<std::string> lines;                    ///< of standard output
  std::vector<std::string> warnings;
};

// Each throws bad_request or bad_input, and writes nothing.
[[nodiscard]] ExportForm export_mjcf(const ExportOptions& options);
[[nodiscard]] ExportForm export_dh(const ExportOptions& options);
[[nodiscard]] ExportForm export_lerobot(const ExportOptions& options);
[[nodiscard]] ExportForm export_mcap(const ExportOptions& options);
[[nodiscard]] ExportForm export_tum(const ExportOptions& options);

/// A finished run with what its recording showed.
struct RecordedRun {
  StoredRun run;
  JointValues joints;
  std::vector<std::vector<Pose>> T_base_link;  ///< times x links; not finite: not known
  /// T_base_camera, of the (reference) camera: one a time, not finite where it is not known.
  std::vector<Pose> T_base_camera;
  std::vector<std::filesystem::path> inputs;  ///< files that were read
};

/// Throws as read_stored_run(); bad_request naming `option` for a source that is no folder.
[[nodiscard]] RecordedRun read_recorded_run(const std::filesystem::path& source,
                                            std::string_view option);

}  // namespace kinescope
