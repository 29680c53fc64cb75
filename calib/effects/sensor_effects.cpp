// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "calib/effects/camera_effects.h"
#include "calib/effects/elsewhere.h"

namespace kinescope::effects {
namespace {

CameraEffect time_offset() {
  CameraEffect out =
      effect("time_offset", "clock", "the joint log's clock and the camera's do not agree",
             {{"offset", "s"}}, "s");
  out.candidate.check = "latency of the camera driver, time stamps at arrival instead of exposure";
  out.candidate.record = "move faster, and at changing speed";
  out.is_time_offset = true;
  out.corrections = [like = out](double) {
    return std::vector{correct(CorrectedPart::kClock, like, 0)};
  };
  return out;
}

CameraEffect clock_drift(const EffectWorld& world) {
  CameraEffect out = effect("clock_drift", "clock", "one of the clocks runs faster than the other",
                            {{"drift", "s/s"}}, "s/s");
  out.candidate.check = "frame rate that the container declares, clock of the robot's controller";
  out.candidate.record = "a longer recording, with motion at its beginning and end";
  const Eigen::VectorXd time = frame_times(world);
  out.corrections = [like = out, time](double) {
    Correction drift = correct(CorrectedPart::kClock, like, 0);
    drift.share = time.array() - time.mean();
    drift.reference = time.mean();
    return std::vector{drift};
  };
  return out;
}

CameraEffect rolling_shutter() {
  CameraEffect out = effect("rolling_shutter", "camera", "the camera reads its rows one by one",
                            {{"line delay", "s"}}, "s");
  out.candidate.check = "the sensor's data sheet: rolling shutter, time of a line";
  out.candidate.record = "move faster, with markers high and low in the image";
  out.corrections = [like = out](double) {
    return std::vector{correct(CorrectedPart::kReadout, like, 0)};
  };
  return out;
}

CameraEffect lens(std::string place, std::string words, const std::vector<int>& intrinsics,
                  std::vector<EffectParameter> parameters, std::string unit) {
  CameraEffect out = effect("lens_distortion", std::move(place), std::move(words),
                            std::move(parameters), std::move(unit));
  // The first parameter is the size that people know (k1, p1, fx).
  out.candidate.size_weights.tail(out.candidate.size_weights.size() - 1).setZero();
  out.candidate.check = "calibrate the camera again (kinescope camera), at the focus it is used at";
  out.candidate.record = "let the markers pass near the image's corners";
  out.corrections = [like = out, intrinsics](double) {
    std::vector<Correction> corrections;
    for (std::size_t i = 0; i < intrinsics.size(); ++i) {
      corrections.push_back(correct(CorrectedPart::kIntrinsic, like, i, intrinsics[i]));
    }
    return corrections;
  };
  return out;
}

std::vector<CameraEffect> lenses(const CameraModel& camera) {
  std::vector<CameraEffect> out;
  out.push_back(lens("camera", "the lens bends more (or less) than declared", {4, 5},
                     {{"k1", ""}, {"k2", ""}}, ""));
  if (camera.model != DistortionModel::kEquidistant) {
    out.push_back(lens("camera tangential", "the lens is tilted against the sensor", {6, 7},
                       {{"p1", ""}, {"p2", ""}}, ""));
  }
  out.push_back(lens("camera pinhole", "focal length or image centre differ from those declared",
                     {0, 1, 2, 3}, {{"fx", "px"}, {"fy", "px"}, {"cx", "px"}, {"cy", "px"}}, "px"));
  return out;
}

CameraEffect tag_size(const EffectWorld& world, int marker) {
  const std::string name = marker_name(world, marker);
  CameraEffect out = effect("tag_size", name, fmt::format("{} is not as large as declared", name),
                            {{"relative size", ""}}, "");
  out.candidate.check = "measure the black square's edge; printers scale";
  out.candidate.record = "bring the marker nearer to the camera and farther away";
  // One view, for ever: what it says of the size is the errors of its corners.
  if (rests(world, marker)) out.candidate.floor = std::numeric_limits<double>::infinity();
  out.corrections = [like = out, marker](double) {
    return std::vector{correct(CorrectedPart::kMarkerSize, like, 0, marker)};
  };
  return out;
}

// A page printed too large shows against lengths that the robot knows: its slides' encoders, or a
// nominal model's. Beside a single slide it says what that encoder's scale says.
bool may_be_misprinted(const EffectWorld& world) {
  const auto slides = std::ranges::count_if(world.driven, [&](int joint) {
    return world.tree.joints[static_cast<std::size_t>(joint)].type == JointType::kPrismatic;
  });
  const auto moving =
      std::ranges::count_if(world.seen, [&](int marker) { return !rests(world, marker); });
  return slides != 1 && moving > 1;
}

CameraEffect all_tag_sizes() {
  CameraEffect out = effect("tag_size", "tags", "all markers are larger (or smaller) than declared",
                            {{"relative size", ""}}, "");
  out.candidate.check =
      "measure a black square's edge: printers scale a page. Were the markers right, the scale of "
      "every slide (of the nominal model) would be wrong";
  out.candidate.record =
      "measure a black square's edge: without a known length no recording says it";
  out.corrections = [like = out](double) {
    return std::vector{correct(CorrectedPart::kMarkerSize, like, 0)};
  };
  return out;
}

}  // namespace

std::vector<CameraEffect> camera_effects(const EffectWorld& world) {
  std::vector<CameraEffect> out;
  const bool corners = world.kind == MeasurementKind::kCorners;
  if (!world.postures) {
    if (world.clock_free) out.push_back(time_offset());
    out.push_back(clock_drift(world));
    if (corners) out.push_back(rolling_shutter());
  }
  if (corners) {
    for (CameraEffect& lens : lenses(world.camera)) out.push_back(std::move(lens));
    for (const int marker : world.seen) out.push_back(tag_size(world, marker));
    if (may_be_misprinted(world)) out.push_back(all_tag_sizes());
  }
  return out;
}

}  // namespace kinescope::effects
