// SPDX-License-Identifier: Apache-2.0
#include "app/report/plot.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/numbers.h"

namespace kinescope::report {
namespace {

constexpr double kLegendRow = 15.0;
constexpr double kCharacterWidth = 6.1;  ///< of an 11 px label
constexpr double kAxisName = 24.0;       ///< left of the ticks' labels
constexpr double kArrowHead = 4.0;

std::string pair_text(const Eigen::Vector2d& p) { return drawn(p.x()) + " " + drawn(p.y()); }

double nice_step(double length, int count) {
  const double raw = length / std::max(count, 1);
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (raw <= step * power * (1.0 + 1e-9)) return step * power;
  }
  return 10.0 * power;
}

/// Ticks with their labels. A logarithmic axis has 1, 2, 5 of every decade, or whole decades when
/// there are many.
std::vector<std::pair<double, std::string>> ticks_of(const PlotAxis& axis) {
  std::vector<std::pair<double, std::string>> ticks;
  if (!axis.log10) {
    const std::vector<double> places = nice_ticks(axis.lower, axis.upper, axis.ticks);
    for (const double place : places) {
      const double step = places.size() > 1 ? places[1] - places[0] : std::abs(place);
      ticks.emplace_back(place, tick_label(place, step));
    }
    return ticks;
  }
  const double decades = axis.upper - axis.lower;
  const int stride = std::max(1, static_cast<int>(std::ceil(decades / 6.0)));
  const int last = static_cast<int>(std::floor(axis.upper));
  for (int decade = static_cast<int>(std::floor(axis.lower)); decade <= last; decade += stride) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      if (decades > 3.0 && digit > 1.0) continue;
      const double place = decade + std::log10(digit);
      if (place < axis.lower || place > axis.upper) continue;
      ticks.emplace_back(place, fmt::format("{:.3g}", digit * std::pow(10.0, decade)));
    }
  }
  return ticks;
}

}  // namespace

std::string series_class(std::size_t series) {
  return fmt::format("c{}", series % static_cast<std::size_t>(kSeriesColours));
}

std::vector<double> nice_ticks(double lower, double upper, int count) {
  if (!(upper > lower) || !std::isfinite(upper - lower)) return {};
  double step = nice_step(upper - lower, count);
  // A range that straddles one round number only would have one tick: take the finer step then.
  if (std::floor(upper / step) - std::ceil(lower / step) < 2.0) {
    step = nice_step(upper - lower, 2 * count);
  }
  std::vector<double> ticks;
  for (double k = std::ceil(lower / step - 1e-9); k * step <= upper + 1e-9 * step; k += 1.0) {
    ticks.push_back(k * step);
  }
  return ticks;
}

std::string tick_label(double tick, double step) {
  if (std::abs(tick) < 1e-9 * step) return "0";
  if (step < 1e-5 || std::abs(tick) >= 1e6) return fmt::format("{:.3g}", tick);
  const int decimals = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  return fmt::format("{:.{}f}", tick, decimals);
}

void pad_range(double& lower, double& upper, double margin) {
  if (!std::isfinite(lower) || !std::isfinite(upper) || upper < lower) {
    lower = 0.0;
    upper = 1.0;
    return;
  }
  double pad = margin * (upper - lower);
  if (pad <= 1e-12 * std::max(std::abs(lower), std::abs(upper))) {
    pad = lower == 0.0 ? 1.0 : 0.1 * std::abs(lower);
  }
  lower -= pad;
  upper += pad;
}

Plot::Plot(std::string_view name, PlotAxis x, PlotAxis y, PlotSize size)
    : name_(name), x_(std::move(x)), y_(std::move(y)), size_(size) {
  if (!(x_.upper > x_.lower)) pad_range(x_.lower, x_.upper);
  if (!(y_.upper > y_.lower)) pad_range(y_.lower, y_.upper);
  // Settled before the first mark is placed.
  const auto make_room = [this](const std::string& text) {
    left_ = std::max(left_, kAxisName + kCharacterWidth * static_cast<double>(text.size()));
  };
  if (y_.row_names.empty()) {
    for (const auto& [tick, text] : ticks_of(y_)) make_room(text);
  }
  for (const std::string& row : y_.row_names) make_room(row);
}

Eigen::Vector2d Plot::place(const Eigen::Vector2d& point) const {
  const double u = (point.x() - x_.lower) / (x_.upper - x_.lower);
  const double v = (point.y() - y_.lower) / (y_.upper - y_.lower);
  const double width = size_.width - left_ - right_;
  const double height = size_.height - top_ - bottom_;
  return {left_ + u * width, top_ + (y_.down ? v : 1.0 - v) * height};
}

void Plot::line(const std::vector<Eigen::Vector2d>& points, std::string_view css_class) {
  std::string path;
  bool pen_down = false;
  for (const Eigen::Vector2d& point : points) {
    if (!point.allFinite()) {
      pen_down = false;
      continue;
    }
    path += (pen_down ? "L" : "M") + pair_text(place(point));
    pen_down = true;
  }
  marks_ += fmt::format("<path class=\"line {}\" d=\"{}\"/>", css_class, path);
}

void Plot::dots(const std::vector<Eigen::Vector2d>& points, std::string_view css_class) {
  std::string path;
  for (const Eigen::Vector2d& point : points) {
    if (point.allFinite()) path += "M" + pair_text(place(point)) + "h0";
  }
  if (!path.empty()) {
    marks_ += fmt::format("<path class=\"dots {}\" d=\"{}\"/>", css_class, path);
  }
}

void Plot::band(const std::vector<double>& x, const std::vector<double>& lower,
                const std::vector<double>& upper, std::string_view css_class) {
  std::string path;
  for (std::size_t i = 0; i < x.size(); ++i) {
    path += (path.empty() ? "M" : "L") + pair_text(place({x[i], upper[i]}));
  }
  for (std::size_t i = x.size(); i-- > 0;) path += "L" + pair_text(place({x[i], lower[i]}));
  if (!path.empty()) {
    marks_ += fmt::format("<path class=\"band {}\" d=\"{}Z\"/>", css_class, path);
  }
}

void Plot::bar(double x_from, double x_to, double y_from, double y_to, std::string_view css_class) {
  const Eigen::Vector2d a = place({x_from, y_from});
  const Eigen::Vector2d b = place({x_to, y_to});
  marks_ += fmt::format("<rect class=\"bar {}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>",
                        css_class, drawn(std::min(a.x(), b.x())), drawn(std::min(a.y(), b.y())),
                        drawn(std::abs(a.x() - b.x())), drawn(std::abs(a.y() - b.y())));
}

void Plot::arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                 std::string_view css_class) {
  const Eigen::Vector2d a = place(from);
  const Eigen::Vector2d b = place(to);
  const Eigen::Vector2d run = b - a;
  std::string path = "M" + pair_text(a) + "L" + pair_text(b);
  if (run.norm() > 1.0) {
    const Eigen::Vector2d along = run.normalized() * std::min(kArrowHead, 0.5 * run.norm());
    const Eigen::Vector2d across(-along.y(), along.x());
    path += "M" + pair_text(b - along + 0.6 * across) + "L" + pair_text(b) + "L" +
            pair_text(b - along - 0.6 * across);
  }
  marks_ += fmt::format("<path class=\"line {}\" d=\"{}\"/>", css_class, path);
}

void Plot::ellipse(const Eigen::Vector2d& centre, double radius_x, double radius_y,
                   std::string_view css_class) {
  const Eigen::Vector2d c = place(centre);
  const Eigen::Vector2d edge = place(centre + Eigen::Vector2d(radius_x, radius_y));
  marks_ += fmt::format("<ellipse class=\"line {}\" cx=\"{}\" cy=\"{}\" rx=\"{}\" ry=\"{}\"/>",
                        css_class, drawn(c.x()), drawn(c.y()), drawn(std::abs(edge.x() - c.x())),
                        drawn(std::abs(edge.y() - c.y())));
}

void Plot::label(const Eigen::Vector2d& at, std::string_view text, std::string_view css_class) {
  const Eigen::Vector2d p = place(at);
  marks_ += fmt::format("<text class=\"{}\" x=\"{}\" y=\"{}\">{}</text>", css_class, drawn(p.x()),
                        drawn(p.y()), escaped(text));
}

void Plot::legend(std::string_view text, std::string_view css_class) {
  legend_.emplace_back(text, css_class);
}

std::string Plot::x_axis() const {
  const double y0 = size_.height - bottom_;
  std::string grid, text;
  for (const auto& [tick, name] : ticks_of(x_)) {
    const double x = place({tick, y_.lower}).x();
    grid += fmt::format("M{} {}V{}", drawn(x), drawn(y0), drawn(top_));
    text += fmt::format("<text class=\"tick\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                        drawn(x), drawn(y0 + 14), name);
  }
  text += fmt::format("<text class=\"axis\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                      drawn(0.5 * (left_ + size_.width - right_)), drawn(size_.height - 6),
                      escaped(x_.label));
  return fmt::format("<path class=\"grid\" d=\"{}\"/>{}", grid, text);
}

std::string Plot::y_axis() const {
  const double x0 = left_;
  std::string grid, text;
  const auto write = [&](double y, const std::string& name) {
    text += fmt::format("<text class=\"tick\" x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>",
                        drawn(x0 - 5), drawn(y + 4), name);
  };
  if (y_.row_names.empty()) {
    for (const auto& [tick, name] : ticks_of(y_)) {
      const double y = place({x_.lower, tick}).y();
      grid += fmt::format("M{} {}H{}", drawn(x0), drawn(y), drawn(size_.width - right_));
      write(y, name);
    }
  }
  for (std::size_t k = 0; k < y_.row_names.size(); ++k) {
    write(place({x_.lower, static_cast<double>(k)}).y(), escaped(y_.row_names[k]));
  }
  text += fmt::format(
      "<text class=\"axis\" x=\"12\" y=\"{0}\" text-anchor=\"middle\" transform=\"rotate(-90 12 "
      "{0})\">{1}</text>",
      drawn(0.5 * (top_ + size_.height - bottom_)), escaped(y_.label));
  return fmt::format("<path class=\"grid\" d=\"{}\"/>{}", grid, text);
}

std::string Plot::axes() const {
  return x_axis() + y_axis() +
         fmt::format("<path class=\"frame\" d=\"M{} {}V{}H{}\"/>", drawn(left_), drawn(top_),
                     drawn(size_.height - bottom_), drawn(size_.width - right_));
}

std::vector<Eigen::Vector2d> Plot::legend_places() const {
  std::vector<Eigen::Vector2d> places;
  double x = left_, y = size_.height + 10.0;
  for (const auto& [name, css_class] : legend_) {
    const double width = 22.0 + kCharacterWidth * static_cast<double>(name.size());
    if (x + width > size_.width && x > left_) {
      x = left_;
      y += kLegendRow;
    }
    places.emplace_back(x, y);
    x += width;
  }
  return places;
}

std::string Plot::legend_text() const {
  const std::vector<Eigen::Vector2d> places = legend_places();
  std::string text;
  for (std::size_t k = 0; k < places.size(); ++k) {
    const auto& [name, css_class] = legend_[k];
    text += fmt::format(
        "<path class=\"key {}\" d=\"M{} {}h11\"/><text class=\"tick\" x=\"{}\" y=\"{}\">{}</text>",
        css_class, drawn(places[k].x()), drawn(places[k].y() - 4), drawn(places[k].x() + 15),
        drawn(places[k].y()), escaped(name));
  }
  return text;
}

std::string Plot::str() const {
  const double height = legend_.empty() ? size_.height : legend_places().back().y() + 5.0;
  const double width = size_.width - left_ - right_;
  const double inner = size_.height - top_ - bottom_;
  std::string time;
  if (time_axis_) {
    time = fmt::format(
        " data-t0=\"{:.6g}\" data-t1=\"{:.6g}\" data-x0=\"{}\" data-x1=\"{}\""
        " data-y0=\"{}\" data-y1=\"{}\"",
        x_.lower, x_.upper, drawn(left_), drawn(left_ + width), drawn(top_), drawn(top_ + inner));
  }
  // The inner svg clips the marks to the frame; its viewBox keeps their coordinates.
  return fmt::format(
      "<svg class=\"plot\" viewBox=\"0 0 {} {}\" style=\"--w:{}px\" role=\"img\" "
      "aria-label=\"{}\"{}>{}"
      "<svg x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" viewBox=\"{} {} {} {}\">{}</svg>{}</svg>",
      drawn(size_.width), drawn(height), drawn(size_.width), escaped(name_), time, axes(),
      drawn(left_), drawn(top_), drawn(width), drawn(inner), drawn(left_), drawn(top_),
      drawn(width), drawn(inner), marks_, legend_text());
}

}  // namespace kinescope::report
