// SPDX-License-Identifier: Apache-2.0
//
// Claimed intervals against scatter: `coverage [WORLDS [RENDERED [PAIRS]]]`. Random robots, first
// with white noise on exact corners, then as pictures that go through detection and corner
// refinement, then in two recordings that are calibrated together, the second with three times the
// noise of the first.
// For every axis the error in direction and position against twice its standard uncertainty, and
// for the clock; the axes in the base marker's frame, where they do not depend on the gauge, and
// among one another.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "calib/bundle/calibrate.h"
#include "calib/vision/refine_corners.h"
#include "calib/vision/tag_detector.h"
#include "tests/truth/axis_errors.h"
#include "tests/truth/camera_world.h"
#include "tests/truth/joined_recordings.h"
#include "tests/truth/recordings_world.h"
#include "tests/truth/render.h"

namespace kinescope {
namespace {

using truth::World;
using truth::WorldOptions;

constexpr double kOffset = 0.012;  // s

/// How often 95 % intervals hold the truth, and the mean square of error over sigma.
struct Coverage {
  int held = 0;
  int count = 0;
  double square = 0.0;

  void add(double error, double sigma) {
    held += std::abs(error) < 2.0 * sigma ? 1 : 0;
    square += std::pow(error / sigma, 2);
    ++count;
  }
  void print(const char* name) const {
    const double share = static_cast<double>(held) / count;
    fmt::print("  {:22} {:5.1f} % of {} hold the truth (+- {:.1f} %); rms of error/sigma {:.2f}\n",
               name, 100.0 * share, count, 100.0 * std::sqrt(share * (1.0 - share) / count),
               std::sqrt(square / count));
  }
};

struct AxisCoverage {
  Coverage direction, position;

  void add(const truth::AxisDifference& error, const Sigma& direction_rad,
           const Sigma& position_m) {
    if (direction_rad) direction.add(error.direction_rad, *direction_rad);
    if (position_m && error.position_m) position.add(*error.position_m, *position_m);
  }
  void print(const std::string& where) const {
    direction.print(("direction " + where).c_str());
    position.print(("position " + where).c_str());
  }
};

struct Score {
  AxisCoverage in_base, among;
  Coverage clock;
  double ratio = 0.0;  // sum of held out / training
  int worlds = 0;

  void print(const char* name) const {
    fmt::print("{}, {} recordings: held out / training {:.3f}\n", name, worlds, ratio / worlds);
    in_base.print("in the base");
    among.print("among axes");
    clock.print("clock offset");
    std::fflush(stdout);
  }
};

void judge(const World& world, const Calibration& found, Score& score) {
  const truth::AxisDifferences errors = truth::axis_differences(world.tree, found);
  for (std::size_t j = 0; j < found.joints.size(); ++j) {
    const JointEstimate& joint = found.joints[j];
    score.in_base.add(errors.in_base[j], joint.direction_sigma_rad, joint.position_sigma_m);
    score.among.add(errors.among[j], joint.among_direction_sigma_rad, joint.among_position_sigma_m);
  }
  if (found.time_offset_sigma_s) {
    score.clock.add(found.time_offset_s - kOffset, *found.time_offset_sigma_s);
  }
  score.ratio += found.held_out_rms / found.training_rms;
  ++score.worlds;
}

WorldOptions options_of(int seed) {
  WorldOptions options;
  options.seed = 5000 + static_cast<std::uint64_t>(seed);
  options.time_offset_s = kOffset;
  options.link_length_m = 0.2;
  options.joints = {JointType::kRevolute, JointType::kRevolute,
                    seed % 2 == 0 ? JointType::kRevolute : JointType::kPrismatic,
                    JointType::kRevolute};
  return options;
}

Calibration calibrated(const World& world, const Measurements& measurements, std::uint64_t seed) {
  return calibrate(measurements, world.markers, world.log,
                   truth::perturbed_start(world, 0.01, 0.002, seed));
}

// Markers that the camera sees in a frame and that no other one overlaps in the picture.
std::vector<PlacedMarker> visible(const World& world, const Measurements& exact, int frame) {
  std::vector<PlacedMarker> out;
  const auto links = forward_kinematics(world.tree, world.joint_values.row(frame));
  for (const TagObservation& seen : exact.corners) {
    if (seen.frame != frame) continue;
    const Marker* marker = world.tree.marker(seen.id);
    PlacedMarker placed;
    placed.art = apriltag_art("tag36h11", seen.id.value);
    placed.T_camera_tag = world.T_camera_base * links[marker->link.index()] * marker->T_link_marker;
    placed.size_m = marker->size_m;
    const auto pixel = project(world.camera, placed.T_camera_tag.translation);
    const auto clear = [&](const PlacedMarker& other) {
      const auto there = project(world.camera, other.T_camera_tag.translation);
      const double size_px = world.camera.fx * placed.size_m / placed.T_camera_tag.translation.z();
      return (*pixel - *there).norm() > 2.2 * size_px;
    };
    if (std::ranges::all_of(out, clear)) out.push_back(std::move(placed));
  }
  return out;
}

// A marker that others hide for most of the time makes no recording worth judging.
bool all_seen(const World& world, const Measurements& measurements) {
  return std::ranges::all_of(world.tree.markers, [&](const Marker& marker) {
    return 2 * std::ranges::count(measurements.corners, marker.id, &TagObservation::id) >
           static_cast<std::ptrdiff_t>(measurements.times_s.size());
  });
}

Measurements filmed(const World& world, std::uint64_t seed) {
  Rng rng = Rng::from_name("coverage pictures", seed);
  const std::unique_ptr<TagDetector> detector = make_tag_detector("tag36h11");
  const TagLayout layout = tag_layout("tag36h11");
  Measurements out;
  out.times_s = world.measurements.times_s;
  for (int f = 0; f < static_cast<int>(out.times_s.size()); ++f) {
    const auto placed = visible(world, world.measurements, f);
    const GreyImage image = render_markers(world.camera, placed, {.supersample = 4}, rng);
    for (TagObservation seen : detector->detect(image.view())) {
      if (world.tree.marker(seen.id) == nullptr) continue;
      Corners corners;
      std::ranges::copy(seen.corners_px, corners.begin());
      const RefinedCorners refined =
          refine_corners(image.view(), corners, layout, ToneCurve(), &world.camera);
      if (refined.status != RefineStatus::kDone) continue;
      seen.frame = f;
      std::ranges::copy(refined.corners_px, seen.corners_px.begin());
      seen.sigma_px = refined.sigma_px;
      out.corners.push_back(seen);
    }
  }
  return out;
}

// One robot in two motions before two cameras.
std::vector<World> two_recordings(int seed) {
  truth::FilmedRobotOptions robot;
  robot.seed = 5000 + static_cast<std::uint64_t>(seed);
  robot.kind = truth::kRobotKinds[static_cast<std::size_t>(seed) % truth::kRobotKinds.size()];
  robot.duration_s = 10.0;
  robot.tag_size_m = 0.06;
  robot.scale = 1.5;
  robot.distance_m = 1.6;
  std::vector<truth::RecordingOptions> recordings(2);
  for (std::size_t k = 0; k < recordings.size(); ++k) {
    recordings[k].name = k == 0 ? "first" : "second";
    recordings[k].motion = 2 * static_cast<std::uint64_t>(seed) + k;
    recordings[k].camera.rate_hz = 15.0;
    recordings[k].camera.clock_s = kOffset;
    recordings[k].camera.azimuth_rad = k == 0 ? 0.0 : 0.5;
    recordings[k].camera.sigma_px = k == 0 ? 0.1 : 0.3;
  }
  return truth::make_recordings(robot, recordings);
}

Calibration calibrated_together(const std::vector<World>& worlds, std::uint64_t seed) {
  const truth::JoinedRecordings joined = truth::joined_recordings(worlds);
  return calibrate(joined.measurements, worlds.front().markers, joined.log,
                   truth::perturbed_starts(worlds, seed));
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  using namespace kinescope;
  const int worlds = argc > 1 ? std::atoi(argv[1]) : 200;
  const int rendered = argc > 2 ? std::atoi(argv[2]) : 20;
  Score white;
  for (int seed = 0; white.worlds < worlds; ++seed) {
    const World world = truth::make_world(options_of(seed));
    if (!all_seen(world, world.measurements)) continue;
    judge(world, calibrated(world, world.measurements, static_cast<std::uint64_t>(seed)), white);
  }
  if (worlds > 0) white.print("white noise on corners");
  Score pictures;
  for (int seed = 0; pictures.worlds < rendered; ++seed) {
    const World world = truth::make_world(options_of(seed));
    const auto key = static_cast<std::uint64_t>(seed);
    const Measurements pictured = filmed(world, key);
    if (!all_seen(world, pictured)) continue;
    judge(world, calibrated(world, pictured, key), pictures);
  }
  if (rendered > 0) pictures.print("pictures");
  const int pairs = argc > 3 ? std::atoi(argv[3]) : 100;
  Score together;
  for (int seed = 0; together.worlds < pairs; ++seed) {
    const std::vector<World> recordings = two_recordings(seed);
    if (!std::ranges::all_of(recordings,
                             [](const World& w) { return all_seen(w, w.measurements); }))
      continue;
    judge(recordings.front(), calibrated_together(recordings, static_cast<std::uint64_t>(seed)),
          together);
  }
  if (pairs > 0) together.print("two recordings together");
  return 0;
}
