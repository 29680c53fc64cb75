// SPDX-License-Identifier: Apache-2.0
//
// Takes   samples beside a marker's edges.
// Gives   the grey value that a blurred step along each edge predicts there, and the normal
//         equations of its unknowns.
// Units   px, grey levels.
// Method  a straight edge (shift, turn, sagitta) between two grey levels that change linearly from
//         knot to knot, blurred by a Gaussian: light = inside + (outside - inside) Phi(d / blur),
//         seen through the camera's tone curve.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "calib/vision/marker_edges.h"
#include "calib/vision/tone_curve.h"

namespace kinescope::corner_fit {

// The unknowns: shift, turn and sagitta of each edge (px), two blurs (px), then the grey levels
// beside each edge at knots along it, inside and outside.
inline constexpr int kBlurIndex = 12;
inline constexpr int kLevelsIndex = 14;

// How the unknowns are stored.
struct Layout {
  std::array<int, 4> knots{};   // of each edge, on each side
  std::array<int, 4> inside{};  // where each edge's levels begin
  std::array<int, 4> outside{};
  int size = 0;

  explicit Layout(const Corners& corners);
};

/// The model's grey value and its derivatives by eight unknowns: the edge's line (3), its blur, the
/// levels at the knots before and behind the sample, inside (2) and outside (2).
struct Prediction {
  double grey = 0.0;
  int piece = 0;  ///< of an edge between two knots, counted over all edges
  Eigen::Matrix<double, 8, 1> slope;
};

[[nodiscard]] std::vector<Prediction> predict(const Layout& layout, const Eigen::VectorXd& unknowns,
                                              const std::vector<Sample>& samples,
                                              const ToneCurve& tone);

/// Normal equations of the weighted, robust least squares.
struct System {
  Eigen::MatrixXd H;  // lower triangle
  Eigen::VectorXd g;
  double cost = 0.0;    // weighted sum of squares
  double weight = 0.0;  // sum of weights
};

/// `predictions` of the samples; `noise`: standard deviation of a grey value.
[[nodiscard]] System make_system(const std::vector<Sample>& samples,
                                 const std::vector<Prediction>& predictions, const Layout& layout,
                                 double noise);

/// Adds the belief that row_a * unknowns(a) + row_b * unknowns(b) is zero; `weight` is the noise's
/// variance over the belief's.
void add_belief(System& system, const Eigen::VectorXd& unknowns, int a, double row_a, int b,
                double row_b, double weight);

/// Standard deviation of the grey values around the model, from their median.
[[nodiscard]] double robust_noise(const std::vector<Sample>& samples,
                                  const std::vector<Prediction>& predictions);

/// A first guess of the grey values inside and outside: medians of the pixels well away from the
/// edge; nothing where there are too few.
[[nodiscard]] std::optional<std::array<double, 2>> guess_levels(const std::vector<Sample>& samples);

/// Where the chord of edge e - 1 meets that of edge e, as the corner e, with the lever of each
/// edge's unknowns.
struct Meeting {
  Eigen::Vector2d point;
  Eigen::Matrix<double, 2, 12> slope = Eigen::Matrix<double, 2, 12>::Zero();
};

[[nodiscard]] Meeting meet(const std::array<Edge, 4>& edges, const Eigen::VectorXd& unknowns,
                           std::size_t corner);

}  // namespace kinescope::corner_fit
