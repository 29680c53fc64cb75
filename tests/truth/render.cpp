// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/render.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include <apriltag/apriltag.h>
#include <apriltag/common/image_u8.h>
#include <opencv2/aruco.hpp>

#include "calib/camera/marker_set.h"
#include "calib/vision/apriltag_families.h"

namespace kinescope {
namespace {

std::size_t at(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(x);
}

// The scene in one direction, averaged over a small square of directions: an edge that crosses a
// subsample counts by the share on either side, so that few samples place it exactly.
class Plane {
 public:
  /// `footprint`: side of that square in the image plane at unit distance.
  Plane(const PlacedMarker& marker, const ImageOptions& options, double footprint)
      : art_(marker.art),
        options_(options),
        footprint_(footprint),
        T_tag_camera_(marker.T_camera_tag.inverse()),
        R_(T_tag_camera_.matrix3()),
        cell_m_(marker.size_m / marker.art.border_cells) {}

  [[nodiscard]] double grey(const Eigen::Vector2d& ray) const {
    const Eigen::Vector3d direction = R_ * Eigen::Vector3d(ray.x(), ray.y(), 1.0);
    const double depth = -T_tag_camera_.translation.z() / direction.z();
    if (!(depth > 0.0)) return options_.background;
    const Eigen::Vector3d p = T_tag_camera_.translation + depth * direction;
    // How far the point moves for a step of the ray to the right, and down.
    const Eigen::Vector3d right = depth * (R_.col(0) - direction * (R_(2, 0) / direction.z()));
    const Eigen::Vector3d down = depth * (R_.col(1) - direction * (R_(2, 1) / direction.z()));
    const Share column = share(p.x(), std::abs(right.x()) + std::abs(down.x()));
    const Share row = share(p.y(), std::abs(right.y()) + std::abs(down.y()));
    const auto along = [&](int r) {
      const double after = column.after > 0.0 ? cell(column.boundary, r) : 0.0;
      const double before = column.after < 1.0 ? cell(column.boundary - 1, r) : 0.0;
      return column.after * after + (1.0 - column.after) * before;
    };
    const double after = row.after > 0.0 ? along(row.boundary) : 0.0;
    const double before = row.after < 1.0 ? along(row.boundary - 1) : 0.0;
    return row.after * after + (1.0 - row.after) * before;
  }

 private:
  struct Share {
    int boundary = 0;    // the nearest one between two cells
    double after = 0.0;  // share behind it
  };

  // `place_m` from the tag's centre; `slope_m`: of the place per unit in the image plane.
  [[nodiscard]] Share share(double place_m, double slope_m) const {
    const double at = place_m / cell_m_ + 0.5 * art_.total_cells;
    const double width = slope_m * footprint_ / cell_m_;
    const double nearest = std::round(at);
    return {static_cast<int>(nearest), std::clamp((at - nearest) / width + 0.5, 0.0, 1.0)};
  }

  [[nodiscard]] double cell(int column, int row) const {
    if (column < 0 || row < 0 || column >= art_.total_cells || row >= art_.total_cells)
      return options_.background;
    return art_.at(column, row) ? options_.white : options_.black;
  }

  const MarkerArt& art_;
  const ImageOptions& options_;
  double footprint_;
  Pose T_tag_camera_;
  Eigen::Matrix3d R_;
  double cell_m_;
};

// Gaussian blur and the pixel's box as one kernel over subsamples; its middle is the pixel's
// centre.
std::vector<double> make_kernel(const ImageOptions& options) {
  const int s = options.supersample;
  const double sigma = options.blur_px * s;
  const int radius = static_cast<int>(std::ceil(5.0 * sigma)) + s;
  std::vector<double> kernel;
  double sum = 0.0;
  const auto phi = [&](double x) {
    if (sigma < 1e-9) return x > 0.0 ? 1.0 : 0.0;
    return 0.5 * std::erfc(-x / (sigma * std::sqrt(2.0)));
  };
  for (int i = -radius; i < radius; ++i) {
    const double x = i + 0.5;  // of the subsample, from the pixel's centre
    kernel.push_back(phi(x + 0.5 * s) - phi(x - 0.5 * s));
    sum += kernel.back();
  }
  for (double& k : kernel) k /= sum;
  return kernel;
}

struct Box {
  int x0, y0, x1, y1;  // inclusive
};

Box bounding_box(const CameraModel& camera, const PlacedMarker& marker, int border) {
  const double grow = static_cast<double>(marker.art.total_cells) / marker.art.border_cells;
  Eigen::Vector2d low(1e9, 1e9);
  Eigen::Vector2d high(-1e9, -1e9);
  for (const Eigen::Vector3d& corner : square_corners(marker.size_m * grow)) {
    const auto pixel = project(camera, marker.T_camera_tag * corner);
    if (!pixel) throw std::invalid_argument("marker behind the camera");
    low = low.cwiseMin(*pixel);
    high = high.cwiseMax(*pixel);
  }
  return {std::max(0, static_cast<int>(low.x()) - border),
          std::max(0, static_cast<int>(low.y()) - border),
          std::min(camera.width - 1, static_cast<int>(high.x()) + border),
          std::min(camera.height - 1, static_cast<int>(high.y()) + border)};
}

// Adds `weight` times what the marker, moved by `shift` px, changes of the background.
void paint(const CameraModel& camera, const PlacedMarker& marker, const ImageOptions& options,
           const Eigen::Vector2d& shift, double weight, std::vector<double>& image) {
  const std::vector<double> kernel = make_kernel(options);
  const int taps = static_cast<int>(kernel.size());
  const int s = options.supersample;
  const int margin = taps / 2;  // subsamples beside the pixel's centre
  const int moved = static_cast<int>(std::ceil(shift.cwiseAbs().maxCoeff()));
  const Box box = bounding_box(camera, marker, margin / s + 2 + moved);
  const int columns = box.x1 - box.x0 + 1;
  const int rows = box.y1 - box.y0 + 1;
  if (columns <= 0 || rows <= 0) return;
  const Plane plane(marker, options, 1.0 / (s * camera.fx));
  // Subsample i lies at pixel x0 + (i + 0.5 - margin) / s: pixel x's kernel begins at subsample (x
  // - x0) s.
  const int sub_columns = (columns - 1) * s + taps;
  const int sub_rows = (rows - 1) * s + taps;
  std::vector<double> line(static_cast<std::size_t>(sub_columns));
  std::vector<double> across(static_cast<std::size_t>(sub_rows) *
                             static_cast<std::size_t>(columns));
  // Samples stand at other places in every row and column, so that an edge along them is not
  // rounded to the grid.
  const auto jitter = [](int k) {
    constexpr double kGolden = 0.6180339887498949;
    const double t = kGolden * k;
    return t - std::floor(t);
  };
  for (int j = 0; j < sub_rows; ++j) {
    for (int i = 0; i < sub_columns; ++i) {
      const double x = box.x0 + (i + jitter(j) - margin) / s - shift.x();
      const double y = box.y0 + (j + jitter(i) - margin) / s - shift.y();
      const auto ray = unproject(camera, {x, y});
      line[static_cast<std::size_t>(i)] = ray ? plane.grey(*ray) : options.background;
    }
    for (int c = 0; c < columns; ++c) {
      double sum = 0.0;
      for (int k = 0; k < taps; ++k) {
        sum += kernel[static_cast<std::size_t>(k)] * line[static_cast<std::size_t>(c * s + k)];
      }
      across[at(c, j, columns)] = sum;
    }
  }
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      double sum = 0.0;
      for (int k = 0; k < taps; ++k) {
        sum += kernel[static_cast<std::size_t>(k)] * across[at(c, r * s + k, columns)];
      }
      image[at(box.x0 + c, box.y0 + r, camera.width)] += weight * (sum - options.background);
    }
  }
}

// What lens and camera make of the light.
void develop(const CameraModel& camera, const ImageOptions& options, std::vector<double>& image) {
  if (options.vignetting > 0.0) {
    const double corner = 0.5 * std::hypot(camera.width, camera.height);
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const double r = std::hypot(x - 0.5 * camera.width, y - 0.5 * camera.height) / corner;
        image[at(x, y, camera.width)] *= 1.0 - options.vignetting * r * r;
      }
    }
  }
  if (options.gamma != 1.0) {
    for (double& grey : image)
      grey = 255.0 * std::pow(std::max(0.0, grey) / 255.0, 1.0 / options.gamma);
  }
}

}  // namespace

MarkerArt apriltag_art(const std::string& family, int id) {
  const AprilTagFamily april = make_apriltag_family(family);
  if (!april) throw std::invalid_argument("no such family");
  const std::unique_ptr<image_u8_t, void (*)(image_u8_t*)> picture(
      apriltag_to_image(april.get(), id), image_u8_destroy);
  MarkerArt art{picture->width, april->width_at_border, {}};
  for (int y = 0; y < picture->height; ++y) {
    for (int x = 0; x < picture->width; ++x) {
      art.white.push_back(picture->buf[y * picture->stride + x] > 127);
    }
  }
  return art;
}

MarkerArt aruco_art(int dictionary, int id) {
  const auto table = cv::aruco::getPredefinedDictionary(dictionary);
  const int cells = table->markerSize + 2;
  cv::Mat picture;
  cv::aruco::drawMarker(table, id, cells, picture, 1);
  MarkerArt art{cells + 2, cells, {}};
  for (int y = -1; y <= cells; ++y) {
    for (int x = -1; x <= cells; ++x) {
      const bool margin = x < 0 || y < 0 || x == cells || y == cells;
      art.white.push_back(margin || picture.at<std::uint8_t>(y, x) > 127);
    }
  }
  return art;
}

GreyImage render_markers(const CameraModel& camera, const std::vector<PlacedMarker>& markers,
                         const ImageOptions& options, Rng& rng) {
  std::vector<double> image(
      static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height),
      options.background);
  // Instants of the exposure, nearer to one another than the blur.
  const int instants = 1 + static_cast<int>(std::ceil(2.0 * options.motion_px.norm()));
  for (const PlacedMarker& marker : markers) {
    for (int i = 0; i < instants; ++i) {
      const double t = (i + 0.5) / instants - 0.5;
      paint(camera, marker, options, t * options.motion_px, 1.0 / instants, image);
    }
  }
  develop(camera, options, image);
  GreyImage out{camera.width, camera.height, {}};
  out.pixels.reserve(image.size());
  for (const double grey : image) {
    const double noisy = options.noise > 0.0 ? grey + rng.normal(options.noise) : grey;
    out.pixels.push_back(static_cast<std::uint8_t>(std::clamp(std::lround(noisy), 0L, 255L)));
  }
  return out;
}

std::array<Eigen::Vector2d, 4> true_corners(const CameraModel& camera, const PlacedMarker& marker) {
  std::array<Eigen::Vector2d, 4> out;
  const std::vector<Eigen::Vector3d> corners = square_corners(marker.size_m);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto pixel = project(camera, marker.T_camera_tag * corners[i]);
    if (!pixel) throw std::invalid_argument("marker behind the camera");
    out[i] = *pixel;
  }
  return out;
}

Pose pose_showing(const CameraModel& camera, const Eigen::Vector2d& pixel, double side_px,
                  double size_m, double tilt, double tilt_direction, double turn) {
  const double depth = size_m * camera.fx / side_px;
  const auto ray = unproject(camera, pixel);
  if (!ray) throw std::invalid_argument("pixel outside the lens model");
  Pose pose;
  pose.rotation =
      exp_rotation({tilt * std::cos(tilt_direction), tilt * std::sin(tilt_direction), 0.0}) *
      exp_rotation({0.0, 0.0, turn});
  pose.translation = depth * Eigen::Vector3d(ray->x(), ray->y(), 1.0);
  return pose;
}

}  // namespace kinescope
