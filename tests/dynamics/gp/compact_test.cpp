// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/compact.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <gtest/gtest.h>

#include "dynamics/gp/compact_loops.h"
#include "dynamics/gp/sparse.h"
#include "kinematics/core/error.h"
#include "tests/dynamics/gp/gp_samples.h"

namespace kinescope::gp {
namespace {

constexpr int kColumns = 3;
const std::vector<Eigen::VectorXd> kNoFeatures(1);

CompactKernel squared_exponential(const GpModel& model) {
  CompactKernel out;
  const std::vector<Parameter>& parameters = model.kernel.parameters();
  out.rbf_variance = parameters[0].value;
  out.rbf_rates.resize(kColumns);
  for (int d = 0; d < kColumns; ++d) {
    out.rbf_rates[d] = 1.0 / parameters[static_cast<std::size_t>(d) + 1].value;
  }
  return out;
}

std::vector<int> numbers(Eigen::Index count) {
  std::vector<int> out(static_cast<std::size_t>(count));
  std::iota(out.begin(), out.end(), 0);
  return out;
}

TEST(Compact, IsTheProcessThroughItsInducingPoints) {
  Rng rng = Rng::from_name("compact sparse");
  const Dataset data = smooth_data(rng, 600, kColumns, 0.1);
  const GpModel model = make_model(rbf(first_columns(kColumns)), 0.01);
  const Eigen::MatrixXd inducing = choose_inducing(model, data, {.count = 60});
  const FittedGp fitted = fit_sparse(model, data, inducing);
  CompactGp compact;
  compact.kernel = squared_exponential(model);
  compact.points = numbers(inducing.rows());
  compact.weights = kernel_weights(fitted);
  compact.root = compact_variance(model, {data}, {}, inducing).root;
  CompactPredictor predictor({compact}, inducing, {Eigen::MatrixXd(inducing.rows(), 0)});
  const Eigen::MatrixXd x = 2.0 * random_matrix(rng, 50, kColumns);
  const Prediction expected = predict(fitted, x);
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    // The kernel matrix of the points is singular to 1e-8 (InducingOptions): weights lose its root.
    EXPECT_NEAR(predictor.mean(x.row(i).transpose(), kNoFeatures)[0], expected.mean(i, 0), 1e-7);
    EXPECT_NEAR(predictor.variance(0), expected.variance(i, 0), 1e-7);
    EXPECT_EQ(predictor.variance(0), predictor.variance(0));
  }
}

TEST(Compact, VarianceIsTheMeanOfTheParts) {
  Rng rng = Rng::from_name("compact parts");
  const Dataset a = smooth_data(rng, 60, kColumns, 0.1);
  const Dataset b = smooth_data(rng, 90, kColumns, 0.1);
  const GpModel model = make_model(rbf(first_columns(kColumns)), 0.01);
  const Eigen::MatrixXd inducing = choose_inducing(model, a, {.count = 40});
  const Eigen::MatrixXd x = random_matrix(rng, 20, kColumns);
  const CompactVariance both = compact_variance(model, {a, b}, {x, x}, inducing);
  CompactGp compact;
  compact.kernel = squared_exponential(model);
  compact.points = numbers(inducing.rows());
  compact.weights = Eigen::VectorXd::Zero(inducing.rows());
  compact.root = both.root;
  CompactPredictor predictor({compact}, inducing, {Eigen::MatrixXd(inducing.rows(), 0)});
  const Eigen::VectorXd of_a = predict(fit_sparse(model, a, inducing), x).variance;
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    EXPECT_NEAR(both.own[0][i], of_a[i], 1e-12);
    (void)predictor.mean(x.row(i).transpose(), kNoFeatures)[0];
    EXPECT_NEAR(predictor.variance(0), 0.5 * (both.own[0][i] + both.own[1][i]), 1e-7);
  }
}

TEST(Compact, ExponentialIsRightToTheLastBits) {
  // One point at the origin: the mean is the kernel.
  CompactGp compact;
  compact.kernel.rbf_variance = 1.0;
  compact.kernel.rbf_rates = Eigen::VectorXd::Ones(1);
  compact.points = {0};
  compact.weights = Eigen::VectorXd::Ones(1);
  CompactPredictor predictor({compact}, Eigen::MatrixXd::Zero(1, 1), {Eigen::MatrixXd(1, 0)});
  for (double x = 0.0; x < 37.0; x += 0.0137) {
    const double expected = std::exp(-0.5 * x * x);
    EXPECT_NEAR(predictor.mean(Eigen::VectorXd::Constant(1, x), kNoFeatures)[0], expected,
                4e-16 * expected)
        << x;
  }
  EXPECT_LT(predictor.mean(Eigen::VectorXd::Constant(1, 1e6), kNoFeatures)[0], 1e-300);
}

TEST(Compact, PolynomialAndLinearPartsAreTheKernels) {
  Rng rng = Rng::from_name("compact gip");
  const JointKinds joints{JointKind::kRevolute, JointKind::kPrismatic};
  const Kernel kernel = gip(joints, random_matrix(rng, 30, 6)) + joint_friction(2, 0, 0.1);
  std::vector<Parameter> parameters = kernel.parameters();
  for (Parameter& parameter : parameters) parameter.value *= std::exp(rng.normal(0.3));
  const Kernel changed = kernel.with_parameters(parameters);
  CompactGp compact;
  compact.kernel.gip_joints = joints;
  std::size_t next = 0;
  const auto take = [&](Eigen::Index count) {
    Eigen::VectorXd out(count);
    for (double& value : out) value = parameters[next++].value;
    return out;
  };
  compact.kernel.gip_offset = take(1)[0];
  compact.kernel.gip_motion = take(5);
  compact.kernel.gip_first.resize(3);
  compact.kernel.gip_second.resize(3);
  compact.kernel.gip_first.head(2) = take(2);
  compact.kernel.gip_second.head(2) = take(2);
  compact.kernel.gip_first.tail(1) = take(1);
  compact.kernel.gip_second.tail(1) = take(1);
  compact.kernel.linear = take(2);
  ASSERT_EQ(next, parameters.size());
  const Eigen::MatrixXd points = random_matrix(rng, 300, 6);
  const Eigen::MatrixXd features = friction(2, 0.1)(points);
  compact.points = numbers(points.rows());
  compact.weights = random_matrix(rng, 300, 1);
  CompactPredictor predictor({compact}, points, {features});
  const Eigen::MatrixXd x = random_matrix(rng, 10, 6);
  const Eigen::VectorXd expected = covariance(changed, x, points) * compact.weights;
  const Eigen::VectorXd prior = covariance(changed, x).diagonal();
  const Eigen::MatrixXd own = friction(2, 0.1)(x);
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    // Sums of 300 terms of that size.
    const double rounding = 1e-14 * std::sqrt(300.0) * prior[i];
    EXPECT_NEAR(predictor.mean(x.row(i).transpose(), {own.row(i).transpose()})[0], expected[i],
                300.0 * rounding);
    EXPECT_NEAR(predictor.variance(0), prior[i], rounding);
  }
}

// Two turning joints and a sliding one.
const JointKinds kThreeJoints{JointKind::kRevolute, JointKind::kPrismatic, JointKind::kRevolute};

CompactGp random_process(Rng& rng, bool polynomial, std::vector<int> points) {
  CompactGp out;
  const auto positive = [&](Eigen::Index size) {
    Eigen::VectorXd values(size);
    for (double& value : values) value = rng.uniform(0.1, 0.5);
    return values;
  };
  out.kernel.rbf_variance = 1.5;
  out.kernel.rbf_rates = positive(9);
  if (polynomial) {
    out.kernel.gip_joints = kThreeJoints;
    out.kernel.gip_offset = 0.7;
    out.kernel.gip_motion = positive(9);
    out.kernel.gip_first = positive(5);
    out.kernel.gip_second = positive(5);
  }
  out.weights = random_matrix(rng, std::ssize(points), 1);
  out.root = 0.1 * random_matrix(rng, 7, 7);
  out.points = std::move(points);
  return out;
}

// Six processes of the same points, one of others and one of none: each as it is alone.
TEST(Compact, ProcessesTogetherAreEachAlone) {
  Rng rng = Rng::from_name("compact together");
  constexpr int kRows = 301;  // more than a pass, and not eight by eight
  const Eigen::MatrixXd motions = random_matrix(rng, kRows, 9);
  std::vector<CompactGp> processes;
  for (int j = 0; j < 6; ++j) {
    std::vector<int> points = numbers(kRows);
    std::rotate(points.begin(), points.begin() + 11 * j, points.end());
    processes.push_back(random_process(rng, j > 4, std::move(points)));
  }
  processes.push_back(random_process(rng, true, {5, 17, 3, 300, 8, 40, 2, 17}));
  processes.emplace_back().shift = 2.0;
  const std::vector<Eigen::MatrixXd> tables(processes.size(), Eigen::MatrixXd(kRows, 0));
  const std::vector<Eigen::VectorXd> none(processes.size());
  CompactPredictor together(processes, motions, tables);
  for (int sample = 0; sample < 5; ++sample) {
    const Eigen::VectorXd x = random_matrix(rng, 9, 1);
    const Eigen::VectorXd mean = together.mean(x, none);
    for (std::size_t j = 0; j < processes.size(); ++j) {
      const auto process = static_cast<Eigen::Index>(j);
      CompactPredictor alone({processes[j]}, motions, {tables[j]});
      EXPECT_EQ(mean[process], alone.mean(x, kNoFeatures)[0]) << j;
      EXPECT_EQ(together.variance(process), alone.variance(0)) << j;
    }
    EXPECT_EQ(mean[7], 2.0);
  }
}

TEST(CompactLoops, GiveTheSameBitsForRegistersOfAnyWidth) {
  Rng rng = Rng::from_name("compact loops");
  const Eigen::MatrixXd table = random_matrix(rng, 531, 9);
  const loops::LaneTable motions(table);
  const loops::LaneTable positions(table.leftCols(5));
  for (const Eigen::Index processes : {1, 2, 3, 4, 7}) {
    const Eigen::MatrixXd start = random_matrix(rng, motions.rows(), processes);
    const Eigen::MatrixXd factors = random_matrix(rng, processes, 9).cwiseAbs();
    const Eigen::VectorXd x = random_matrix(rng, 9, 1);
    const loops::PolynomialFactors of_each{factors.col(0), factors, factors.leftCols(5),
                                           factors.rightCols(5)};
    const auto values = [&](loops::Registers registers) {
      Eigen::MatrixXd out = start;
      loops::polynomials(motions, positions, kThreeJoints, of_each, out, registers);
      loops::add_rbf(motions, x, factors, factors.col(1), out, registers);
      return out;
    };
    const Eigen::MatrixXd narrow = values(loops::Registers::k128);
    EXPECT_GT(narrow.cwiseAbs().minCoeff(), 0.0);
    for (const loops::Registers registers : {loops::Registers::k256, loops::Registers::k512}) {
      if (registers > loops::widest_registers()) continue;
      EXPECT_EQ(narrow, values(registers));
    }
  }
}

TEST(Compact, RefusesPartsThatDoNotFit) {
  CompactGp compact;
  compact.kernel.rbf_rates = Eigen::VectorXd::Ones(2);
  compact.points = {0, 5};
  compact.weights = Eigen::VectorXd::Ones(2);
  const Eigen::MatrixXd motions = Eigen::MatrixXd::Zero(3, 2);
  const Eigen::MatrixXd none(3, 0);
  EXPECT_THROW(CompactPredictor({compact}, motions, {none}), Error) << "no row 5";
  compact.points = {0, 1};
  EXPECT_NO_THROW(CompactPredictor({compact}, motions, {none}));
  compact.root = Eigen::MatrixXd::Zero(3, 3);
  EXPECT_THROW(CompactPredictor({compact}, motions, {none}), Error) << "more carriers than points";
  compact.root.resize(0, 0);
  compact.kernel.rbf_rates = Eigen::VectorXd::Ones(3);
  EXPECT_THROW(CompactPredictor({compact}, motions, {none}), Error) << "lengths of three columns";
}

}  // namespace
}  // namespace kinescope::gp
