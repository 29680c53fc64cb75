// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/tag_detector.h"

#include <algorithm>
#include <array>

#include <gtest/gtest.h>
#include <opencv2/aruco.hpp>

#include "calib/vision/refine_corners.h"
#include "calib/vision/tag_pattern.h"
#include "kinematics/core/error.h"
#include "tests/truth/render.h"

namespace kinescope {
namespace {

constexpr double kCoarse = 2.0;    // px, raw corners of the detectors
constexpr double kRefined = 0.08;  // px, about 5 sigma at 70 px side and noise 2

CameraModel small_camera() { return pinhole_guess(240, 200, 600.0); }

PlacedMarker upright(MarkerArt art, double side_px = 70.0) {
  PlacedMarker marker;
  marker.art = std::move(art);
  marker.T_camera_tag =
      pose_showing(small_camera(), {121.3, 98.6}, side_px, marker.size_m, 0.0, 0.0, 0.0);
  return marker;
}

// The corners of a marker upright in front of the camera are lb, rb, rt, lt; and refined they are
// exact.
void expect_found(const std::string& family, const PlacedMarker& marker, int id) {
  Rng rng = Rng::from_name(family);
  const GreyImage image = render_markers(small_camera(), {marker}, {.supersample = 6}, rng);
  const auto found = make_tag_detector(family)->detect(image.view());
  ASSERT_EQ(found.size(), 1U) << family;
  EXPECT_EQ(found[0].id, TagId{id}) << family;
  const auto truth = true_corners(small_camera(), marker);
  Corners start;
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LT((found[0].corners_px[i] - truth[i]).norm(), kCoarse) << family << " corner " << i;
    start[i] = found[0].corners_px[i];
  }
  EXPECT_LT(truth[0].x(), truth[1].x());  // lb left of rb
  EXPECT_GT(truth[0].y(), truth[3].y());  // lb below lt
  const CameraModel lens = small_camera();
  const RefinedCorners refined =
      refine_corners(image.view(), start, tag_layout(family), ToneCurve(), &lens);
  ASSERT_EQ(refined.status, RefineStatus::kDone) << family;
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LT((refined.corners_px[i] - truth[i]).norm(), kRefined) << family << " corner " << i;
  }
}

TEST(TagDetector, EveryAprilTagFamilyIsReadBack) {
  for (const char* family :
       {"tag36h11", "tag36h10", "tag25h9", "tag16h5", "tagStandard41h12", "tagStandard52h13",
        "tagCircle21h7", "tagCircle49h12", "tagCustom48h12"}) {
    expect_found(family, upright(apriltag_art(family, 7)), 7);
  }
}

TEST(TagDetector, EveryArucoDictionaryIsReadBackWithAprilTagsCorners) {
  const std::vector<std::pair<std::string, int>> dictionaries = {
      {"DICT_4X4_50", cv::aruco::DICT_4X4_50},
      {"DICT_4X4_1000", cv::aruco::DICT_4X4_1000},
      {"DICT_5X5_100", cv::aruco::DICT_5X5_100},
      {"DICT_6X6_250", cv::aruco::DICT_6X6_250},
      {"DICT_7X7_1000", cv::aruco::DICT_7X7_1000},
      {"DICT_ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL}};
  for (const auto& [name, value] : dictionaries) {
    expect_found(name, upright(aruco_art(value, 11)), 11);
  }
}

TEST(TagDetector, OpenCvsNamesOfAprilTagsGoToTheAprilTagLibrary) {
  expect_found("DICT_APRILTAG_36h11", upright(apriltag_art("tag36h11", 3)), 3);
}

TEST(TagDetector, MarkersTurnedInTheImageKeepTheirCorners) {
  for (const double turn : {0.4, 1.9, 3.1, -1.2}) {
    for (const bool aruco : {false, true}) {
      PlacedMarker marker =
          upright(aruco ? aruco_art(cv::aruco::DICT_6X6_250, 5) : apriltag_art("tag36h11", 5));
      marker.T_camera_tag =
          pose_showing(small_camera(), {120.0, 100.0}, 80.0, marker.size_m, 0.5, 0.7, turn);
      Rng rng = Rng::from_name("turned");
      const GreyImage image = render_markers(small_camera(), {marker}, {.supersample = 6}, rng);
      const auto found =
          make_tag_detector(aruco ? "DICT_6X6_250" : "tag36h11")->detect(image.view());
      ASSERT_EQ(found.size(), 1U);
      const auto truth = true_corners(small_camera(), marker);
      for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_LT((found[0].corners_px[i] - truth[i]).norm(), kCoarse) << aruco << turn << i;
      }
    }
  }
}

// Two cells of the code are wrong: dust, a glint.
TEST(TagDetector, CorrectsAsManyBitsAsTheCodesAllow) {
  const auto found = [](const std::string& family, MarkerArt art, DetectorOptions options = {}) {
    const int inside = (art.total_cells - art.border_cells) / 2 + 2;
    for (const int column : {inside, inside + 1}) {
      const auto wrong = static_cast<std::size_t>(inside * art.total_cells + column);
      art.white[wrong] = !art.white[wrong];
    }
    Rng rng = Rng::from_name(family);
    const GreyImage image =
        render_markers(small_camera(), {upright(std::move(art))}, {.supersample = 6}, rng);
    return make_tag_detector(family, options)->detect(image.view()).size();
  };
  EXPECT_EQ(found("DICT_6X6_250", aruco_art(cv::aruco::DICT_6X6_250, 11)), 1U);
  EXPECT_EQ(found("DICT_6X6_250", aruco_art(cv::aruco::DICT_6X6_250, 11), {.max_hamming = 1}), 0U);
  EXPECT_EQ(found("DICT_4X4_50", aruco_art(cv::aruco::DICT_4X4_50, 11)), 0U);
  EXPECT_EQ(found("tag36h11", apriltag_art("tag36h11", 11)), 0U);
  EXPECT_EQ(found("tag36h11", apriltag_art("tag36h11", 11), {.max_hamming = 2}), 1U);
}

class Told final : public TagDetector {
 public:
  explicit Told(std::vector<TagObservation> tags) : tags_(std::move(tags)) {}
  std::vector<TagObservation> detect(const ImageView& /*image*/) override { return tags_; }

 private:
  std::vector<TagObservation> tags_;
};

TEST(TagDetector, WhatEitherSearchFindsIsFoundOnce) {
  const auto tag = [](int id, double x, double margin) {
    TagObservation out;
    out.id = TagId{id};
    out.decision_margin = margin;
    out.corners_px = {{x, 50.0}, {x + 20.0, 50.0}, {x + 20.0, 30.0}, {x, 30.0}};
    return out;
  };
  Told fine({tag(1, 10.0, 1.0), tag(1, 200.0, 1.0)});
  Told coarse({tag(1, 10.4, 2.0), tag(1, 100.0, 2.0), tag(2, 200.0, 2.0)});
  const std::vector<TagObservation> found = detect_with_both(fine, coarse, ImageView{});
  ASSERT_EQ(found.size(), 4U);
  EXPECT_EQ(found[0].decision_margin, 1.0);  // at 10
  EXPECT_EQ(found[1].decision_margin, 2.0);  // at 100
  EXPECT_EQ(found[2].decision_margin, 1.0);  // at 200
  EXPECT_EQ(found[3].id, TagId{2});
}

TEST(TagDetector, KnowsItsFamiliesAndRefusesOthers) {
  for (const std::string& family : known_families()) {
    EXPECT_GE(tag_layout(family).cells, 5) << family;
  }
  try {
    (void)make_tag_detector("tag99h1");
    FAIL() << "took an unknown family";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadRequest);
    EXPECT_NE(std::string(error.what()).find("tagStandard41h12"), std::string::npos);
  }
  EXPECT_THROW((void)tag_layout(""), Error);
  EXPECT_THROW((void)make_tag_detector("tag36h11", {.decimate = 0.5}), Error);
  EXPECT_THROW((void)make_tag_detector("tag36h11", {.decimate = std::nan("")}), Error);
  EXPECT_THROW((void)make_tag_detector("tagCircle49h12", {.max_hamming = 2}), Error);
}

// A marker as it is printed, on white paper: 16 px a cell.
TEST(TagDetector, EveryPatternIsReadBackWithItsCornersWhereItsEdgeEnds) {
  constexpr int kPxPerCell = 16;
  constexpr int kPaper = 3;  // cells around it
  constexpr int kId = 5;
  for (const std::string& family : known_families()) {
    const TagPattern pattern = tag_pattern(family, kId);
    EXPECT_EQ(pattern.edge, tag_layout(family).cells) << family;
    const int side = kPxPerCell * (pattern.cells + 2 * kPaper);
    GreyImage image{side, side,
                    std::vector<std::uint8_t>(static_cast<std::size_t>(side * side), 255)};
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const int row = y / kPxPerCell - kPaper;
        const int column = x / kPxPerCell - kPaper;
        if (std::min(row, column) < 0 || std::max(row, column) >= pattern.cells) continue;
        const auto cell = static_cast<std::size_t>(row * pattern.cells + column);
        image.pixels[static_cast<std::size_t>(y * side + x)] = pattern.bright[cell] ? 255 : 0;
      }
    }
    const auto found = make_tag_detector(family)->detect(image.view());
    const double first = kPxPerCell * (kPaper + pattern.margin()) - 0.5;
    const double last = first + kPxPerCell * pattern.edge;
    const std::array<Eigen::Vector2d, 4> corners{
        Eigen::Vector2d(first, last), {last, last}, {last, first}, {first, first}};
    // Without any blur OpenCV takes a line within the border for a second border.
    double nearest = side;
    for (const TagObservation& tag : found) {
      EXPECT_EQ(tag.id, TagId{kId}) << family;
      double farthest = 0.0;
      for (std::size_t i = 0; i < corners.size(); ++i)
        farthest = std::max(farthest, (tag.corners_px[i] - corners[i]).norm());
      nearest = std::min(nearest, farthest);
    }
    EXPECT_LT(nearest, kCoarse) << family;
  }
  EXPECT_THROW((void)tag_pattern("tag36h11", 587), Error);
  EXPECT_THROW((void)tag_pattern("DICT_4X4_50", 50), Error);
  EXPECT_THROW((void)tag_pattern("tag36h11", -1), Error);
  EXPECT_THROW((void)tag_pattern("tag36h12", 1), Error);
}

TEST(TagDetector, NothingInAnEmptyImage) {
  GreyImage image{100, 80, std::vector<std::uint8_t>(8000, 128)};
  EXPECT_TRUE(make_tag_detector("tag36h11")->detect(image.view()).empty());
  EXPECT_TRUE(make_tag_detector("DICT_4X4_50")->detect(image.view()).empty());
}

}  // namespace
}  // namespace kinescope
