// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/line_regression.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/structure/residual_scale.h"

namespace kinescope::structure_search {
namespace {

constexpr Eigen::Index kInformation = 21;  // numbers of the lower half of a symmetric 6 x 6 matrix
constexpr Eigen::Index kMoments = kInformation + 6;

using Matrix12d = Eigen::Matrix<double, 12, 12>;
using Vector12d = Eigen::Matrix<double, 12, 1>;
using Moments = Eigen::Matrix<double, kMoments, 3>;

Matrix6d symmetric(const Eigen::Ref<const Eigen::Matrix<double, kMoments, 1>>& packed) {
  Matrix6d out;
  Eigen::Index at = 0;
  for (Eigen::Index c = 0; c < 6; ++c) {
    for (Eigen::Index r = c; r < 6; ++r, ++at) out(r, c) = out(c, r) = packed(at);
  }
  return out;
}

// Residuals of a line and what is along its slope.
ResidualParts line_residuals(const LineProblem& problem, const Eigen::VectorXd& coordinate,
                             const LineFit& line, bool free) {
  const Eigen::Index n = coordinate.size();
  Eigen::Matrix<double, 6, 2> sides;
  sides << line.mean, line.slope;
  const Eigen::MatrixXd white = problem.whitening * sides;
  const Eigen::Map<const Eigen::MatrixXd> mean(white.data(), 6, n);
  const Eigen::Map<const Eigen::MatrixXd> axis(white.data() + 6 * n, 6, n);
  ResidualParts parts;
  parts.split = line.slope.squaredNorm() > 0.0;
  parts.free_axis = free;
  const auto size = static_cast<std::size_t>(n);
  for (auto* part : {&parts.along, &parts.across, &parts.lever}) part->resize(size);
  parts.penalty.assign(size, 0.0);
  for (std::size_t i = 0; i < size; ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    const Vector6d a = axis.col(at);
    const Vector6d r = problem.white.col(at) - mean.col(at) - coordinate(at) * a;
    const double lever = a.norm();
    const double along = parts.split ? a.dot(r) / lever : 0.0;
    parts.along[i] = free ? 0.0 : along;
    parts.across[i] = std::max(0.0, r.squaredNorm() - along * along);
    parts.lever[i] = lever;
  }
  return parts;
}

// Sums of the moments over the samples, times 1, c and c^2.
Moments weighted_moments(const LineProblem& problem, const Eigen::VectorXd& coordinate,
                         const std::vector<double>& weight) {
  Eigen::MatrixXd factors(coordinate.size(), 3);
  factors.col(0) = Eigen::Map<const Eigen::VectorXd>(weight.data(), coordinate.size());
  factors.col(1) = factors.col(0).cwiseProduct(coordinate);
  factors.col(2) = factors.col(1).cwiseProduct(coordinate);
  return problem.moments.transpose() * factors;
}

// Solves for the parameters whose index is in `used` (mean, then slope); true standard deviations
// need unit noise.
LineFit solve_line(const LineProblem& problem, const Eigen::VectorXd& coordinate,
                   const std::vector<double>& weight, const std::vector<int>& used) {
  const Moments m = weighted_moments(problem, coordinate, weight);
  Matrix12d H;
  H.topLeftCorner<6, 6>() = symmetric(m.col(0));
  H.bottomLeftCorner<6, 6>() = symmetric(m.col(1));
  H.topRightCorner<6, 6>() = H.bottomLeftCorner<6, 6>();
  H.bottomRightCorner<6, 6>() = symmetric(m.col(2));
  Vector12d g;
  g << m.col(0).tail<6>(), m.col(1).tail<6>();
  Eigen::MatrixXd part = H(used, used);
  part.diagonal() *= 1.0 + 1e-9;
  const LdltFactor factor(part);
  Vector12d x = Vector12d::Zero();
  const Eigen::VectorXd right = g(used);
  const Eigen::VectorXd solved = factor.solve(right);
  for (std::size_t k = 0; k < used.size(); ++k) x(used[k]) = solved(static_cast<Eigen::Index>(k));
  LineFit fit{.mean = x.head<6>(), .slope = x.tail<6>()};
  if (used.size() == 12) {
    const Eigen::MatrixXd covariance =
        factor.solve(Eigen::MatrixXd(Eigen::MatrixXd::Identity(12, 12).middleCols<3>(6)));
    const double variance = covariance.middleRows<3>(6).trace() / 3.0;
    fit.turn_evidence = fit.slope.head<3>().norm() / std::sqrt(std::max(1e-300, variance));
  }
  return fit;
}

std::vector<int> parameters_of(JointType type) {
  if (type == JointType::kRevolute) return {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
  return {0, 1, 2, 3, 4, 5, 9, 10, 11};
}

// Passes of reweighted least squares; the best by cost, since few outliers may lead astray.
template <typename Improve>
LineFit reweighted(const LineProblem& problem, Eigen::VectorXd& coordinate,
                   const std::vector<int>& used, const LineFit& start, bool free,
                   Improve&& improve) {
  constexpr int kPasses = 3;
  constexpr double kEnough = 1.0;  // -2 ln likelihood
  ResidualParts parts = line_residuals(problem, coordinate, start, free);
  ResidualScale scale = residual_scale(parts);
  LineFit best;
  Eigen::VectorXd best_coordinate = coordinate;
  for (int pass = 0; pass < kPasses; ++pass) {
    LineFit line = solve_line(problem, coordinate, robust_weights(parts, scale), used);
    improve(line, coordinate);
    parts = line_residuals(problem, coordinate, line, free);
    scale = residual_scale(parts);
    line.cost = scale.cost;
    line.across = scale.across;
    const double gain = best.cost - line.cost;
    if (pass > 0 && gain <= 0.0) continue;
    best = line;
    best_coordinate = coordinate;
    if (pass > 0 && gain < kEnough) break;
  }
  coordinate = best_coordinate;
  return best;
}

}  // namespace

LineProblem line_problem(const LinearMotion& linear, const Motion& motion) {
  const auto n = static_cast<Eigen::Index>(motion.size());
  LineProblem out{Eigen::MatrixXd(6 * n, 6), Eigen::MatrixXd(6, n), Eigen::MatrixXd(n, kMoments)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vector6d y = linear.tangent.col(i);
    const Matrix6d W = tangent_whitening(motion[static_cast<std::size_t>(i)], y);
    const Vector6d white = W * y;
    out.whitening.middleRows<6>(6 * i) = W;
    out.white.col(i) = white;
    Eigen::Index at = 0;
    for (Eigen::Index c = 0; c < 6; ++c) {
      for (Eigen::Index r = c; r < 6; ++r) out.moments(i, at++) = W.col(r).dot(W.col(c));
    }
    out.moments.row(i).tail<6>() = white.transpose() * W;
  }
  return out;
}

LineFit fit_line(const LineProblem& problem, const Eigen::VectorXd& coordinate, JointType type,
                 const LineFit& start) {
  Eigen::VectorXd kept = coordinate;
  return reweighted(problem, kept, parameters_of(type), start, false,
                    [](const LineFit&, const Eigen::VectorXd&) {});
}

LineFit fit_free_line(const LineProblem& problem, Eigen::VectorXd& coordinate, JointType type,
                      const LineFit& start) {
  const auto move = [&](const LineFit& line, Eigen::VectorXd& c) {
    for (Eigen::Index i = 0; i < c.size(); ++i) {
      const auto W = problem.whitening.middleRows<6>(6 * i);
      const Vector6d axis = W * line.slope;
      const Vector6d left = problem.white.col(i) - W * line.mean;
      c(i) = axis.dot(left) / axis.squaredNorm();
    }
  };
  LineFit fit = reweighted(problem, coordinate, parameters_of(type), start, true, move);
  const ResidualParts parts = line_residuals(problem, coordinate, fit, true);
  const double variance = (coordinate.array() - coordinate.mean()).square().mean();
  for (const double lever : parts.lever) fit.cost += 1.0 + std::log1p(variance * lever * lever);
  return fit;
}

LineFit fit_point(const LineProblem& problem, const LineFit& start) {
  Eigen::VectorXd none = Eigen::VectorXd::Zero(problem.white.cols());
  return reweighted(problem, none, {0, 1, 2, 3, 4, 5}, {.mean = start.mean}, false,
                    [](const LineFit&, const Eigen::VectorXd&) {});
}

}  // namespace kinescope::structure_search
