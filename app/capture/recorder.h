// SPDX-License-Identifier: Apache-2.0
//
// Takes   frames and joint values as they come.
// Gives   a recording's folder that is whole at every moment: images with their times.csv,
//         joints.csv, tags.yaml and, where it is given, camera.yaml.
// Method  an image is listed when it is written, and each line is written in one piece; a process
//         that is killed leaves one image that is not listed, which readers pass over.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "app/capture/joint_feed.h"
#include "calib/camera/marker_set.h"

namespace kinescope {

/// A file to which whole lines are added.
class LineFile {
 public:
  explicit LineFile(const std::filesystem::path& path);
  ~LineFile();
  LineFile(const LineFile&) = delete;
  LineFile& operator=(const LineFile&) = delete;
  /// All of it or nothing. Throws bad_request where it cannot be written.
  void add(const std::string& lines);

 private:
  std::filesystem::path path_;
  int file_ = -1;
  std::int64_t size_ = 0;
};

/// What makes the folder a recording.
struct RecordingHead {
  MarkerSet markers;
  std::optional<std::filesystem::path> tags;    ///< in place of `markers`
  std::optional<std::filesystem::path> camera;  ///< to be copied
};

/// Throws bad_request: it holds a recording already (unless `force`), another form of one, or it
/// cannot be written. Changes nothing but making the folder.
void require_room_for_recording(const std::filesystem::path& folder, bool force);

class Recorder {
 public:
  /// Removes the recording that is there. Throws bad_request where the folder cannot be written.
  Recorder(std::filesystem::path folder, const RecordingHead& head);
  /// `time_s` since the recording's begin. Throws bad_request where it cannot be written (a full
  /// disk); what was written before stays.
  void add_frame(double time_s, std::span<const std::uint8_t> jpeg);
  void add_joints(const std::vector<std::string>& channels, std::span<const JointRow> rows,
                  double begin_s);
  /// Another family was found than the one that was declared.
  void set_family(const MarkerSet& markers) const;
  [[nodiscard]] int frames() const { return frames_; }
  [[nodiscard]] double last_s() const { return last_s_; }

 private:
  std::filesystem::path folder_;
  std::optional<LineFile> times_;
  std::optional<LineFile> joints_;
  int frames_ = 0;
  double last_s_ = 0.0;
};

}  // namespace kinescope
