// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/golden_section.h"

namespace kinescope {

Maximum golden_section(const std::function<double(double)>& function, double low, double high,
                       int steps) {
  constexpr double kGolden = 0.6180339887498949;
  double left = high - kGolden * (high - low);
  double right = low + kGolden * (high - low);
  double at_left = function(left);
  double at_right = function(right);
  for (int i = 0; i < steps; ++i) {
    if (at_left > at_right) {
      high = right;
      right = left;
      at_right = at_left;
      left = high - kGolden * (high - low);
      at_left = function(left);
    } else {
      low = left;
      left = right;
      at_left = at_right;
      right = low + kGolden * (high - low);
      at_right = function(right);
    }
  }
  return at_left > at_right ? Maximum{left, at_left} : Maximum{right, at_right};
}

}  // namespace kinescope
