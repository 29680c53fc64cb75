// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/tone_curve.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace kinescope {
namespace {

constexpr double kFull = 255.0;
constexpr double kHighest = 280.0;         // light; what a fit tries beyond white
constexpr double kEntriesPerLight = 16.0;  // entries of the table a unit of light

}  // namespace

ToneCurve::ToneCurve(double gamma) : gamma_(gamma) {
  if (is_linear()) return;
  for (std::size_t i = 0; i < lights_.size(); ++i) lights_[i] = light(static_cast<double>(i));
  greys_.resize(static_cast<std::size_t>(kHighest * kEntriesPerLight) + 2);
  for (std::size_t i = 0; i < greys_.size(); ++i) {
    const double light = static_cast<double>(i) / kEntriesPerLight;
    greys_[i] = static_cast<float>(kFull * std::pow(light / kFull, 1.0 / gamma_));
  }
}

double ToneCurve::light(double grey) const {
  return is_linear() ? grey : kFull * std::pow(std::max(grey, kDarkest) / kFull, gamma_);
}

double ToneCurve::grey(double light) const {
  if (is_linear()) return light;
  const double place = std::clamp(light, 0.0, kHighest) * kEntriesPerLight;
  const auto i = static_cast<std::size_t>(place);
  const double part = place - static_cast<double>(i);
  return (1.0 - part) * static_cast<double>(greys_[i]) + part * static_cast<double>(greys_[i + 1]);
}

}  // namespace kinescope
