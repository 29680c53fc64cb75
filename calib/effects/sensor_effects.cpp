// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "calib/effects/camera_effects.h"
#include "calib/effects/elsewhere.h"

namespace kinescope::effects {
namespace {

// Where intrinsics sit.
constexpr const char* kFocalLength = "camera focal length";
constexpr const char* kCentre = "camera centre";

CameraEffect time_offset() {
  CameraEffect out =
      effect("time_offset", "clock", "the joint log's clock and the camera's do not agree",
             {{"offset", "s"}}, "s");
  out.candidate.signed_words = {"the joint log's clock is ahead of the camera's",
                                "the joint log's clock is behind the camera's"};
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
  out.candidate.signed_words = {"the joint log's clock runs faster than the camera's",
                                "the joint log's clock runs slower than the camera's"};
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

// Corrections of intrinsic parameters, one a parameter of the effect.
CameraEffect of_intrinsics(std::string name, std::string place, std::string words,
                           std::vector<EffectParameter> parameters, std::string unit,
                           const std::vector<int>& intrinsics) {
  CameraEffect out = effect(std::move(name), std::move(place), std::move(words),
                            std::move(parameters), std::move(unit));
  out.candidate.check = "calibrate the camera again (kinescope camera), at the focus it is used at";
  out.candidate.record = "let the markers pass near the image's corners";
  out.corrections = [like = out, intrinsics](double) {
    std::vector<Correction> corrections;
    for (std::size_t i = 0; i < intrinsics.size(); ++i)
      corrections.push_back(correct(CorrectedPart::kIntrinsic, like, i, intrinsics[i]));
    return corrections;
  };
  return out;
}

// The first of the two coefficients is the size that people know (k1, p1).
CameraEffect lens(std::string place, std::string words, std::vector<EffectParameter> coefficients,
                  const std::vector<int>& intrinsics) {
  CameraEffect out = of_intrinsics("lens_distortion", std::move(place), std::move(words),
                                   std::move(coefficients), "", intrinsics);
  out.candidate.size_weights[1] = 0.0;
  return out;
}

CameraEffect focal_length() {
  CameraEffect out = effect("intrinsics", kFocalLength,
                            "the focal length is not the declared one (another zoom or focus)",
                            {{"relative change", ""}}, "");
  out.candidate.check =
      "calibrate the camera again (kinescope camera), at the zoom and focus it is used at; switch "
      "autofocus off";
  out.candidate.record = "bring the markers nearer to the camera and farther away, and tilt them";
  out.corrections = [like = out](double) {
    return std::vector{correct(CorrectedPart::kFocalLength, like, 0)};
  };
  return out;
}

std::vector<CameraEffect> of_camera(const CameraModel& camera) {
  std::vector<CameraEffect> out;
  out.push_back(lens("camera", "the lens bends more (or less) than declared",
                     {{"k1", ""}, {"k2", ""}}, {4, 5}));
  if (camera.model != DistortionModel::kEquidistant) {
    out.push_back(lens("camera tangential", "the lens is tilted against the sensor",
                       {{"p1", ""}, {"p2", ""}}, {6, 7}));
  }
  out.push_back(focal_length());
  out.push_back(of_intrinsics(
      "intrinsics", kCentre, "the image's centre is not the declared one (a cropped image)",
      {{"cx", "px"}, {"cy", "px"}}, "px", {kFirstOfCentre, kFirstOfCentre + 1}));
  CameraEffect aspect = of_intrinsics("intrinsics", "camera aspect",
                                      "the image is stretched one way", {{"fy", "px"}}, "px", {1});
  aspect.candidate.check = "how the video was scaled: pixels that are not square";
  out.push_back(std::move(aspect));
  return out;
}

// Overexposed paper, ink that runs: by as many pixels at every distance.
CameraEffect blooming() {
  CameraEffect out = effect("blooming", "camera",
                            "white shines into black (or ink runs): the edges of all markers are "
                            "not where they are printed",
                            {{"shift of edges", "px"}}, "px");
  out.candidate.floor = kUsualShift;
  out.candidate.check = "exposure: white paper must not be overexposed; toner or ink that runs";
  out.candidate.record = "bring the markers nearer to the camera and farther away";
  out.corrections = [like = out](double) {
    return std::vector{correct(CorrectedPart::kBloom, like, 0)};
  };
  return out;
}

CameraEffect tag_size(const EffectWorld& world, int marker) {
  const std::string name = marker_name(world, marker);
  CameraEffect out = effect("tag_size", name, fmt::format("{} is not as large as declared", name),
                            {{"relative size", ""}}, "");
  out.candidate.signed_words = {name + " is larger than declared",
                                name + " is smaller than declared"};
  out.candidate.check = "measure the black square's edge; printers scale";
  out.candidate.record = "bring the marker nearer to the camera and farther away";
  // One view, for ever: what it says of the size is the errors of its corners.
  if (rests(world, marker)) out.candidate.floor = std::numeric_limits<double>::infinity();
  out.corrections = [like = out, marker](double) {
    return std::vector{correct(CorrectedPart::kMarkerSize, like, 0, marker)};
  };
  return out;
}

// Seen from before, a sheet that is bent across one direction is shorter along that: smaller, and
// no longer square, by the square of the bend.
std::vector<Correction> foreshortening(int marker, const std::string& name) {
  constexpr double kMost = 0.02;  // of its size: bent by 5 % of it
  std::vector<Correction> out;
  for (const auto& [part, what] : {std::pair{CorrectedPart::kMarkerSize, "shortened"},
                                   std::pair{CorrectedPart::kMarkerShear, "sheared"}}) {
    Correction& one = out.emplace_back();
    one.name = fmt::format("{} {}", name, what);
    one.part = part;
    one.index = marker;
    one.is_nuisance = true;
    one.prior_sigma = kMost;
  }
  return out;
}

// A sheet of paper that does not lie flat.
CameraEffect bent_tag(const EffectWorld& world, int marker) {
  const std::string name = marker_name(world, marker);
  CameraEffect out = effect("bent_tag", name, fmt::format("{} is not flat (or not square)", name),
                            {{"out of plane", "m"}, {"width over height", ""}}, "m");
  const double half = 0.5 * world.tree.markers[static_cast<std::size_t>(marker)].size_m;
  // Any of these bends the images of markers.
  out.candidate.refines = {{"tag_size", name}};
  for (std::size_t c = 0; c < world.cameras.size(); ++c) {
    for (const EffectId& id : {EffectId{"blooming", "camera"},
                               {"lens_distortion", "camera"},
                               {"lens_distortion", "camera tangential"},
                               {"intrinsics", kFocalLength},
                               {"intrinsics", kCentre}})
      out.candidate.refines.push_back({id.effect, place_at(world, c, id.place)});
  }
  out.candidate.floor = kUsualShift;
  out.candidate.size = [half](const Eigen::VectorXd& shape) {
    return std::hypot(shape[0], half * shape[1]);
  };
  out.candidate.possible = [half](const Eigen::VectorXd& shape) {
    constexpr double kMostOfSize = 0.5;
    return std::abs(shape[0]) < kMostOfSize * half && std::abs(shape[1]) < kMostOfSize;
  };
  out.candidate.check = "glue the marker on something flat; a printer that stretches one way";
  out.candidate.record = "show the marker from several sides, tilted";
  if (rests(world, marker)) out.candidate.floor = std::numeric_limits<double>::infinity();
  out.corrections = [like = out, marker](double) {
    return std::vector{correct(CorrectedPart::kMarkerWarp, like, 0, marker),
                       correct(CorrectedPart::kMarkerWidth, like, 1, marker)};
  };
  out.nuisances = [marker, name](double) { return foreshortening(marker, name); };
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
  out.candidate.signed_words = {"all markers are larger than declared",
                                "all markers are smaller than declared"};
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
    const bool motion_known = corners && !world.is_carried;
    for (std::size_t c = 0; motion_known && c < world.cameras.size(); ++c)
      out.push_back(at_camera(world, c, rolling_shutter()));
  }
  if (corners) {
    for (std::size_t c = 0; c < world.cameras.size(); ++c) {
      for (CameraEffect& effect : of_camera(world.cameras[c].model))
        out.push_back(at_camera(world, c, std::move(effect)));
      out.push_back(at_camera(world, c, blooming()));
    }
    for (const int marker : world.seen) out.push_back(tag_size(world, marker));
    for (const int marker : world.seen) out.push_back(bent_tag(world, marker));
    if (may_be_misprinted(world)) out.push_back(all_tag_sizes());
  }
  return out;
}

}  // namespace kinescope::effects
