// SPDX-License-Identifier: Apache-2.0
#include "app/capture/guide.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr int kWidth = 400;
constexpr int kHeight = 300;

struct Square {
  int left = 150;
  int top = 100;
  int edge = 80;
  double ramp_px = 1.0;  // over which its border goes from dark to bright
  double dark = 30.0;
  double bright = 200.0;
  double squeezed = 1.0;  // its height, of its width
};

GreyImage picture_of(const Square& s) {
  GreyImage out{kWidth, kHeight, {}};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double inside =
          std::min(std::min<double>(x - s.left + 0.5, s.left + s.edge - 0.5 - x),
                   std::min<double>(y - s.top + 0.5, s.top + s.squeezed * s.edge - 0.5 - y));
      const double share = std::clamp(0.5 - inside / s.ramp_px, 0.0, 1.0);
      out.pixels.push_back(static_cast<std::uint8_t>(s.dark + share * (s.bright - s.dark)));
    }
  }
  return out;
}

TagObservation corners_of(const Square& s, int id = 4) {
  const double l = s.left - 0.5;
  const double t = s.top - 0.5;
  const double r = l + s.edge;
  const double b = t + s.squeezed * s.edge;
  TagObservation out;
  out.id = TagId{id};
  out.corners_px = {{l, b}, {r, b}, {r, t}, {l, t}};
  return out;
}

FrameView view_of(const Square& square) {
  const GreyImage image = picture_of(square);
  const TagObservation tag = corners_of(square);
  return look_at_frame(image.view(), {&tag, 1});
}

bool says(const std::vector<std::string>& lines, std::string_view words) {
  return std::ranges::any_of(
      lines, [&](const std::string& line) { return line.find(words) != std::string::npos; });
}

TEST(CaptureGuide, RefusesViewsOfNoUse) {
  EXPECT_EQ(view_of({}).refusal, Refusal::kNone);
  EXPECT_EQ(view_of({.edge = 15}).refusal, Refusal::kSmall);
  EXPECT_EQ(view_of({.squeezed = 0.2}).refusal, Refusal::kEdgeOn);
  EXPECT_EQ(view_of({.ramp_px = 12.0}).refusal, Refusal::kBlurred);
  EXPECT_EQ(view_of({.dark = 10.0, .bright = 45.0}).refusal, Refusal::kDark);
  EXPECT_EQ(view_of({.bright = 255.0}).refusal, Refusal::kClipped);
}

TEST(CaptureGuide, SaysWhyNoMarkerIsSeen) {
  const auto refusal = [](double dark, double bright) {
    const GreyImage image = picture_of({.dark = dark, .bright = bright});
    return look_at_frame(image.view(), {}).refusal;
  };
  EXPECT_EQ(refusal(30.0, 200.0), Refusal::kNoMarker);
  EXPECT_EQ(refusal(2.0, 20.0), Refusal::kDark);
  EXPECT_EQ(refusal(240.0, 255.0), Refusal::kClipped);
}

TEST(CaptureGuide, TiltIsThatOfWeakPerspective) {
  for (const double tilt_deg : {0.0, 30.0, 60.0}) {
    const double squeezed = std::cos(tilt_deg * std::numbers::pi / 180.0);
    std::vector<Eigen::Vector2d> corners = corners_of({.squeezed = squeezed}).corners_px;
    const Eigen::Rotation2Dd turn(0.7);  // in the image: no tilt
    for (Eigen::Vector2d& corner : corners) corner = turn * corner;
    constexpr double kTolerance_deg = 1e-5;  // the arc cosine near 1
    EXPECT_NEAR(tilt_of_square_deg(corners), tilt_deg, kTolerance_deg);
  }
}

TEST(CaptureGuide, CountsWhatIsOfUseAlone) {
  CaptureGuide guide;
  add_frame(guide, view_of({}));
  add_frame(guide, view_of({.left = 20, .top = 20, .ramp_px = 12.0}));
  EXPECT_EQ(guide.frames, 2);
  EXPECT_EQ(guide.used, 1);
  EXPECT_EQ(guide.refused.at(Refusal::kBlurred), 1);
  EXPECT_EQ(guide.markers.at(TagId{4}).frames, 2);
  EXPECT_EQ(guide.markers.at(TagId{4}).used, 1);
  EXPECT_EQ(std::ranges::count_if(guide.grid, [](int n) { return n > 0; }), 4)
      << "the corners of the sharp one";
}

TEST(CaptureGuide, SaysWhatIsMissing) {
  CaptureGuide guide;
  Declared declared;
  declared.joints = true;
  declared.markers.sizes_m = {{TagId{4}, 0.04}, {TagId{9}, 0.04}};
  EXPECT_TRUE(says(what_is_missing(guide, declared), "no marker of family tag36h11 is seen"));
  add_frame(guide, view_of({}));
  EXPECT_TRUE(says(what_is_missing(guide, declared), "no marker is seen in 5 frames or more"));
  for (int i = 0; i < 10; ++i) add_frame(guide, view_of({}));
  std::vector<std::string> missing = what_is_missing(guide, declared);
  EXPECT_TRUE(says(missing, "tag 9 is listed in tags.yaml but was not seen"));
  EXPECT_TRUE(says(missing, "one marker only"));
  EXPECT_TRUE(says(missing, "no joint value came"));
  EXPECT_TRUE(says(missing, "cover 5 % of the image"));
  EXPECT_TRUE(says(missing, "tilted by 0 degrees at most"));
  add_joint_values(guide, {"arm", "lift"}, std::vector{0.1, 0.5});
  add_joint_values(guide, {"arm", "lift"}, std::vector{1.1, 0.5});
  missing = what_is_missing(guide, declared);
  EXPECT_FALSE(says(missing, "no joint value came"));
  EXPECT_FALSE(says(missing, "'arm'"));
  EXPECT_TRUE(says(missing, "channel 'lift' never changes"));
}

TEST(CaptureGuide, ALensThatIsKnownNeedsNoCoverage) {
  CaptureGuide guide;
  for (int i = 0; i < 10; ++i) {
    for (const int id : {1, 2}) {
      FrameView view = view_of({});
      view.markers.front().tag.id = TagId{id};
      add_frame(guide, view);
    }
  }
  EXPECT_EQ(what_is_missing(guide, {MarkerSet{}, true, false}), std::vector<std::string>{});
  EXPECT_EQ(what_is_missing(guide, {}).size(), 2U);
}

TEST(CaptureGuide, WhatIsOfUseTooSeldomIsSaid) {
  CaptureGuide guide;
  for (int i = 0; i < 10; ++i) add_frame(guide, view_of({.squeezed = i == 0 ? 1.0 : 0.2}));
  EXPECT_TRUE(says(what_is_missing(guide, {}), "tag 4 is of use in 1 of its 10 frames only"));
}

}  // namespace
}  // namespace kinescope
