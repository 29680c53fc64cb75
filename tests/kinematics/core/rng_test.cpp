// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/rng.h"

#include <cmath>
#include <set>
#include <vector>

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr int kDraws = 200000;
// Four standard deviations of a mean over kDraws values of variance 1.
const double kFourSigma = 4.0 / std::sqrt(static_cast<double>(kDraws));

TEST(Rng, IsTheSameEverywhere) {
  Rng rng(42);
  const std::vector<std::uint32_t> first = {rng.next(), rng.next(), rng.next()};
  Rng again(42);
  for (const std::uint32_t value : first) EXPECT_EQ(again.next(), value);
  EXPECT_EQ(stable_hash(""), 14695981039346656037ULL);
  EXPECT_EQ(stable_hash("a"), 0xAF63DC4C8601EC8CULL) << "FNV-1a's own test vector";
}

TEST(Rng, NamesAndSaltsGiveDifferentStreams) {
  std::set<std::uint32_t> seen;
  for (const char* name : {"a", "b", "ab", "ba"}) {
    for (std::uint64_t salt = 0; salt < 50; ++salt) seen.insert(Rng::from_name(name, salt).next());
  }
  EXPECT_EQ(seen.size(), 200U);
}

TEST(Rng, UniformHasItsMeanSpreadAndRange) {
  Rng rng = Rng::from_name("Rng.Uniform");
  double sum = 0.0;
  double squares = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = rng.uniform(-1.0, 3.0);
    ASSERT_GE(x, -1.0);
    ASSERT_LT(x, 3.0);
    sum += x;
    squares += (x - 1.0) * (x - 1.0);
  }
  const double sigma = 4.0 / std::sqrt(12.0);
  EXPECT_NEAR(sum / kDraws, 1.0, kFourSigma * sigma);
  EXPECT_NEAR(std::sqrt(squares / kDraws), sigma, kFourSigma * sigma);
}

TEST(Rng, NormalHasItsMoments) {
  Rng rng = Rng::from_name("Rng.Normal");
  double sum = 0.0;
  double squares = 0.0;
  double cubes = 0.0;
  double within = 0.0;
  double neighbours = 0.0;
  double previous = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = rng.normal(2.0) / 2.0;
    sum += x;
    squares += x * x;
    cubes += x * x * x;
    if (std::abs(x) < 1.0) within += 1.0;
    neighbours += x * previous;
    previous = x;
  }
  EXPECT_NEAR(sum / kDraws, 0.0, kFourSigma);
  EXPECT_NEAR(squares / kDraws, 1.0, kFourSigma * std::sqrt(2.0));
  EXPECT_NEAR(cubes / kDraws, 0.0, kFourSigma * std::sqrt(15.0));
  EXPECT_NEAR(within / kDraws, 0.682689, kFourSigma * 0.4655);
  EXPECT_NEAR(neighbours / kDraws, 0.0, kFourSigma) << "neighbours are independent";
}

TEST(Rng, IndexReachesAllAndIsEven) {
  Rng rng = Rng::from_name("Rng.Index");
  std::vector<int> counts(7, 0);
  for (int i = 0; i < kDraws; ++i) ++counts[static_cast<std::size_t>(rng.index(7))];
  for (const int count : counts) {
    EXPECT_NEAR(count, kDraws / 7.0, 4.0 * std::sqrt(kDraws * (1.0 / 7.0) * (6.0 / 7.0)));
  }
}

TEST(Rng, DirectionsCoverTheSphere) {
  Rng rng = Rng::from_name("Rng.Directions");
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (int i = 0; i < kDraws; ++i) {
    const Eigen::Vector3d v = rng.unit3();
    ASSERT_NEAR(v.norm(), 1.0, 1e-15 * 10);
    mean += v / kDraws;
    spread += v * v.transpose() / kDraws;
  }
  EXPECT_LT(mean.norm(), kFourSigma);
  EXPECT_LT((spread - Eigen::Matrix3d::Identity() / 3.0).norm(), kFourSigma);
}

}  // namespace
}  // namespace kinescope
