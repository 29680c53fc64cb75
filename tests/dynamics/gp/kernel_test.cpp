// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/kernel.h"

#include <cmath>
#include <functional>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "dynamics/gp/kernel_node.h"
#include "dynamics/gp/robot_kernels.h"
#include "tests/dynamics/gp/gp_samples.h"

namespace kinescope::gp {
namespace {

// Sums of a few hundred products of numbers of order one.
constexpr double kKernelRounding = 1e-12;
// Central differences with a step of 1e-6 of sums of order 100.
constexpr double kSlopeTolerance = 1e-6;

const JointKinds kTwoTurnsOneSlide = {JointKind::kRevolute, JointKind::kPrismatic,
                                      JointKind::kRevolute};

struct Case {
  std::string name;
  Kernel kernel;
  int columns;
};

std::vector<Case> all_kernels() {
  const Eigen::MatrixXd root = (Eigen::Matrix3d() << 1, 0, 0, 0.5, 1, 0, -0.2, 0.1, 0.7).finished();
  return {
      {"rbf", rbf(first_columns(3)), 3},
      {"rbf of some columns, one scale", rbf(columns({2, 0}), LengthScales::kCommon), 3},
      {"linear", linear(first_columns(3)), 3},
      {"linear, unit offset", linear(first_columns(2), Offset::kUnit), 2},
      {"cubic", polynomial(first_columns(3), 3), 3},
      {"homogeneous square", polynomial(first_columns(2), 2, Offset::kNone), 2},
      {"common weight", polynomial(first_columns(2), 2, Offset::kFree, Weights::kCommon), 2},
      {"multiplicative", multiplicative_polynomial(first_columns(3), 3), 3},
      {"sum", rbf(columns({0})) + linear(first_columns(3)) + constant(0.7), 3},
      {"product", rbf(columns({0})) * linear(first_columns(3)) * polynomial(columns({1}), 2), 3},
      {"scaled sum in a product", 2.0 * (rbf(columns({0})) + constant()) * linear(columns({1})), 2},
      {"features", feature_kernel(first_columns(3), root * root.transpose()), 3},
      {"angles", linear(joined(angle(0), friction(1, 0.3))), 2},
      {"positions", position_factors(kTwoTurnsOneSlide, 1.0, 0.1, {1.0, 0.3, 1.0}), 3},
      {"gip", gip(kTwoTurnsOneSlide) + joint_friction(3, 1), 9},
      {"semi-parametric",
       semi_parametric(first_columns(3), root * root.transpose(), first_columns(2)), 3},
      {"two outputs", independent_outputs({rbf(columns({0})), linear(first_columns(2))}), 2}};
}

TEST(Kernel, IsSymmetricAndPositive) {
  for (const Case& c : all_kernels()) {
    Rng rng = Rng::from_name("psd " + c.name);
    const Kernel kernel = shuffled_parameters(c.kernel, rng);
    const Eigen::MatrixXd x = random_matrix(rng, 40, c.columns);
    const Eigen::MatrixXd k = covariance(kernel, x, x);
    const double scale = k.diagonal().maxCoeff();
    EXPECT_LT((k - k.transpose()).cwiseAbs().maxCoeff(), kKernelRounding * scale) << c.name;
    EXPECT_LT((k - covariance(kernel, x)).cwiseAbs().maxCoeff(), kKernelRounding * scale) << c.name;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(k);
    EXPECT_GT(eigen.eigenvalues()[0], -1e-10 * eigen.eigenvalues().maxCoeff()) << c.name;
  }
}

TEST(Kernel, GradientsAgreeWithDifferences) {
  for (const Case& c : all_kernels()) {
    Rng rng = Rng::from_name("gradient " + c.name);
    const Kernel kernel = shuffled_parameters(c.kernel, rng);
    const Eigen::MatrixXd x = random_matrix(rng, 30, c.columns);
    Eigen::MatrixXd q = random_matrix(rng, 30 * kernel.outputs(), 30 * kernel.outputs());
    q = (q + q.transpose()).eval();
    const Eigen::VectorXd gradient = covariance_gradient(kernel, x, q);
    const Eigen::VectorXd values = kernel.log_values();
    for (Eigen::Index p = 0; p < values.size(); ++p) {
      const auto sum = [&](double step) {
        Eigen::VectorXd moved = values;
        moved[p] += step;
        return covariance(kernel.with_log_values(moved), x).cwiseProduct(q).sum();
      };
      const double slope = (sum(kDifferenceStep) - sum(-kDifferenceStep)) / (2.0 * kDifferenceStep);
      const double size = covariance(kernel, x).cwiseProduct(q).cwiseAbs().sum();
      EXPECT_NEAR(gradient[p], slope, kSlopeTolerance * std::max(1.0, size))
          << c.name << ": " << kernel.parameters()[static_cast<std::size_t>(p)].name;
    }
  }
}

// Tiles: a set large enough for several of them gives what one tile gives.
TEST(Kernel, TilesDoNotShow) {
  Rng rng = Rng::from_name("tiles");
  const Kernel kernel = shuffled_parameters(
      gip(kTwoTurnsOneSlide) + rbf(first_columns(9)) * linear(columns({3})), rng);
  const Eigen::MatrixXd x = random_matrix(rng, 600, 9);
  const Eigen::MatrixXd whole = covariance(kernel, x);
  const Eigen::MatrixXd part = covariance(kernel, x.topRows(5), x.bottomRows(7));
  EXPECT_LT((whole.topRightCorner(5, 7) - part).cwiseAbs().maxCoeff(),
            kKernelRounding * whole.maxCoeff());
}

// Inputs as far from the origin as time stamps are give the same distances.
TEST(Kernel, SquaredExponentialDoesNotMindWhereTheOriginIs) {
  Rng rng = Rng::from_name("far");
  const Kernel kernel = shuffled_parameters(rbf(first_columns(2)), rng);
  Eigen::MatrixXd x = random_matrix(rng, 20, 2);
  Eigen::MatrixXd far = x;
  far.col(0).array() += 1024.0 * 1024.0 * 1024.0;
  // What the addition left of the inputs.
  x.col(0) = far.col(0).array() - 1024.0 * 1024.0 * 1024.0;
  Eigen::MatrixXd q = random_matrix(rng, 20, 20);
  q = (q + q.transpose()).eval();
  // Dividing by the length scale rounds 1e9 to 1e-7.
  constexpr double kTolerance = 1e-5;
  EXPECT_LT((covariance(kernel, x) - covariance(kernel, far)).cwiseAbs().maxCoeff(), kTolerance);
  EXPECT_LT((covariance_gradient(kernel, x, q) - covariance_gradient(kernel, far, q))
                .cwiseAbs()
                .maxCoeff(),
            100.0 * kTolerance);
}

TEST(Kernel, FeaturesGiveTheSameCovariance) {
  int checked = 0;
  for (const Case& c : all_kernels()) {
    if (!c.kernel.node().feature_count()) continue;
    Rng rng = Rng::from_name("features " + c.name);
    const Kernel kernel = shuffled_parameters(c.kernel, rng);
    const Eigen::MatrixXd x = random_matrix(rng, 7, c.columns);
    const Basis basis = kernel.node().basis(x);
    ASSERT_EQ(static_cast<double>(basis.values.cols()), *kernel.node().feature_count()) << c.name;
    const Eigen::VectorXd scale = (basis.exponents * kernel.log_values()).array().exp();
    const Eigen::MatrixXd by_features =
        basis.values * scale.asDiagonal() * basis.values.transpose();
    const Eigen::MatrixXd k = covariance(kernel, x);
    for (Eigen::Index i = 0; i < 7; ++i) {
      for (Eigen::Index j = 0; j < 7; ++j) {
        for (int a = 0; a < kernel.outputs(); ++a) {
          for (int b = 0; b < kernel.outputs(); ++b) {
            EXPECT_NEAR(by_features(a * 7 + i, b * 7 + j),
                        k(i * kernel.outputs() + a, j * kernel.outputs() + b),
                        kKernelRounding * k.maxCoeff())
                << c.name;
          }
        }
      }
    }
    ++checked;
  }
  EXPECT_EQ(checked, 10);
}

// The definition, written down once more without a single shared line.
TEST(Gip, IsTheProductOfItsDefinition) {
  Rng rng = Rng::from_name("gip definition");
  const Kernel kernel = shuffled_parameters(gip(kTwoTurnsOneSlide), rng);
  const Eigen::VectorXd w = kernel.log_values().array().exp();
  const Eigen::MatrixXd x = random_matrix(rng, 2, 9);
  const auto value = [&](int sample, int column) { return x(sample, column); };
  Eigen::Index at = 0;
  double expected = w[at++];
  for (int i = 0; i < 3; ++i) expected += w[at++] * value(0, 6 + i) * value(1, 6 + i);
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      expected += w[at++] * value(0, 3 + i) * value(0, 3 + j) * value(1, 3 + i) * value(1, 3 + j);
    }
  }
  for (int joint = 0; joint < 3; ++joint) {
    for (int factor = 0; factor < 2; ++factor) {
      const double p = value(0, joint);
      const double q = value(1, joint);
      if (joint == 1) {
        expected *= 1.0 + w[at++] * p * q;
      } else {
        const double cosines = w[at++] * std::cos(p) * std::cos(q);
        expected *= 1.0 + cosines + w[at++] * std::sin(p) * std::sin(q);
      }
    }
  }
  ASSERT_EQ(at, w.size());
  EXPECT_NEAR(covariance(kernel, x.row(0), x.row(1))(0, 0), expected,
              kKernelRounding * std::abs(expected));
}

}  // namespace
}  // namespace kinescope::gp
