// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/smoothing_spline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr int kDegree = 5;
constexpr int kBasis = kDegree + 1;      // functions that are not zero at a point
constexpr double kKnotsPerPeriod = 6.0;  // of the cut-off: the basis follows it to 1e-4
constexpr double kLargestWeight = 10.0;  // of a sample before a gap, in mean weights
constexpr Eigen::Index kFewestPoints = 8;

using Functions = std::array<double, kBasis>;

/// Uniform B-splines of a degree on [0, 1): Cox - de Boor, de Boor 1978, ch. X.
Functions basis_of_degree(double u, int degree) {
  Functions b{};
  b[0] = 1.0;
  for (int d = 1; d <= degree; ++d) {
    double left = 0.0;
    for (int k = 0; k < d; ++k) {
      const double part = b[static_cast<std::size_t>(k)] / d;
      b[static_cast<std::size_t>(k)] = left + (k + 1 - u) * part;
      left = (u + d - 1 - k) * part;
    }
    b[static_cast<std::size_t>(d)] = left;
  }
  return b;
}

/// The derivative of the quintic basis in units of the knot step: each derivative is a difference
/// of functions one degree lower.
Functions basis(double u, int derivative) {
  Functions b = basis_of_degree(u, kDegree - derivative);
  for (int d = kDegree - derivative + 1; d <= kDegree; ++d) {
    Functions next{};
    for (int k = 0; k <= d; ++k) {
      const double before = k > 0 ? b[static_cast<std::size_t>(k - 1)] : 0.0;
      const double here = k < d ? b[static_cast<std::size_t>(k)] : 0.0;
      next[static_cast<std::size_t>(k)] = before - here;
    }
    b = next;
  }
  return b;
}

/// Integrals of the products of third derivatives over one interval of length 1 (exact: degree 4).
Eigen::Matrix<double, kBasis, kBasis> roughness() {
  const double offset = std::sqrt(0.6) / 2.0;
  const std::array<std::pair<double, double>, 3> gauss = {
      {{0.5 - offset, 5.0 / 18.0}, {0.5, 8.0 / 18.0}, {0.5 + offset, 5.0 / 18.0}}};
  Eigen::Matrix<double, kBasis, kBasis> out = Eigen::Matrix<double, kBasis, kBasis>::Zero();
  for (const auto& [u, weight] : gauss) {
    const Functions third = basis(u, 3);
    const Eigen::Map<const Eigen::Matrix<double, kBasis, 1>> row(third.data());
    out += weight * row * row.transpose();
  }
  return out;
}

/// Half the time to either neighbour, over the mean.
Eigen::VectorXd time_weights(const Eigen::VectorXd& t_s) {
  const Eigen::Index n = t_s.size();
  const double mean = (t_s(n - 1) - t_s(0)) / static_cast<double>(n - 1);
  Eigen::VectorXd weights(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double before = i > 0 ? t_s(i) - t_s(i - 1) : t_s(1) - t_s(0);
    const double after = i + 1 < n ? t_s(i + 1) - t_s(i) : t_s(n - 1) - t_s(n - 2);
    weights(i) = std::min(0.5 * (before + after) / mean, kLargestWeight);
  }
  return weights;
}

struct Place {
  Eigen::Index interval;
  double u;
};

Place place_of(double t_s, double start_s, double step_s, Eigen::Index intervals) {
  const double at = (t_s - start_s) / step_s;
  const auto interval =
      std::clamp<Eigen::Index>(static_cast<Eigen::Index>(std::floor(at)), 0, intervals - 1);
  return {interval, at - static_cast<double>(interval)};
}

}  // namespace

SmoothingSpline::SmoothingSpline(const Eigen::VectorXd& t_s, const Eigen::MatrixXd& values,
                                 double cutoff_hz)
    : SmoothingSpline(t_s, values, time_weights(t_s), cutoff_hz) {}

SmoothingSpline::SmoothingSpline(const Eigen::VectorXd& t_s, const Eigen::MatrixXd& values,
                                 const Eigen::VectorXd& weights, double cutoff_hz) {
  const Eigen::Index n = t_s.size();
  KINESCOPE_CHECK(n >= kFewestPoints && values.rows() == n && weights.size() == n,
                  "a spline wants 8 samples or more");
  KINESCOPE_CHECK(cutoff_hz > 0.0, "the cut-off must be positive");
  const double duration_s = t_s(n - 1) - t_s(0);
  const double step_s = duration_s / static_cast<double>(n - 1);
  const double wanted_s = std::max(step_s, 1.0 / (kKnotsPerPeriod * cutoff_hz));
  intervals_ =
      std::max<Eigen::Index>(1, static_cast<Eigen::Index>(std::ceil(duration_s / wanted_s)));
  start_s_ = t_s(0);
  knot_step_s_ = duration_s / static_cast<double>(intervals_);

  const double omega = 2.0 * std::numbers::pi * cutoff_hz * knot_step_s_;  // rad per knot
  const double lambda =
      (std::numbers::sqrt2 - 1.0) * knot_step_s_ / (step_s * std::pow(omega, 6.0));
  const Eigen::Index size = intervals_ + kDegree;
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(static_cast<std::size_t>((n + intervals_) * kBasis * kBasis / 2));
  const auto add = [&](Eigen::Index interval, const Eigen::Matrix<double, kBasis, kBasis>& block) {
    for (int r = 0; r < kBasis; ++r) {
      for (int c = 0; c <= r; ++c) entries.emplace_back(interval + r, interval + c, block(r, c));
    }
  };
  const Eigen::Matrix<double, kBasis, kBasis> rough = lambda * roughness();
  for (Eigen::Index k = 0; k < intervals_; ++k) add(k, rough);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(size, values.cols());
  Eigen::Matrix<double, kBasis, kBasis> block = Eigen::Matrix<double, kBasis, kBasis>::Zero();
  Eigen::Index open = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Place place = place_of(t_s(i), start_s_, knot_step_s_, intervals_);
    if (place.interval != open) {
      add(open, block);
      block.setZero();
      open = place.interval;
    }
    const Functions b = basis(place.u, 0);
    const Eigen::Map<const Eigen::Matrix<double, kBasis, 1>> row(b.data());
    block += weights(i) * row * row.transpose();
    right.middleRows<kBasis>(place.interval) += weights(i) * row * values.row(i);
  }
  add(open, block);
  Eigen::SparseMatrix<double> normal(size, size);
  normal.setFromTriplets(entries.begin(), entries.end());
  // Banded as it stands: no reordering.
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower,
                              Eigen::NaturalOrdering<int>>
      factor(normal);
  KINESCOPE_CHECK(factor.info() == Eigen::Success, "the spline's equations are singular");
  coefficients_ = factor.solve(right);
}

Eigen::MatrixXd SmoothingSpline::evaluate(const Eigen::VectorXd& t_s, int derivative) const {
  KINESCOPE_CHECK(derivative >= 0 && derivative <= 2, "derivatives 0 to 2");
  Eigen::MatrixXd out(t_s.size(), coefficients_.cols());
  const double scale = std::pow(knot_step_s_, -derivative);
  for (Eigen::Index i = 0; i < t_s.size(); ++i) {
    const Place place = place_of(t_s(i), start_s_, knot_step_s_, intervals_);
    const Functions b = basis(place.u, derivative);
    const Eigen::Map<const Eigen::Matrix<double, kBasis, 1>> row(b.data());
    out.row(i) = scale * row.transpose() * coefficients_.middleRows<kBasis>(place.interval);
  }
  return out;
}

}  // namespace kinescope
