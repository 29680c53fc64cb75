// SPDX-License-Identifier: Apache-2.0
//
// Takes  a marker's corners and how its cells lie.
// Gives  its four edges with the strips of pixels beside them that no other step in grey reaches.
// Units  px; pixel (0, 0) is the centre of the top-left pixel.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "calib/vision/refine_corners.h"

namespace kinescope::corner_fit {

/// Grey levels between dark and bright cells, at least.
inline constexpr double kMinContrast = 12.0;
/// Px of blur a px of cell, at most: beyond it steps cannot be told from one another.
inline constexpr double kSharp = 0.2;
/// Px, of a corner that is fitted as well as can be; measured: tests/experiments/corners.cpp.
inline constexpr double kFloorSigma = 0.002;
/// Noise units beyond which a pixel's weight falls.
inline constexpr double kRobust = 3.0;
/// Grey levels, rounding.
inline constexpr double kMinNoise = 0.3;
/// Px over which a pixel's weight fades out at the rim of what is used, so that the result does not
/// jump when one enters it.
inline constexpr double kTaper = 0.7;
/// Px, of the usual video codecs.
inline constexpr int kCodecBlock = 8;

/// The square that corners are the image of, in their order.
inline const std::array<Eigen::Vector2d, 4> kSquare = {
    Eigen::Vector2d{-1.0, 1.0}, {1.0, 1.0}, {1.0, -1.0}, {-1.0, -1.0}};

/// Homography from that square; nothing for corners that span no quadrangle.
[[nodiscard]] std::optional<Eigen::Matrix3d> tag_to_image(const Corners& corners);

/// One side of the quadrangle, from corner e to e + 1.
struct Edge {
  Eigen::Vector2d middle;
  Eigen::Vector2d along;     // unit
  Eigen::Vector2d outward;   // unit
  double half = 0.0;         // px, half its length
  double inner_width = 0.0;  // px, strip inside
  double outer_width = 0.0;  // px, strip outside
};

/// A pixel in a strip.
struct Sample {
  int edge = 0;
  double u = 0.0;         // along the edge, -1..1 at the corners
  double distance = 0.0;  // outward from the chord, px
  double grey = 0.0;
  double weight = 0.0;
};

/// Edges of the quadrangle, with strips as wide as the neighbouring cells allow; nothing for
/// corners that span no quadrangle. `blur` is that of edges 0 and 2, and of edges 1 and 3.
[[nodiscard]] std::optional<std::array<Edge, 4>> make_edges(const Corners& corners,
                                                            const TagLayout& layout,
                                                            const std::array<double, 2>& blur);

/// Pixels in the strips, with the weight of their place.
[[nodiscard]] std::vector<Sample> collect_samples(const ImageView& image,
                                                  const std::array<Edge, 4>& edges,
                                                  const Corners& corners,
                                                  const std::array<double, 2>& blur);

}  // namespace kinescope::corner_fit
