// SPDX-License-Identifier: Apache-2.0
//
// The torque kernel against the Lagrange operator applied by automatic derivatives (nested Jets) to
// the energies' kernels, and against the kernel's own features.
#include "dynamics/gp/lip_kernel.h"

#include <array>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <ceres/jet.h>
#include <gtest/gtest.h>

#include "dynamics/gp/kernel_node.h"
#include "tests/dynamics/gp/gp_samples.h"

namespace kinescope::gp {
namespace {

// Sums of a few thousand products.
constexpr double kLipRounding = 1e-11;
constexpr double kLipSlopeTolerance = 1e-7;

const JointKinds kThree = {JointKind::kRevolute, JointKind::kPrismatic, JointKind::kRevolute};

template <typename Jet>
Jet constant_jet(double value) {
  if constexpr (std::is_same_v<Jet, double>) {
    return value;
  } else {
    using Inner = std::remove_cvref_t<decltype(Jet().a)>;
    Jet out;
    out.a = constant_jet<Inner>(value);
    out.v[0] = constant_jet<Inner>(0.0);
    return out;
  }
}

// Energy covariance of T - V, for parameters in the order of the kernel's own table by name.
template <typename S>
S energy_covariance(const Kernel& kernel, const JointKinds& joints, const std::array<S, 3>& q,
                    const std::array<S, 3>& v, const std::array<S, 3>& q2,
                    const std::array<S, 3>& v2) {
  using std::cos;
  using std::sin;
  const auto parameter = [&](const std::string& name) {
    for (const Parameter& p : kernel.parameters()) {
      if (p.name == name) return constant_jet<S>(p.value);
    }
    throw std::logic_error("no parameter " + name);
  };
  const auto position = [&](const std::string& energy, std::size_t j) {
    const std::string at = " q" + std::to_string(j);
    if (joints[j] == JointKind::kPrismatic) {
      return constant_jet<S>(1.0) + parameter(energy + " position" + at) * q[j] * q2[j];
    }
    return constant_jet<S>(1.0) + parameter(energy + " cos" + at) * cos(q[j]) * cos(q2[j]) +
           parameter(energy + " sin" + at) * sin(q[j]) * sin(q2[j]);
  };
  S out = constant_jet<S>(0.0);
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const std::string energy = "kinetic " + std::to_string(i);
    S u = constant_jet<S>(0.0);
    S r = constant_jet<S>(1.0);
    for (std::size_t j = 0; j <= i; ++j) {
      u += parameter(energy + " weight dq" + std::to_string(j)) * v[j] * v2[j];
      const S g = position(energy, j);
      r *= g * g;
    }
    out += u * u * r;
  }
  S r = parameter("potential scale");
  for (std::size_t j = 0; j < joints.size(); ++j) r *= position("potential", j);
  return out + r;
}

// tau_a = sum_b L_(dq_a dq_b) ddq_b + L_(dq_a q_b) dq_b - L_(q_a) on both arguments: the operator
// is linear in mixed derivatives of order (<= 2, <= 2), taken one direction at a time: d/dt along
// (dq, ddq) of the derivative by dq_a is one Jet direction more. k_T and k_V are independent, and L
// = T - V has the covariance k_T + k_V.
using J1 = ceres::Jet<double, 1>;
using J2 = ceres::Jet<J1, 1>;
using J3 = ceres::Jet<J2, 1>;
using J4 = ceres::Jet<J3, 1>;

struct Direction {
  std::array<double, 3> q{};
  std::array<double, 3> v{};
};

// value + e1 d1 + e2 d2 + e3 d3 + e4 d4, each e in its own level.
J4 lifted(double value, double d1, double d2, double d3, double d4) {
  J4 out = constant_jet<J4>(value);
  out.a.a.a.v[0] = d1;
  out.a.a.v[0].a = d2;
  out.a.v[0].a.a = d3;
  out.v[0].a.a.a = d4;
  return out;
}

// Mixed derivative: up to two directions on x (d1, d2) and two on y (d3, d4); null: none there.
double mixed(const Kernel& kernel, const Eigen::RowVectorXd& x, const Eigen::RowVectorXd& y,
             const Direction* d1, const Direction* d2, const Direction* d3, const Direction* d4) {
  const Direction none;
  const Direction& a = d1 != nullptr ? *d1 : none;
  const Direction& b = d2 != nullptr ? *d2 : none;
  const Direction& c = d3 != nullptr ? *d3 : none;
  const Direction& d = d4 != nullptr ? *d4 : none;
  std::array<J4, 3> q, v, q2, v2;
  for (std::size_t j = 0; j < 3; ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    q[j] = lifted(x[k], a.q[j], b.q[j], 0, 0);
    v[j] = lifted(x[3 + k], a.v[j], b.v[j], 0, 0);
    q2[j] = lifted(y[k], 0, 0, c.q[j], d.q[j]);
    v2[j] = lifted(y[3 + k], 0, 0, c.v[j], d.v[j]);
  }
  const J4 k = energy_covariance(kernel, kThree, q, v, q2, v2);
  const J3 k3 = d4 != nullptr ? k.v[0] : k.a;
  const J2 k2 = d3 != nullptr ? k3.v[0] : k3.a;
  const J1 k1 = d2 != nullptr ? k2.v[0] : k2.a;
  return d1 != nullptr ? k1.v[0] : k1.a;
}

double torque_covariance(const Kernel& kernel, const Eigen::RowVectorXd& x,
                         const Eigen::RowVectorXd& y, std::size_t a, std::size_t b) {
  const auto flow = [](const Eigen::RowVectorXd& s) {
    Direction out;
    for (std::size_t j = 0; j < 3; ++j) {
      out.q[j] = s[3 + static_cast<Eigen::Index>(j)];
      out.v[j] = s[6 + static_cast<Eigen::Index>(j)];
    }
    return out;
  };
  const Direction time_x = flow(x);
  const Direction time_y = flow(y);
  Direction va, qa, vb, qb;
  va.v[a] = 1.0;
  qa.q[a] = 1.0;
  vb.v[b] = 1.0;
  qb.q[b] = 1.0;
  return mixed(kernel, x, y, &va, &time_x, &vb, &time_y) -
         mixed(kernel, x, y, &va, &time_x, &qb, nullptr) -
         mixed(kernel, x, y, &qa, nullptr, &vb, &time_y) +
         mixed(kernel, x, y, &qa, nullptr, &qb, nullptr);
}

TEST(Lip, IsTheLagrangeOperatorOnTheEnergies) {
  Rng rng = Rng::from_name("lip jets");
  const Kernel kernel = shuffled_parameters(lip(kThree), rng);
  const Eigen::MatrixXd x = random_matrix(rng, 3, 9);
  const Eigen::MatrixXd y = random_matrix(rng, 2, 9);
  const Eigen::MatrixXd k = covariance(kernel, x, y);
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index j = 0; j < 2; ++j) {
      for (std::size_t a = 0; a < 3; ++a) {
        for (std::size_t b = 0; b < 3; ++b) {
          EXPECT_NEAR(k(3 * i + static_cast<Eigen::Index>(a), 3 * j + static_cast<Eigen::Index>(b)),
                      torque_covariance(kernel, x.row(i), y.row(j), a, b),
                      kLipRounding * k.cwiseAbs().maxCoeff())
              << i << j << a << b;
        }
      }
    }
  }
}

TEST(Lip, IsSymmetricAndPositive) {
  for (const std::size_t joints : {1U, 2U, 4U, 7U}) {
    Rng rng = Rng::from_name("lip psd", joints);
    JointKinds kinds(joints, JointKind::kRevolute);
    if (joints == 4) kinds[1] = JointKind::kPrismatic;
    const Kernel kernel = shuffled_parameters(lip(kinds), rng);
    const Eigen::MatrixXd x = random_matrix(rng, 21, 3 * static_cast<Eigen::Index>(joints));
    const Eigen::MatrixXd k = covariance(kernel, x, x);
    EXPECT_LT((k - k.transpose()).cwiseAbs().maxCoeff(), kLipRounding * k.cwiseAbs().maxCoeff());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(k);
    EXPECT_GT(eigen.eigenvalues()[0], -1e-10 * eigen.eigenvalues().maxCoeff());
  }
}

TEST(Lip, GradientAgreesWithDifferences) {
  for (const JointKinds& kinds :
       {kThree, JointKinds{JointKind::kPrismatic}, JointKinds(5, JointKind::kRevolute)}) {
    Rng rng = Rng::from_name("lip gradient", kinds.size());
    const auto n = static_cast<Eigen::Index>(kinds.size());
    const Kernel kernel = shuffled_parameters(lip(kinds), rng);
    const Eigen::MatrixXd x = random_matrix(rng, 11, 3 * n, 0.7);
    Eigen::MatrixXd q = random_matrix(rng, 11 * n, 11 * n);
    q = (q + q.transpose()).eval();
    const Eigen::VectorXd gradient = covariance_gradient(kernel, x, q);
    const Eigen::VectorXd values = kernel.log_values();
    const double size = covariance(kernel, x).cwiseProduct(q).cwiseAbs().sum();
    for (Eigen::Index p = 0; p < values.size(); ++p) {
      const auto sum = [&](double step) {
        Eigen::VectorXd moved = values;
        moved[p] += step;
        return covariance(kernel.with_log_values(moved), x).cwiseProduct(q).sum();
      };
      EXPECT_NEAR(gradient[p],
                  (sum(kDifferenceStep) - sum(-kDifferenceStep)) / (2.0 * kDifferenceStep),
                  kLipSlopeTolerance * size)
          << kernel.parameters()[static_cast<std::size_t>(p)].name;
    }
  }
}

TEST(Lip, FeaturesGiveTheSameCovariance) {
  Rng rng = Rng::from_name("lip features");
  const JointKinds kinds = {JointKind::kRevolute, JointKind::kPrismatic};
  const Kernel kernel = shuffled_parameters(lip(kinds), rng);
  const Eigen::MatrixXd x = random_matrix(rng, 5, 6);
  const Basis basis = kernel.node().basis(x);
  ASSERT_EQ(static_cast<double>(basis.values.cols()), *kernel.node().feature_count());
  const Eigen::VectorXd scale = (basis.exponents * kernel.log_values()).array().exp();
  const Eigen::MatrixXd by_features = basis.values * scale.asDiagonal() * basis.values.transpose();
  const Eigen::MatrixXd k = covariance(kernel, x);
  for (Eigen::Index i = 0; i < 10; ++i) {
    for (Eigen::Index j = 0; j < 10; ++j) {
      EXPECT_NEAR(by_features(i, j), k(2 * (i % 5) + i / 5, 2 * (j % 5) + j / 5),
                  kLipRounding * k.cwiseAbs().maxCoeff());
    }
  }
}

}  // namespace
}  // namespace kinescope::gp
