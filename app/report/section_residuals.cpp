// SPDX-License-Identifier: Apache-2.0
//
// Pictures of what the model leaves: over the image, over time, over each joint value, against the
// normal curve.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/plot.h"
#include "app/report/sections.h"

namespace kinescope::report {
namespace {

constexpr std::size_t kMostDots = 2500;  ///< of one plot; more are thinned evenly
constexpr int kCurveBins = 24;

bool has_corners(const Facts& facts) { return !facts.analysis.corners.empty(); }

/// Every n-th, so that at most kMostDots remain.
std::size_t stride_for(std::size_t count) {
  return std::max<std::size_t>(1, (count + kMostDots - 1) / kMostDots);
}

/// Symmetric limit that holds 99 % of the values.
double robust_limit(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return 1.0;
  for (double& v : values) v = std::abs(v);
  const std::size_t place = (values.size() - 1) * 99 / 100;
  std::ranges::nth_element(values, values.begin() + static_cast<long>(place));
  return std::max(1.15 * values[place], 1e-12);
}

/// Mean residual in each cell of a grid over one camera's image, as arrows.
std::string image_field(const Facts& facts, std::size_t of) {
  const Calibration& calibration = facts.run.calibration;
  const CameraModel& camera = calibration.model_of_camera(of);
  if (camera.width <= 0 || camera.height <= 0) return "";
  constexpr int kColumns = 16, kRows = 9, kFewest = 4;
  std::array<Eigen::Vector3d, kColumns * kRows> cells;
  cells.fill(Eigen::Vector3d::Zero());
  for (const CornerPoint& corner : facts.analysis.corners) {
    if (corner.camera != of) continue;
    const int column = static_cast<int>(corner.pixel.x() / camera.width * kColumns);
    const int row = static_cast<int>(corner.pixel.y() / camera.height * kRows);
    if (column < 0 || column >= kColumns || row < 0 || row >= kRows) continue;
    cells[static_cast<std::size_t>(row * kColumns + column)] +=
        Eigen::Vector3d(corner.residual.x(), corner.residual.y(), 1.0);
  }
  double longest = 0.0;
  for (const Eigen::Vector3d& cell : cells) {
    if (cell.z() >= kFewest) longest = std::max(longest, cell.head<2>().norm() / cell.z());
  }
  const double width = 470.0;
  const double aspect = static_cast<double>(camera.height) / camera.width;
  const std::string& name = calibration.name_of_camera(of);
  Plot plot("Mean residual over the image" + (name.empty() ? name : " of camera " + name),
            {.label = "image column, px", .lower = 0.0, .upper = static_cast<double>(camera.width)},
            {.label = "image row, px",
             .lower = 0.0,
             .upper = static_cast<double>(camera.height),
             .down = true},
            {.width = width, .height = 48.0 + (width - 62.0) * aspect});
  const double cell_px = static_cast<double>(camera.width) / kColumns;
  const double scale = longest > 0.0 ? 1.4 * cell_px / longest : 0.0;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const Eigen::Vector3d& cell = cells[static_cast<std::size_t>(row * kColumns + column)];
      if (cell.z() < kFewest) continue;
      const Eigen::Vector2d centre((column + 0.5) * cell_px,
                                   (row + 0.5) * camera.height / static_cast<double>(kRows));
      const Eigen::Vector2d mean = cell.head<2>() / cell.z();
      const Eigen::Vector2d half = 0.5 * scale * mean;
      // Coloured where the mean stands out of the noise: 3 standard errors of a mean of that many
      // corners.
      const bool clear = mean.norm() > 3.0 * facts.analysis.component_rms / std::sqrt(cell.z());
      plot.arrow(centre - half, centre + half, clear ? "c1" : "faint");
    }
  }
  plot.legend(fmt::format("longest arrow {}; stands out of the noise",
                          text_with_unit(longest, Quantity::kPixels)),
              "c1");
  plot.legend("does not", "faint");
  return plot.str();
}

std::string image_scatter(const Facts& facts) {
  std::vector<double> all;
  for (const CornerPoint& corner : facts.analysis.corners) {
    all.push_back(corner.residual.x());
    all.push_back(corner.residual.y());
  }
  const double limit = robust_limit(std::move(all));
  Plot plot("Residual of every corner",
            {.label = "residual along columns, px", .lower = -limit, .upper = limit},
            {.label = "residual along rows, px", .lower = -limit, .upper = limit, .down = true},
            {.width = 330.0, .height = 318.0});
  const std::size_t stride = stride_for(facts.analysis.corners.size());
  for (std::size_t m = 0; m < facts.analysis.markers.size(); ++m) {
    std::vector<Eigen::Vector2d> dots;
    for (std::size_t k = 0; k < facts.analysis.corners.size(); k += stride) {
      const CornerPoint& corner = facts.analysis.corners[k];
      if (corner.marker == m) dots.push_back(corner.residual);
    }
    plot.dots(dots, series_class(m));
    plot.legend(marker_name(facts.analysis.markers[m]), series_class(m));
  }
  const double rms = facts.analysis.component_rms;
  const double two = std::sqrt(-2.0 * std::log(1.0 - 0.95)) * rms;
  plot.ellipse({0.0, 0.0}, two, two, "ink");
  return plot.str();
}

struct Component {
  std::string_view name;
  int index;
};

/// Mean over a sighting's corners (px), or the displacement (mm).
double component_of(MeasurementKind kind, const SightingResidual& sighting, int index) {
  if (kind != MeasurementKind::kCorners) return 1000.0 * sighting.displacement(3 + index);
  double mean = 0.0;
  for (const Eigen::Vector2d& corner : sighting.corners_px) mean += corner(index);
  return mean / static_cast<double>(std::max<std::size_t>(1, sighting.corners_px.size()));
}

std::string time_plot(const Facts& facts, const Component& component) {
  const Calibration& calibration = facts.run.calibration;
  const bool corners = calibration.kind == MeasurementKind::kCorners;
  if (calibration.times_s.size() < 2) return "";
  std::vector<double> all;
  std::vector<std::pair<double, double>> pairs;
  std::vector<std::vector<Eigen::Vector2d>> dots(facts.analysis.markers.size());
  for (const SightingResidual& sighting : calibration.residuals) {
    if (!sighting.used || (corners && sighting.corners_px.empty())) continue;
    const double time = calibration.times_s.at(static_cast<std::size_t>(sighting.frame));
    const double value = component_of(calibration.kind, sighting, component.index);
    const auto marker = std::ranges::find(facts.analysis.markers, sighting.id);
    dots[static_cast<std::size_t>(marker - facts.analysis.markers.begin())].emplace_back(time,
                                                                                         value);
    all.push_back(value);
    pairs.emplace_back(time, value);
  }
  const double limit = robust_limit(all);
  Plot plot(fmt::format("Residual {} over time", component.name),
            {.label = "time, s",
             .lower = calibration.times_s.front(),
             .upper = calibration.times_s.back(),
             .ticks = 10},
            {.label = fmt::format("{}, {}", component.name, corners ? "px" : "mm"),
             .lower = -limit,
             .upper = limit,
             .ticks = 4},
            {.width = 940.0, .height = 170.0});
  plot.is_time_axis();
  const std::size_t stride = stride_for(all.size());
  for (std::size_t m = 0; m < dots.size(); ++m) {
    std::vector<Eigen::Vector2d> thinned;
    for (std::size_t k = 0; k < dots[m].size(); k += stride) thinned.push_back(dots[m][k]);
    plot.dots(thinned, series_class(m));
  }
  std::vector<Eigen::Vector2d> curve;
  for (const Bin& bin : quantile_bins(pairs, 2 * kCurveBins))
    curve.emplace_back(bin.centre, bin.median);
  plot.line(curve, "ink");
  return plot.str();
}

std::string time_plots(const Facts& facts) {
  const MeasurementKind kind = facts.run.calibration.kind;
  std::vector<Component> components;
  if (kind == MeasurementKind::kCorners) {
    components = {{"column", 0}, {"row", 1}};
  } else {
    components = {{"x", 0}, {"y", 1}, {"z", 2}};
  }
  std::string out;
  for (const Component& component : components) out += time_plot(facts, component);
  return out;
}

std::string joint_plot(const Facts& facts, std::size_t j) {
  const Joint& joint = facts.run.calibration.tree.joints[j];
  const auto& series = facts.analysis.joint_errors[j];
  if (series.size() < 2) return "";
  const DisplayUnit unit = display_unit(joint_quantity(joint.type));
  std::vector<std::pair<double, double>> pairs;
  std::vector<double> errors;
  double low = 1e300, high = -1e300;
  for (const JointError& one : series) {
    pairs.emplace_back(unit.factor * one.value, unit.factor * one.error);
    errors.push_back(unit.factor * one.error);
    low = std::min(low, unit.factor * one.value);
    high = std::max(high, unit.factor * one.value);
  }
  pad_range(low, high, 0.02);
  const double limit = robust_limit(errors);
  Plot plot(fmt::format("Residual as an error of {}", joint.name),
            {.label = fmt::format("{}, {}", joint.name, unit.text), .lower = low, .upper = high},
            {.label = fmt::format("error, {}", unit.text), .lower = -limit, .upper = limit},
            {.width = 460.0, .height = 210.0});
  std::vector<Eigen::Vector2d> dots, median;
  const std::size_t stride = std::max<std::size_t>(1, pairs.size() / 600);
  for (std::size_t k = 0; k < pairs.size(); k += stride)
    dots.emplace_back(pairs[k].first, pairs[k].second);
  plot.dots(dots, "faint");
  std::vector<double> x, lower, upper;
  for (const Bin& bin : quantile_bins(pairs, kCurveBins)) {
    x.push_back(bin.centre);
    lower.push_back(bin.low);
    upper.push_back(bin.high);
    median.emplace_back(bin.centre, bin.median);
  }
  plot.band(x, lower, upper, "c0");
  plot.line(median, "c0");
  return plot.str();
}

std::string joint_plots(const Facts& facts) {
  std::string out;
  for (std::size_t j = 0; j < facts.analysis.joint_errors.size(); ++j) {
    const std::string plot = joint_plot(facts, j);
    if (plot.empty()) continue;
    out += figure(plot, facts.run.calibration.tree.joints[j].name, "half");
  }
  return out;
}

std::string histogram(const Facts& facts) {
  const Analysis& analysis = facts.analysis;
  if (analysis.components.empty() || !(analysis.component_rms > 0.0)) return "";
  const bool corners = facts.run.calibration.kind == MeasurementKind::kCorners;
  const double factor = corners ? 1.0 : 1000.0;
  const double rms = factor * analysis.component_rms;
  constexpr int kBars = 41;
  constexpr double kSpan = 4.0;  ///< rms to each side
  const double step = 2.0 * kSpan * rms / kBars;
  std::array<double, kBars> counts{};
  for (const double component : analysis.components) {
    const double place = std::floor((factor * component + kSpan * rms) / step);
    counts[static_cast<std::size_t>(std::clamp(place, 0.0, kBars - 1.0))] += 1.0;
  }
  const auto total = static_cast<double>(analysis.components.size());
  const auto density = [&](double x) {
    return std::exp(-0.5 * x * x / (rms * rms)) / (rms * std::sqrt(2.0 * std::numbers::pi));
  };
  double top = density(0.0);
  for (double& count : counts) {
    count /= total * step;
    top = std::max(top, count);
  }
  Plot plot(
      "Histogram of the residual components",
      {.label = corners ? "residual component, px" : "residual component, mm",
       .lower = -kSpan * rms,
       .upper = kSpan * rms},
      {.label = corners ? "density, 1/px" : "density, 1/mm", .lower = 0.0, .upper = 1.05 * top},
      {.width = 460.0, .height = 250.0});
  std::vector<Eigen::Vector2d> curve;
  for (int k = 0; k < kBars; ++k) {
    const double from = -kSpan * rms + k * step;
    plot.bar(from, from + step, 0.0, counts[static_cast<std::size_t>(k)], "c0");
  }
  for (int k = 0; k <= 80; ++k) {
    const double x = kSpan * rms * (k / 40.0 - 1.0);
    curve.emplace_back(x, density(x));
  }
  plot.line(curve, "c1");
  plot.legend("residuals (ends: all beyond)", "c0 area");
  plot.legend("normal curve of the same rms", "c1");
  return plot.str();
}

std::string dependence_table(const Facts& facts) {
  if (facts.analysis.dependence.empty()) {
    return paragraph(
        "Too few independent frames to say whether the residual follows a joint value or the time.",
        "note");
  }
  Table table("dependence-table", "How much of the residual follows one variable", facts.result);
  table.header({"Variable", "Share of its variance, %", "Half range of the mean curve", "Frames"});
  const bool corners = facts.run.calibration.kind == MeasurementKind::kCorners;
  for (std::size_t k = 0; k < facts.analysis.dependence.size(); ++k) {
    const Dependence& one = facts.analysis.dependence[k];
    const std::string at = fmt::format("/residuals/dependence/{}", k);
    const Quantity quantity =
        one.time ? (corners ? Quantity::kPixels : Quantity::kLength)
                 : joint_quantity(
                       facts.run.calibration.tree.joints[static_cast<std::size_t>(one.joint)].type);
    table.begin_row();
    table.text(one.on);
    table.number(at + "/share", Quantity::kPercent);
    table.number_with_unit(at + "/half_range", quantity);
    table.number(at + "/frames", Quantity::kCount);
  }
  return table.str() + paragraph(
                           "What chance gives is taken off. Variables "
                           "that move together share what they "
                           "explain: this points to a place to look, it does not prove a cause.",
                           "note");
}

}  // namespace

std::string residuals_section(const Facts& facts) {
  std::string out = section_head("residuals", "Residuals");
  out +=
      "<p>Observed minus predicted by the final model. Rms of one component: " +
      inline_number(facts.result, "/residuals/component_rms",
                    facts.run.calibration.kind == MeasurementKind::kCorners ? Quantity::kPixels
                                                                            : Quantity::kLength) +
      "; beyond twice that: " +
      inline_number(facts.result, "/residuals/outside_two_sigma", Quantity::kPercent) +
      " (normal: 4.55 %).</p>\n";
  out += dependence_table(facts);
  if (has_corners(facts)) {
    out += "<h3 id=\"residuals-image\">Over the image</h3><div class=\"figures\">";
    for (std::size_t c = 0; c < facts.run.calibration.cameras(); ++c) {
      out += figure(image_field(facts, c), "Mean residual in each part of the image, magnified.",
                    "half");
    }
    out += figure(image_scatter(facts),
                  "Every corner, by marker. Circle: holds 95 % of a normal error of this rms.",
                  "third");
    out += "</div>\n";
  }
  out += "<h3 id=\"residuals-time\">Over time</h3>";
  out += figure(time_plots(facts),
                has_corners(facts)
                    ? "Mean over each marker's corners, colours as above; line: running median."
                    : "Displacement of each marker; line: running median.",
                "wide");
  const std::string joints = joint_plots(facts);
  if (!joints.empty()) {
    out += "<h3 id=\"residuals-joints\">Over each joint value</h3>";
    out += paragraph(
        "What error of this joint alone would best explain each frame: dots; line: median; band: "
        "two thirds of "
        "the frames. A flat line at zero means nothing is left that follows this joint.");
    out += "<div class=\"figures\">" + joints + "</div>\n";
  }
  const std::string bars = histogram(facts);
  if (!bars.empty()) {
    out += "<h3 id=\"residuals-histogram\">Against the normal curve</h3>" +
           figure(bars, "Components of all used residuals.", "half");
  }
  return out + "</section>\n";
}

}  // namespace kinescope::report
