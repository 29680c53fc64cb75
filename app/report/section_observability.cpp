// SPDX-License-Identifier: Apache-2.0
//
// What the data see, and what they cannot tell apart.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/plot.h"
#include "app/report/sections.h"

namespace kinescope::report {
namespace {

constexpr double kMatrixSize = 560.0;
constexpr std::size_t kMostCorrelated = 160;  ///< of the correlation matrix; above, it is left out
constexpr int kShades = 5;                    ///< of each sign

std::string ladder(const std::vector<double>& values) {
  std::vector<Eigen::Vector2d> dots;
  double low = 0.0;
  if (values.empty() || !(values.front() > 0.0)) return "";
  constexpr double kFloor = -16.0;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const double relative = values[k] / values.front();
    const double height = relative > 0.0 ? std::max(kFloor, std::log10(relative)) : kFloor;
    dots.emplace_back(static_cast<double>(k + 1), height);
    low = std::min(low, height);
  }
  Plot plot("Singular values of the scaled Jacobian",
            {.label = "number", .lower = 0.0, .upper = static_cast<double>(values.size()) + 1.0},
            {.label = "against the largest", .lower = low - 0.3, .upper = 0.2, .log10 = true},
            {.width = 460.0, .height = 250.0});
  plot.line(dots, "c0");
  plot.dots(dots, "c0");
  return plot.str();
}

std::string cell(double x, double y, double size) {
  const std::string s = drawn(size);
  return fmt::format("M{} {}h{}v{}h-{}z", drawn(x), drawn(y), s, s, s);
}

/// Lines between the blocks of parameters, and their names.
std::string block_marks(const std::vector<Parameter>& parameters, double left, double size) {
  std::string lines, names;
  std::size_t from = 0;
  const auto count = parameters.size();
  for (std::size_t k = 1; k <= count; ++k) {
    if (k < count && parameters[k].block == parameters[from].block) continue;
    const double at = static_cast<double>(k) * size;
    const double end = static_cast<double>(count) * size;
    if (k < count) {
      lines += fmt::format("M{} {}H{}M{} 0V{}", drawn(left), drawn(at), drawn(left + end),
                           drawn(left + at), drawn(end));
    }
    if (static_cast<double>(k - from) * size >= 9.0) {
      names +=
          fmt::format("<text class=\"tick\" x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>",
                      drawn(left - 4.0), drawn(0.5 * (static_cast<double>(from) * size + at) + 4.0),
                      escaped(parameters[from].block));
    }
    from = k;
  }
  return fmt::format("<path class=\"frame\" d=\"{}\"/>{}", lines, names);
}

/// One path a shade: dark for strong, blue for negative, orange for positive.
std::string correlation_matrix(const Calibration& calibration) {
  const std::size_t count = calibration.parameters.size();
  if (count < 2 || count > kMostCorrelated ||
      calibration.covariance.rows() != static_cast<Eigen::Index>(count)) {
    return "";
  }
  const double left = 90.0;
  const double size = kMatrixSize / static_cast<double>(count);
  std::array<std::string, 2 * kShades> paths;
  for (std::size_t a = 0; a < count; ++a) {
    for (std::size_t b = 0; b < count; ++b) {
      const double r = a == b ? 1.0 : correlation(calibration, a, b);
      const int shade = static_cast<int>(std::abs(r) * kShades * 0.999999);
      if (shade == 0) continue;
      const int sign = r < 0.0 ? kShades : 0;
      paths[static_cast<std::size_t>(sign + shade)] +=
          cell(left + static_cast<double>(b) * size, static_cast<double>(a) * size, size);
    }
  }
  std::string drawing;
  for (std::size_t k = 0; k < paths.size(); ++k) {
    if (paths[k].empty()) continue;
    const bool negative = k >= kShades;
    drawing += fmt::format("<path class=\"{}\" style=\"opacity:{:.2f}\" d=\"{}\"/>",
                           negative ? "minus" : "plus",
                           static_cast<double>(k % kShades) / (kShades - 1), paths[k]);
  }
  return fmt::format(
      "<svg class=\"matrix\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"Correlation of the "
      "parameters\">{}<path class=\"frame\" d=\"M{} 0h{}v{}h-{}z\"/>{}</svg>",
      drawn(left + kMatrixSize + 1.0), drawn(kMatrixSize + 1.0), drawing, drawn(left),
      drawn(kMatrixSize), drawn(kMatrixSize), drawn(kMatrixSize),
      block_marks(calibration.parameters, left, size));
}

std::string weak_list(const Facts& facts) {
  const auto& weak = facts.run.calibration.observability.weak;
  if (weak.empty()) {
    return paragraph("No combination of parameters is weakly determined by this recording.",
                     "note");
  }
  Table table("weak-table", "What this recording (hardly) tells apart", facts.result);
  table.header({"In words", "Singular value, relative", "Parameters and their weights"});
  constexpr std::size_t kMostWeights = 5;
  for (std::size_t k = 0; k < weak.size(); ++k) {
    table.begin_row();
    table.text(weak[k].words);
    table.number(fmt::format("/observability/weak/{}/relative_singular_value", k),
                 Quantity::kPlain);
    std::string weights;
    for (std::size_t w = 0; w < std::min(kMostWeights, weak[k].parameters.size()); ++w) {
      const auto& [index, weight] = weak[k].parameters[w];
      const auto& parameters = facts.run.calibration.parameters;
      if (index < 0 || static_cast<std::size_t>(index) >= parameters.size()) continue;
      weights +=
          (weights.empty() ? "" : "; ") +
          fmt::format("{} {:+.2f}", parameters[static_cast<std::size_t>(index)].name, weight);
    }
    table.text(weights);
  }
  return table.str();
}

std::string correlation_table(const Facts& facts) {
  const nlohmann::json& pairs = facts.result.at("observability").at("strong_correlations");
  if (pairs.empty()) {
    return paragraph(fmt::format("No two parameters correlate by {} or more.", kStrongCorrelation),
                     "note");
  }
  Table table("correlations-table",
              fmt::format("Pairs of parameters that correlate by {} or more", kStrongCorrelation),
              facts.result);
  table.header({"Parameter", "Parameter", "Correlation"});
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    table.begin_row();
    table.text(pairs[k].at("a").get<std::string>());
    table.text(pairs[k].at("b").get<std::string>());
    table.number(fmt::format("/observability/strong_correlations/{}/correlation", k),
                 Quantity::kPlain);
  }
  return table.str();
}

}  // namespace

std::string observability_section(const Facts& facts) {
  const Calibration& calibration = facts.run.calibration;
  std::string out =
      section_head("observability", "What the data see, and what they cannot tell apart");
  // Beyond what a double holds, the worst determined combination is not known at all.
  constexpr double kSingular = 1e16;
  if (calibration.observability.condition_number < kSingular) {
    out += "<p>Condition number of the scaled Jacobian: " +
           inline_number(facts.result, "/observability/condition_number", Quantity::kPlain) +
           ": so many times less well than the best determined combination of parameters is the "
           "worst determined one known.</p>\n";
  } else {
    out +=
        "<p>Some combination of parameters is not determined at all: the Jacobian is "
        "singular.</p>\n";
  }
  out += weak_list(facts) + "<div class=\"figures\">";
  const std::string steps = ladder(calibration.observability.singular_values);
  if (!steps.empty()) {
    out += figure(
        steps, "Singular values, largest first: a step down is a combination that is hardly seen.",
        "half");
  }
  const std::string matrix = correlation_matrix(calibration);
  if (!matrix.empty()) {
    out += figure(matrix,
                  "Correlation of the parameters in the order of their table: orange positive, "
                  "blue negative, "
                  "full colour at 1.",
                  "half");
  }
  return out + "</div>\n" + correlation_table(facts) + "</section>\n";
}

}  // namespace kinescope::report
