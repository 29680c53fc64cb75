// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/field.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "calib/trace/distribution.h"
#include "calib/trace/own_space.h"
#include "calib/trace/trace.h"
#include "kinematics/core/rng.h"
#include "tests/calib/trace/linear_world.h"

namespace kinescope::trace {
namespace {

using truth::LinearWorld;
using truth::LinearWorldOptions;

constexpr int kNodes = 60;

TEST(QuadraticForm, TailIsThatOfChiSquare) {
  // A saddlepoint's tail is right to some per cent (Kuonen 1999, table 1).
  constexpr double kRelative = 0.06;
  EXPECT_NEAR(quadratic_form_survival(11.0705, Eigen::VectorXd::Ones(5)), 0.05, kRelative * 0.05);
  EXPECT_NEAR(quadratic_form_survival(3.8415, Eigen::VectorXd::Ones(1)), 0.05, kRelative * 0.05);
  EXPECT_NEAR(quadratic_form_survival(2.0 * 29.588, Eigen::VectorXd::Constant(10, 2.0)), 1e-3,
              kRelative * 1e-3);
}

TEST(QuadraticForm, WeightsOfEitherSignAreAsSimulated) {
  const Eigen::VectorXd weights{{3.0, 1.0, -0.5, -2.0, -1.5}};  // of mean zero
  constexpr double kValue = 12.0;
  constexpr int kDraws = 100000;
  Rng rng = Rng::from_name("quadratic form");
  int above = 0;
  for (int i = 0; i < kDraws; ++i) {
    double sum = 0.0;
    for (const double weight : weights) sum += weight * std::pow(rng.normal(), 2);
    if (sum > kValue) ++above;
  }
  const double simulated = static_cast<double>(above) / kDraws;
  EXPECT_NEAR(quadratic_form_survival(kValue, weights), simulated, 0.08 * simulated);
  EXPECT_EQ(quadratic_form_survival(-1.0, weights), 1.0);
}

// A model of two joints, and its field.
struct Model {
  TracedFit fit;
  NormalSystem system;
  explicit Model(TracedFit fitted)
      : fit(std::move(fitted)), system(fit.linear, make_partition(fit.linear)) {}
};

Model model_of(std::uint64_t seed, double size, double memory = 0.0) {
  LinearWorldOptions options;
  options.seed = seed;
  options.noise_memory = memory;
  return Model(LinearWorld(options, {{0, "field", size}}).fit({}));
}

TEST(FieldGrid, IsBilinearAndLeavesRowsWithoutAPlaceAlone) {
  Model model = model_of(1, 0.0);
  RestField field = model.fit.rest_fields.front();
  field.at.topRows(40).setConstant(std::numeric_limits<double>::quiet_NaN());
  const FieldGrid grid = make_field_grid(model.fit.linear, field, kNodes);
  ASSERT_GT(grid.nodes.rows(), 20);
  EXPECT_LE(grid.nodes.rows(), kNodes);
  // Nodes that hold an affine field give every row its value.
  Eigen::VectorXd values(2 * grid.nodes.rows());
  values << grid.nodes.col(0) - 2.0 * grid.nodes.col(1),
      (0.5 - 3.0 * grid.nodes.col(0).array()).matrix();
  const Eigen::VectorXd rows = grid.columns * values;
  EXPECT_EQ(rows.head(40).norm(), 0.0);
  constexpr double kRounding = 1e-9;
  for (Eigen::Index row = 40; row < rows.size(); ++row) {
    const Eigen::RowVector2d at = field.at.row(row);
    const double expected = row % 2 == 0 ? at.x() - 2.0 * at.y() : 0.5 - 3.0 * at.x();
    ASSERT_NEAR(rows[row], expected, kRounding) << row;
  }
}

// Four lengths count as four tests though they are much alike: fewer than 1 in 20 of noise.
TEST(FieldTest, NoiseIsSeldomSignificant) {
  constexpr int kRuns = 150;
  for (const double memory : {0.0, 0.8}) {
    int significant = 0;
    for (int seed = 0; seed < kRuns; ++seed) {
      const Model model = model_of(900 + static_cast<std::uint64_t>(seed), 0.0, memory);
      const FieldGrid grid =
          make_field_grid(model.fit.linear, model.fit.rest_fields.front(), kNodes);
      if (field_p_value(model.system, grid) < 0.05) ++significant;
    }
    EXPECT_LE(significant, 15) << memory;  // 7.5 and 2.8 standard deviations of a count
    EXPECT_GE(significant, 1) << memory;   // a test that says nothing never would be
  }
}

TEST(FieldTest, MapIsTheTruthWithinItsDoubt) {
  const Model model = model_of(3, 1.0);
  const auto found = find_field(model.system, model.fit.rest_fields, 0.005);
  ASSERT_TRUE(found.has_value());
  ASSERT_TRUE(found->rest.is_field());
  EXPECT_LT(found->rest.p_value, 1e-4);
  EXPECT_GT(found->rest.explained, 0.2);
  EXPECT_LT(found->rest.held_out_after.value, found->rest.held_out_before.value);
  const FieldMap& map = found->rest.field;
  int clear = 0;
  int covered = 0;
  for (Eigen::Index node = 0; node < map.at.rows(); ++node) {
    const Eigen::RowVector2d truth = LinearWorld::shape_of_field(map.at.row(node)).transpose();
    // Prior variances are near 1/2: well below, the data have spoken.
    if (map.sigma.row(node).maxCoeff() > 0.4) continue;
    clear += 2;
    const Eigen::Array2d off = (map.mean.row(node) - truth).cwiseAbs().transpose();
    const Eigen::Array2d bound = 3.0 * map.sigma.row(node).transpose();
    covered += static_cast<int>((off < bound).count());
  }
  EXPECT_GT(clear, 60);
  // Bilinear between nodes is not the truth, nor is a joint's zero known without the field.
  EXPECT_GE(covered, clear * 9 / 10);
}

TEST(FieldTest, WhatDependsOnThePlaceIsUnknownOverIt) {
  constexpr int kRuns = 6;
  int right = 0;
  for (int seed = 0; seed < kRuns; ++seed) {
    LinearWorldOptions options;
    options.seed = static_cast<std::uint64_t>(seed);
    const Trace trace = trace_effects(LinearWorld(options, {{0, "field", 1.5}}));
    if (trace.verdict != TraceVerdict::kUnknown || trace.rest.size() != 1) continue;
    const Rest& rest = trace.rest.front();
    if (!rest.is_field() || !trace.accepted.empty()) continue;
    ++right;
    EXPECT_EQ(rest.covariate, "place in the image");
    EXPECT_NE(trace.reason.find("place in the image"), std::string::npos) << trace.reason;
    EXPECT_GT(trace.held_out_before.value, 1.2);  // of noise 1
    EXPECT_LT(trace.held_out_after.value, 1.15);
  }
  EXPECT_GE(right, kRuns - 1);
}

TEST(FieldTest, WhatMovesRowsByLessThanItsFloorIsNotLookedFor) {
  Model model = model_of(3, 1.0);
  model.fit.rest_fields.front().floor = 2.0;  // of a field of amplitude 1
  EXPECT_FALSE(find_field(model.system, model.fit.rest_fields, 0.005).has_value());
}

// Parameters that the data hardly tell apart: the inverse normal matrix knows their difference to
// few digits only.
TEST(OwnSpace, FreesRowsOfParametersThatAreHardlyToldApart) {
  Model model = model_of(2, 0.0);
  Linearisation& linear = model.fit.linear;
  Rng rng = Rng::from_name("own space");
  constexpr double kApart = 3e-6;
  linear.jacobian.col(1) = linear.jacobian.col(0);
  for (double& entry : linear.jacobian.col(1)) entry += kApart * rng.normal();
  Eigen::VectorXd difference = linear.jacobian.col(1) - linear.jacobian.col(0);
  difference.normalize();
  const NormalSystem system(linear, make_partition(linear));
  const OwnSpace own(system);
  const Eigen::VectorXd left =
      difference - own.basis() * own.solve(own.basis().transpose() * difference);
  constexpr double kGone = 1e-4;
  EXPECT_LT(left.norm(), kGone);
}

}  // namespace
}  // namespace kinescope::trace
