// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "calib/effects/camera_effects.h"

namespace kinescope::effects {
namespace {

// Slips and bumps leave no trace too near to the ends.
constexpr double kFewestBefore = 0.06;  // of the recording
constexpr int kMostTimes = 120;

CameraEffect effect(std::string name, std::string place, std::string words,
                    std::vector<EffectParameter> parameters, std::string size_unit) {
  CameraEffect out;
  Candidate& c = out.candidate;
  c.id = {std::move(name), std::move(place)};
  c.words = std::move(words);
  c.size_weights = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(parameters.size()));
  c.parameters = std::move(parameters);
  c.size_unit = std::move(size_unit);
  return out;
}

Correction correct(CorrectedPart part, const CameraEffect& effect, std::size_t parameter,
                   int index = kEverywhere) {
  Correction out;
  out.block = effect.candidate.id.place;
  out.name = out.block + " " + effect.candidate.id.effect + " " +
             effect.candidate.parameters[parameter].name;
  out.unit = effect.candidate.parameters[parameter].unit;
  out.part = part;
  out.index = index;
  return out;
}

Eigen::VectorXd frame_times(const EffectWorld& world) {
  return Eigen::Map<const Eigen::VectorXd>(world.frames.times_s.data(),
                                           static_cast<Eigen::Index>(world.frames.times_s.size()));
}

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

std::string marker_name(const EffectWorld& world, int marker) {
  return fmt::format("tag_{}", world.tree.markers[static_cast<std::size_t>(marker)].id.value);
}

bool rests(const EffectWorld& world, int marker) {
  return world.tree.path_to(world.tree.markers[static_cast<std::size_t>(marker)].link).empty();
}

// A marker at rest repeats its corners' errors in every frame, until a bump gives it others.
constexpr double kRestingBias = 0.05;  // px

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

const std::vector<EffectParameter> kTwist{{"turn x", "rad"}, {"turn y", "rad"}, {"turn z", "rad"},
                                          {"shift x", "m"},  {"shift y", "m"},  {"shift z", "m"}};

// A twist of a part from a time on.
void happens_at_a_time(const EffectWorld& world, CorrectedPart part, int index, CameraEffect& out) {
  Candidate& c = out.candidate;
  const double length = world.last_s - world.first_s;
  const double begin = world.first_s + kFewestBefore * length;
  const double end = world.last_s - kFewestBefore * length;
  const auto count = std::min<std::size_t>(kMostTimes, world.frames.times_s.size());
  for (std::size_t k = 0; k < count; ++k) {
    c.scan.push_back(begin + (end - begin) * static_cast<double>(k) /
                                 static_cast<double>(std::max<std::size_t>(1, count - 1)));
  }
  // A step between two frames: any time between them says the same.
  c.scan_step =
      length / static_cast<double>(std::max<std::size_t>(1, world.frames.times_s.size() - 1));
  c.scan_name = "at";
  c.scan_unit = "s";
  if (world.postures) {
    // Their stamps may be any numbers.
    c.scan_words = [times_s = world.frames.times_s](double at_s) {
      const auto first = std::ranges::lower_bound(times_s, at_s);
      return fmt::format("posture {} of {}", first - times_s.begin() + 1, times_s.size());
    };
  }
  const Eigen::VectorXd time = frame_times(world);
  out.corrections = [like = out, part, index, time](double at_s) {
    std::vector<Correction> corrections;
    for (std::size_t i = 0; i < kTwist.size(); ++i) {
      Correction twist = correct(part, like, i, index);
      twist.direction = Vector6d::Unit(static_cast<Eigen::Index>(i));
      twist.share = (time.array() >= at_s).cast<double>();
      corrections.push_back(std::move(twist));
    }
    return corrections;
  };
}

// Further than its own size, or half a radian, a marker does not slip: it is put elsewhere.
std::function<bool(const Eigen::VectorXd&)> is_a_slip(const EffectWorld& world, int marker) {
  constexpr double kMostTurn = 0.5;      // rad
  constexpr double kUnknownSize = 0.05;  // m
  const double size = world.tree.markers[static_cast<std::size_t>(marker)].size_m;
  return [most = size > 0.0 ? size : kUnknownSize](const Eigen::VectorXd& twist) {
    return twist.head<3>().norm() < kMostTurn && twist.tail<3>().norm() < most;
  };
}

CameraEffect tag_slip(const EffectWorld& world, int marker) {
  const std::string name = marker_name(world, marker);
  CameraEffect out =
      effect("tag_slip", name, fmt::format("{} moved on its link", name), kTwist, "m");
  out.candidate.size_weights.head<3>().setZero();
  out.candidate.check = "glue or screws of the marker's plate";
  out.candidate.record = "more frames with this marker in view, before and after";
  out.candidate.possible = is_a_slip(world, marker);
  if (rests(world, marker) && world.kind == MeasurementKind::kCorners)
    out.candidate.floor = kRestingBias;
  happens_at_a_time(world, CorrectedPart::kMarker, marker, out);
  return out;
}

CameraEffect camera_bump(const EffectWorld& world) {
  CameraEffect out =
      effect("camera_bump", "camera", "the camera (or the robot's base) was moved", kTwist, "rad");
  out.candidate.size_weights.tail<3>().setZero();
  out.candidate.check = "tripod, cable pulls, screws of the base";
  out.candidate.record = "put a marker on the base, in view all the time";
  happens_at_a_time(world, CorrectedPart::kCamera, 0, out);
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
  for (const int marker : world.seen) out.push_back(tag_slip(world, marker));
  out.push_back(camera_bump(world));
  return out;
}

}  // namespace kinescope::effects
