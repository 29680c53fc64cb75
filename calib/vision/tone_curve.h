// SPDX-License-Identifier: Apache-2.0
//
// Takes   grey levels as a camera delivers them.
// Gives   the light they stand for, and back.
// Units   both 0 to 255.
// Method  grey = 255 (light / 255)^(1 / gamma), the usual form of a camera's tone curve (sRGB is
//         near gamma 2.2).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace kinescope {

class ToneCurve {
 public:
  ToneCurve() = default;  ///< linear
  explicit ToneCurve(double gamma);

  [[nodiscard]] double gamma() const { return gamma_; }
  [[nodiscard]] bool is_linear() const { return gamma_ == 1.0; }
  /// Of a grey level; below kDarkest as there.
  [[nodiscard]] double light(double grey) const;
  /// Of a pixel. Not for a linear curve.
  [[nodiscard]] double light(std::uint8_t pixel) const { return lights_[pixel]; }
  /// The inverse, from a table.
  [[nodiscard]] double grey(double light) const;
  /// Change of grey per change of light, where `grey` stands for `light` above nought.
  [[nodiscard]] double slope(double grey, double light) const { return grey / (gamma_ * light); }

  static constexpr double kDarkest = 1.0;  ///< grey level; a power has no slope at nought

 private:
  double gamma_ = 1.0;
  std::array<double, 256> lights_{};  // of a pixel's levels
  std::vector<float> greys_;          // of evenly spaced lights; empty for a linear curve
};

}  // namespace kinescope
