// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/camera_file.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "calib/camera/camera_formats.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

using namespace camera_file;  // NOLINT(google-build-using-namespace): this file is its front door

YAML::Node parse_yaml(const Source& source, std::string text) {
  // OpenCV writes "%YAML:1.0", which is no directive of YAML; blanked, so that line numbers stay.
  if (text.starts_with("%YAML:")) {
    const std::size_t end = text.find('\n');
    text.replace(0, end == std::string::npos ? text.size() : end, "");
  }
  try {
    YAML::Node root = YAML::Load(text);
    if (root.IsMap()) return root;
  } catch (const YAML::Exception& error) {
    throw bad_input(fmt::format("{}:{}", source.file, error.mark.line + 1),
                    fmt::format("not YAML: {}", error.msg), std::string(kKnownFiles));
  }
  throw bad_input(source.file, "holds no camera", std::string(kKnownFiles));
}

// A file that does not tell the size of its images may be of another resolution, or of a crop: the
// middle of the image then lies elsewhere. Lenses are centred far better than this.
void require_centred(const CameraModel& camera, int width, int height, const std::string& source) {
  constexpr double kOffCentre = 0.15;  // of the image's side
  const double x = camera.cx - 0.5 * (width - 1);
  const double y = camera.cy - 0.5 * (height - 1);
  if (std::abs(x) <= kOffCentre * width && std::abs(y) <= kOffCentre * height) return;
  throw bad_input(
      source,
      fmt::format("its principal point ({:.0f}, {:.0f}) is not near the middle of images of {} x "
                  "{}, and it does not say which size it was made for",
                  camera.cx, camera.cy, width, height),
      "add image_width and image_height to it, or calibrate the camera at the resolution of the "
      "video (kinescope camera)");
}

// Focal lengths in mm, or of another image: lenses from fisheye (a third of the image's longer
// side) to telephoto lie far inside these bounds.
void require_plausible_focal(const CameraModel& camera, const std::string& source) {
  constexpr double kShortest = 0.1;  // of the image's longer side; half of it is a view of 157 deg
  constexpr double kLongest = 1000.0;
  const double side = std::max(camera.width, camera.height);
  const auto plausible = [&](double focal) {
    return focal >= kShortest * side && focal <= kLongest * side;
  };
  if (plausible(camera.fx) && plausible(camera.fy)) return;
  throw bad_input(
      source,
      fmt::format("focal lengths {:.6g} and {:.6g} fit no lens for images of {} x {} px: in mm?",
                  camera.fx, camera.fy, camera.width, camera.height),
      "fx and fy are in pixels: the focal length in mm times the pixels per mm of the sensor; or "
      "calibrate the camera (kinescope camera)");
}

// Distortion that folds the image over itself, so that most pixels see no direction, or next to the
// same one. A fit may do so in the corners that no board reached.
void require_plausible_distortion(const CameraModel& camera, const std::string& source) {
  constexpr int kPerSide = 9;
  constexpr double kSamePlace = 1.0;  // px
  constexpr double kLeast = 0.2;      // of the angle that the focal length says
  int seen = 0;
  for (int i = 0; i < kPerSide; ++i) {
    for (int j = 0; j < kPerSide; ++j) {
      const Eigen::Vector2d pixel((i + 0.5) / kPerSide * camera.width,
                                  (j + 0.5) / kPerSide * camera.height);
      const auto direction = unproject(camera, pixel);
      if (!direction) continue;
      const auto back = project(camera, {direction->x(), direction->y(), 1.0});
      const Eigen::Vector2d straight((pixel.x() - camera.cx) / camera.fx,
                                     (pixel.y() - camera.cy) / camera.fy);
      const bool bent = direction->norm() < kLeast * straight.norm();
      if (back && !bent && (*back - pixel).norm() < kSamePlace) ++seen;
    }
  }
  if (2 * seen > kPerSide * kPerSide) return;
  throw bad_input(
      source,
      fmt::format("{} with these distortion coefficients shows {} of {} places of "
                  "the image nowhere: it folds the image over itself",
                  to_string(camera.model), kPerSide * kPerSide - seen, kPerSide * kPerSide),
      "check model, number and order of the coefficients, or calibrate the camera "
      "(kinescope camera)");
}

CameraModel require_plausible(CameraModel camera, const std::string& source) {
  if (camera.width <= 0 || camera.height <= 0) return camera;  // asked when the size is known
  require_plausible_focal(camera, source);
  require_plausible_distortion(camera, source);
  return camera;
}

bool is_opencv_yaml(const std::string& text) {
  return text.starts_with("%YAML:") || text.find("!!opencv-matrix") != std::string::npos;
}

CameraModel parse_any_format(const std::string& text, const Source& source) {
  const std::size_t first = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  if (first == std::string::npos)
    throw bad_input(source.file, "is empty", std::string(kKnownFiles));
  if (text[first] == '<') return read_opencv_xml(source, text);
  const YAML::Node root = parse_yaml(source, text);
  try {
    if (is_opencv_yaml(text)) return read_opencv_yaml(source, root);
    if (root["cam0"]) {
      if (!root["cam0"].IsMap())
        throw source.bad("cam0", "holds no camera", std::string(kKnownFiles));
      return read_kalibr(source, "cam0", root["cam0"]);
    }
    if (root["intrinsics"] && root["resolution"]) return read_kalibr(source, "camera", root);
    return read_ros(source, root);
  } catch (const YAML::Exception& error) {
    throw bad_input(fmt::format("{}:{}", source.file, error.mark.line + 1), error.msg,
                    std::string(kKnownFiles));
  }
}

}  // namespace

CameraModel read_camera(const std::filesystem::path& path) {
  constexpr std::uintmax_t kLargest = 1U << 24U;
  return parse_camera(read_text_file(path, kLargest), path.string());
}

CameraModel parse_camera(const std::string& text, const std::string& source) {
  return require_plausible(parse_any_format(text, Source{source}), source);
}

CameraModel with_image_size(CameraModel camera, int width, int height, const std::string& source) {
  if (camera.width == 0 && camera.height == 0) {
    require_centred(camera, width, height, source);
    camera.width = width;
    camera.height = height;
    return require_plausible(camera, source);
  }
  if (camera.width != width || camera.height != height) {
    throw bad_input(source,
                    fmt::format("made for images of {} x {}, these are {} x {}", camera.width,
                                camera.height, width, height),
                    "calibrate the camera at the resolution of the video (kinescope camera)");
  }
  return camera;
}

std::string write_camera_info(const CameraModel& camera) {
  const int terms = distortion_count(camera.model);
  std::string d;
  for (int i = 0; i < terms; ++i) {
    d += fmt::format("{}{}", i == 0 ? "" : ", ", camera.distortion[static_cast<std::size_t>(i)]);
  }
  return fmt::format(
      "image_width: {}\n"
      "image_height: {}\n"
      "camera_name: {}\n"
      "camera_matrix:\n"
      "  rows: 3\n"
      "  cols: 3\n"
      "  data: [{}, 0.0, {}, 0.0, {}, {}, 0.0, 0.0, 1.0]\n"
      "distortion_model: {}\n"
      "distortion_coefficients:\n"
      "  rows: 1\n"
      "  cols: {}\n"
      "  data: [{}]\n"
      "rectification_matrix:\n"
      "  rows: 3\n"
      "  cols: 3\n"
      "  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n"
      "projection_matrix:\n"
      "  rows: 3\n"
      "  cols: 4\n"
      "  data: [{}, 0.0, {}, 0.0, 0.0, {}, {}, 0.0, 0.0, 0.0, 1.0, 0.0]\n",
      camera.width, camera.height, camera.name, camera.fx, camera.cx, camera.fy, camera.cy,
      to_string(camera.model), terms, d, camera.fx, camera.cx, camera.fy, camera.cy);
}

}  // namespace kinescope
