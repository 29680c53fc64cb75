// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/draws.h"

#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/policy/philox.h"

namespace kinescope::policy {
namespace {

// The known answers that the authors publish with their library (kat_vectors, philox4x32-10).
TEST(Philox, GivesTheKnownAnswers) {
  EXPECT_EQ(philox4x32({0, 0, 0, 0}, {0, 0}),
            (PhiloxCounter{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr std::uint32_t kOnes = 0xffffffff;
  EXPECT_EQ(philox4x32({kOnes, kOnes, kOnes, kOnes}, {kOnes, kOnes}),
            (PhiloxCounter{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox4x32({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (PhiloxCounter{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Draws, OfAParticleDoNotDependOnItsBlock) {
  const DrawPlace place{3, Use::kTransition, 7, 9};
  const DrawPlace dropout{3, Use::kDropout, 7, 9};
  Eigen::MatrixXd all(200, 3);
  Eigen::MatrixXd masks(200, 37);
  draw_normals(place, 0, all);
  draw_dropout(dropout, 0.25, 0, masks);
  for (const Eigen::Index first : {0, 8, 61, 130}) {
    Eigen::MatrixXd part(70, 3);
    Eigen::MatrixXd mask(70, 37);
    draw_normals(place, first, part);
    draw_dropout(dropout, 0.25, first, mask);
    EXPECT_EQ(part, all.middleRows(first, 70));
    EXPECT_EQ(mask, masks.middleRows(first, 70));
  }
}

TEST(Draws, DifferByEveryPartOfTheirPlace) {
  Eigen::MatrixXd base(8, 2);
  draw_normals({1, Use::kTransition, 2, 3}, 0, base);
  for (const DrawPlace& other :
       {DrawPlace{2, Use::kTransition, 2, 3}, DrawPlace{1, Use::kMeasurement, 2, 3},
        DrawPlace{1, Use::kTransition, 3, 3}, DrawPlace{1, Use::kTransition, 2, 4}}) {
    Eigen::MatrixXd draw(8, 2);
    draw_normals(other, 0, draw);
    EXPECT_GT((draw - base).cwiseAbs().minCoeff(), 0.0);
  }
}

// 4 standard errors of 40 000 draws.
TEST(Draws, AreStandardNormal) {
  Eigen::MatrixXd draw(20000, 2);
  draw_normals({5, Use::kStart, 0, 0}, 0, draw);
  const double count = static_cast<double>(draw.size());
  EXPECT_NEAR(draw.mean(), 0.0, 4.0 / std::sqrt(count));
  EXPECT_NEAR(draw.array().square().mean(), 1.0, 4.0 * std::sqrt(2.0 / count));
  EXPECT_NEAR(draw.array().pow(4).mean(), 3.0, 4.0 * std::sqrt(96.0 / count));
  EXPECT_NEAR((draw.col(0).array() * draw.col(1).array()).mean(), 0.0,
              4.0 * std::sqrt(2.0 / count));
}

TEST(Draws, DropAtTheirRateAndKeepTheMean) {
  for (const double rate : {0.0, 0.125, 0.25}) {
    Eigen::MatrixXd mask(1000, 50);
    draw_dropout({5, Use::kDropout, 1, 2}, rate, 0, mask);
    const double count = static_cast<double>(mask.size());
    const double dropped = static_cast<double>((mask.array() == 0.0).count()) / count;
    EXPECT_NEAR(dropped, rate, 4.0 * std::sqrt(rate * (1.0 - rate) / count));
    EXPECT_NEAR(mask.mean(), 1.0, 4.0 * std::sqrt(rate / (1.0 - rate) / count));
  }
}

}  // namespace
}  // namespace kinescope::policy
