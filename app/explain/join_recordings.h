// SPDX-License-Identifier: Apache-2.0
//
// Takes   several recordings of one robot, read.
// Gives   one Recording that stands for all of them: what they declare, their logs one after the
//         other.
// Not here: what they show (see_recordings.h).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "app/io/recording.h"
#include "app/io/shard.h"

namespace kinescope {

/// The names of the recordings in `paths.folder` and the `further` folders, in their order: that of
/// the folder, where two are alike with the folder above it. Nothing is read. Throws bad_request
/// where two have one name.
[[nodiscard]] std::vector<std::string> recording_names(
    const RecordingPaths& paths, const std::vector<std::filesystem::path>& further);

/// The recording at `paths`; with those in `further` folders all, by name (recording_names()), or
/// of them those of a shard. Each of several has its name as `camera_name`.
/// Throws what reading throws, and bad_request or bad_input, in one line, where they cannot be
/// combined: one recording twice, files named that are of one recording, several cameras, a
/// flange.csv, no joints.csv, points held in targets, different entries, channels, units, markers
/// or nominal robots.
[[nodiscard]] std::vector<Recording> read_recordings(
    const RecordingPaths& paths, const std::vector<std::filesystem::path>& further,
    const Shard& shard = {});

/// All as one, before they were looked at: names, files, markers, nominal robot; the log is the
/// first's. Of one recording, that.
[[nodiscard]] Recording described_together(const std::vector<Recording>& recordings);

/// The log of all, each one's stamps moved by its start, s.
[[nodiscard]] JointLog logs_together(const std::vector<Recording>& recordings,
                                     const std::vector<double>& starts_s);

}  // namespace kinescope
