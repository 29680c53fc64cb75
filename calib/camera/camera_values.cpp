// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/camera_values.h"

#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "kinematics/core/csv.h"

namespace kinescope::camera_file {

Error Source::bad(std::string_view key, std::string_view what, std::string_view remedy) const {
  return bad_input(file, fmt::format("{}: {}", key, what), remedy);
}

double to_number(const Source& source, const std::string& key, const std::string& text) {
  const std::optional<double> value = parse_number(text);
  if (!value || !std::isfinite(*value)) {
    throw source.bad(key, fmt::format("'{}' is not a finite number", text), "write a plain number");
  }
  return *value;
}

std::vector<double> to_numbers(const Source& source, const std::string& key,
                               const YAML::Node& node) {
  if (!node.IsSequence()) {
    throw source.bad(key, "is not a list of numbers", "write [a, b, c]");
  }
  std::vector<double> out;
  for (const YAML::Node& item : node) {
    if (!item.IsScalar()) throw source.bad(key, "is not a list of numbers", "write [a, b, c]");
    out.push_back(to_number(source, key, item.Scalar()));
  }
  return out;
}

YAML::Node need(const Source& source, const YAML::Node& parent, const std::string& key) {
  YAML::Node node = parent[key];
  if (!node || node.IsNull()) throw source.bad(key, "is missing", std::string(kKnownFiles));
  return node;
}

int to_size(const Source& source, const std::string& key, const std::string& text) {
  const double value = to_number(source, key, text);
  if (!(value >= 1.0) || value > 1e5 || value != std::floor(value)) {
    throw source.bad(key, fmt::format("'{}' is no image size in pixels", text),
                     "write the width or height of the video's frames");
  }
  return static_cast<int>(value);
}

void set_matrix(const Source& source, const std::string& key, const std::vector<double>& m,
                CameraModel& camera) {
  if (m.size() != 9) {
    throw source.bad(key, fmt::format("has {} numbers", m.size()), "a camera matrix has 3 x 3");
  }
  if (m[1] != 0.0 || m[3] != 0.0 || m[6] != 0.0 || m[7] != 0.0 || m[8] != 1.0) {
    throw source.bad(key, "is not of the form [fx 0 cx; 0 fy cy; 0 0 1]",
                     "skew is not supported; give row by row fx 0 cx 0 fy cy 0 0 1");
  }
  camera.fx = m[0];
  camera.fy = m[4];
  camera.cx = m[2];
  camera.cy = m[5];
}

void check_values(const Source& source, const CameraModel& camera, std::string_view focal_key) {
  if (!(camera.fx > 0.0) || !(camera.fy > 0.0)) {
    throw source.bad(focal_key,
                     fmt::format("focal lengths {} and {} are not positive", camera.fx, camera.fy),
                     "fx and fy are in pixels");
  }
}

void set_polynomial(const Source& source, const std::string& key, std::vector<double> d,
                    DistortionModel model, CameraModel& camera) {
  while (d.size() > 8 && d.back() == 0.0) d.pop_back();
  if (model == DistortionModel::kPlumbBob) {
    while (d.size() > 5 && d.back() == 0.0) d.pop_back();
  }
  const std::size_t most = model == DistortionModel::kPlumbBob ? 5 : 8;
  const bool known = d.empty() || d.size() == 4 || d.size() == 5 || d.size() == most;
  if (!known || d.size() > most) {
    throw source.bad(
        key, fmt::format("has {} distortion terms", d.size()),
        fmt::format("{} has {}", to_string(model),
                    model == DistortionModel::kPlumbBob ? "4 or 5: k1 k2 p1 p2 [k3]"
                                                        : "8: k1 k2 p1 p2 k3 k4 k5 k6"));
  }
  camera.model = model;
  for (std::size_t i = 0; i < d.size(); ++i) camera.distortion[i] = d[i];
}

void set_equidistant(const Source& source, const std::string& key, const std::vector<double>& d,
                     CameraModel& camera) {
  if (d.size() != 4) {
    throw source.bad(key, fmt::format("has {} distortion terms", d.size()),
                     "equidistant has 4: k1 k2 k3 k4");
  }
  camera.model = DistortionModel::kEquidistant;
  for (std::size_t i = 0; i < 4; ++i) camera.distortion[i] = d[i];
}

}  // namespace kinescope::camera_file
