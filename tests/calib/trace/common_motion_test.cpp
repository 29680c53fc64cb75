// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/common_motion.h"

#include <gtest/gtest.h>

#include "calib/trace/partition.h"
#include "kinematics/core/rng.h"

namespace kinescope::trace {
namespace {

constexpr int kMotionInstants = 300;
constexpr int kBodies = 3;
constexpr int kRowsOfBody = 4;

// What each instant does to the rows beside white noise of 1: a shake of the first carrier, which
// moves the last two bodies, an error of each body, an error of the time (the second carrier).
struct Unrest {
  double shake = 0.0;
  double of_body = 0.0;
  double of_time = 0.0;
};

Linearisation world(const Unrest& unrest) {
  Rng rng(7);
  constexpr int kRowsAtOnce = kBodies * kRowsOfBody;
  Linearisation out;
  out.residual.resize(kMotionInstants * kRowsAtOnce);
  out.unit = Eigen::VectorXd::Ones(out.residual.size());
  out.jacobian = RowMatrix::Zero(out.residual.size(), 1);
  out.time_s = Eigen::VectorXd::LinSpaced(kMotionInstants, 0.0, 10.0);
  std::vector<Eigen::Triplet<double>> carriers;
  for (int i = 0; i < kMotionInstants; ++i) {
    out.first_row.push_back(i * kRowsAtOnce);
    out.fold.push_back(i % 5);
    const double shake = rng.normal(unrest.shake);
    const double time = rng.normal(unrest.of_time);
    for (int b = 0; b < kBodies; ++b) {
      const double own = rng.normal(unrest.of_body);
      for (int k = 0; k < kRowsOfBody; ++k) {
        const int row = i * kRowsAtOnce + b * kRowsOfBody + k;
        const double moved = b == 0 ? 0.0 : rng.uniform(1.0, 2.0);
        const double speed = rng.uniform(-2.0, 2.0);
        if (b > 0) carriers.emplace_back(row, 0, moved);
        carriers.emplace_back(row, 1, speed);
        out.residual[row] = rng.normal() + moved * shake + own + speed * time;
        out.jacobian(row, 0) = 1.0;
        out.body.push_back(b);
      }
    }
  }
  out.first_row.push_back(kMotionInstants * kRowsAtOnce);
  out.carriers.resize(out.residual.size(), 2);
  out.carriers.setFromTriplets(carriers.begin(), carriers.end());
  return out;
}

CommonMotion found_in(const Unrest& unrest) {
  const Linearisation linear = world(unrest);
  const NormalSystem system(linear, make_partition(linear));
  const auto found = find_common_motion(system, {{"joint", "rad", 0}}, 1);
  EXPECT_TRUE(found.has_value());
  return found.value_or(CommonMotion{});
}

TEST(CommonMotion, AShakeIsFoundWithItsSize) {
  const CommonMotion found = found_in({.shake = 2.0});
  EXPECT_EQ(found.place, 0U);
  EXPECT_NEAR(found.size, 2.0, 0.2);
  EXPECT_GT(found.share, 0.8);
}

TEST(CommonMotion, NoiseOfEachRowOrOfEachBodyIsNone) {
  EXPECT_LT(found_in({}).share, 0.05);
  EXPECT_LT(found_in({.of_body = 3.0}).share, 0.2);
}

// Of a joint that moves a marker more, further out, the same shake makes more of what is left
// there.
TEST(CommonMotion, TheJointBeforeIsNamedWhereBodiesFurtherOutShowItToo) {
  Linearisation linear = world({.shake = 0.8});
  // A third carrier moves the last body alone, and one behind it that sees as much.
  std::vector<Eigen::Triplet<double>> carriers;
  for (int c = 0; c < linear.carriers.outerSize(); ++c) {
    for (Eigen::SparseMatrix<double>::InnerIterator entry(linear.carriers, c); entry; ++entry) {
      carriers.emplace_back(entry.row(), c, entry.value());
      const auto row = static_cast<std::size_t>(entry.row());
      if (c == 0 && linear.body[row] == kBodies - 1) {
        if (entry.row() % 2 == 0) linear.body[row] = kBodies;
        carriers.emplace_back(entry.row(), 2, entry.value());
      }
    }
  }
  linear.carriers.resize(linear.residual.size(), 3);
  linear.carriers.setFromTriplets(carriers.begin(), carriers.end());
  // What the second body shows of it is half noise of its own.
  Rng rng(8);
  for (Eigen::Index row = 0; row < linear.residual.size(); ++row)
    if (linear.body[static_cast<std::size_t>(row)] == 1) linear.residual[row] += rng.normal(1.5);
  const NormalSystem system(linear, make_partition(linear));
  const auto found = find_common_motion(system, {{"outer", "rad", 2}, {"joint", "rad", 0}}, 1);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->place, 1U);
  EXPECT_GT(found->largest_share, found->share);
}

TEST(CommonMotion, StampsThatScatterAreNone) { EXPECT_LT(found_in({.of_time = 3.0}).share, 0.05); }

TEST(CommonMotion, OneBodyAloneDoesNotTell) {
  Linearisation linear = world({.shake = 2.0});
  for (int& body : linear.body) body = 0;
  const NormalSystem system(linear, make_partition(linear));
  EXPECT_FALSE(find_common_motion(system, {{"joint", "rad", 0}}, 1).has_value());
}

}  // namespace
}  // namespace kinescope::trace
