// SPDX-License-Identifier: Apache-2.0
//
// Experiment: how exact the corners are, the library's and the refined ones, on renders with exact
// corners and on the synthetic recordings (shared data, where present).
//   corner_accuracy [trials a row]
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>

#include <fmt/core.h>

#include "calib/vision/refine_corners.h"
#include "calib/vision/tag_detector.h"
#include "calib/vision/video.h"
#include "kinematics/core/csv.h"
#include "tests/truth/render.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

// What a set of corners misses by.
struct Tally {
  int tags = 0;
  int corners = 0;
  double squared = 0.0;   // px^2, both coordinates
  double outward = 0.0;   // px
  double whitened = 0.0;  // squared error over sigma^2, both coordinates
  double worst = 0.0;
  double shift_x = 0.0;
  double shift_y = 0.0;

  void add(const Corners& found, const Corners& truth, double sigma) {
    const Eigen::Vector2d middle = 0.25 * (truth[0] + truth[1] + truth[2] + truth[3]);
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d error = found[i] - truth[i];
      squared += error.squaredNorm();
      outward += error.dot((truth[i] - middle).normalized());
      if (sigma > 0.0) whitened += error.squaredNorm() / (sigma * sigma);
      worst = std::max(worst, error.norm());
      shift_x += error.x();
      shift_y += error.y();
      ++corners;
    }
    ++tags;
  }
  [[nodiscard]] double rms() const { return std::sqrt(squared / corners); }
  [[nodiscard]] std::string row() const {
    if (corners == 0) return "none";
    return fmt::format(
        "n {:4d}  2-D rms {:.4f}  outward {:+.4f}  worst {:.3f}  shift ({:+.4f},{:+.4f})  chi2/dof "
        "{:.2f}",
        tags, rms(), outward / corners, worst, shift_x / corners, shift_y / corners,
        whitened / (2.0 * corners));
  }
};

Corners as_corners(const TagObservation& tag) {
  return {tag.corners_px[0], tag.corners_px[1], tag.corners_px[2], tag.corners_px[3]};
}

struct Row {
  double side;
  double noise;
  double blur;
};

void renders(const std::string& family, const Row& row, int trials, double decimate, double k1) {
  const auto detector = make_tag_detector(family, {.decimate = decimate, .min_margin = 5.0});
  const TagLayout layout = tag_layout(family);
  CameraModel camera = pinhole_guess(220, 220, 900.0);
  camera.distortion[0] = k1;
  if (k1 != 0.0) {  // far from the axis, where lines bend
    camera.cx -= 300.0;
    camera.cy -= 200.0;
  }
  Tally library;
  Tally refined;
  std::map<int, int> failed;
  double sigma = 0.0;
  for (int trial = 0; trial < trials; ++trial) {
    Rng rng = Rng::from_name("corner accuracy", static_cast<std::uint64_t>(trial));
    PlacedMarker marker;
    const bool aruco = family.starts_with("DICT");
    marker.art = aruco ? aruco_art(10, rng.index(250)) : apriltag_art(family, rng.index(30));
    const Eigen::Vector2d pixel(110.0 + rng.uniform(-5.0, 5.0), 110.0 + rng.uniform(-5.0, 5.0));
    marker.T_camera_tag = pose_showing(
        camera, pixel, row.side, marker.size_m, rng.uniform(0.0, 55.0) * std::numbers::pi / 180.0,
        rng.uniform(0.0, 2.0 * std::numbers::pi), rng.uniform(0.0, 2.0 * std::numbers::pi));
    const GreyImage image =
        render_markers(camera, {marker}, {.blur_px = row.blur, .noise = row.noise}, rng);
    const Corners truth = true_corners(camera, marker);
    for (const TagObservation& tag : detector->detect(image.view())) {
      const Corners start = as_corners(tag);
      if ((start[0] - truth[0]).norm() > 3.0) continue;
      library.add(start, truth, 0.0);
      const RefinedCorners better = refine_corners(image.view(), start, layout);
      if (better.status != RefineStatus::kDone) {
        ++failed[static_cast<int>(better.status)];
        continue;
      }
      refined.add(better.corners_px, truth, better.sigma_px);
      sigma += better.sigma_px;
    }
  }
  fmt::print(
      "{} side {:5.0f} noise {} blur {} decimate {} k1 {}\n  library {}\n  refined {}  mean sigma "
      "{:.4f}",
      family, row.side, row.noise, row.blur, decimate, k1, library.row(), refined.row(),
      refined.tags > 0 ? sigma / refined.tags : 0.0);
  for (const auto& [status, count] : failed) fmt::print("  status {}: {}", status, count);
  fmt::print("\n");
}

void video(const std::string& name) {
  const auto folder = shared_data("synthetic/" + name);
  if (!folder) {
    fmt::print("{}: absent\n", name);
    return;
  }
  // The truth as a table without compression is made by the caller: truth_frames.csv beside the
  // program.
  const std::string table = name + ".truth_frames.csv";
  if (!std::filesystem::exists(table)) {
    fmt::print("{0}: zcat truth_frames.csv.gz > {0}.truth_frames.csv first\n", name);
    return;
  }
  const CsvTable truth_table = read_csv(table);
  std::map<std::pair<int, int>, Corners> truth;
  for (std::size_t r = 0; r < truth_table.rows.size(); ++r) {
    if (truth_table.integer(r, 2) != 1) continue;
    Corners corners;
    for (std::size_t c = 0; c < 4; ++c) {
      corners[c] = {truth_table.number(r, 3 + 2 * c), truth_table.number(r, 4 + 2 * c)};
    }
    truth[{truth_table.integer(r, 0), truth_table.integer(r, 1)}] = corners;
  }
  const auto detector = make_tag_detector("tag36h11", {.decimate = 1.0});
  const TagLayout layout = tag_layout("tag36h11");
  Tally library;
  std::map<int, Tally> refined;
  Tally all;
  std::map<int, int> failed;
  const auto reader = open_video(*folder / "video.mp4");
  while (const auto frame = reader->next()) {
    if (std::abs(frame->time_s - frame->index / 30.0) > 1e-6) {
      fmt::print("{}: frame {} at {}\n", name, frame->index, frame->time_s);
    }
    if (frame->index % 4 != 0) continue;
    for (const TagObservation& tag : detector->detect(frame->image.view())) {
      const auto found = truth.find({frame->index, tag.id.value});
      if (found == truth.end()) continue;
      library.add(as_corners(tag), found->second, 0.0);
      const RefinedCorners better = refine_corners(frame->image.view(), as_corners(tag), layout);
      if (better.status != RefineStatus::kDone) {
        ++failed[static_cast<int>(better.status)];
        continue;
      }
      const double side = (found->second[1] - found->second[0]).norm();
      refined[static_cast<int>(side / 10.0) * 10].add(better.corners_px, found->second,
                                                      better.sigma_px);
      all.add(better.corners_px, found->second, better.sigma_px);
    }
  }
  fmt::print("{}\n  library {}\n  refined {}\n", name, library.row(), all.row());
  for (const auto& [side, tally] : refined) fmt::print("   {:3d} px {}\n", side, tally.row());
  for (const auto& [status, count] : failed) fmt::print("  status {}: {}\n", status, count);
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  using namespace kinescope;
  const int trials = argc > 1 ? std::atoi(argv[1]) : 150;
  for (const double side : {16.0, 20.0, 24.0, 30.0, 40.0, 60.0, 120.0}) {
    renders("tag36h11", {side, 2.0, 0.7}, trials, side < 30.0 ? 1.0 : 2.0, 0.0);
  }
  for (const double side : {24.0, 60.0}) renders("tag36h11", {side, 5.0, 1.0}, trials, 1.0, 0.0);
  for (const double side : {40.0, 120.0}) renders("tag36h11", {side, 2.0, 0.7}, trials, 2.0, -0.25);
  renders("tagStandard41h12", {40.0, 2.0, 0.7}, trials, 1.0, 0.0);
  renders("tagCircle21h7", {40.0, 2.0, 0.7}, trials, 1.0, 0.0);
  renders("DICT_6X6_250", {40.0, 2.0, 0.7}, trials, 1.0, 0.0);
  for (const char* name : {"scara4_none", "ur6_none", "gantry_time_lag", "ur6_gear_eccentricity"}) {
    video(name);
  }
  return 0;
}
