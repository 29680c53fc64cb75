// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/splits.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "tests/dynamics/data/log_world.h"

namespace kinescope {
namespace {

/// Trajectories of two joints, 10 Hz, each on a path of its own seed.
TorqueSamples make_samples(const std::vector<int>& lengths, const std::vector<int>& seeds) {
  Eigen::Index total = 0;
  for (const int length : lengths) total += length;
  TorqueSamples out;
  out.t_s.resize(total);
  out.q.resize(total, 2);
  out.trajectory.resize(total);
  Eigen::Index row = 0;
  for (std::size_t p = 0; p < lengths.size(); ++p) {
    for (int k = 0; k < lengths[p]; ++k, ++row) {
      const double t = 0.1 * k;
      out.t_s(row) = t;
      out.q.row(row) << std::sin((0.7 + 0.31 * seeds[p]) * t + seeds[p]),
          std::cos((1.1 + 0.17 * seeds[p]) * t + 2.0 * seeds[p]);
      out.trajectory(row) = static_cast<int>(p);
    }
    out.trajectory_names.push_back("run" + std::to_string(p));
  }
  out.dq = out.q;
  out.ddq = out.q;
  out.torque = out.q;
  return out;
}

/// Every row is judged once, and no fold learns from what it is judged on.
void expect_sound(const Folds& folds, const TorqueSamples& samples, double guard_s) {
  std::vector<int> judged(static_cast<std::size_t>(samples.size()), 0);
  for (const Fold& fold : folds.folds) {
    EXPECT_TRUE(std::ranges::is_sorted(fold.train));
    EXPECT_FALSE(fold.train.empty());
    for (const Eigen::Index row : fold.test) ++judged[static_cast<std::size_t>(row)];
    for (const Eigen::Index a : fold.train) {
      for (const Eigen::Index b : fold.test) {
        ASSERT_NE(a, b);
        if (samples.trajectory(a) != samples.trajectory(b)) continue;
        ASSERT_FALSE(folds.by_trajectory);
        ASSERT_GT(std::abs(samples.t_s(a) - samples.t_s(b)), guard_s);
      }
    }
  }
  EXPECT_TRUE(std::ranges::all_of(judged, [](int count) { return count == 1; }));
}

TEST(Splits, HoldOutWholeTrajectories) {
  const TorqueSamples samples = make_samples({100, 200, 150, 120, 180}, {1, 2, 3, 4, 5});
  const Folds folds = split_folds(samples, {.folds = 3});
  EXPECT_TRUE(folds.by_trajectory);
  EXPECT_EQ(folds.folds.size(), 3U);
  expect_sound(folds, samples, 0.0);
  for (const Fold& fold : folds.folds) EXPECT_GE(fold.test.size(), 180U) << "evenly dealt";
}

TEST(Splits, OneTrajectoryIsCutIntoBlocksWithAGuard) {
  const TorqueSamples samples = make_samples({400}, {1});
  const Folds folds = split_folds(samples, {.folds = 8, .guard_s = 0.55});
  EXPECT_FALSE(folds.by_trajectory);
  EXPECT_EQ(folds.folds.size(), 8U);
  expect_sound(folds, samples, 0.55);
  for (const Fold& fold : folds.folds) {
    EXPECT_EQ(fold.test.back() - fold.test.front() + 1, std::ssize(fold.test)) << "contiguous";
  }
}

TEST(Splits, RepeatsOfOnePathStayTogether) {
  // Runs 0, 2 and 4 follow one path; 4 does so with noise and half as long.
  TorqueSamples samples = make_samples({300, 300, 300, 300, 300}, {1, 2, 1, 3, 1});
  for (Eigen::Index row = 0; row < samples.size(); ++row) {
    if (samples.trajectory(row) == 4)
      samples.q(row, 0) += 1e-3 * std::sin(17.0 * static_cast<double>(row));
  }
  EXPECT_EQ(repeated_paths(samples), (std::vector<int>{0, 1, 0, 3, 0}));
  const Folds folds = split_folds(samples, {.folds = 5});
  EXPECT_EQ(folds.folds.size(), 3U);
  expect_sound(folds, samples, 0.0);
  EXPECT_EQ(findings_of(folds.findings, LogFault::kRepeatedPath).size(), 2U);
  const Folds apart = split_folds(samples, {.folds = 5, .keep_repeats_together = false});
  EXPECT_EQ(apart.folds.size(), 5U);
  const TorqueSamples repeats = make_samples({300, 300}, {1, 1});
  EXPECT_FALSE(split_folds(repeats).by_trajectory) << "one path only: blocks";
}

TEST(Splits, DoNotDependOnTheNumbersOfTrajectories) {
  const TorqueSamples forward = make_samples({100, 130, 160}, {1, 2, 3});
  const TorqueSamples backward = make_samples({160, 130, 100}, {3, 2, 1});
  const auto key = [](const TorqueSamples& samples, const SplitOptions& options) {
    std::set<std::set<double>> tests;
    for (const Fold& fold : split_folds(samples, options).folds) {
      std::set<double> values;
      for (const Eigen::Index row : fold.test) values.insert(samples.q(row, 0));
      tests.insert(values);
    }
    return tests;
  };
  EXPECT_EQ(key(forward, {.folds = 2}), key(backward, {.folds = 2}));
}

TEST(Splits, LastPartIsHeldOut) {
  const TorqueSamples many = make_samples({100, 100, 100, 100}, {1, 2, 3, 4});
  const Fold by_run = split_last(many, 0.25);
  EXPECT_EQ(by_run.test.front(), 300);
  EXPECT_EQ(by_run.train.size(), 300U);
  const TorqueSamples one = make_samples({100}, {1});
  const Fold by_block = split_last(one, 0.3, {.guard_s = 0.45});
  EXPECT_EQ(by_block.test.front(), 70);
  EXPECT_EQ(by_block.train.back(), 65);
  EXPECT_EQ(select_rows(one, by_block.test).size(), 30);
}

TEST(Splits, WhatWasNotMeasuredIsInNoPart) {
  TorqueSamples samples = make_samples({100}, {1});
  samples.torque_missing = MissingTorque::Constant(100, samples.torque.cols(), false);
  samples.torque_missing(3, 0) = samples.torque_missing(80, samples.torque.cols() - 1) = true;
  const auto expect_without = [](const Fold& fold) {
    for (const Eigen::Index row : {3, 80}) {
      EXPECT_EQ(std::ranges::count(fold.train, row), 0) << row;
      EXPECT_EQ(std::ranges::count(fold.test, row), 0) << row;
    }
  };
  std::size_t tested = 0;
  for (const Fold& fold : split_folds(samples, {.folds = 4}).folds) {
    expect_without(fold);
    tested += fold.test.size();
  }
  EXPECT_EQ(tested, 98U);
  expect_without(split_last(samples, 0.3));
  expect_without(split_at_random(samples, 0.3, 1));
  const TorqueSamples measured = measured_part(samples);
  EXPECT_EQ(measured.size(), 98);
  EXPECT_EQ(measured.torque_missing.size(), 0);
  const TorqueSamples split = split_at_gaps(measured);
  EXPECT_EQ(split.trajectory(2), 0);
  EXPECT_EQ(split.trajectory(3), 1);
  EXPECT_EQ(split.trajectory(97), 2);
}

TEST(Splits, RefuseWhatLeavesNothing) {
  const TorqueSamples few = make_samples({6}, {1});
  EXPECT_NE(refusal_of([&] { static_cast<void>(split_folds(few)); }).find("6 samples are too few"),
            std::string::npos);
  const TorqueSamples one = make_samples({100}, {1});
  EXPECT_NE(refusal_of([&] {
              static_cast<void>(split_folds(one, {.folds = 2, .guard_s = 60.0}));
            }).find("leaves nothing to learn from"),
            std::string::npos);
  EXPECT_NE(refusal_of([&] { static_cast<void>(split_folds(one, {.folds = 1})); }).find("1 folds"),
            std::string::npos);
  EXPECT_NE(refusal_of([&] { static_cast<void>(split_last(one, 1.5)); }).find("between 0 and 1"),
            std::string::npos);
}

TEST(Splits, ByLotHasEverySampleOnceAndIsTheSameForASeed) {
  const TorqueSamples samples = make_samples({300, 200}, {1, 2});
  const Fold fold = split_at_random(samples, 0.3, 7);
  EXPECT_EQ(fold.test.size(), 150U);
  std::set<Eigen::Index> all(fold.train.begin(), fold.train.end());
  all.insert(fold.test.begin(), fold.test.end());
  EXPECT_EQ(all.size(), 500U);
  EXPECT_EQ(fold.test, split_at_random(samples, 0.3, 7).test);
  EXPECT_NE(fold.test, split_at_random(samples, 0.3, 8).test);
  const auto in_first =
      std::ranges::count_if(fold.test, [](Eigen::Index row) { return row < 300; });
  EXPECT_NEAR(static_cast<double>(in_first), 90.0, 25.0);  // 4.5 sigma of the lot
  EXPECT_THROW((void)split_at_random(samples, 1.5, 1), Error);
}

}  // namespace
}  // namespace kinescope
