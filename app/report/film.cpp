// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/plot.h"
#include "app/report/sections.h"

namespace kinescope::report {
namespace {

// 1, 2 or 5 times a power of ten, at most as large.
double round_factor(double factor) {
  const double power = std::pow(10.0, std::floor(std::log10(factor)));
  const double share = factor / power;
  return (share < 2.0 ? 1.0 : share < 5.0 ? 2.0 : 5.0) * power;
}

// By how much the arrows are longer than the residuals: a usual one is a fortieth of the picture.
double arrow_scale(const Facts& facts, const Still& still) {
  constexpr double kShareOfWidth = 0.025;
  const double usual = facts.analysis.component_rms;
  return usual > 0.0 ? round_factor(kShareOfWidth * still.width / usual) : 1.0;
}

// The corners used, by frame and marker.
using Seen = std::map<int, std::map<std::size_t, std::vector<const CornerPoint*>>>;

Seen seen_in(const Analysis& analysis) {
  Seen out;
  for (const CornerPoint& corner : analysis.corners)
    out[corner.frame][corner.marker].push_back(&corner);
  return out;
}

std::string marker_drawing(const std::vector<const CornerPoint*>& corners, std::size_t marker,
                           double scale) {
  std::string outline, arrows;
  for (const CornerPoint* corner : corners) {
    const Eigen::Vector2d tip = corner->pixel + scale * corner->residual;
    outline += fmt::format("{}{:.1f},{:.1f}", outline.empty() ? "" : " ", corner->pixel.x(),
                           corner->pixel.y());
    arrows += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", corner->pixel.x(), corner->pixel.y(),
                          tip.x(), tip.y());
  }
  constexpr std::size_t kOfASquare = 4;  // a board has more, in rows
  const std::string square =
      corners.size() == kOfASquare
          ? fmt::format("<polygon class=\"{}\" points=\"{}\"/>", series_class(marker), outline)
          : "";
  return fmt::format("{}<path d=\"{}\"/>", square, arrows);
}

std::string picture(const Still& still, int frame, const Seen& seen, double scale, bool shown) {
  std::string markers;
  if (const auto found = seen.find(frame); found != seen.end())
    for (const auto& [marker, corners] : found->second)
      markers += marker_drawing(corners, marker, scale);
  return fmt::format(
      "<svg{} data-t=\"{:.4f}\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"The video at "
      "{:.2f} s\"><image width=\"{}\" height=\"{}\" "
      "href=\"data:image/jpeg;base64,{}\"/>{}</svg>\n",
      shown ? " class=\"shown\"" : "", still.time_s, still.width, still.height, still.time_s,
      still.width, still.height, still.jpeg_base64, markers);
}

}  // namespace

std::string film(const Facts& facts) {
  const std::vector<Still>& stills = facts.run.film;
  if (stills.empty()) return "";
  const std::vector<double>& times_s = facts.run.calibration.times_s;
  const Seen seen = seen_in(facts.analysis);
  const double scale = arrow_scale(facts, stills.front());
  const std::size_t middle = stills.size() / 2;
  std::string out = "<figure id=\"film\">\n";
  for (std::size_t k = 0; k < stills.size(); ++k) {
    const auto frame = std::ranges::min_element(
        times_s, {}, [&](double time_s) { return std::abs(time_s - stills[k].time_s); });
    out += picture(stills[k], static_cast<int>(frame - times_s.begin()), seen, scale, k == middle);
  }
  return out +
         fmt::format(
             "<figcaption>The video at <span id=\"film-clock\">{:.2f}</span> s: markers where they "
             "were seen, and what the model misses each corner by, {:g} times as long.</figcaption>"
             "\n</figure>\n",
             stills[middle].time_s, scale);
}

}  // namespace kinescope::report
