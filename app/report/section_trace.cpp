// SPDX-License-Identifier: Apache-2.0
//
// Closing the loop, told as a diagnosis: what was left, what it was, what is left now.
#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/plot.h"
#include "app/report/sections.h"
#include "app/report/trace_lines.h"
#include "app/report/trace_section.h"
#include "app/report/trace_words.h"

namespace kinescope::report {
namespace {

constexpr Eigen::Index kMostBins = 40;

// Means of the values over bins of equal count; NaN values are left out.
struct Binned {
  std::vector<Eigen::Vector2d> before;
  std::vector<Eigen::Vector2d> after;
  std::vector<Eigen::Vector2d> effect;
};

Binned bin(const EffectPicture& picture, double x_factor, double y_factor) {
  std::vector<Eigen::Index> order;
  for (Eigen::Index i = 0; i < picture.at.size(); ++i) {
    if (std::isfinite(picture.before[i]) && std::isfinite(picture.after[i])) order.push_back(i);
  }
  std::ranges::stable_sort(order, {}, [&](Eigen::Index i) { return picture.at[i]; });
  Binned out;
  const auto n = static_cast<Eigen::Index>(order.size());
  const Eigen::Index bins = std::min(kMostBins, n);
  for (Eigen::Index b = 0; b < bins; ++b) {
    const Eigen::Index first = b * n / bins;
    const Eigen::Index last = (b + 1) * n / bins;
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for (Eigen::Index k = first; k < last; ++k) {
      const Eigen::Index i = order[static_cast<std::size_t>(k)];
      sum += Eigen::Vector4d(picture.at[i] * x_factor, picture.before[i] * y_factor,
                             picture.after[i] * y_factor, picture.effect[i] * y_factor);
    }
    sum /= static_cast<double>(last - first);
    out.before.emplace_back(sum[0], sum[1]);
    out.after.emplace_back(sum[0], sum[2]);
    out.effect.emplace_back(sum[0], sum[3]);
  }
  return out;
}

void widen(const std::vector<Eigen::Vector2d>& points, int axis, double& low, double& high) {
  for (const Eigen::Vector2d& point : points) {
    low = std::min(low, point[axis]);
    high = std::max(high, point[axis]);
  }
}

std::string label_of(const std::string& name, const std::string& unit) {
  return unit.empty() ? name : fmt::format("{}, {}", name, unit);
}

// Before and after side by side, on the same scale.
std::string effect_figure(const TracedEffect& effect) {
  const EffectPicture& picture = effect.picture;
  if (picture.covariate.empty()) return "";
  const AmountUnit x = amount_unit(picture.covariate == "time" ? "" : picture.covariate_unit);
  const AmountUnit y = amount_unit(picture.unit);
  const Binned points = bin(picture, x.factor, y.factor);
  if (points.before.size() < 2) return "";
  double left = points.before.front().x();
  double right = points.before.back().x();
  double low = 1e300;
  double high = -1e300;
  widen(points.before, 1, low, high);
  widen(points.after, 1, low, high);
  pad_range(left, right);
  pad_range(low, high, 0.1);
  const std::string x_label =
      label_of(picture.covariate, picture.covariate == "time" ? "s" : x.text);
  std::string drawing;
  for (const bool before : {true, false}) {
    Plot plot(fmt::format("{} {}", effect.id.effect, before ? "before" : "after"),
              {.label = x_label, .lower = left, .upper = right},
              {.label = label_of(before ? "before" : "after", y.text), .lower = low, .upper = high},
              {.width = 420.0, .height = 230.0});
    if (before) plot.line(points.effect, series_class(1));
    plot.dots(before ? points.before : points.after, series_class(0));
    plot.legend("measured, mean of a bin", series_class(0));
    if (before) plot.legend("the effect", series_class(1));
    drawing += figure(plot.str(),
                      before ? fmt::format("{}, before it is in the model.", effect_name(effect))
                             : "What is left with it in the model, on the same scale.");
  }
  return "<div class=\"figures pair\">" + drawing + "</div>\n";
}

// The vector at each node as an arrow over the image; the longest one that stands out of its doubt
// is as long as two nodes are apart, and no other longer.
std::string field_figure(const Rest& rest) {
  const FieldMap& field = rest.field;
  const auto is_clear = [&](Eigen::Index i) {
    return field.mean.row(i).norm() > kCoverageFactor * field.sigma.row(i).norm();
  };
  double longest = 0.0;
  for (Eigen::Index i = 0; i < field.at.rows(); ++i) {
    if (is_clear(i)) longest = std::max(longest, field.mean.row(i).norm());
  }
  if (!(longest > 0.0)) longest = field.mean.rowwise().norm().maxCoeff();
  const Eigen::RowVector2d low = field.at.colwise().minCoeff().array() - field.spacing;
  const Eigen::RowVector2d high = field.at.colwise().maxCoeff().array() + field.spacing;
  constexpr double kWidth = 470.0;
  constexpr double kNarrowest = 0.2;
  constexpr double kHighest = 2.0;
  const double aspect =
      std::clamp((high.y() - low.y()) / (high.x() - low.x()), kNarrowest, kHighest);
  Plot plot(
      "what is left over the image",
      {.label = label_of("image column", rest.covariate_unit), .lower = low.x(), .upper = high.x()},
      {.label = label_of("image row", rest.covariate_unit),
       .lower = low.y(),
       .upper = high.y(),
       .down = true},
      {.width = kWidth, .height = 48.0 + (kWidth - 62.0) * aspect});
  const double scale = longest > 0.0 ? 2.0 * field.spacing / longest : 0.0;
  for (Eigen::Index i = 0; i < field.at.rows(); ++i) {
    const double length = field.mean.row(i).norm();
    const double shortened = length > longest ? longest / length : 1.0;
    const Eigen::Vector2d half = 0.5 * scale * shortened * field.mean.row(i).transpose();
    const Eigen::Vector2d at = field.at.row(i).transpose();
    plot.arrow(at - half, at + half, is_clear(i) ? series_class(1) : "faint");
  }
  plot.legend(
      fmt::format("longest arrow {}; stands out of its doubt", amount_text(longest, rest.unit)),
      series_class(1));
  plot.legend("does not", "faint");
  return figure(plot.str(),
                fmt::format("What is left at {} as a function of the {}: from where the model "
                            "expects corners to where they are seen (Gaussian process).",
                            rest.place, rest.covariate),
                "half");
}

std::string rest_figure(const Rest& rest) {
  if (rest.is_field()) return field_figure(rest);
  const AmountUnit x = amount_unit(rest.covariate == "time" ? "" : rest.covariate_unit);
  const AmountUnit y = amount_unit(rest.unit);
  std::vector<double> at, lower, upper;
  std::vector<Eigen::Vector2d> mean;
  for (Eigen::Index i = 0; i < rest.at.size(); ++i) {
    at.push_back(rest.at[i] * x.factor);
    mean.emplace_back(at.back(), rest.mean[i] * y.factor);
    lower.push_back((rest.mean[i] - kCoverageFactor * rest.sigma[i]) * y.factor);
    upper.push_back((rest.mean[i] + kCoverageFactor * rest.sigma[i]) * y.factor);
  }
  if (at.size() < 2) return "";
  double left = at.front();
  double right = at.back();
  double low = *std::ranges::min_element(lower);
  double high = *std::ranges::max_element(upper);
  pad_range(left, right);
  pad_range(low, high, 0.1);
  Plot plot("what is left over what it depends on",
            {.label = label_of(rest.covariate, rest.covariate == "time" ? "s" : x.text),
             .lower = left,
             .upper = right},
            {.label = label_of(rest.place, y.text), .lower = low, .upper = high});
  plot.band(at, lower, upper, series_class(0));
  plot.line(mean, series_class(0));
  plot.legend("Gaussian process, k = 2", series_class(0));
  return figure(
      plot.str(),
      fmt::format("What is left at {}, as a function of the {}.", rest.place, rest.covariate),
      "half");
}

std::string effects_table(const Trace& trace) {
  std::string rows;
  for (const TracedEffect& effect : trace.accepted) {
    rows += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.3g} %</td><td>{}</td><td>{}</td></tr>",
        escaped(effect_name(effect)), escaped(effect.words),
        escaped(size_words(effect) + other_sizes_words(effect)), 100.0 * effect.explained,
        escaped(error_change_words(effect.held_out_before, effect.held_out_after)),
        escaped(effect.check));
  }
  return fmt::format(
      "<div class=\"scroll\"><table id=\"trace-table\"><caption>Effects</caption>"
      "<thead><tr><th>Effect</th><th>In words</th><th>Size (95 % interval)</th>"
      "<th>Of the residual</th><th>Error on unseen data, without → with it</th>"
      "<th>Check on the robot</th></tr></thead><tbody>{}</tbody></table></div>",
      rows);
}

std::string not_found_table(const Trace& trace) {
  std::string rows;
  std::string hidden;
  for (const NotFoundEffect& missing : trace.not_found) {
    if (missing.hidden) {
      hidden += fmt::format("<li>{} at {}: {}</li>", escaped(missing.id.effect),
                            escaped(missing.id.place),
                            escaped(missing.record.empty() ? "the model's own parameters take its "
                                                             "shape"
                                                           : "to see it, " + missing.record));
      continue;
    }
    rows += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>", escaped(missing.id.effect),
                        escaped(missing.id.place), escaped(limit_text(missing)));
  }
  std::string out = fmt::format(
      "<details class=\"tests\"><summary>Looked for and not found: {} effects</summary><div "
      "class=\"scroll\">"
      "<table><thead><tr><th>Effect</th><th>Place</th><th>Would have been found from</th></tr>"
      "</thead><tbody>{}</tbody></table></div></details>",
      trace.not_found.size(), rows);
  if (!hidden.empty()) {
    out += fmt::format(
        "<details class=\"tests\"><summary>Cannot show in this recording, at no size that anybody "
        "would overlook</summary><ul>{}</ul>"
        "</details>",
        hidden);
  }
  return out;
}

std::string steps_list(const Trace& trace) {
  std::string items;
  for (const TraceStep& step : trace.steps) {
    items += fmt::format("<li>{}{}: error on unseen data {}</li>", escaped(step.words),
                         items.empty() ? start_words(trace) : "",
                         escaped(amount_text(step.held_out.value, step.held_out.unit)));
  }
  return fmt::format(
      "<details class=\"tests\"><summary>How the search went</summary><ol>{}</ol></details>",
      items);
}

}  // namespace

namespace {

// The first ones open: the search finds what explains most first.
std::string effect_figures(const std::vector<TracedEffect>& effects) {
  constexpr std::size_t kOpen = 3;  // figures that a screen holds
  std::string open, rest;
  for (std::size_t k = 0; k < effects.size(); ++k)
    (k < kOpen ? open : rest) += effect_figure(effects[k]);
  if (rest.empty()) return open;
  return open +
         folded_part(fmt::format("The other {} effects, before and after", effects.size() - kOpen),
                     rest);
}

}  // namespace

std::string trace_section(const Trace& trace, const std::string& further) {
  std::string out = section_head("trace", "Closing the loop");
  const std::vector<std::string> lines = trace_lines(trace);
  if (lines.empty()) return "";
  out += paragraph(lines.front(), "lead");
  if (trace.verdict == TraceVerdict::kNothingToSay) return out + "</section>\n";
  if (!further.empty()) out += paragraph(further);
  if (!trace.accepted.empty()) out += effects_table(trace);
  out += effect_figures(trace.accepted);
  for (const Ambiguity& ambiguity : trace.ambiguities) out += paragraph(ambiguity_words(ambiguity));
  for (const Rest& rest : trace.rest) {
    out += paragraph(rest_words(rest));
    out += rest_figure(rest);
  }
  out += paragraph(
      fmt::format(
          "Every candidate is tested against what the model's own parameters can do, with "
          "the noise judged over {} stretches of time; over all tests together something is "
          "invented in {:.0f} of 100 recordings without effects. {}All tests stand in "
          "trace.json.",
          trace.stretches, 100.0 * trace.false_alarm_rate,
          trace.held_out_after.unit == "px"
              ? "Sightings that contradict those before and after them are left out here, more of "
                "them than in the fit, so that this error is not quite that of the calibration. "
              : ""),
      "note");
  out += not_found_table(trace) + steps_list(trace);
  return out + "</section>\n";
}

}  // namespace kinescope::report
