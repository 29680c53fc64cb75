// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/board.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include <fmt/format.h>
#include <opencv2/core/utils/logger.hpp>

#include "calib/vision/board_album.h"
#include "calib/vision/board_coverage.h"
#include "calib/vision/board_fit.h"
#include "calib/vision/board_markers.h"
#include "calib/vision/board_points.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr int kFolds = 5;
constexpr double kOutlierRatio = 3.0;     // a view's RMS against the median of all
constexpr double kOutlierLeast_px = 0.3;  // and in px
constexpr double kMaxOutlierShare = 0.34;
constexpr double kMinTilt_deg = 4.0;    // below, focal length and distance cannot be told apart
constexpr double kMaxFocalSigma = 0.1;  // share of the focal length: beyond, nothing was determined

std::vector<BoardSight> pick(const BoardAlbum& album, const std::vector<std::size_t>& which) {
  std::vector<BoardSight> out;
  for (const std::size_t i : which) out.push_back(album.sights[i]);
  return out;
}

Error not_determined(const std::string& source, std::string_view what) {
  return undetermined(source, what,
                      "tilt the board by 30 to 50 degrees to all sides, near and far, and fill the "
                      "image's corners");
}

struct Estimate {
  CameraModel camera;
  std::vector<ViewFit> fits;               // of the views used
  std::optional<std::size_t> unexplained;  // the first of the views that the lens has no pose for
};

Estimate estimate(const BoardAlbum& album, const std::vector<std::size_t>& used,
                  const BoardOptions& options, const std::string& source) {
  const std::vector<BoardSight> views = pick(album, used);
  const auto camera = estimate_intrinsics(views, album.width, album.height, options);
  if (!camera) throw not_determined(source, "no lens explains these views");
  Estimate out{*camera, {}, std::nullopt};
  for (std::size_t i = 0; i < views.size() && !out.unexplained; ++i) {
    if (const auto fit = fit_view(*camera, views[i])) {
      out.fits.push_back(*fit);
    } else {
      out.unexplained = i;
    }
  }
  return out;
}

double rms_of(const std::vector<ViewFit>& fits) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const ViewFit& fit : fits) {
    for (const auto& r : fit.residuals_px) sum += r.squaredNorm();
    count += fit.residuals_px.size();
  }
  return std::sqrt(sum / static_cast<double>(count));
}

// The view that stands out, if any.
std::optional<std::size_t> worst_view(const std::vector<ViewFit>& fits) {
  std::vector<double> rms;
  for (const ViewFit& fit : fits) rms.push_back(fit.rms_px);
  std::vector<double> sorted = rms;
  std::ranges::sort(sorted);
  const double median = sorted[sorted.size() / 2];
  const auto worst = std::ranges::max_element(rms);
  if (*worst <= std::max(kOutlierRatio * median, median + kOutlierLeast_px)) return std::nullopt;
  return static_cast<std::size_t>(worst - rms.begin());
}

// Estimates, takes out the view that has no pose or stands out, and again.
Estimate estimate_robustly(BoardAlbum& album, std::vector<std::size_t>& used,
                           const BoardOptions& options, const std::string& source,
                           const Progress& progress) {
  const auto most = static_cast<std::size_t>(kMaxOutlierShare * static_cast<double>(used.size()));
  std::size_t removed = 0;
  while (true) {
    report_progress(progress, "estimating the lens", static_cast<int>(removed), 0);
    Estimate now = estimate(album, used, options, source);
    const bool may_remove = removed < most && used.size() > kMinBoardViews;
    if (now.unexplained && !may_remove) {
      throw not_determined(source, "the estimated lens does not explain a view");
    }
    const auto worst = now.unexplained ? now.unexplained : worst_view(now.fits);
    if (!worst || !may_remove) return now;
    BoardView& view = album.views[used[*worst]];
    if (now.unexplained) {
      view.reason = "the lens that the others give does not explain it";
    } else {
      view.rms_px = now.fits[*worst].rms_px;
      view.reason = fmt::format("stands out: {:.2f} px where the others have {:.2f} px",
                                view.rms_px, rms_of(now.fits));
    }
    used.erase(used.begin() + static_cast<std::ptrdiff_t>(*worst));
    ++removed;
  }
}

// Views left out of the fit in turn; only their pose is fitted again.
double held_out_rms(const BoardAlbum& album, const std::vector<std::size_t>& used,
                    const BoardOptions& options, const Progress& progress) {
  const int folds = std::min(kFolds, static_cast<int>(used.size()));
  std::vector<ViewFit> out;
  for (int fold = 0; fold < folds; ++fold) {
    report_progress(progress, "judging on views left out", fold, folds);
    std::vector<std::size_t> train;
    std::vector<std::size_t> test;
    for (std::size_t i = 0; i < used.size(); ++i) {
      (static_cast<int>(i) % folds == fold ? test : train).push_back(used[i]);
    }
    if (train.size() < 2) return 0.0;
    const auto camera = estimate_intrinsics(pick(album, train), album.width, album.height, options);
    if (!camera) continue;
    for (const BoardSight& view : pick(album, test)) {
      if (const auto fit = fit_view(*camera, view)) out.push_back(*fit);
    }
  }
  return out.empty() ? 0.0 : rms_of(out);
}

// Marker corners against the calibrated board: a wrong marker size or layout leaves the chessboard
// corners, and so the calibration's own error, untouched.
void check_markers(const BoardAlbum& album, const std::vector<std::size_t>& used,
                   const Estimate& now, const BoardSpec& board, const std::string& source) {
  if (board.type != BoardType::kCharuco) return;
  double sum = 0.0;
  double square_px = 0.0;
  double larger = 0.0;  // markers as seen, against declared
  int count = 0;
  for (std::size_t v = 0; v < used.size(); ++v) {
    const Pose& pose = now.fits[v].T_camera_board;
    for (const BoardMarker& marker : album.sights[used[v]].markers) {
      const auto places = charuco_marker_places(board, board.legacy_charuco, marker.id);
      if (!places || !marker.refined) continue;
      const Eigen::Vector3d middle = 0.5 * ((*places)[0] + (*places)[2]);
      for (std::size_t i = 0; i < 4; ++i) {
        const auto pixel = project(now.camera, pose * (*places)[i]);
        const double per_m = now.camera.fx / (pose * (*places)[i]).z();
        if (!pixel) continue;
        sum += (*pixel - marker.pixels[i]).squaredNorm();
        square_px += per_m * board.square_m;
        const auto centre = project(now.camera, pose * middle);
        if (centre) {
          larger += (marker.pixels[i] - *centre).norm() / (*pixel - *centre).norm();
        }
        ++count;
      }
    }
  }
  if (count == 0) return;
  const double rms = std::sqrt(sum / count);
  square_px /= count;
  if (rms <= max_size_misfit_px(square_px)) return;
  const double measured = board.marker_m * larger / count;
  throw bad_input(source,
                  fmt::format("the markers' corners miss the declared board by {:.1f} px", rms),
                  fmt::format("by the images a marker's edge is about {:.1f} mm where squares are "
                              "{:.2f} mm; check sizes and layout",
                              1e3 * measured, 1e3 * board.square_m));
}

}  // namespace

IntrinsicCalibration calibrate_intrinsics(const std::filesystem::path& images_or_video,
                                          const BoardSpec& board, const BoardOptions& options,
                                          const Progress& progress) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  const std::string source = images_or_video.string();
  if (options.max_views < kMinBoardViews) {
    throw bad_request("max_views", fmt::format("{} are too few", options.max_views),
                      "use 3 or more");
  }
  const std::unique_ptr<BoardFinder> finder = make_board_finder(board);
  if (!std::filesystem::exists(images_or_video)) {
    throw bad_input(source, "no such file or folder", "name a folder of photographs or a video");
  }
  BoardAlbum album = read_album(images_or_video, *finder, progress);
  std::ranges::move(finder->settle(album.sights, source), std::back_inserter(album.warnings));
  std::vector<std::size_t> used = usable_views(album, options, source);
  const Estimate best = estimate_robustly(album, used, options, source, progress);
  check_markers(album, used, best, board, source);

  IntrinsicCalibration result;
  result.camera = best.camera;
  result.rms_px = rms_of(best.fits);
  result.tilt_range_deg = tilt_range_deg(best.fits);
  if (result.tilt_range_deg < kMinTilt_deg) {
    throw not_determined(source, fmt::format("the board was turned by {:.1f} degrees only, so that "
                                             "focal length and distance cannot be told apart",
                                             result.tilt_range_deg));
  }
  const std::vector<int> free = free_intrinsics(options);
  const auto covariance = intrinsic_covariance(best.camera, pick(album, used), best.fits, free);
  if (!covariance) throw not_determined(source, "the views do not determine the lens model");
  for (std::size_t i = 0; i < free.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    result.sigma[static_cast<std::size_t>(free[i])] = std::sqrt((*covariance)(k, k));
  }
  if (result.sigma[0] > kMaxFocalSigma * result.camera.fx ||
      result.sigma[1] > kMaxFocalSigma * result.camera.fy) {
    throw not_determined(source, fmt::format("the focal length comes out as {:.0f} +- {:.0f} px",
                                             result.camera.fx, 2.0 * result.sigma[0]));
  }
  result.held_out_rms_px = held_out_rms(album, used, options, progress);
  for (std::size_t i = 0; i < used.size(); ++i) {
    album.views[used[i]].used = true;
    album.views[used[i]].rms_px = best.fits[i].rms_px;
  }
  count_coverage(album, used, result);
  result.views = std::move(album.views);
  result.warnings = std::move(album.warnings);
  add_board_warnings(result, static_cast<int>(used.size()));
  return result;
}

}  // namespace kinescope
