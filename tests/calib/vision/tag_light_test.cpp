// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/tag_light.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

namespace kinescope::whole_tag {
namespace {

TagCode some_code() {
  TagCode code(4, Cell::kBright);
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column)
      code.set(column, row, (column * 5 + row * 3) % 4 < 2 ? Cell::kDark : Cell::kBright);
  }
  return code;
}

const TagPlace kSomewhere{1.8, 2.3, {0.21, 0.05}, {0.04, 0.19}};
const Eigen::Matrix2d kBlur = (Eigen::Matrix2d() << 1.1, 0.2, 0.2, 0.7).finished();

// The light by brute force: a Gaussian around the pixel, point by point.
double summed(const TagCode& code, const TagPlace& place, const Eigen::Matrix2d& blur) {
  constexpr double kStep = 0.04;  // standard deviations
  constexpr int kCount = 125;     // to 5 of them
  const Eigen::Matrix2d root = blur.llt().matrixL();
  double sum = 0.0;
  double weights = 0.0;
  for (int i = -kCount; i <= kCount; ++i) {
    for (int j = -kCount; j <= kCount; ++j) {
      const Eigen::Vector2d z(i * kStep, j * kStep);
      const Eigen::Vector2d px = root * z;
      const auto cell = [](double at) {
        return std::clamp(static_cast<int>(std::floor(at)), -1, 4);
      };
      const double weight = std::exp(-0.5 * z.squaredNorm());
      weights += weight;
      if (code.at(cell(place.x + place.per_px_x.dot(px)), cell(place.y + place.per_px_y.dot(px))) ==
          Cell::kBright)
        sum += weight;
    }
  }
  return sum / weights;
}

TEST(TagLight, IsThatOfABlurredCode) {
  constexpr double kSame = 3e-3;  // of the contrast: the sum's own steps
  const TagCode code = some_code();
  for (const double x : {-0.1, 0.6, 1.0, 1.8, 3.4}) {
    for (const double y : {0.2, 2.05, 3.9}) {
      TagPlace place = kSomewhere;
      place.x = x;
      place.y = y;
      EXPECT_NEAR(bright_share(code, place, kBlur).value, summed(code, place, kBlur), kSame)
          << x << " " << y;
    }
  }
}

TEST(TagLight, SlopesAreThoseOfDifferences) {
  constexpr double kStep = 1e-4;
  constexpr double kSame = 0.02;  // per cell, per px^2: where the series of slopes ends
  const TagCode code = some_code();
  const Share share = bright_share(code, kSomewhere, kBlur);
  const auto slope = [&](const auto& change) {
    const auto at = [&](double step) {
      TagPlace place = kSomewhere;
      Eigen::Matrix2d blur = kBlur;
      change(place, blur, step);
      return bright_share(code, place, blur).value;
    };
    return (at(kStep) - at(-kStep)) / (2.0 * kStep);
  };
  using Blur = Eigen::Matrix2d;
  EXPECT_NEAR(share.x, slope([](TagPlace& p, Blur&, double d) { p.x += d; }), kSame);
  EXPECT_NEAR(share.y, slope([](TagPlace& p, Blur&, double d) { p.y += d; }), kSame);
  EXPECT_NEAR(share.blur(0), slope([](TagPlace&, Blur& b, double d) { b(0, 0) += d; }), kSame);
  EXPECT_NEAR(share.blur(1), slope([](TagPlace&, Blur& b, double d) {
                b(0, 1) += d;
                b(1, 0) += d;
              }),
              kSame);
  EXPECT_NEAR(share.blur(2), slope([](TagPlace&, Blur& b, double d) { b(1, 1) += d; }), kSame);
}

// A bright half plane that grows by d is the same one seen d further on.
TEST(TagLight, SpreadMovesTheBorder) {
  TagCode code(4, Cell::kBright);
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) code.set(column, row, Cell::kDark);
  }
  const TagPlace place{0.1, 2.0, {0.2, 0.0}, {0.0, 0.2}};
  const Share share = bright_share(code, place, 0.6 * Eigen::Matrix2d::Identity());
  EXPECT_NEAR(share.spread, -share.x * 0.2, 1e-9);
  EXPECT_GT(share.spread, 0.1);
}

}  // namespace
}  // namespace kinescope::whole_tag
