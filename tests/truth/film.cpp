// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/film.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/LU>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "calib/camera/camera_file.h"
#include "kinematics/core/file.h"
#include "kinematics/core/rng.h"
#include "tests/truth/h264_writer.h"
#include "tests/truth/render.h"

namespace kinescope::truth {
namespace {

constexpr double kWhite = 215.0;  // grey levels
constexpr double kBlack = 28.0;
constexpr double kBackground = 110.0;
constexpr double kVignetting = 0.15;      // share of the light that the image's corners lack
constexpr int kSupersample = 4;           // a pixel, in each direction
constexpr double kLensStep = 8.0;         // px between the points at which the lens is evaluated
constexpr int kInstants = 3;              // of an exposure
constexpr double kMargin = 4.0;           // px around a tag in which the blur leaves something
constexpr double kGolden = 0.6180339887;  // spreads samples evenly
constexpr int kNoisePool = 1 << 22;       // values of the sensor's noise, drawn once

using Quad = std::array<Eigen::Vector2d, 4>;

// A tag in one frame.
struct Shot {
  TagId id;
  Quad corners_px;
  Quad rate_px_s;
  double side_px = 0.0;
};

double mean_side(const Quad& corners) {
  double sum = 0.0;
  for (std::size_t c = 0; c < 4; ++c) sum += 0.25 * (corners[c] - corners[(c + 1) % 4]).norm();
  return sum;
}

// Maps points of the image plane (undistorted) to the tag's plane, in units of half its side.
Eigen::Matrix3d to_tag_plane(const Quad& corners) {
  constexpr std::array<std::array<double, 2>, 4> kSquare{
      {{-1.0, 1.0}, {1.0, 1.0}, {1.0, -1.0}, {-1.0, -1.0}}};
  Eigen::Matrix<double, 8, 8> A = Eigen::Matrix<double, 8, 8>::Zero();
  Eigen::Matrix<double, 8, 1> b;
  for (int c = 0; c < 4; ++c) {
    const Eigen::Vector2d& p = corners[static_cast<std::size_t>(c)];
    for (int k = 0; k < 2; ++k) {
      const double target = kSquare.at(static_cast<std::size_t>(c)).at(static_cast<std::size_t>(k));
      A.row(2 * c + k).segment<3>(3 * k) << p.x(), p.y(), 1.0;
      A.row(2 * c + k).tail<2>() << -target * p.x(), -target * p.y();
      b[2 * c + k] = target;
    }
  }
  const Eigen::Matrix<double, 8, 1> h = A.partialPivLu().solve(b);
  Eigen::Matrix3d H;
  H << h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0;
  return H;
}

// Undistorted coordinates over a window of the image, interpolated between exact ones.
class LensWindow {
 public:
  LensWindow(const CameraModel& camera, const cv::Rect& window) : origin_(window.x, window.y) {
    columns_ = static_cast<int>(window.width / kLensStep) + 2;
    const int rows = static_cast<int>(window.height / kLensStep) + 2;
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < columns_; ++c) {
        const auto ray = unproject(camera, origin_ + kLensStep * Eigen::Vector2d(c, r));
        nodes_.push_back(ray.value_or(Eigen::Vector2d::Zero()));
      }
    }
  }
  [[nodiscard]] Eigen::Vector2d undistorted(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector2d at = (pixel - origin_).cwiseMax(0.0) / kLensStep;
    const int c = std::min(static_cast<int>(at.x()), columns_ - 2);
    const int r =
        std::min(static_cast<int>(at.y()), static_cast<int>(nodes_.size()) / columns_ - 2);
    const double u = at.x() - c;
    const double v = at.y() - r;
    const auto node = [&](int row, int column) -> const Eigen::Vector2d& {
      return nodes_[static_cast<std::size_t>(row * columns_ + column)];
    };
    return (1.0 - v) * ((1.0 - u) * node(r, c) + u * node(r, c + 1)) +
           v * ((1.0 - u) * node(r + 1, c) + u * node(r + 1, c + 1));
  }

 private:
  Eigen::Vector2d origin_;
  int columns_ = 0;
  std::vector<Eigen::Vector2d> nodes_;
};

class Film {
 public:
  Film(const World& world, const FilmOptions& options)
      : world_(world), options_(options), rng_(Rng::from_name("sensor of a film", options.seed)) {
    for (const Marker& marker : world.tree.markers)
      art_[marker.id] = apriltag_art("tag36h11", marker.id.value);
    for (const TagObservation& seen : world.measurements.corners)
      std::ranges::copy(seen.corners_px, corners_[{seen.frame, seen.id}].begin());
    for (float& value : noise_) value = static_cast<float>(rng_.normal(options.noise));
    light_.create(world.camera.height, world.camera.width, CV_32F);
    const double corner = std::hypot(world.camera.width, world.camera.height) / 2.0;
    for (int y = 0; y < light_.rows; ++y) {
      for (int x = 0; x < light_.cols; ++x) {
        const double r = std::hypot(x - light_.cols / 2.0, y - light_.rows / 2.0) / corner;
        light_.at<float>(y, x) = static_cast<float>(1.0 - kVignetting * r * r);
      }
    }
  }

  // Grey values, row by row.
  [[nodiscard]] std::vector<std::uint8_t> frame(int f) {
    cv::Mat image(world_.camera.height, world_.camera.width, CV_32F, cv::Scalar(kBackground));
    for (const Shot& shot : shots(f)) paint(shot, image);
    image = image.mul(light_);
    std::vector<std::uint8_t> out;
    out.reserve(image.total());
    auto stray = static_cast<std::size_t>(rng_.index(kNoisePool));
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        stray = (stray + 1) % noise_.size();
        const float grey = image.at<float>(y, x) + noise_[stray];
        out.push_back(static_cast<std::uint8_t>(std::clamp(std::lround(grey), 0L, 255L)));
      }
    }
    return out;
  }

 private:
  // From the farthest to the nearest.
  [[nodiscard]] std::vector<Shot> shots(int f) const {
    std::vector<Shot> out;
    for (const Marker& marker : world_.tree.markers) {
      const auto here = corners_.find({f, marker.id});
      if (here == corners_.end()) continue;
      Shot shot{marker.id, here->second, {}, mean_side(here->second)};
      const auto before = corners_.find({f - 1, marker.id});
      const auto after = corners_.find({f + 1, marker.id});
      const bool moves = before != corners_.end() && after != corners_.end();
      for (std::size_t c = 0; c < 4; ++c) {
        shot.rate_px_s[c] = moves ? Eigen::Vector2d(0.5 * options_.frame_rate_hz *
                                                    (after->second[c] - before->second[c]))
                                  : Eigen::Vector2d::Zero();
      }
      out.push_back(shot);
    }
    std::ranges::stable_sort(
        out, {}, [&](const Shot& shot) { return shot.side_px / world_.markers.size_m(shot.id); });
    return out;
  }

  [[nodiscard]] cv::Rect window(const Shot& shot) const {
    const MarkerArt& art = art_.at(shot.id);
    const double reach = static_cast<double>(art.total_cells) / art.border_cells;
    const Eigen::Vector2d middle =
        0.25 * (shot.corners_px[0] + shot.corners_px[1] + shot.corners_px[2] + shot.corners_px[3]);
    double radius = 0.0;
    double blur = 0.0;
    for (std::size_t c = 0; c < 4; ++c) {
      radius = std::max(radius, (shot.corners_px[c] - middle).norm());
      blur = std::max(blur, 0.5 * options_.exposure_s * shot.rate_px_s[c].norm());
    }
    const int half = static_cast<int>(reach * radius + blur + kMargin) + 1;
    const cv::Rect square(static_cast<int>(middle.x()) - half, static_cast<int>(middle.y()) - half,
                          2 * half, 2 * half);
    return square & cv::Rect(0, 0, world_.camera.width, world_.camera.height);
  }

  // Grey and coverage on a fine grid, averaged over the exposure, blurred, then over each pixel.
  void paint(const Shot& shot, cv::Mat& image) const {
    const cv::Rect box = window(shot);
    if (box.empty()) return;
    cv::Mat fine(box.height * kSupersample, box.width * kSupersample, CV_32FC2, cv::Scalar(0, 0));
    const LensWindow lens(world_.camera, box);
    for (int i = 0; i < kInstants; ++i) {
      const double t = options_.exposure_s * ((i + 0.5) / kInstants - 0.5);
      expose(shot, t, lens, box, fine);
    }
    cv::GaussianBlur(fine, fine, {}, options_.blur_px * kSupersample);
    cv::Mat coarse;
    cv::resize(fine, coarse, box.size(), 0.0, 0.0, cv::INTER_AREA);
    for (int y = 0; y < box.height; ++y) {
      for (int x = 0; x < box.width; ++x) {
        const auto& light = coarse.at<cv::Vec2f>(y, x);
        float& pixel = image.at<float>(box.y + y, box.x + x);
        pixel = (1.0F - light[1]) * pixel + light[0];
      }
    }
  }

  void expose(const Shot& shot, double t_s, const LensWindow& lens, const cv::Rect& box,
              cv::Mat& fine) const {
    const MarkerArt& art = art_.at(shot.id);
    Quad plane;
    for (std::size_t c = 0; c < 4; ++c) {
      const auto ray = unproject(world_.camera, shot.corners_px[c] + t_s * shot.rate_px_s[c]);
      if (!ray) return;
      plane[c] = *ray;
    }
    const Eigen::Matrix3d H = to_tag_plane(plane);
    for (int j = 0; j < fine.rows; ++j) {
      for (int i = 0; i < fine.cols; ++i) {
        const Eigen::Vector2d pixel(box.x + (i + stray(j)) / kSupersample - 0.5,
                                    box.y + (j + stray(i)) / kSupersample - 0.5);
        const Eigen::Vector3d p = H * lens.undistorted(pixel).homogeneous();
        const int column = cell(p.x() / p.z(), art);
        const int row = cell(p.y() / p.z(), art);
        if (column < 0 || row < 0 || column >= art.total_cells || row >= art.total_cells) continue;
        auto& sample = fine.at<cv::Vec2f>(j, i);
        sample[0] += static_cast<float>((art.at(column, row) ? kWhite : kBlack) / kInstants);
        sample[1] += 1.0F / kInstants;
      }
    }
  }

  // Samples leave the grid so that an edge along it is not rounded to it.
  [[nodiscard]] static double stray(int k) { return kGolden * k - std::floor(kGolden * k); }

  [[nodiscard]] static int cell(double x, const MarkerArt& art) {
    return static_cast<int>(std::floor(0.5 * (x * art.border_cells + art.total_cells)));
  }

  const World& world_;
  const FilmOptions& options_;
  Rng rng_;
  std::vector<float> noise_ = std::vector<float>(kNoisePool);
  std::map<TagId, MarkerArt> art_;
  std::map<std::pair<int, TagId>, Quad> corners_;
  cv::Mat light_;
};

std::string joints_csv(const JointLog& log) {
  std::string out = "t";
  for (const std::string& channel : log.channels) out += "," + channel;
  out += "\n";
  for (std::size_t i = 0; i < log.times_s.size(); ++i) {
    out += fmt::format("{:.6f}", log.times_s[i]);
    for (Eigen::Index j = 0; j < log.values.cols(); ++j)
      out += fmt::format(",{:.8f}", log.values(static_cast<Eigen::Index>(i), j));
    out += "\n";
  }
  return out;
}

std::string tags_yaml(const World& world) {
  std::string out =
      fmt::format("family: tag36h11\ndefault_size: {}\n", world.markers.default_size_m);
  if (world.markers.sizes_m.empty()) return out;
  out += "sizes:\n";
  for (const auto& [id, size] : world.markers.sizes_m)
    out += fmt::format("  {}: {}\n", id.value, size);
  return out;
}

}  // namespace

void write_recording(const std::filesystem::path& folder, const World& world,
                     const FilmOptions& options) {
  write_file_atomically(folder / "joints.csv", joints_csv(world.log));
  write_file_atomically(folder / "camera.yaml", write_camera_info(world.camera));
  write_file_atomically(folder / "tags.yaml", tags_yaml(world));
  H264Writer encoder(folder / "video.mp4", world.camera.width, world.camera.height,
                     options.frame_rate_hz, options.crf);
  Film film(world, options);
  for (std::size_t f = 0; f < world.measurements.times_s.size(); ++f)
    encoder.add(film.frame(static_cast<int>(f)));
  encoder.finish();
}

}  // namespace kinescope::truth
