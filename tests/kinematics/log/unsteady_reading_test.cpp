// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/unsteady_reading.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr double kReadingStep = 0.01;
constexpr double kExactStep = 1e-12;

struct Read {
  std::vector<double> times_s;
  Eigen::VectorXd truth;
  Eigen::VectorXd reading;
};

// 1.5 rad/s at most.
Read moved(double rate_hz = 200.0) {
  Read out;
  out.truth.resize(2000);
  for (Eigen::Index i = 0; i < out.truth.size(); ++i) {
    const double t = static_cast<double>(i) / rate_hz;
    out.times_s.push_back(t);
    out.truth[i] = 0.5 * std::sin(2.0 * t) + 0.1 * std::sin(5.0 * t);
  }
  out.reading = out.truth;
  return out;
}

Read in_steps(double step, double rate_hz = 200.0) {
  Read out = moved(rate_hz);
  for (double& value : out.reading) value = step * std::round(value / step);
  return out;
}

double rms(const Eigen::VectorXd& error) { return std::sqrt(error.array().square().mean()); }

// What the reading is off by, but for its zero.
double rms_left(const Read& read) {
  const auto found = unsteady_reading(read.times_s, read.reading);
  KINESCOPE_CHECK(found, "the reading is unsteady");
  Eigen::VectorXd off = found->motion - read.truth;
  off.array() -= off.mean();
  return rms(off);
}

TEST(UnsteadyReading, TheStepIsThatOfTheGrid) {
  for (const double step : {0.05, kReadingStep, 2e-3}) {
    const auto found = step_of(in_steps(step).reading);
    ASSERT_TRUE(found) << step;
    EXPECT_NEAR(*found, step, kExactStep);
  }
}

// Written with four digits: steps of 0.0087 or 0.0088.
TEST(UnsteadyReading, DigitsThatWereCutOffAreNoOtherGrid) {
  constexpr double kHalfDegree = 0.00872664626;
  Read read = in_steps(kHalfDegree);
  for (double& value : read.reading) value = 1e-4 * std::round(value / 1e-4);
  const auto step = step_of(read.reading);
  ASSERT_TRUE(step);
  EXPECT_NEAR(*step, kHalfDegree, 1e-6);
}

TEST(UnsteadyReading, AFineGridAndASmoothMotionHaveNothingToSay) {
  EXPECT_FALSE(step_of(in_steps(1e-5).reading));
  EXPECT_FALSE(step_of(moved().reading));
  EXPECT_FALSE(step_of(Eigen::VectorXd::Constant(100, 0.3)));
  EXPECT_FALSE(step_of(Eigen::VectorXd()));
  EXPECT_FALSE(unsteady_reading(moved().times_s, moved().reading));
  EXPECT_FALSE(unsteady_reading(in_steps(1e-5).times_s, in_steps(1e-5).reading));
  EXPECT_FALSE(unsteady_reading({}, Eigen::VectorXd()));
  EXPECT_FALSE(unsteady_reading({0.0}, Eigen::VectorXd::Constant(1, 0.3)));
}

// Three samples on each step: the edges tell the value to a fraction of a step.
TEST(UnsteadyReading, BetweenTheStepsTheTimesOfTheChangesTellTheValue) {
  const Read read = in_steps(kReadingStep);
  const auto found = unsteady_reading(read.times_s, read.reading);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->in_steps);
  EXPECT_NEAR(found->size, kReadingStep, kExactStep);
  EXPECT_LE((found->motion - read.reading).cwiseAbs().maxCoeff(), 0.5 * kReadingStep + kExactStep);
  EXPECT_NEAR(rms(read.reading - read.truth), kReadingStep / std::sqrt(12.0), 0.05 * kReadingStep);
  EXPECT_LT(rms_left(read), 0.06 * kReadingStep);
}

// A tenth of a degree beside a motion of up to four steps a sample.
TEST(UnsteadyReading, StepsThatAMotionLeapsOverAreNoise) {
  const Read read = in_steps(0.1 * std::numbers::pi / 180.0);
  EXPECT_LT(rms_left(read), 0.5 * rms(read.reading - read.truth));
}

// A counter that cuts off is behind by half a step, whichever way the joint moves.
TEST(UnsteadyReading, CuttingOffIsAnotherZero) {
  Read read = moved();
  for (double& value : read.reading) value = kReadingStep * std::floor(value / kReadingStep);
  EXPECT_LT(rms_left(read), 0.06 * kReadingStep);
}

TEST(UnsteadyReading, WhileItRestsOnAStepTheValueIsSomewhereInIt) {
  constexpr std::size_t kRests = 400;  // samples, from the first on
  Read read = moved();
  const double shift = 0.3 * kReadingStep;
  for (std::size_t i = 0; i < read.times_s.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    if (i < kRests) read.truth[at] = read.truth[kRests];
    read.reading[at] = kReadingStep * std::round((read.truth[at] + shift) / kReadingStep);
  }
  const auto found = unsteady_reading(read.times_s, read.reading);
  ASSERT_TRUE(found);
  ASSERT_FALSE(found->doubts.empty());
  const double anywhere = kReadingStep / std::sqrt(12.0);
  const Doubt& rest = found->doubts.front();
  EXPECT_EQ(rest.first_s, read.times_s.front());
  EXPECT_NEAR(rest.last_s, read.times_s[kRests], 0.1);
  EXPECT_EQ(rest.share(read.times_s.front()), 1.0);
  EXPECT_EQ(rest.share(read.times_s[kRests / 2]), 1.0);
  EXPECT_LT(rest.share(rest.last_s - 1e-6), 1e-3);
  EXPECT_EQ(rest.share(rest.last_s + 1.0), 0.0);
  for (const Doubt& doubt : found->doubts) {
    EXPECT_LE(doubt.sigma, anywhere + kExactStep);
    if (doubt.last_s < read.times_s[kRests]) {
      EXPECT_NEAR(doubt.sigma, anywhere, kExactStep);
    }
  }
  EXPECT_LT(found->doubts[2 * found->doubts.size() / 3].sigma, 0.5 * anywhere);
}

// Over steps from a fortieth of the range to a sixth of it: by what the motion is off, over what is
// said of it there. Of few edges it is said with room to spare.
TEST(UnsteadyReading, WhatItIsOffByIsWhatItDoubts) {
  for (const double step : {0.2, 0.1, 0.05, 0.025}) {
    const Read read = in_steps(step);
    const auto found = unsteady_reading(read.times_s, read.reading);
    ASSERT_TRUE(found) << step;
    double squares = 0.0;
    for (Eigen::Index i = 0; i < read.truth.size(); ++i) {
      double variance = 0.0;
      for (const Doubt& doubt : found->doubts)
        variance +=
            std::pow(doubt.sigma * doubt.share(read.times_s[static_cast<std::size_t>(i)]), 2);
      squares += std::pow(found->motion[i] - read.truth[i], 2) / variance;
    }
    const double ratio = std::sqrt(squares / static_cast<double>(read.truth.size()));
    EXPECT_GT(ratio, 0.1) << step;
    EXPECT_LT(ratio, 2.0) << step;
  }
}

TEST(UnsteadyReading, DoubtsThatNobodySeesAreNone) {
  const Read read = in_steps(kReadingStep);
  auto found = unsteady_reading(read.times_s, read.reading);
  ASSERT_TRUE(found);
  const std::vector<Doubt> all = found->doubts;
  const Eigen::Vector2d seen_s(read.times_s[900], read.times_s[300]);
  const double clearly = 1e6 / (kReadingStep * kReadingStep);
  found->keep_visible(seen_s, Eigen::Vector2d(0.0, clearly));
  ASSERT_FALSE(found->doubts.empty());
  for (const Doubt& doubt : found->doubts) EXPECT_GT(doubt.share(seen_s[1]), 0.0);
  found->doubts = all;
  found->keep_visible(seen_s, Eigen::Vector2d(1e-6 * clearly, 0.0));
  EXPECT_TRUE(found->doubts.empty()) << "less than what one look shows";
}

TEST(UnsteadyReading, PosturesShowStepsInWhateverOrder) {
  Rng rng(5);
  Eigen::VectorXd values(60);
  for (double& value : values)
    value = kReadingStep * std::round(rng.uniform(-1.0, 1.0) / kReadingStep);
  const auto found = reading_in_steps(values);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->size, kReadingStep, kExactStep);
  EXPECT_NEAR(found->error, kReadingStep / std::sqrt(12.0), kExactStep);
  for (double& value : values) value = rng.uniform(-1.0, 1.0);
  EXPECT_FALSE(reading_in_steps(values));
}

TEST(UnsteadyReading, NoiseIsAsLargeAsItIs) {
  constexpr double kNoise = 2e-3;
  Read read = moved();
  Rng rng(3);
  for (double& value : read.reading) value += rng.normal(kNoise);
  const auto found = unsteady_reading(read.times_s, read.reading);
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->in_steps);
  EXPECT_NEAR(found->size, kNoise, 0.1 * kNoise);
  EXPECT_LT(rms_left(read), 0.4 * kNoise);
}

TEST(UnsteadyReading, ALogIsSteadiedWhereItJumps) {
  const Read read = in_steps(kReadingStep);
  JointLog log;
  log.times_s = read.times_s;
  log.channels = {"steps", "smooth"};
  log.values.resize(read.truth.size(), 2);
  log.values << read.reading, read.truth;
  const JointLog steady = steadied(log);
  EXPECT_LT(rms(steady.values.col(0) - read.truth), 0.3 * rms(read.reading - read.truth));
  EXPECT_EQ(steady.values.col(1), log.values.col(1));
}

}  // namespace
}  // namespace kinescope
