// SPDX-License-Identifier: Apache-2.0
//
// The run folder: products under their names, each whole or not there; detection is not done twice.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "app/commands/kept_observations.h"
#include "app/explain/pipeline.h"
#include "app/io/output_folder.h"
#include "app/report/run_summary.h"
#include "calib/camera/tag_observations.h"

namespace kinescope {

inline constexpr std::string_view kRunFile = "run.json";

class RunFolder : public OutputFolder {
 public:
  /// Throws bad_request where the folder is not this run's to write into: one with the recording's
  /// files, or with those of others, or, without force, with the run of another recording.
  RunFolder(const RunOptions& options, const Recording& recording);

  /// The observations of an earlier run with the same video, tags and detection options. Of several
  /// cameras one after the other, as of_camera() gives them.
  [[nodiscard]] std::optional<TagObservations> cached_observations(
      const Recording& recording) const;
  void keep_observations(const Recording& recording, const TagObservations& observations);
  /// A robot of an earlier run, unless that run's result.json says that it is no answer.
  [[nodiscard]] bool holds_answer() const;

  void write(std::string_view name, std::string_view content);
  /// run.json is written last: without it, what a full disk or a kill leaves is no run.
  void begin_products() const;
  /// Products that are written elsewhere.
  void add_products(const std::vector<std::string>& names);
  [[nodiscard]] const std::set<std::string>& products() const { return products_; }
  /// What an earlier run wrote here and this one did not: it would tell of another robot.
  void remove_stale_products() const;

 private:
  DetectOptions detect_;
  bool force_ = false;
  std::set<std::string> products_;  // of this run
};

[[nodiscard]] std::vector<std::pair<std::string, std::string>> list_options(
    const RunOptions& options);
/// What every run says of its input: names, files, options, frames, markers, warnings of reading.
void describe_input(const Recording& recording, const Observed& observed, const RunOptions& options,
                    RunSummary& run);
/// What is needed to run again.
struct RunAgain {
  std::vector<std::string> arguments;
  std::filesystem::path working_folder;
};

/// Throws bad_input where the recording is not the one that run.json speaks of, and names the file
/// that is another one.
void require_same_inputs(const std::filesystem::path& run_folder, const Recording& recording);

/// From run.json. Throws bad_input where there is none or it does not say.
[[nodiscard]] RunAgain read_run_again(const std::filesystem::path& folder);
/// Relative paths as seen from another folder.
void resolve_paths(RecordingPaths& paths, const std::filesystem::path& from);

/// run.json: inputs' hashes, options, version, times, names of the products.
[[nodiscard]] nlohmann::json run_json(const RunSummary& run, const std::set<std::string>& products);

}  // namespace kinescope
