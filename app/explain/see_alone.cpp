// SPDX-License-Identifier: Apache-2.0
#include "app/explain/see_alone.h"

namespace kinescope {

SeenAlone see_alone(const Recording& recording, const SightOptions& options,
                    const std::optional<TagObservations>& cached, const Progress& progress) {
  SeenAlone out;
  out.observed = observe(recording, options, recording.camera, cached, progress);
  out.camera = choose_camera(recording, out.observed.tags);
  if (recording.camera || recording.nominal || out.observed.tags.observations.empty()) return out;
  const auto find_camera = [&] {
    return camera_from_motion(recording, out.observed, out.camera, options.calibrate);
  };
  std::optional<CameraModel> found = find_camera();
  if (found && recording.entry == RecordingEntry::kVideo && !out.observed.tags.lens_known) {
    const Progress again = [&](std::string_view, int done, int total) {
      report_progress(progress, "markers with this lens", done, total);
    };
    out.observed = observe(recording, options, found, std::nullopt, again);
    out.camera = choose_camera(recording, out.observed.tags);
    found = find_camera();
  }
  if (found) out.camera = *found;
  return out;
}

}  // namespace kinescope
