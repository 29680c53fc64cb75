// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/board_coverage.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "calib/vision/image_grid.h"

namespace kinescope {
namespace {

constexpr double kGoodFocalSigma = 0.005;
constexpr int kGoodViews = 10;

}  // namespace

void count_coverage(const BoardAlbum& album, const std::vector<std::size_t>& used,
                    IntrinsicCalibration& result) {
  result.coverage_counts = empty_grid();
  for (const std::size_t i : used) {
    for (const Eigen::Vector2d& p : album.sights[i].pixels)
      count_point(result.coverage_counts, p, album.width, album.height);
  }
  result.coverage = covered_share(result.coverage_counts);
}

double tilt_range_deg(const std::vector<ViewFit>& fits) {
  double least = 1.0;
  for (const ViewFit& a : fits) {
    for (const ViewFit& b : fits) {
      const Eigen::Vector3d na = a.T_camera_board.rotation * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d nb = b.T_camera_board.rotation * Eigen::Vector3d::UnitZ();
      least = std::min(least, std::abs(na.dot(nb)));
    }
  }
  return std::acos(std::min(1.0, least)) * 180.0 / std::numbers::pi;
}

void add_board_warnings(IntrinsicCalibration& result, int used) {
  const auto warn = [&](std::string text) { result.warnings.push_back(std::move(text)); };
  if (used < kGoodViews) {
    warn(fmt::format("only {} views: take 15 to 30 photographs", used));
  }
  if (result.coverage < kGoodCoverage) {
    warn(
        fmt::format("corners cover {:.0f} % of the image: photograph the board at the image's rim, "
                    "above all at the {} side",
                    100.0 * result.coverage, emptiest_side(result.coverage_counts)));
  }
  if (result.tilt_range_deg < kGoodTilt_deg) {
    warn(fmt::format(
        "the board was turned by {:.0f} degrees at most: tilt it by 30 to 50 degrees to "
        "all sides",
        result.tilt_range_deg));
  }
  const double focal =
      std::max(result.sigma[0] / result.camera.fx, result.sigma[1] / result.camera.fy);
  if (focal > kGoodFocalSigma) {
    warn(fmt::format(
        "the focal length is known to {:.1f} % only (k = 2): take more, larger and more "
        "tilted views",
        200.0 * focal));
  }
  const double difference = std::abs(result.camera.fx - result.camera.fy);
  const double spread = std::hypot(result.sigma[0], result.sigma[1]);
  if (difference > 0.01 * result.camera.fx && difference > 2.0 * spread) {
    warn(fmt::format(
        "fx and fy differ by {:.1f} %: unusual; is the board flat and the image unscaled?",
        100.0 * difference / result.camera.fx));
  }
  constexpr double kWorse = 1.4;
  if (result.held_out_rms_px > kWorse * result.rms_px) {
    warn(fmt::format(
        "views left out of the fit are explained worse ({:.2f} px against {:.2f} px): too "
        "few views for this lens model",
        result.held_out_rms_px, result.rms_px));
  }
  constexpr double kPoor_px = 1.0;
  if (result.rms_px > kPoor_px) {
    warn(fmt::format(
        "the error of {:.2f} px is large: blurred photographs, a board that is not flat, or "
        "a lens that needs another model",
        result.rms_px));
  }
}

}  // namespace kinescope
