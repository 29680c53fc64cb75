// SPDX-License-Identifier: Apache-2.0
//
// Whether stated uncertainties of lengths hold: errors against what was claimed of them.
#pragma once

#include <cmath>

#include <gtest/gtest.h>

#include "calib/bundle/calibration.h"

namespace kinescope::truth {

/// Errors over claims, squared, and how many are within twice the claim.
struct Coverage {
  int count = 0;
  int held = 0;
  double square = 0.0;

  void add(double error, const Sigma& sigma) {
    ASSERT_TRUE(sigma);
    ++count;
    held += error < 2.0 * *sigma ? 1 : 0;
    square += std::pow(error / *sigma, 2);
  }

  [[nodiscard]] double share() const { return static_cast<double>(held) / count; }
  [[nodiscard]] double rms() const { return std::sqrt(square / count); }
};

}  // namespace kinescope::truth
