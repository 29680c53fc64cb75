// SPDX-License-Identifier: Apache-2.0
//
// The run folder: products under their names, each whole or not there; detection is not done twice.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "app/report/run_summary.h"
#include "calib/camera/tag_observations.h"

namespace kinescope {

class RunFolder {
 public:
  /// Makes the folder and proves that it can be written. Throws bad_request.
  RunFolder(const RunOptions& options, const Recording& recording);

  [[nodiscard]] std::filesystem::path file(std::string_view name) const { return folder_ / name; }
  void write(std::string_view name, std::string_view content) const;

  /// The observations of an earlier run with the same video, tags and detection options.
  [[nodiscard]] std::optional<TagObservations> cached_observations(
      const Recording& recording) const;
  void keep_observations(const Recording& recording, const TagObservations& observations) const;

 private:
  [[nodiscard]] std::string detection_key(const Recording& recording) const;

  std::filesystem::path folder_;
  DetectOptions detect_;
  bool force_ = false;
};

[[nodiscard]] std::string program_version();
/// Every file that was read, with its SHA-256.
[[nodiscard]] std::vector<InputFile> hash_inputs(const Recording& recording);
[[nodiscard]] std::vector<std::pair<std::string, std::string>> list_options(
    const RunOptions& options);
/// run.json: inputs' hashes, options, version, times.
[[nodiscard]] nlohmann::json run_json(const RunSummary& run);

}  // namespace kinescope
