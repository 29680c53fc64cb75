// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/hinge.h"

#include <cmath>
#include <cstddef>
#include <limits>

namespace kinescope::contact {
namespace {

/// Residual sum of squares of y = a + b x with x = max(0, t - bend)^power.
double residual(std::span<const double> t, std::span<const double> y, std::size_t bend, int power) {
  double x1 = 0.0, x2 = 0.0, y1 = 0.0, y2 = 0.0, xy = 0.0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    const double ahead = i > bend ? t[i] - t[bend] : 0.0;
    const double x = power == 1 ? ahead : ahead * ahead;
    x1 += x;
    x2 += x * x;
    y1 += y[i];
    y2 += y[i] * y[i];
    xy += x * y[i];
  }
  const auto n = static_cast<double>(t.size());
  const double sxx = x2 - x1 * x1 / n;
  const double sxy = xy - x1 * y1 / n;
  return y2 - y1 * y1 / n - (sxx > 0.0 ? sxy * sxy / sxx : 0.0);
}

}  // namespace

double bend_time(std::span<const double> t, std::span<const double> y) {
  if (t.size() < 5) return t.front();
  double best = std::numeric_limits<double>::infinity();
  double time = t.front();
  for (const int power : {1, 2}) {
    for (std::size_t bend = 0; bend + 2 < t.size(); ++bend) {
      const double value = residual(t, y, bend, power);
      if (value >= best) continue;
      best = value;
      time = t[bend];
    }
  }
  return time;
}

}  // namespace kinescope::contact
