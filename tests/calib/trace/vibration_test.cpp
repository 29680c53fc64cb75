// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/vibration.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "calib/trace/partition.h"
#include "calib/trace/rest.h"
#include "kinematics/core/rng.h"

namespace kinescope::trace {
namespace {

constexpr int kFrames = 600;
constexpr double kFramesASecond = 30.0;

struct Swing {
  double size = 0.0;
  double frequency_hz = 0.0;
  double memory = 0.0;  // AR(1) of the noise, from frame to frame
};

// One body of eight rows, which the first carrier moves; a second one moves nothing.
Linearisation film(const Swing& swing, std::uint64_t seed) {
  Rng rng(seed);
  constexpr int kRows = 8;
  Linearisation out;
  out.residual.resize(kFrames * kRows);
  out.unit = Eigen::VectorXd::Ones(out.residual.size());
  out.unit_name = "px";
  out.jacobian = RowMatrix::Zero(out.residual.size(), 1);
  out.time_s = Eigen::VectorXd::LinSpaced(kFrames, 0.0, (kFrames - 1) / kFramesASecond);
  out.body.assign(static_cast<std::size_t>(out.residual.size()), 0);
  out.coordinates = 2;
  const double start = rng.uniform(0.0, 2.0 * std::numbers::pi);
  std::vector<Eigen::Triplet<double>> carriers;
  std::vector<double> noise(kRows, 0.0);
  for (int i = 0; i < kFrames; ++i) {
    out.first_row.push_back(i * kRows);
    out.fold.push_back(i * 20 / kFrames % 5);
    const double phase = start + 2.0 * std::numbers::pi * swing.frequency_hz * out.time_s[i];
    for (int k = 0; k < kRows; ++k) {
      const int row = i * kRows + k;
      double& now = noise[static_cast<std::size_t>(k)];
      now = swing.memory * now + std::sqrt(1.0 - swing.memory * swing.memory) * rng.normal();
      const double moved = rng.uniform(1.0, 2.0);
      carriers.emplace_back(row, 0, moved);
      out.residual[row] = now + moved * swing.size * std::sin(phase);
      out.jacobian(row, 0) = 1.0;
    }
  }
  out.first_row.push_back(kFrames * kRows);
  out.carriers.resize(out.residual.size(), 2);
  out.carriers.setFromTriplets(carriers.begin(), carriers.end());
  return out;
}

const std::vector<RestPlace> kPlaces{{"joint", "rad", 0}, {"camera", "px", 1}};
constexpr double kLevel = 0.01;

TEST(Vibration, IsFoundWithItsFrequency) {
  for (const double frequency_hz : {1.7, 3.56, 11.3}) {
    const Linearisation linear = film({.size = 0.5, .frequency_hz = frequency_hz}, 3);
    const NormalSystem system(linear, make_partition(linear));
    const auto found = find_vibration(system, kPlaces, {}, kLevel, {});
    ASSERT_TRUE(found.has_value()) << frequency_hz;
    EXPECT_EQ(found->place, 0U);
    const double phase = 2.0 * std::numbers::pi * frequency_hz * linear.time_s[kFrames - 1];
    // An eighth of a turn over the whole film.
    EXPECT_LT(
        std::abs(std::remainder(found->phase.value[kFrames - 1] - phase, 2.0 * std::numbers::pi)),
        0.25 * std::numbers::pi);
  }
}

TEST(Vibration, AsACurveOverItsPhaseItPredictsWhatIsHeldOut) {
  const Linearisation linear = film({.size = 1.0, .frequency_hz = 3.56}, 5);
  const NormalSystem system(linear, make_partition(linear));
  const Covariate time{"time", "s", linear.time_s};
  const auto rest = find_rest(system, kPlaces, {time}, {}, kLevel, {});
  ASSERT_TRUE(rest.has_value());
  EXPECT_EQ(rest->rest.place, "joint");
  EXPECT_EQ(rest->rest.covariate, "phase of a vibration of 3.56 Hz");
  EXPECT_LT(rest->rest.held_out_after.value, 1.03 * std::sqrt(2.0));
  EXPECT_GT(rest->rest.held_out_before.value, 1.3 * std::sqrt(2.0));
}

TEST(Vibration, NoiseHoldsNone) {
  // At a rate of 1 % more than four of 100 would be a chance of 3e-3.
  constexpr int kRuns = 100;
  for (const double memory : {0.0, 0.8}) {
    int invented = 0;
    for (int seed = 0; seed < kRuns; ++seed) {
      Linearisation linear = film({.memory = memory}, static_cast<std::uint64_t>(seed));
      // Integral time of an AR(1).
      linear.correlation_time_s = (0.5 + memory / (1.0 - memory)) / kFramesASecond;
      const NormalSystem system(linear, make_partition(linear));
      if (find_vibration(system, kPlaces, {}, kLevel, {})) ++invented;
    }
    EXPECT_LE(invented, 4) << "memory " << memory;
  }
}

TEST(Vibration, PosturesHaveNoFrequency) {
  Linearisation linear = film({.size = 1.0, .frequency_hz = 3.56}, 5);
  linear.independent_instants = true;
  const NormalSystem system(linear, make_partition(linear));
  EXPECT_FALSE(find_vibration(system, kPlaces, {}, kLevel, {}).has_value());
}

}  // namespace
}  // namespace kinescope::trace
