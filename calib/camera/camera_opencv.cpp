// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>
#include <initializer_list>
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

enum class Lens { kPolynomial, kFisheye };

/// A model's name, of the lens or of the whole camera; nothing for "pinhole", which leaves the lens
/// open.
std::optional<Lens> lens_of(const Source& source, const std::string& key, const std::string& said) {
  std::string name = said;
  std::ranges::transform(name, name.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const auto is_one_of = [&](std::initializer_list<std::string_view> names) {
    return std::ranges::find(names, name) != names.end();
  };
  if (name.empty() || name == "pinhole") return std::nullopt;
  if (is_one_of({"plumb_bob", "radtan", "rational_polynomial", "rational", "brown_conrady"})) {
    return Lens::kPolynomial;
  }
  if (is_one_of({"fisheye", "equidistant", "equi", "kannala_brandt", "kannala_brandt4"})) {
    return Lens::kFisheye;
  }
  throw source.bad(key, fmt::format("'{}' is not known", said),
                   "known: plumb_bob, rational_polynomial, equidistant (fisheye)");
}

/// What the file says of its lens, in whichever of its keys; a polynomial where it says nothing, as
/// OpenCV does.
Lens declared_lens(const Source& source, const Storage& storage) {
  std::optional<Lens> lens;
  std::string said;
  const auto add = [&](const std::string& key, std::optional<Lens> other) {
    if (!other) return;
    if (lens && *lens != *other) {
      throw source.bad(key, fmt::format("contradicts {}", said), "keep the one that is right");
    }
    lens = other;
    said = key;
  };
  for (const char* key : {"distortion_model", "camera_model"}) {
    if (const auto name = storage.scalar(key)) add(key, lens_of(source, key, *name));
  }
  const auto [flag, key] = first_of({"fisheye_model", "fisheye"},
                                    [&](const std::string& k) { return storage.scalar(k); });
  if (flag) add(key, *flag == "1" || *flag == "true" ? Lens::kFisheye : Lens::kPolynomial);
  return lens.value_or(Lens::kPolynomial);
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
  if (declared_lens(source, storage) == Lens::kFisheye) {
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
