// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/tone_table.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace kinescope {
namespace {

constexpr double kWhite = 255.0;
constexpr double kEntriesPerShare = 64.0;
constexpr double kBeyond = 0.25;
constexpr double kDarkest = 0.2;        // of the dark cells' light
constexpr double kLeastContrast = 1.0;  // grey levels

}  // namespace

ToneTable::ToneTable(double dark, double bright, double gamma) {
  const double black = std::max(1.0, dark) / kWhite;
  const double white = std::max(black + kLeastContrast / kWhite, bright / kWhite);
  const double low = std::pow(black, gamma);
  const double high = std::pow(white, gamma);
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const double share = static_cast<double>(i) / kEntriesPerShare - kBeyond;
    const double light = std::max(kDarkest * low, low + (high - low) * share);
    const double grey = std::pow(light, 1.0 / gamma);
    // By gamma, at the same levels.
    const double low_slope = low * std::log(black);
    const double light_slope = low_slope + (high * std::log(white) - low_slope) * share;
    entries_[i].value = (grey - black) / (white - black);
    entries_[i].per_gamma =
        grey * (light_slope / light - std::log(light) / gamma) / gamma / (white - black);
  }
}

ToneTable::Value ToneTable::at(double share) const {
  const double place = (share + kBeyond) * kEntriesPerShare;
  const auto i =
      static_cast<std::size_t>(std::clamp(place, 0.0, static_cast<double>(entries_.size()) - 2.0));
  const double part = place - static_cast<double>(i);
  const Entry& a = entries_[i];
  const Entry& b = entries_[i + 1];
  return {a.value + part * (b.value - a.value), (b.value - a.value) * kEntriesPerShare,
          a.per_gamma + part * (b.per_gamma - a.per_gamma)};
}

}  // namespace kinescope
