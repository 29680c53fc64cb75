// SPDX-License-Identifier: Apache-2.0
#include "app/report/motion_picture.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "app/report/numbers.h"
#include "app/report/plot.h"

namespace kinescope::report {
namespace {

using Eigen::Index;
using Eigen::Matrix2Xd;
using Eigen::Vector2d;

constexpr int kPostures = 12;  // drawn one over the other
constexpr double kPictureWidth = 480.0;
constexpr double kMargin = 0.08;    // of the drawing
constexpr double kFrame_px = 80.0;  // of axis labels, about
constexpr double kTallest = 480.0;

std::vector<Vector2d> points_of(const Matrix2Xd& columns) {
  std::vector<Vector2d> out;
  for (Index c = 0; c < columns.cols(); ++c) out.emplace_back(columns.col(c));
  return out;
}

/// What all postures take up, m.
struct Extent {
  Vector2d lower, upper;

  void hold(const Matrix2Xd& points) {
    for (Index c = 0; c < points.cols(); ++c) {
      lower = lower.cwiseMin(points.col(c));
      upper = upper.cwiseMax(points.col(c));
    }
  }
};

// The same scale both ways.
Plot frame_of(std::string_view name, Extent extent) {
  const Vector2d pad = kMargin * (extent.upper - extent.lower).maxCoeff() * Vector2d::Ones();
  extent.lower -= pad;
  extent.upper += pad;
  const Vector2d size = extent.upper - extent.lower;
  const double height =
      std::min(kTallest, (kPictureWidth - kFrame_px) * size.y() / size.x() + 0.6 * kFrame_px);
  return {name,
          {.label = "m", .lower = extent.lower.x(), .upper = extent.upper.x()},
          {.label = "m", .lower = extent.lower.y(), .upper = extent.upper.y()},
          {.width = kPictureWidth, .height = height}};
}

std::string pixels(const Plot& plot, const Matrix2Xd& points) {
  std::string out;
  for (const Vector2d& point : points_of(points)) {
    const Vector2d p = plot.place(point);
    out += fmt::format("{}{},{}", out.empty() ? "" : " ", drawn(p.x()), drawn(p.y()));
  }
  return out;
}

std::string animate(std::string_view attribute, const std::string& values, double seconds) {
  return fmt::format(
      "<animate attributeName=\"{}\" dur=\"{:.6g}s\" repeatCount=\"indefinite\" "
      "calcMode=\"linear\" values=\"{}\"/>",
      attribute, seconds, values);
}

// A polyline that goes through all postures and begins again.
std::string moving_body(const Plot& plot, const std::vector<Matrix2Xd>& postures, double seconds) {
  std::string lines;
  for (const Matrix2Xd& posture : postures) {
    lines += (lines.empty() ? "" : ";") + pixels(plot, posture);
  }
  return fmt::format("<g class=\"moving\"><polyline class=\"body\" points=\"{}\">{}</polyline></g>",
                     pixels(plot, postures.front()), animate("points", lines, seconds));
}

}  // namespace

std::string moving_dot(const Plot& plot, const std::vector<Vector2d>& path, double seconds) {
  std::string xs, ys;
  for (const Vector2d& point : path) {
    const Vector2d p = plot.place(point);
    xs += (xs.empty() ? "" : ";") + drawn(p.x());
    ys += (ys.empty() ? "" : ";") + drawn(p.y());
  }
  const Vector2d first = plot.place(path.front());
  return fmt::format(
      "<g class=\"moving\"><circle class=\"tip\" r=\"5\" cx=\"{}\" cy=\"{}\">{}{}</circle></g>",
      drawn(first.x()), drawn(first.y()), animate("cx", xs, seconds), animate("cy", ys, seconds));
}

std::string motion_picture(std::string_view name, const policy::Skeleton& skeleton,
                           const Eigen::MatrixXd& states, double step_s) {
  if (!skeleton.moving || states.rows() < 2) return {};
  std::vector<Matrix2Xd> postures;
  std::vector<Vector2d> path;
  for (Index k = 0; k < states.rows(); ++k) {
    postures.push_back(skeleton.moving(states.row(k).head(states.cols() / 2)));
    path.emplace_back(postures.back().rightCols<1>());
  }
  Extent extent{postures.front().col(0), postures.front().col(0)};
  extent.hold(skeleton.fixed);
  for (const Matrix2Xd& posture : postures) extent.hold(posture);
  Plot plot = frame_of(name, extent);
  plot.line(points_of(skeleton.fixed), "ground");
  plot.line(path, series_class(0));
  const Index last = std::ssize(postures) - 1;
  for (int k = 0; k < kPostures; ++k) {
    const auto at = static_cast<std::size_t>(last * k / kPostures);
    plot.line(points_of(postures[at]), "faint");
  }
  plot.line(points_of(postures.back()), "ink");
  plot.dots({path.back()}, "ink");
  const double seconds = static_cast<double>(last) * step_s;
  plot.add(moving_body(plot, postures, seconds));
  plot.add(moving_dot(plot, path, seconds));
  plot.legend("at the end", "ink");
  plot.legend("before", "faint");
  plot.legend("path of the tip", series_class(0));
  return plot.str();
}

}  // namespace kinescope::report
