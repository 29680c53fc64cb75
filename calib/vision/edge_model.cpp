// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/edge_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/LU>

namespace kinescope::corner_fit {
namespace {

constexpr double kKnotSpacing =
    7.0;  // px, of the grey levels along an edge: shadows cross a marker
constexpr int kMaxKnots = 10;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

Layout::Layout(const Corners& corners) {
  size = kLevelsIndex;
  for (std::size_t e = 0; e < 4; ++e) {
    const double length = (corners[(e + 1) % 4] - corners[e]).norm();
    knots[e] = std::clamp(static_cast<int>(std::lround(length / kKnotSpacing)), 2, kMaxKnots);
    inside[e] = size;
    outside[e] = size + knots[e];
    size += 2 * knots[e];
  }
}

Prediction predict(const Layout& layout, const Eigen::VectorXd& unknowns, const Sample& s) {
  Prediction out;
  const auto e = static_cast<std::size_t>(s.edge);
  const int line = 3 * s.edge;
  const int blur_index = kBlurIndex + s.edge % 2;
  const double blur = unknowns(blur_index);
  const double sag = s.u * s.u - 1.0;
  const double d =
      s.distance - (unknowns(line) + unknowns(line + 1) * s.u + unknowns(line + 2) * sag);
  const double z = d / blur;
  const double step = 0.5 * std::erfc(-z * std::numbers::sqrt2 / 2.0);
  const double bell = std::exp(-0.5 * z * z) / (blur * std::sqrt(2.0 * std::numbers::pi));
  const double place = std::clamp(0.5 * (s.u + 1.0), 0.0, 1.0) * (layout.knots[e] - 1);
  const int knot = std::min(static_cast<int>(place), layout.knots[e] - 2);
  const double part = place - knot;
  const int in = layout.inside[e] + knot;
  const int on = layout.outside[e] + knot;
  const double inside = (1.0 - part) * unknowns(in) + part * unknowns(in + 1);
  const double outside = (1.0 - part) * unknowns(on) + part * unknowns(on + 1);
  const double contrast = outside - inside;
  out.grey = inside + contrast * step;
  const double slope = contrast * bell;  // per px of distance
  out.index = {line, line + 1, line + 2, blur_index, in, in + 1, on, on + 1};
  out.slope = {-slope,
               -slope * s.u,
               -slope * sag,
               -slope * z,
               (1.0 - step) * (1.0 - part),
               (1.0 - step) * part,
               step * (1.0 - part),
               step * part};
  return out;
}

System make_system(const std::vector<Sample>& samples, const Layout& layout,
                   const Eigen::VectorXd& unknowns, double noise) {
  System system{Eigen::MatrixXd::Zero(layout.size, layout.size),
                Eigen::VectorXd::Zero(layout.size)};
  for (const Sample& s : samples) {
    const Prediction p = predict(layout, unknowns, s);
    const double r = s.grey - p.grey;
    const double limit = kRobust * noise;
    const double w = s.weight * (std::abs(r) > limit ? limit / std::abs(r) : 1.0);
    system.cost += w * r * r;
    system.weight += w;
    for (std::size_t i = 0; i < 8; ++i) {
      const double wj = w * p.slope[i];
      system.g(p.index[i]) += wj * r;
      for (std::size_t j = 0; j <= i; ++j) system.H(p.index[i], p.index[j]) += wj * p.slope[j];
    }
  }
  return system;
}

void add_belief(System& system, const Eigen::VectorXd& unknowns, int a, double row_a, int b,
                double row_b, double weight) {
  const double r = row_a * unknowns(a) + row_b * unknowns(b);
  system.g(a) -= weight * row_a * r;
  system.g(b) -= weight * row_b * r;
  system.H(a, a) += weight * row_a * row_a;
  system.H(b, b) += weight * row_b * row_b;
  system.H(std::max(a, b), std::min(a, b)) += weight * row_a * row_b;
}

double robust_noise(const std::vector<Sample>& samples, const Layout& layout,
                    const Eigen::VectorXd& unknowns) {
  std::vector<double> size;
  size.reserve(samples.size());
  for (const Sample& s : samples) {
    if (s.weight > 0.5) size.push_back(std::abs(s.grey - predict(layout, unknowns, s).grey));
  }
  if (size.empty()) return 0.0;
  return std::max(kMinNoise, 1.4826 * median(std::move(size)));
}

std::optional<std::array<double, 2>> guess_levels(const std::vector<Sample>& samples) {
  std::vector<double> inside;
  std::vector<double> outside;
  for (const Sample& s : samples) {
    if (s.distance < -0.8) inside.push_back(s.grey);
    if (s.distance > 0.8) outside.push_back(s.grey);
  }
  if (inside.size() < 8 || outside.size() < 8) return std::nullopt;
  return std::array<double, 2>{median(std::move(inside)), median(std::move(outside))};
}

Meeting meet(const std::array<Edge, 4>& edges, const Eigen::VectorXd& unknowns,
             std::size_t corner) {
  const std::array<std::size_t, 2> pair = {(corner + 3) % 4, corner};
  Eigen::Matrix2d A;
  Eigen::Vector2d b;
  for (int i = 0; i < 2; ++i) {
    const std::size_t e = pair[static_cast<std::size_t>(i)];
    const Edge& edge = edges[e];
    const double turn = unknowns(3 * static_cast<int>(e) + 1) / edge.half;
    const Eigen::Vector2d normal = edge.outward - turn * edge.along;
    A.row(i) = normal.transpose();
    b(i) = unknowns(3 * static_cast<int>(e)) + normal.dot(edge.middle);
  }
  const Eigen::Matrix2d inverse = A.inverse();
  Meeting out;
  out.point = inverse * b;
  for (int i = 0; i < 2; ++i) {
    const int e = static_cast<int>(pair[static_cast<std::size_t>(i)]);
    out.slope.col(3 * e) = inverse.col(i);
    out.slope.col(3 * e + 1) = inverse.col(i) * (i == 0 ? 1.0 : -1.0);  // u at the corner
  }
  return out;
}

}  // namespace kinescope::corner_fit
