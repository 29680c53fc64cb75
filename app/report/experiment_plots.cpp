// SPDX-License-Identifier: Apache-2.0
#include "app/report/experiment_plots.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/experiments/quartiles.h"

namespace kinescope::report {
namespace {

constexpr double kRow = 26.0;      // height of one, px
constexpr double kBarHalf = 0.3;   // of a row
constexpr double kMarkHalf = 0.4;  // the median's line

struct Range {
  double lower = std::numeric_limits<double>::infinity();
  double upper = -std::numeric_limits<double>::infinity();

  void hold(double value) {
    if (!std::isfinite(value)) return;
    lower = std::min(lower, value);
    upper = std::max(upper, value);
  }
};

double drawn_at(double value, bool log10) { return log10 ? std::log10(value) : value; }

PlotAxis axis_of(const CurveAxis& axis, Range range) {
  pad_range(range.lower, range.upper);
  return {.label = axis.label, .lower = range.lower, .upper = range.upper, .log10 = axis.log10};
}

std::vector<double> above_zero(const std::vector<double>& values) {
  std::vector<double> out;
  for (const double value : values) {
    if (value > 0.0 && std::isfinite(value)) out.push_back(value);
  }
  return out;
}

}  // namespace

std::string box_plot(std::string_view name, std::string_view axis,
                     const std::vector<BoxRow>& rows) {
  Range range;
  std::vector<std::string> names;
  for (const BoxRow& row : rows) {
    names.push_back(row.name);
    for (const double value : above_zero(row.values)) range.hold(std::log10(value));
  }
  pad_range(range.lower, range.upper);
  const auto count = static_cast<double>(rows.size());
  Plot plot(name,
            {.label = std::string(axis), .lower = range.lower, .upper = range.upper, .log10 = true},
            {.label = "", .lower = -0.6, .upper = count - 0.4, .down = true, .row_names = names},
            {.width = 480.0, .height = 60.0 + kRow * count});
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const std::vector<double> values = above_zero(rows[k].values);
    if (values.empty()) continue;
    const experiments::Quartiles q = experiments::quartiles(values);
    const auto y = static_cast<double>(k);
    const double median = std::log10(q.median);
    plot.bar(std::log10(q.lower), std::log10(q.upper), y - kBarHalf, y + kBarHalf, series_class(k));
    plot.line({{median, y - kMarkHalf}, {median, y + kMarkHalf}}, "ink");
    std::vector<Eigen::Vector2d> dots;
    for (const double value : values) dots.emplace_back(std::log10(value), y);
    plot.dots(dots, "ink");
  }
  return plot.str();
}

std::string curve_plot(std::string_view name, const CurveAxis& x, const CurveAxis& y,
                       const std::vector<Curve>& curves) {
  Range across, up;
  for (const Curve& curve : curves) {
    for (const Eigen::Vector2d& point : curve.points) {
      across.hold(drawn_at(point.x(), x.log10));
      up.hold(drawn_at(point.y(), y.log10));
    }
    for (const double value : curve.lower) up.hold(drawn_at(value, y.log10));
    for (const double value : curve.upper) up.hold(drawn_at(value, y.log10));
  }
  Plot plot(name, axis_of(x, across), axis_of(y, up), {.width = 480.0, .height = 300.0});
  for (std::size_t k = 0; k < curves.size(); ++k) {
    const Curve& curve = curves[k];
    const std::string colour = series_class(k);
    std::vector<Eigen::Vector2d> points;
    std::vector<double> at, lower, upper;
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
      at.push_back(drawn_at(curve.points[i].x(), x.log10));
      points.emplace_back(at.back(), drawn_at(curve.points[i].y(), y.log10));
      if (curve.lower.empty()) continue;
      lower.push_back(drawn_at(curve.lower[i], y.log10));
      upper.push_back(drawn_at(curve.upper[i], y.log10));
    }
    if (!lower.empty()) plot.band(at, lower, upper, colour);
    curve.dots ? plot.dots(points, colour) : plot.line(points, colour);
    plot.legend(curve.name, colour);
  }
  return plot.str();
}

}  // namespace kinescope::report
