// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/tag_detector.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>

#include "calib/vision/apriltag_families.h"
#include "calib/vision/aruco_dictionaries.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// Tables of corrected codes grow with codes x bits^2; beyond this they take gigabytes.
constexpr std::uint32_t kMaxCodesForTwoBits = 5000;

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
  ArucoDetector(cv::Ptr<cv::aruco::Dictionary> dictionary, const DetectorOptions& options)
      : dictionary_(std::move(dictionary)), parameters_(cv::aruco::DetectorParameters::create()) {
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
  std::ranges::copy(aruco_dictionary_names(), std::back_inserter(names));
  return names;
}

Error unknown_family(const std::string& family) {
  return bad_request(family, "no such marker family",
                     fmt::format("known: {}", fmt::join(known_families(), ", ")));
}

TagLayout tag_layout(const std::string& family) {
  if (const auto aruco = aruco_dictionary(family))
    return {.cells = aruco->markerSize + 2, .dark_inside = true};
  const AprilTagFamily april = make_apriltag_family(family);
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
  if (const auto aruco = aruco_dictionary(family))
    return std::make_unique<ArucoDetector>(aruco, options);
  if (!is_apriltag_family(family)) throw unknown_family(family);
  return std::make_unique<AprilTagDetector>(family, options);
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
