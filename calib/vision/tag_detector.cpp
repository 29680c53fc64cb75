// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/tag_detector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>

#include "calib/vision/apriltag_families.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// Tables of corrected codes grow with codes x bits^2; beyond this they take gigabytes.
constexpr std::uint32_t kMaxCodesForTwoBits = 5000;

struct ArucoDictionary {
  std::string_view name;
  cv::aruco::PREDEFINED_DICTIONARY_NAME value;
};

constexpr std::array<ArucoDictionary, 17> kArucoDictionaries = {{
    {"DICT_4X4_50", cv::aruco::DICT_4X4_50},
    {"DICT_4X4_100", cv::aruco::DICT_4X4_100},
    {"DICT_4X4_250", cv::aruco::DICT_4X4_250},
    {"DICT_4X4_1000", cv::aruco::DICT_4X4_1000},
    {"DICT_5X5_50", cv::aruco::DICT_5X5_50},
    {"DICT_5X5_100", cv::aruco::DICT_5X5_100},
    {"DICT_5X5_250", cv::aruco::DICT_5X5_250},
    {"DICT_5X5_1000", cv::aruco::DICT_5X5_1000},
    {"DICT_6X6_50", cv::aruco::DICT_6X6_50},
    {"DICT_6X6_100", cv::aruco::DICT_6X6_100},
    {"DICT_6X6_250", cv::aruco::DICT_6X6_250},
    {"DICT_6X6_1000", cv::aruco::DICT_6X6_1000},
    {"DICT_7X7_50", cv::aruco::DICT_7X7_50},
    {"DICT_7X7_100", cv::aruco::DICT_7X7_100},
    {"DICT_7X7_250", cv::aruco::DICT_7X7_250},
    {"DICT_7X7_1000", cv::aruco::DICT_7X7_1000},
    {"DICT_ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL},
}};

// OpenCV's names of the AprilTag families. DICT_APRILTAG_36h10 is not in the AprilTag library.
struct Alias {
  std::string_view name;
  std::string_view family;
};
constexpr std::array<Alias, 3> kAliases = {{{"DICT_APRILTAG_16h5", "tag16h5"},
                                            {"DICT_APRILTAG_25h9", "tag25h9"},
                                            {"DICT_APRILTAG_36h11", "tag36h11"}}};

std::string_view resolve_alias(std::string_view family) {
  const auto* found = std::ranges::find(kAliases, family, &Alias::name);
  return found == kAliases.end() ? family : found->family;
}

const ArucoDictionary* find_aruco(std::string_view family) {
  const auto* found = std::ranges::find(kArucoDictionaries, family, &ArucoDictionary::name);
  return found == kArucoDictionaries.end() ? nullptr : found;
}

Error unknown_family(const std::string& family) {
  return bad_request(family, "no such marker family",
                     fmt::format("known: {}", fmt::join(known_families(), ", ")));
}

struct FreeDetector {
  void operator()(apriltag_detector_t* p) const { apriltag_detector_destroy(p); }
};

class AprilTagDetector final : public TagDetector {
 public:
  AprilTagDetector(std::string_view name, const DetectorOptions& options)
      : options_(options),
        max_hamming_(options.max_hamming.value_or(1)),
        family_(make_apriltag_family(name)) {
    if (max_hamming_ > 1 && family_->ncodes > kMaxCodesForTwoBits) {
      throw bad_request(
          "max_hamming",
          fmt::format("{} bits corrected in {} would take gigabytes of tables", max_hamming_, name),
          "use 0 or 1 with this family");
    }
    detector_.reset(apriltag_detector_create());
    detector_->nthreads = 1;
    detector_->quad_decimate = static_cast<float>(options.decimate);
    detector_->quad_sigma = static_cast<float>(options.blur_sigma);
    detector_->refine_edges = options.refine_edges;
    apriltag_detector_add_family_bits(detector_.get(), family_.get(), max_hamming_);
  }

  std::vector<TagObservation> detect(const ImageView& image) override {
    image_u8_t input = {image.width, image.height, image.stride,
                        const_cast<std::uint8_t*>(image.data)};  // the library only reads it
    const std::unique_ptr<zarray_t, void (*)(zarray_t*)> found(
        apriltag_detector_detect(detector_.get(), &input), apriltag_detections_destroy);
    std::vector<TagObservation> out;
    for (int i = 0; i < zarray_size(found.get()); ++i) {
      apriltag_detection_t* detection = nullptr;
      zarray_get(found.get(), i, static_cast<void*>(&detection));
      if (detection->hamming > max_hamming_) continue;
      if (!(static_cast<double>(detection->decision_margin) >= options_.min_margin)) continue;
      TagObservation tag;
      tag.id = TagId{detection->id};
      tag.hamming = detection->hamming;
      tag.decision_margin = static_cast<double>(detection->decision_margin);
      for (const auto& p : detection->p) tag.corners_px.emplace_back(p[0] - 0.5, p[1] - 0.5);
      out.push_back(std::move(tag));
    }
    sort_detections(out);
    return out;
  }

 private:
  DetectorOptions options_;
  int max_hamming_;
  AprilTagFamily family_;  // outlives the detector, which refers to it
  std::unique_ptr<apriltag_detector_t, FreeDetector> detector_;
};

// The frames are the threads' work. Once: OpenCV rebuilds its pool at every call, which is no safe
// thing to do while another thread detects.
void use_one_thread() {
  [[maybe_unused]] static const bool done = [] {
    cv::setNumThreads(1);
    return true;
  }();
}

// Bits that can be corrected where two codes differ in nine or more: chance then makes one of a
// thousand codes with two wrong bits out of fewer than one in ten thousand squares.
constexpr int kFarApart = 4;

class ArucoDetector final : public TagDetector {
 public:
  ArucoDetector(const ArucoDictionary& dictionary, const DetectorOptions& options)
      : dictionary_(cv::aruco::getPredefinedDictionary(dictionary.value)),
        parameters_(cv::aruco::DetectorParameters::create()) {
    use_one_thread();
    // OpenCV's refinements are no better than its raw corners (about 0.8 px; SUBPIX jumps to the
    // outer rim of narrow white margins): refine_corners() does it.
    parameters_->cornerRefinementMethod = cv::aruco::CORNER_REFINE_NONE;
    // At the default 0.05 the rim of a white margin of one cell counts as the same square and hides
    // the marker.
    parameters_->minMarkerDistanceRate = 0.02;
    const int correctable = dictionary_->maxCorrectionBits;
    const int bits = options.max_hamming.value_or(correctable >= kFarApart ? 2 : 1);
    parameters_->errorCorrectionRate =
        correctable > 0 ? std::min(1.0, static_cast<double>(bits) / correctable) : 0.0;
  }

  std::vector<TagObservation> detect(const ImageView& image) override {
    // OpenCV's detector reads only.
    const cv::Mat input(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.data),
                        static_cast<std::size_t>(image.stride));
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(input, dictionary_, corners, ids, parameters_);
    std::vector<TagObservation> out;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      TagObservation tag;
      tag.id = TagId{ids[i]};
      // OpenCV: left top, right top, right bottom, left bottom of the upright marker.
      for (const std::size_t k : {3U, 2U, 1U, 0U}) {
        tag.corners_px.emplace_back(static_cast<double>(corners[i][k].x),
                                    static_cast<double>(corners[i][k].y));
      }
      out.push_back(std::move(tag));
    }
    sort_detections(out);
    return out;
  }

 private:
  cv::Ptr<cv::aruco::Dictionary> dictionary_;
  cv::Ptr<cv::aruco::DetectorParameters> parameters_;
};

}  // namespace

void sort_detections(std::vector<TagObservation>& tags) {
  std::ranges::sort(tags, [](const TagObservation& a, const TagObservation& b) {
    if (a.frame != b.frame) return a.frame < b.frame;
    if (a.id != b.id) return a.id < b.id;
    return std::ranges::lexicographical_compare(
        a.corners_px, b.corners_px, [](const Eigen::Vector2d& p, const Eigen::Vector2d& q) {
          return p.x() != q.x() ? p.x() < q.x() : p.y() < q.y();
        });
  });
}

std::vector<std::string> known_families() {
  std::vector<std::string> names = apriltag_family_names();
  for (const Alias& alias : kAliases) names.emplace_back(alias.name);
  for (const ArucoDictionary& dictionary : kArucoDictionaries) names.emplace_back(dictionary.name);
  return names;
}

TagLayout tag_layout(const std::string& family) {
  if (const ArucoDictionary* aruco = find_aruco(family)) {
    const int bits = cv::aruco::getPredefinedDictionary(aruco->value)->markerSize;
    return {.cells = bits + 2, .dark_inside = true};
  }
  const AprilTagFamily april = make_apriltag_family(resolve_alias(family));
  if (!april) throw unknown_family(family);
  return {.cells = april->width_at_border, .dark_inside = !april->reversed_border};
}

std::unique_ptr<TagDetector> make_tag_detector(const std::string& family,
                                               const DetectorOptions& options) {
  if (!(options.decimate >= 1.0) || !(options.blur_sigma >= 0.0) ||
      options.max_hamming.value_or(1) < 0 || options.max_hamming.value_or(1) > 2) {
    throw bad_request("detector", "decimate below 1, negative blur or max_hamming outside 0..2",
                      "use decimate 1 or 2, blur 0, max_hamming 1");
  }
  if (const ArucoDictionary* aruco = find_aruco(family)) {
    return std::make_unique<ArucoDetector>(*aruco, options);
  }
  const std::string_view april = resolve_alias(family);
  if (!is_apriltag_family(april)) throw unknown_family(family);
  return std::make_unique<AprilTagDetector>(april, options);
}

std::vector<TagObservation> detect_with_both(TagDetector& fine, TagDetector& coarse,
                                             const ImageView& image) {
  const auto middle = [](const TagObservation& tag) -> Eigen::Vector2d {
    return 0.25 * (tag.corners_px[0] + tag.corners_px[1] + tag.corners_px[2] + tag.corners_px[3]);
  };
  std::vector<TagObservation> out = fine.detect(image);
  const std::size_t count = out.size();
  for (TagObservation& tag : coarse.detect(image)) {
    const double near = 0.5 * (tag.corners_px[0] - tag.corners_px[2]).norm();
    const bool known = std::any_of(
        out.begin(), out.begin() + static_cast<std::ptrdiff_t>(count), [&](const auto& other) {
          return other.id == tag.id && (middle(other) - middle(tag)).norm() < near;
        });
    if (!known) out.push_back(std::move(tag));
  }
  sort_detections(out);
  return out;
}

}  // namespace kinescope
