// SPDX-License-Identifier: Apache-2.0
#include <optional>

#include <fmt/format.h>
#include <tinyxml2.h>

#include "calib/camera/camera_formats.h"

namespace kinescope::camera_file {
namespace {

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

}  // namespace

CameraModel read_opencv_yaml(const Source& source, const YAML::Node& root) {
  return read_opencv(source, YamlStorage(source, root));
}

CameraModel read_opencv_xml(const Source& source, const std::string& text) {
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

}  // namespace kinescope::camera_file
