// SPDX-License-Identifier: Apache-2.0
#include "app/capture/guide.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include <Eigen/SVD>
#include <fmt/format.h>

#include "calib/vision/detect.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr double kWhite = 255.0;

/// Singular values of the affine map from the unit square to the corners, px.
Eigen::Vector2d widths_px(std::span<const Eigen::Vector2d> c) {
  if (c.size() != 4) return Eigen::Vector2d::Zero();
  Eigen::Matrix2d map;
  map.col(0) = 0.5 * (c[1] - c[0] + c[2] - c[3]);
  map.col(1) = 0.5 * (c[3] - c[0] + c[2] - c[1]);
  return Eigen::JacobiSVD<Eigen::Matrix2d>(map).singularValues();
}

Refusal refusal_of(const MarkerView& view, bool clipped) {
  if (view.edge_px < kSmallMarkerPx) return Refusal::kSmall;
  if (widths_px(view.tag.corners_px)[1] < kSmallMarkerPx) return Refusal::kEdgeOn;
  if (view.contrast > 0.0 && view.contrast < kLowContrast) return Refusal::kDark;
  if (view.blur_px > kBlurredPx) return Refusal::kBlurred;
  return clipped ? Refusal::kClipped : Refusal::kNone;
}

MarkerView look_at_marker(const ImageView& image, const TagObservation& tag) {
  MarkerEdges edges;
  add_edges(edges, image, tag);
  MarkerView out{.tag = tag,
                 .edge_px = median_of(edges.edges_px),
                 .tilt_deg = tilt_of_square_deg(tag.corners_px)};
  if (edges.contrasts.empty()) {  // at the image's rim
    out.refusal = refusal_of(out, false);
    return out;
  }
  out.contrast = median_of(edges.contrasts);
  out.blur_px = median_of(edges.blurs_px);
  const bool clipped =
      std::ranges::all_of(edges.brights, [](double grey) { return grey >= kWhite; });
  out.refusal = refusal_of(out, clipped);
  return out;
}

/// No marker could have the contrast that is asked for: all but single pixels are as dark or as
/// bright as that.
Refusal without_markers(const ImageView& image) {
  std::array<int, 256> histogram{};
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* row = image.data + static_cast<std::ptrdiff_t>(image.stride) * y;
    for (int x = 0; x < image.width; ++x) ++histogram[row[x]];
  }
  const double total = static_cast<double>(image.width) * image.height;
  constexpr double kSinglePixels = 0.001;
  double below = 0.0;
  double above = 0.0;
  for (std::size_t grey = 0; grey < histogram.size(); ++grey) {
    if (static_cast<double>(grey) > kLowContrast) above += histogram[grey];
    if (static_cast<double>(grey) < kWhite - kLowContrast) below += histogram[grey];
  }
  if (above < kSinglePixels * total) return Refusal::kDark;
  if (below < kSinglePixels * total) return Refusal::kClipped;
  return Refusal::kNoMarker;
}

/// Of a frame in which every view is refused: the reason of most of them.
Refusal most_frequent(const std::vector<MarkerView>& markers) {
  std::map<Refusal, int> counts;
  for (const MarkerView& view : markers) ++counts[view.refusal];
  if (counts.contains(Refusal::kNone)) return Refusal::kNone;
  return std::ranges::max_element(counts, {}, [](const auto& one) { return one.second; })->first;
}

void add_marker_words(const CaptureGuide& guide, const Declared& declared,
                      std::vector<std::string>& out) {
  const int least = DetectOptions{}.min_sightings;
  std::size_t known = 0;
  for (const auto& [id, tally] : guide.markers) {
    if (declared.markers.only_listed && !declared.markers.sizes_m.contains(id)) continue;
    if (tally.frames < least) continue;  // may be no marker at all
    ++known;
    for (std::string& advice : marker_advice(id, median_of(tally.edges_px),
                                             median_of(tally.blurs_px), median_of(tally.contrasts)))
      out.push_back(std::move(advice));
    if (tally.used < least) {
      out.push_back(fmt::format("tag {} is of use in {} of its {} frames only: show it for longer",
                                id.value, tally.used, tally.frames));
    }
  }
  for (const auto& [id, size] : declared.markers.sizes_m) {
    if (!guide.markers.contains(id)) out.push_back(listed_but_not_seen(id, guide.frames));
  }
  if (known == 0) {
    out.push_back(
        fmt::format("no marker is seen in {} frames or more: show each for longer", least));
  }
  if (known == 1) out.emplace_back(kOneMarkerOnly);
}

/// Without camera.yaml the lens is found from the markers, which must show all of it.
void add_lens_words(const CaptureGuide& guide, std::vector<std::string>& out) {
  const double covered = covered_share(guide.grid);
  if (covered < kGoodCoverage) {
    out.push_back(
        fmt::format("markers cover {:.0f} % of the image: without a camera.yaml the lens is found "
                    "from them; move them to the image's rim, above all at the {} side",
                    100.0 * covered, emptiest_side(guide.grid)));
  }
  if (guide.most_tilt_deg() < kGoodTilt_deg) {
    out.push_back(
        fmt::format("markers were tilted by {:.0f} degrees at most: without a camera.yaml the "
                    "focal length is found from their perspective; tilt them by 30 to 50 degrees",
                    guide.most_tilt_deg()));
  }
}

void add_joint_words(const CaptureGuide& guide, const Declared& declared,
                     std::vector<std::string>& out) {
  if (!declared.joints) return;
  if (guide.rows == 0) {
    out.emplace_back("no joint value came: does the program that sends them run, and flush?");
  }
  for (const ChannelTally& channel : guide.channels) {
    if (auto advice = channel_advice(channel.name, guess_unit(channel.span), channel.span))
      out.push_back(std::move(*advice));
  }
}

}  // namespace

std::string_view to_string(Refusal refusal) {
  switch (refusal) {
    case Refusal::kNone:
      return "";
    case Refusal::kNoMarker:
      return "no marker";
    case Refusal::kSmall:
      return "marker too small";
    case Refusal::kEdgeOn:
      return "marker edge on";
    case Refusal::kBlurred:
      return "blurred";
    case Refusal::kDark:
      return "too dark";
    case Refusal::kClipped:
      return "overexposed";
  }
  return "";
}

double tilt_of_square_deg(std::span<const Eigen::Vector2d> corners_px) {
  const Eigen::Vector2d widths = widths_px(corners_px);
  if (!(widths[0] > 0.0)) return 0.0;
  return std::acos(std::min(1.0, widths[1] / widths[0])) * 180.0 / std::numbers::pi;
}

FrameView look_at_frame(const ImageView& image, std::span<const TagObservation> tags) {
  FrameView out{.width = image.width, .height = image.height, .markers = {}};
  for (const TagObservation& tag : tags) out.markers.push_back(look_at_marker(image, tag));
  out.refusal = tags.empty() ? without_markers(image) : most_frequent(out.markers);
  return out;
}

double CaptureGuide::most_tilt_deg() const {
  double out = 0.0;
  for (const auto& [id, tally] : markers) out = std::max(out, tally.most_tilt_deg);
  return out;
}

void add_frame(CaptureGuide& guide, const FrameView& frame) {
  ++guide.frames;
  if (frame.refusal == Refusal::kNone) {
    ++guide.used;
  } else {
    ++guide.refused[frame.refusal];
  }
  for (const MarkerView& view : frame.markers) {
    MarkerTally& tally = guide.markers[view.tag.id];
    ++tally.frames;
    tally.edges_px.push_back(view.edge_px);
    if (view.contrast > 0.0) {
      tally.contrasts.push_back(view.contrast);
      tally.blurs_px.push_back(view.blur_px);
    }
    if (view.refusal != Refusal::kNone) continue;
    ++tally.used;
    tally.most_tilt_deg = std::max(tally.most_tilt_deg, view.tilt_deg);
    for (const Eigen::Vector2d& corner : view.tag.corners_px)
      count_point(guide.grid, corner, frame.width, frame.height);
  }
}

void add_joint_values(CaptureGuide& guide, const std::vector<std::string>& names,
                      std::span<const double> values) {
  if (guide.channels.empty()) {
    for (std::size_t i = 0; i < names.size(); ++i)
      guide.channels.push_back({names[i], {values[i], values[i], true}});
  }
  ++guide.rows;
  for (std::size_t i = 0; i < guide.channels.size(); ++i) {
    ChannelSpan& span = guide.channels[i].span;
    span.lower = std::min(span.lower, values[i]);
    span.upper = std::max(span.upper, values[i]);
    span.whole = span.whole && values[i] == std::round(values[i]);
  }
}

std::vector<std::string> what_is_missing(const CaptureGuide& guide, const Declared& declared) {
  if (guide.markers.empty()) {
    return {fmt::format(
        "no marker of family {} is seen: are they sharp, bright and wider than {:.0f} px?",
        declared.markers.family, kSmallMarkerPx)};
  }
  std::vector<std::string> out;
  add_marker_words(guide, declared, out);
  add_joint_words(guide, declared, out);
  if (!declared.camera) add_lens_words(guide, out);
  return out;
}

}  // namespace kinescope
