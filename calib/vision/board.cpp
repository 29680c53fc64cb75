// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/board.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>

#include <fmt/format.h>
#include <opencv2/core/utils/logger.hpp>

#include "calib/vision/board_fit.h"
#include "calib/vision/board_points.h"
#include "calib/vision/image_folder.h"
#include "calib/vision/video.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr int kGridColumns = 10;
constexpr int kGridRows = 8;
constexpr int kMinViews = 3;
constexpr std::size_t kMinPoints = 8;
constexpr int kFolds = 5;
constexpr int kVideoCandidates = 200;     // frames of a video that are searched for the board
constexpr double kOutlierRatio = 3.0;     // a view's RMS against the median of all
constexpr double kOutlierLeast_px = 0.3;  // and in px
constexpr double kMaxOutlierShare = 0.34;
constexpr double kMinTilt_deg = 4.0;  // below, focal length and distance cannot be told apart
constexpr double kGoodTilt_deg = 35.0;
constexpr double kGoodCoverage = 0.6;
constexpr double kMaxFocalSigma = 0.1;  // share of the focal length: beyond, nothing was determined
constexpr double kGoodFocalSigma = 0.005;
constexpr int kGoodViews = 10;
constexpr double kMaxMarkerMisfit = 0.03;  // of a square: markers against the calibrated board

// Every view of the source, those without a board too.
struct Album {
  int width = 0;
  int height = 0;
  std::vector<BoardView> views;
  std::vector<BoardSight> sights;  // as views
  std::vector<std::string> warnings;
};

void add_view(Album& album, BoardFinder& finder, const ImageView& image, std::string source) {
  BoardView view;
  view.source = std::move(source);
  BoardSight sight;
  if (album.width == 0) {
    album.width = image.width;
    album.height = image.height;
  }
  if (image.width != album.width || image.height != album.height) {
    throw bad_input(view.source,
                    fmt::format("the image is {} x {}, the first is {} x {}", image.width,
                                image.height, album.width, album.height),
                    "calibrate from images of one size and one camera");
  }
  sight = finder.find(image);
  album.views.push_back(std::move(view));
  album.sights.push_back(std::move(sight));
}

Album read_folder(const std::filesystem::path& folder, BoardFinder& finder,
                  const Progress& progress) {
  Album album;
  const std::vector<std::filesystem::path> files = list_images(folder);
  if (files.empty()) {
    throw bad_input(folder.string(), "no images in this folder",
                    "name a folder of photographs or a video");
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    const std::optional<GreyImage> image = read_grey_image(files[i]);
    if (image) {
      add_view(album, finder, image->view(), files[i].filename().string());
    } else {
      album.warnings.push_back(fmt::format("{}: cannot be decoded", files[i].string()));
    }
    report(progress, "finding the board", static_cast<int>(i) + 1, static_cast<int>(files.size()));
  }
  return album;
}

Album read_video(const std::filesystem::path& path, BoardFinder& finder, const Progress& progress) {
  Album album;
  const std::unique_ptr<VideoReader> reader = open_video(path);
  const int every = std::max(1, reader->info().frame_count / kVideoCandidates);
  while (const std::optional<VideoFrame> frame = reader->next()) {
    if (frame->index % every == 0) {
      add_view(album, finder, frame->image.view(), fmt::format("frame {}", frame->index));
    }
    report(progress, "finding the board", frame->index + 1, reader->info().frame_count);
  }
  album.warnings = reader->warnings();
  return album;
}

// Where a view shows the board: middle, size and slant, in units of the image's width.
Eigen::VectorXd signature(const BoardSight& sight, int width) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& p : sight.pixels) mean += p;
  mean /= static_cast<double>(sight.pixels.size());
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const auto& p : sight.pixels) spread += (p - mean) * (p - mean).transpose();
  spread /= static_cast<double>(sight.pixels.size());
  Eigen::VectorXd out(5);
  out << mean, 2.0 * std::sqrt(spread(0, 0)), 2.0 * std::sqrt(spread(1, 1)),
      2.0 * spread(0, 1) / std::sqrt(spread.trace());
  return out / width;
}

// The most different views, by farthest-point choice; the others are put aside.
void thin_out(Album& album, std::vector<std::size_t>& usable, int most) {
  if (static_cast<int>(usable.size()) <= most) return;
  std::vector<Eigen::VectorXd> where;
  for (const std::size_t i : usable) where.push_back(signature(album.sights[i], album.width));
  std::vector<double> distance(usable.size(), std::numeric_limits<double>::infinity());
  std::vector<std::size_t> chosen;
  std::size_t next = 0;
  while (static_cast<int>(chosen.size()) < most) {
    chosen.push_back(usable[next]);
    for (std::size_t i = 0; i < usable.size(); ++i) {
      distance[i] = std::min(distance[i], (where[i] - where[next]).norm());
    }
    next = static_cast<std::size_t>(std::ranges::max_element(distance) - distance.begin());
  }
  std::ranges::sort(chosen);
  for (const std::size_t i : usable) {
    if (!std::ranges::binary_search(chosen, i)) {
      album.views[i].reason = "much like other frames";
    }
  }
  usable = std::move(chosen);
}

std::vector<std::size_t> usable_views(Album& album, const BoardOptions& options,
                                      const std::string& source) {
  std::vector<std::size_t> usable;
  int with_board = 0;
  for (std::size_t i = 0; i < album.views.size(); ++i) {
    album.views[i].corners = static_cast<int>(album.sights[i].pixels.size());
    if (album.sights[i].pixels.size() >= kMinPoints) {
      usable.push_back(i);
      ++with_board;
    } else if (album.sights[i].pixels.empty()) {
      album.views[i].reason = "no board found";
    } else {
      album.views[i].reason = fmt::format("only {} corners", album.sights[i].pixels.size());
    }
  }
  if (with_board == 0) {
    throw bad_input(source,
                    fmt::format("the board is in none of the {} images", album.views.size()),
                    "check the board's kind, columns and rows (chessboard: inner corners)");
  }
  if (with_board < kMinViews) {
    throw bad_input(source, fmt::format("only {} usable views of the board", with_board),
                    "take 15 to 30 photographs with the board tilted and moved about");
  }
  thin_out(album, usable, options.max_views);
  return usable;
}

std::vector<BoardSight> pick(const Album& album, const std::vector<std::size_t>& which) {
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
  std::vector<ViewFit> fits;  // of the views used
};

Estimate estimate(const Album& album, const std::vector<std::size_t>& used,
                  const BoardOptions& options, const std::string& source) {
  const std::vector<BoardSight> views = pick(album, used);
  const auto camera = estimate_intrinsics(views, album.width, album.height, options);
  if (!camera) throw not_determined(source, "OpenCV's calibration fails on these views");
  Estimate out{*camera, {}};
  for (const BoardSight& view : views) {
    const auto fit = fit_view(*camera, view);
    if (!fit) throw not_determined(source, "the estimated lens does not explain a view");
    out.fits.push_back(*fit);
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

// Estimates, takes out the view that stands out, and again.
Estimate estimate_robustly(Album& album, std::vector<std::size_t>& used,
                           const BoardOptions& options, const std::string& source,
                           const Progress& progress) {
  const auto most = static_cast<std::size_t>(kMaxOutlierShare * static_cast<double>(used.size()));
  std::size_t removed = 0;
  while (true) {
    report(progress, "estimating the lens", static_cast<int>(removed), 0);
    Estimate now = estimate(album, used, options, source);
    const std::optional<std::size_t> worst = worst_view(now.fits);
    if (!worst || removed >= most || used.size() <= kMinViews) return now;
    BoardView& view = album.views[used[*worst]];
    view.rms_px = now.fits[*worst].rms_px;
    view.reason = fmt::format("stands out: {:.2f} px where the others have {:.2f} px", view.rms_px,
                              rms_of(now.fits));
    used.erase(used.begin() + static_cast<std::ptrdiff_t>(*worst));
    ++removed;
  }
}

// Views left out of the fit in turn; only their pose is fitted again.
double held_out_rms(const Album& album, const std::vector<std::size_t>& used,
                    const BoardOptions& options, const Progress& progress) {
  const int folds = std::min(kFolds, static_cast<int>(used.size()));
  std::vector<ViewFit> out;
  for (int fold = 0; fold < folds; ++fold) {
    report(progress, "judging on views left out", fold, folds);
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

void count_coverage(const Album& album, const std::vector<std::size_t>& used,
                    IntrinsicCalibration& result) {
  result.coverage_counts.assign(static_cast<std::size_t>(kGridColumns * kGridRows), 0);
  for (const std::size_t i : used) {
    for (const Eigen::Vector2d& p : album.sights[i].pixels) {
      const int c = std::clamp(static_cast<int>((p.x() + 0.5) / album.width * kGridColumns), 0,
                               kGridColumns - 1);
      const int r =
          std::clamp(static_cast<int>((p.y() + 0.5) / album.height * kGridRows), 0, kGridRows - 1);
      ++result.coverage_counts[static_cast<std::size_t>(r * kGridColumns + c)];
    }
  }
  const auto seen = std::ranges::count_if(result.coverage_counts, [](int n) { return n > 0; });
  result.coverage = static_cast<double>(seen) / (kGridColumns * kGridRows);
}

// Largest angle between the boards' normals.
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

// Marker corners against the calibrated board: a wrong marker size or layout leaves the chessboard
// corners, and so the calibration's own error, untouched.
void check_markers(const Album& album, const std::vector<std::size_t>& used, const Estimate& now,
                   const BoardSpec& board, const std::string& source) {
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
  if (rms <= std::max(1.0, kMaxMarkerMisfit * square_px)) return;
  const double measured = board.marker_m * larger / count;
  throw bad_input(source,
                  fmt::format("the markers' corners miss the declared board by {:.1f} px", rms),
                  fmt::format("by the images a marker's edge is about {:.1f} mm where squares are "
                              "{:.2f} mm; check sizes and layout",
                              1e3 * measured, 1e3 * board.square_m));
}

std::string empty_side(const IntrinsicCalibration& result) {
  std::array<int, 4> cells{};  // seen cells in the left, right, upper, lower third
  for (int r = 0; r < kGridRows; ++r) {
    for (int c = 0; c < kGridColumns; ++c) {
      if (result.coverage_counts[static_cast<std::size_t>(r * kGridColumns + c)] == 0) continue;
      if (c < 3) ++cells[0];
      if (c >= kGridColumns - 3) ++cells[1];
      if (r < 3) ++cells[2];
      if (r >= kGridRows - 3) ++cells[3];
    }
  }
  constexpr std::array<std::string_view, 4> kNames = {"left", "right", "upper", "lower"};
  constexpr std::array<int, 4> kWhole = {3 * kGridRows, 3 * kGridRows, 3 * kGridColumns,
                                         3 * kGridColumns};
  std::size_t worst = 0;
  for (std::size_t i = 1; i < 4; ++i) {
    if (cells[i] * kWhole[worst] < cells[worst] * kWhole[i]) worst = i;
  }
  return std::string(kNames[worst]);
}

void add_warnings(IntrinsicCalibration& result, int used) {
  const auto warn = [&](std::string text) { result.warnings.push_back(std::move(text)); };
  if (used < kGoodViews) {
    warn(fmt::format("only {} views: take 15 to 30 photographs", used));
  }
  if (result.coverage < kGoodCoverage) {
    warn(
        fmt::format("corners cover {:.0f} % of the image: photograph the board at the image's rim, "
                    "above all at the {} side",
                    100.0 * result.coverage, empty_side(result)));
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

}  // namespace

IntrinsicCalibration calibrate_intrinsics(const std::filesystem::path& images_or_video,
                                          const BoardSpec& board, const BoardOptions& options,
                                          const Progress& progress) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  const std::string source = images_or_video.string();
  if (options.max_views < kMinViews) {
    throw bad_request("max_views", fmt::format("{} are too few", options.max_views),
                      "use 3 or more");
  }
  const std::unique_ptr<BoardFinder> finder = make_board_finder(board);
  if (!std::filesystem::exists(images_or_video)) {
    throw bad_input(source, "no such file or folder", "name a folder of photographs or a video");
  }
  Album album = std::filesystem::is_directory(images_or_video)
                    ? read_folder(images_or_video, *finder, progress)
                    : read_video(images_or_video, *finder, progress);
  finder->settle(album.sights, source);
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
  add_warnings(result, static_cast<int>(used.size()));
  return result;
}

}  // namespace kinescope
