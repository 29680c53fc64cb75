// SPDX-License-Identifier: Apache-2.0
//
// The stages of `run` between the rooms: each takes the products before it and gives the next.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/explain/sight_options.h"
#include "app/io/recording.h"
#include "app/report/run_summary.h"
#include "calib/bundle/calibrate.h"
#include "calib/bundle/check_nominal.h"
#include "kinematics/core/error.h"
#include "kinematics/structure/structure.h"

namespace kinescope {

/// A marker of one of several recordings that sits elsewhere than in the others, and is taken as
/// another one.
struct StuckAnew {
  TagId id;       ///< as its picture says
  TagId renamed;  ///< in everything that is estimated and written
};

/// One of several cameras: what it saw by its own frames, and where it stands.
struct ObservedCamera {
  std::string name;
  CameraModel model;
  bool estimate_intrinsics = false;
  TagObservations tags;                          ///< on its own clock
  std::optional<TagObservations> detected = {};  ///< as in Observed
  Pose T_reference_camera;
  double ahead_s = 0.0;  ///< time of the common frames = own time + ahead
  /// Of a recording of its own: time of the common log = its log's time + this.
  std::optional<double> log_ahead_s = {};
  std::vector<StuckAnew> anew = {};
};

/// What the recording shows, whichever way it enters, and how it was seen.
struct Observed {
  Measurements measurements;
  TagObservations tags;  ///< empty unless the recording enters by video or corners
  /// Of a film so long that frames were left out: `tags` with all of them.
  std::optional<TagObservations> detected = {};
  std::vector<std::string> warnings;
  /// Of several: those that are used, the reference camera first, as `measurements` numbers them.
  std::vector<ObservedCamera> cameras = {};
};

/// Of an Observed or an ObservedCamera: all frames.
[[nodiscard]] const TagObservations& all_tags(const auto& seen) {
  return seen.detected ? *seen.detected : seen.tags;
}

/// s, of all frames, also of those that were left out.
[[nodiscard]] inline const std::vector<double>& frame_times(const Observed& observed) {
  return observed.detected ? observed.detected->times_s : observed.measurements.times_s;
}

/// No marker of the declared family in any frame: what observe() throws then.
class NothingSeen : public Error {
 public:
  explicit NothingSeen(const Error& error) : Error(error) {}
};

/// Detects the markers of the video, its lens known or not (or takes them from `cached`), or reads
/// corners, poses or points. Throws bad_input when there is no marker, or none with a size; when
/// video and log do not overlap in time.
[[nodiscard]] Observed observe(const Recording& recording, const SightOptions& options,
                               const std::optional<CameraModel>& lens,
                               const std::optional<TagObservations>& cached,
                               const Progress& progress);

/// Of a film so long that neighbouring frames say nearly the same, one frame in k is measured by;
/// of postures all of them.
void leave_out_neighbours(const Recording& recording, int k, Observed& observed);

/// The declared camera, checked against the image size, or what the markers' shapes say of it.
[[nodiscard]] CameraModel choose_camera(const Recording& recording, const TagObservations& tags);

/// What a first calibration, on the structure that `camera` shows, says of the camera: lens and
/// planar poses that are right to a per cent would pass for motion in the search for the structure.
/// Nothing where that leads nowhere.
[[nodiscard]] std::optional<CameraModel> camera_from_motion(const Recording& recording,
                                                            const Observed& observed,
                                                            const CameraModel& camera,
                                                            CalibrateOptions options);

/// What to look at where the markers do not move as any robot does: files that the recording has.
[[nodiscard]] std::string model_remedy(RecordingEntry entry, bool camera_declared);

/// The structure, with the clocks' offset scanned for unless they are trusted to agree. Throws
/// bad_request for points, which show no structure, and what declared.h throws. `allowance`: as in
/// StructureOptions.
[[nodiscard]] Structure find_robot(const Recording& recording, const PoseTracks& tracks,
                                   const CalibrateOptions& options,
                                   std::optional<double> allowance = {});

/// A structure that was found already, as find_robot() gives it.
[[nodiscard]] Structure as_robot(const Recording& recording, Structure structure);

/// The cameras beside the reference camera, where that stands as the start says; joint values by
/// frame (at_common_instants()) for the frames of all cameras. One camera: nothing changes.
void add_further_cameras(const Observed& observed, CalibrationStart& start);

/// Channels that the structure left in a unit of their own and the calibration finds in a usual
/// one: the start has them in that. False where there are none.
bool take_usual_units(const KinematicTree& calibrated, CalibrationStart& start);

/// A start from the found structure: units of the channels recognised, the base frame placed on the
/// first tag at rest (its normal up; without one at the camera, upright), or level when gravity is
/// declared.
[[nodiscard]] CalibrationStart start_from_structure(const Structure& structure,
                                                    const Recording& recording,
                                                    const CameraModel& camera);

/// A start from a nominal robot: channels matched by name (or by order, with a warning), markers
/// placed, axes and channels that are grossly wrong mended. `warnings` receives what was assumed.
[[nodiscard]] CheckedNominal start_from_nominal(const Recording& recording,
                                                const Observed& observed, const PoseTracks& tracks,
                                                const CameraModel& camera,
                                                std::vector<std::string>& warnings);

/// Throws undetermined with the first doubt's words and remedy when the structure is not
/// determined.
void require_determined(const Structure& structure);

/// Counts and sizes of what was seen of each marker.
[[nodiscard]] std::vector<MarkerSummary> summarise_markers(const Observed& observed,
                                                           const MarkerSet& markers);

}  // namespace kinescope
