// SPDX-License-Identifier: Apache-2.0
//
// Takes   a recording, or a torque log.
// Gives   Inspection, TorqueLogFacts: what it holds and what is wrong with it, from a quick look:
//         about 20 frames searched for markers, all samples of the log.
// Not here: anything that takes longer than a few seconds; structure, calibration.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "app/io/recording.h"
#include "calib/vision/video.h"
#include "kinematics/core/progress.h"

namespace kinescope {

/// Something worth saying; a problem when `run` could not work with it.
struct Finding {
  bool problem = false;
  std::string text;
};

/// One marker over the frames that were searched.
struct MarkerFacts {
  TagId id;
  double size_m = 0.0;    ///< declared; 0: none
  int frames = 0;         ///< in which it was seen
  double edge_px = 0.0;   ///< median length of an edge
  double contrast = 0.0;  ///< median step of grey values across the border, of 255
  double blur_px = 0.0;   ///< median sigma of that step
};

struct VideoFacts {
  VideoInfo info;
  int frames_decoded = 0;
  bool decoded_to_end = false;  ///< false: only the beginning was looked at
  std::vector<double> times_s;  ///< of the decoded frames, on the log's clock
  double frame_rate_hz = 0.0;   ///< from the median step
  double longest_step_s = 0.0;
  int frames_searched = 0;
  std::vector<MarkerFacts> markers;  ///< by id
};

struct ChannelFacts {
  std::string name;
  std::string unit;  ///< declared, or "rad or m"; "ticks?", "deg or mm?" where the values look so
  double lower = 0.0;
  double upper = 0.0;
  bool moves = true;
};

struct LogFacts {
  int samples = 0;
  double first_s = 0.0;
  double last_s = 0.0;
  double rate_hz = 0.0;   ///< from the mean step, gaps left out
  double jitter_s = 0.0;  ///< mean deviation of a step from the mean step
  double longest_gap_s = 0.0;
  double longest_gap_at_s = 0.0;
  std::vector<ChannelFacts> channels;
};

struct Inspection {
  Recording recording;
  std::optional<VideoFacts> video;
  std::optional<LogFacts> log;
  std::vector<Finding> findings;
  /// Of several cameras, each one's own; `video` is empty then. Their findings are in the whole's.
  std::vector<Inspection> cameras = {};

  [[nodiscard]] bool ready() const;
};

/// Throws bad_request when the paths contradict each other; a bad recording is findings.
[[nodiscard]] Inspection inspect_recording(const RecordingPaths& paths,
                                           const Progress& progress = {});

/// The log alone; its findings are added.
[[nodiscard]] LogFacts look_at_log(const JointLog& log, const RecordingSettings& settings,
                                   std::vector<Finding>& findings);
/// Decodes at most the first 900 frames. Throws bad_input for a video that cannot be read.
[[nodiscard]] VideoFacts look_at_video(const Recording& recording, const Progress& progress,
                                       std::vector<Finding>& findings);

/// One signal of one joint; an empty column: not logged.
struct SignalFacts {
  std::string column;
  std::string unit;  ///< that of the range, after conversion to SI
  double lower = 0.0;
  double upper = 0.0;
};

struct TorqueJointFacts {
  std::string name;
  SignalFacts position, velocity, acceleration, torque;
};

/// What `kinescope dynamics` would take from a log.
struct TorqueLogFacts {
  std::string log;
  int rows = 0;
  int rows_used = 0;  ///< after the checks
  int trajectories = 0;
  double duration_s = 0.0;  ///< of all trajectories
  double rate_hz = 0.0;     ///< from the median step
  std::vector<TorqueJointFacts> joints;
  std::vector<Finding> findings;

  [[nodiscard]] bool ready() const;
};

/// A file that is no recording's folder, with the robot where one is named. Throws bad_request for
/// columns or units that were asked for and cannot be; a bad log is findings.
[[nodiscard]] TorqueLogFacts look_at_torques(const InspectOptions& options);
void print_torque_log(const TorqueLogFacts& facts);
[[nodiscard]] nlohmann::json torque_log_json(const TorqueLogFacts& facts);

}  // namespace kinescope
