// SPDX-License-Identifier: Apache-2.0
#include <initializer_list>

#include <fmt/format.h>

#include "calib/camera/camera_formats.h"

namespace kinescope::camera_file {

namespace {

// The key of a file of camera_calibration, or that of the message as `topic echo` prints it (ROS 2,
// ROS 1). Where none is there, the first.
std::string key_of(const YAML::Node& root, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (root[name]) return name;
  }
  return *names.begin();
}

// A matrix as its data alone, or with rows, cols and data.
std::vector<double> data_of(const Source& source, const std::string& key, const YAML::Node& node) {
  return node.IsMap() ? to_numbers(source, key + ".data", need(source, node, "data"))
                      : to_numbers(source, key, node);
}

}  // namespace

CameraModel read_ros(const Source& source, const YAML::Node& root) {
  CameraModel camera;
  const std::string width = key_of(root, {"image_width", "width"});
  const std::string height = key_of(root, {"image_height", "height"});
  camera.width = to_size(source, width, need(source, root, width).as<std::string>(""));
  camera.height = to_size(source, height, need(source, root, height).as<std::string>(""));
  if (const YAML::Node name = root["camera_name"]; name && name.IsScalar()) {
    camera.name = name.Scalar();
  }
  const std::string k = key_of(root, {"camera_matrix", "k", "K"});
  const YAML::Node matrix = need(source, root, k);
  if (k == "camera_matrix" && !matrix.IsMap()) {
    throw source.bad("camera_matrix", "has no rows, cols and data", "see ROS camera_info files");
  }
  const std::string matrix_key = matrix.IsMap() ? k + ".data" : k;
  set_matrix(source, matrix_key, data_of(source, k, matrix), camera);
  check_values(source, camera, matrix_key);
  const std::string model = need(source, root, "distortion_model").as<std::string>("");
  const std::string key = key_of(root, {"distortion_coefficients", "d", "D"});
  const std::vector<double> d = data_of(source, key, need(source, root, key));
  if (model == "plumb_bob") {
    set_polynomial(source, key, d, DistortionModel::kPlumbBob, camera);
  } else if (model == "rational_polynomial") {
    set_polynomial(source, key, d, DistortionModel::kRationalPolynomial, camera);
  } else if (model == "equidistant" || model == "fisheye") {
    set_equidistant(source, key, d, camera);
  } else {
    throw source.bad("distortion_model", fmt::format("'{}' is not known", model),
                     "known: plumb_bob, rational_polynomial, equidistant");
  }
  return camera;
}

CameraModel read_kalibr(const Source& source, const std::string& name, const YAML::Node& root) {
  CameraModel camera;
  camera.name = name;
  if (const YAML::Node model = root["camera_model"];
      model && model.as<std::string>("") != "pinhole") {
    throw source.bad(name + ".camera_model",
                     fmt::format("'{}' is not known", model.as<std::string>("")),
                     "only pinhole is supported");
  }
  const std::vector<double> k =
      to_numbers(source, name + ".intrinsics", need(source, root, "intrinsics"));
  if (k.size() != 4) {
    throw source.bad(name + ".intrinsics", fmt::format("has {} numbers", k.size()),
                     "pinhole has 4: fx fy cx cy");
  }
  camera.fx = k[0];
  camera.fy = k[1];
  camera.cx = k[2];
  camera.cy = k[3];
  check_values(source, camera, name + ".intrinsics");
  const YAML::Node resolution = need(source, root, "resolution");
  if (!resolution.IsSequence() || resolution.size() != 2) {
    throw source.bad(name + ".resolution", "is not [width, height]", "write [width, height]");
  }
  camera.width = to_size(source, name + ".resolution", resolution[0].as<std::string>(""));
  camera.height = to_size(source, name + ".resolution", resolution[1].as<std::string>(""));
  const std::string model = need(source, root, "distortion_model").as<std::string>("");
  const std::string key = name + ".distortion_coeffs";
  if (model == "none") return camera;
  const std::vector<double> d = to_numbers(source, key, need(source, root, "distortion_coeffs"));
  if (model == "radtan" || model == "plumb_bob") {
    set_polynomial(source, key, d, DistortionModel::kPlumbBob, camera);
  } else if (model == "equidistant" || model == "equi") {
    set_equidistant(source, key, d, camera);
  } else {
    throw source.bad(name + ".distortion_model", fmt::format("'{}' is not known", model),
                     "known: radtan, equidistant, none");
  }
  return camera;
}

}  // namespace kinescope::camera_file
