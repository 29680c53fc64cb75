// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/camera_file.h"

#include <cmath>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <tinyxml2.h>
#include <yaml-cpp/yaml.h>

#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

constexpr std::string_view kKnownFiles =
    "ROS camera_info, Kalibr camchain and OpenCV storage files are read";

// One key of the file, for messages: "file: key".
struct Source {
  std::string file;
  [[nodiscard]] Error bad(std::string_view key, std::string_view what,
                          std::string_view remedy) const {
    return bad_input(file, fmt::format("{}: {}", key, what), remedy);
  }
};

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

// Distortion of the polynomial models by number of terms; more than eight only where the rest are
// zero.
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

CameraModel read_ros(const Source& source, const YAML::Node& root) {
  CameraModel camera;
  camera.width =
      to_size(source, "image_width", need(source, root, "image_width").as<std::string>(""));
  camera.height =
      to_size(source, "image_height", need(source, root, "image_height").as<std::string>(""));
  if (const YAML::Node name = root["camera_name"]; name && name.IsScalar()) {
    camera.name = name.Scalar();
  }
  const YAML::Node matrix = need(source, root, "camera_matrix");
  if (!matrix.IsMap()) {
    throw source.bad("camera_matrix", "has no rows, cols and data", "see ROS camera_info files");
  }
  set_matrix(source, "camera_matrix.data",
             to_numbers(source, "camera_matrix.data", need(source, matrix, "data")), camera);
  check_values(source, camera, "camera_matrix.data");
  const std::string model = need(source, root, "distortion_model").as<std::string>("");
  const YAML::Node coefficients = need(source, root, "distortion_coefficients");
  const std::string key = "distortion_coefficients.data";
  const std::vector<double> d = to_numbers(
      source, key, coefficients.IsMap() ? need(source, coefficients, "data") : coefficients);
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

// What OpenCV's FileStorage holds, whether YAML or XML: matrices and scalars by key.
class Storage {
 public:
  virtual ~Storage() = default;
  [[nodiscard]] virtual std::optional<std::vector<double>> matrix(const std::string& key) const = 0;
  [[nodiscard]] virtual std::optional<std::string> scalar(const std::string& key) const = 0;
};

class YamlStorage final : public Storage {
 public:
  YamlStorage(const Source& source, const YAML::Node& root) : source_(source), root_(root) {}
  std::optional<std::vector<double>> matrix(const std::string& key) const override {
    const YAML::Node node = root_[key];
    if (!node) return std::nullopt;
    if (node.IsSequence()) return to_numbers(source_, key, node);
    if (!node.IsMap()) return std::nullopt;
    return to_numbers(source_, key + ".data", need(source_, node, "data"));
  }
  std::optional<std::string> scalar(const std::string& key) const override {
    const YAML::Node node = root_[key];
    if (!node || !node.IsScalar()) return std::nullopt;
    return node.Scalar();
  }

 private:
  const Source& source_;
  YAML::Node root_;
};

class XmlStorage final : public Storage {
 public:
  XmlStorage(const Source& source, const tinyxml2::XMLElement& root)
      : source_(source), root_(root) {}
  std::optional<std::vector<double>> matrix(const std::string& key) const override {
    const tinyxml2::XMLElement* node = root_.FirstChildElement(key.c_str());
    if (node == nullptr) return std::nullopt;
    const tinyxml2::XMLElement* data = node->FirstChildElement("data");
    const char* text = (data != nullptr ? data : node)->GetText();
    if (text == nullptr) return std::vector<double>();
    std::vector<double> out;
    const std::string_view all = text;
    constexpr std::string_view kBlank = " \t\r\n";
    std::size_t begin = all.find_first_not_of(kBlank);
    while (begin != std::string_view::npos) {
      const std::size_t end = all.find_first_of(kBlank, begin);
      out.push_back(to_number(source_, key, std::string(all.substr(begin, end - begin))));
      begin = end == std::string_view::npos ? end : all.find_first_not_of(kBlank, end);
    }
    return out;
  }
  std::optional<std::string> scalar(const std::string& key) const override {
    const tinyxml2::XMLElement* node = root_.FirstChildElement(key.c_str());
    if (node == nullptr || node->GetText() == nullptr) return std::nullopt;
    return node->GetText();
  }

 private:
  const Source& source_;
  const tinyxml2::XMLElement& root_;
};

// Names that OpenCV's samples and their users give to one thing.
template <typename Get>
auto first_of(const std::vector<std::string>& keys, Get get) {
  decltype(get(keys.front())) found;
  std::string key = keys.front();
  for (const std::string& candidate : keys) {
    found = get(candidate);
    if (found) {
      key = candidate;
      break;
    }
  }
  return std::pair(std::move(found), std::move(key));
}

CameraModel read_opencv(const Source& source, const Storage& storage) {
  const auto matrix = [&](const std::string& key) { return storage.matrix(key); };
  const auto scalar = [&](const std::string& key) { return storage.scalar(key); };
  CameraModel camera;
  const auto [k, k_key] = first_of(
      {"camera_matrix", "Camera_Matrix", "cameraMatrix", "CameraMatrix", "K", "M", "M1"}, matrix);
  if (!k) throw source.bad("camera_matrix", "is missing", std::string(kKnownFiles));
  set_matrix(source, k_key, *k, camera);
  check_values(source, camera, k_key);
  const auto [d, d_key] = first_of({"distortion_coefficients", "Distortion_Coefficients",
                                    "distCoeffs", "dist_coeffs", "DistCoeffs", "D", "D1"},
                                   matrix);
  if (!d) throw source.bad("distortion_coefficients", "is missing", std::string(kKnownFiles));
  const auto fisheye = scalar("fisheye_model");
  if (fisheye && *fisheye == "1") {
    set_equidistant(source, d_key, *d, camera);
  } else {
    set_polynomial(
        source, d_key, *d,
        d->size() > 5 ? DistortionModel::kRationalPolynomial : DistortionModel::kPlumbBob, camera);
  }
  const auto [width, width_key] = first_of({"image_width", "image_Width", "width"}, scalar);
  const auto [height, height_key] = first_of({"image_height", "image_Height", "height"}, scalar);
  if (width.has_value() != height.has_value()) {
    throw source.bad(width ? height_key : width_key, "is missing", "give both or none");
  }
  if (width) {
    camera.width = to_size(source, width_key, *width);
    camera.height = to_size(source, height_key, *height);
  }
  return camera;
}

CameraModel read_xml(const Source& source, const std::string& text) {
  tinyxml2::XMLDocument document;
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
    throw bad_input(fmt::format("{}:{}", source.file, document.ErrorLineNum()), "not XML",
                    std::string(kKnownFiles));
  }
  const tinyxml2::XMLElement* root = document.FirstChildElement("opencv_storage");
  if (root == nullptr) {
    throw source.bad("opencv_storage", "is missing", std::string(kKnownFiles));
  }
  return read_opencv(source, XmlStorage(source, *root));
}

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

bool is_opencv_yaml(const std::string& text) {
  return text.starts_with("%YAML:") || text.find("!!opencv-matrix") != std::string::npos;
}

}  // namespace

CameraModel read_camera(const std::filesystem::path& path) {
  constexpr std::uintmax_t kLargest = 1U << 24U;
  const std::string text = read_text_file(path, kLargest);
  const Source source{path.string()};
  const std::size_t first = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  if (first == std::string::npos)
    throw bad_input(source.file, "is empty", std::string(kKnownFiles));
  if (text[first] == '<') return read_xml(source, text);
  const YAML::Node root = parse_yaml(source, text);
  try {
    if (is_opencv_yaml(text)) return read_opencv(source, YamlStorage(source, root));
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

CameraModel with_image_size(CameraModel camera, int width, int height, const std::string& source) {
  if (camera.width == 0 && camera.height == 0) {
    camera.width = width;
    camera.height = height;
    return camera;
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
