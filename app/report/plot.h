// SPDX-License-Identifier: Apache-2.0
//
// Plots as inline SVG: axes with round ticks and units, lines, dots, bands, bars, arrows, a legend.
// Colours are CSS classes (page/style.css), so that light, dark and print each have their own.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace kinescope::report {

/// Colours told apart by colour-blind readers: series k has the class c<k mod kSeriesColours>.
inline constexpr int kSeriesColours = 8;
[[nodiscard]] std::string series_class(std::size_t series);

/// Round numbers from `lower` to `upper`, about `count` of them.
[[nodiscard]] std::vector<double> nice_ticks(double lower, double upper, int count);
/// The label of a tick: no more digits than the step needs.
[[nodiscard]] std::string tick_label(double tick, double step);

struct PlotAxis {
  std::string label;  ///< with unit: "time, s"
  double lower = 0.0;
  double upper = 1.0;
  bool down = false;  ///< grows downward (image rows)
  int ticks = 5;
  bool log10 = false;  ///< the data are decimal logarithms; the ticks show the numbers themselves
  /// y axis only: words in place of its numbers, one a row, row k at y = k.
  std::vector<std::string> row_names = {};
};

struct PlotSize {
  double width = 460.0;
  double height = 230.0;
};

/// Widens [lower, upper] by `margin` of its length; gives an empty or point range a width.
void pad_range(double& lower, double& upper, double margin = 0.05);

class Plot {
 public:
  /// `name` is read out by screen readers.
  Plot(std::string_view name, PlotAxis x, PlotAxis y, PlotSize size = {});

  /// NaN breaks a line.
  void line(const std::vector<Eigen::Vector2d>& points, std::string_view css_class);
  void dots(const std::vector<Eigen::Vector2d>& points, std::string_view css_class);
  /// Area between two curves over the same x.
  void band(const std::vector<double>& x, const std::vector<double>& lower,
            const std::vector<double>& upper, std::string_view css_class);
  void bar(double x_from, double x_to, double y_from, double y_to, std::string_view css_class);
  void arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& to, std::string_view css_class);
  void ellipse(const Eigen::Vector2d& centre, double radius_x, double radius_y,
               std::string_view css_class);
  void label(const Eigen::Vector2d& at, std::string_view text, std::string_view css_class = "");
  void legend(std::string_view text, std::string_view css_class);
  /// Marks the plot's x axis as time: the 3-D view draws its cursor here and follows a click.
  void is_time_axis() { time_axis_ = true; }

  /// Pixels of a data point, for what the helper does not draw.
  [[nodiscard]] Eigen::Vector2d place(const Eigen::Vector2d& point) const;
  /// SVG elements in these pixels.
  void add(std::string_view elements) { marks_ += elements; }
  [[nodiscard]] std::string str() const;

 private:
  [[nodiscard]] std::string x_axis() const;
  [[nodiscard]] std::string y_axis() const;
  [[nodiscard]] std::string axes() const;
  /// Left end of each legend entry; entries that do not fit go to the next row.
  [[nodiscard]] std::vector<Eigen::Vector2d> legend_places() const;
  [[nodiscard]] std::string legend_text() const;

  std::string name_;
  PlotAxis x_, y_;
  PlotSize size_;
  double left_ = 52.0, right_ = 10.0, top_ = 10.0, bottom_ = 38.0;
  bool time_axis_ = false;
  std::string marks_;
  std::vector<std::pair<std::string, std::string>> legend_;  ///< text, class
};

}  // namespace kinescope::report
