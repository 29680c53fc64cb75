// SPDX-License-Identifier: Apache-2.0
//
// Takes   a recording and what to free.
// Gives   Outcome: what `kinescope run` left in its folder, in the figures that the sets are judged
// by.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/commands/commands.h"

namespace kinescope::real {

struct FoundJoint {
  std::string type;
  std::string parent;
  std::string child;
  std::string channel;  ///< empty: none
  double scale = 0.0;   ///< rad or m per unit of the channel, as first found
};

/// Root mean square of the lengths of the errors at the marker.
struct Length {
  double mm = 0.0;
  double deg = 0.0;  ///< 0 for points
};

struct Errors {
  Length before;        ///< the nominal robot, placed only; or the structure
  Length fit;           ///< of the model made of all sightings
  Length held_out;      ///< folds that the model has not seen
  Length held_out_all;  ///< the same, outliers counted in; poses and points only
  Length held_out_median;
  double held_out_px = 0.0;  ///< corners only
  int sightings = 0;
  int rejected = 0;  ///< outliers, left out of all figures but one
};

struct Outcome {
  ExitCode code = ExitCode::kInternalError;
  std::string message;       ///< the error's line, where there was one
  std::string status;        ///< of the structure; empty with a nominal robot
  double probability = 0.0;  ///< of the structure
  std::vector<FoundJoint>
      joints;  ///< of the structure, or of the nominal robot; parents before children
  std::vector<std::vector<int>> links;  ///< tags of each link of the structure, the camera's first
  std::vector<int> free_tags;
  std::vector<std::string> doubts;
  bool calibrated = false;
  Errors errors;
  nlohmann::json result;  ///< result.json; null where the run did not get so far
  nlohmann::json trace;   ///< trace.json; null where nothing was traced
  double seconds = 0.0;

  /// "revolute revolute", from the base outwards.
  [[nodiscard]] std::string types() const;
  /// "joint_1 joint_2", the channels in the same order.
  [[nodiscard]] std::string order() const;
};

/// Runs the whole pipeline into `output`; an error ends up in the outcome.
[[nodiscard]] Outcome run_recording(const RecordingPaths& paths,
                                    const std::filesystem::path& output,
                                    const CalibrateOptions& options = {}, bool trace = true);

/// A folder below the system's temporary one that is gone when this is.
class ScratchFolder {
 public:
  explicit ScratchFolder(const std::string& name);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace kinescope::real
