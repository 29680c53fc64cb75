// SPDX-License-Identifier: Apache-2.0
//
// The shortest way through the library: calibrate RECORDING > robot.urdf
// kinescope run does more: intrinsics from the motion, effects that the model lacks, a report.
#include <cstdio>
#include <exception>
#include <optional>

#include <fmt/format.h>

#include "app/explain/pipeline.h"
#include "calib/tracks/pose_tracks_from_tags.h"
#include "kinematics/urdf/urdf.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: calibrate RECORDING > robot.urdf\n");
    return 2;
  }
  try {
    using namespace kinescope;
    RecordingPaths paths;
    paths.folder = argv[1];
    const Recording recording = read_recording(paths);
    const SightOptions options;
    const Observed observed = observe(recording, options, recording.camera, std::nullopt, {});
    const CameraModel camera = choose_camera(recording, observed.tags);
    const PoseTracks tracks = pose_tracks_from_tags(observed.tags, camera, recording.markers);
    const Structure structure = find_robot(recording, tracks, options.calibrate);
    require_determined(structure);
    const Calibration calibration =
        calibrate(observed.measurements, recording.markers, recording.log,
                  start_from_structure(structure, recording, camera), options.calibrate);
    for (const Joint& joint : calibration.tree.joints) {
      fmt::print(stderr, "{}: {}, driven by {}\n", joint.name, to_string(joint.type),
                 joint.channel.empty() ? "no channel" : joint.channel);
    }
    fmt::print("{}", write_urdf(calibration.tree));
    return calibration.status == CalibrationStatus::kConverged ? 0 : 4;
  } catch (const std::exception& error) {
    fmt::print(stderr, "calibrate: {}\n", error.what());
    return 1;
  }
}
