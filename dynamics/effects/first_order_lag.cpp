// SPDX-License-Identifier: Apache-2.0
#include "dynamics/effects/first_order_lag.h"

#include <array>
#include <cmath>
#include <vector>

#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

/// y(k) = decay y(k-1) + the weights times x(k-2) .. x(k+1); y(k) = x(k) mirrored where it starts.
struct Step {
  double decay = 0.0;
  std::array<double, 4> weights{};
  bool starts = true;
  double mean = 0.0;  ///< of the time gone by within the step, weighted as in moments()
};

/// Integrals of ratio e^(-ratio (1 - u)) u^n over a step, n = 0 .. 3, by parts.
std::array<double, 4> moments(double ratio) {
  std::array<double, 4> out{};
  out[0] = -std::expm1(-ratio);
  for (std::size_t n = 1; n < out.size(); ++n)
    out[n] = 1.0 - static_cast<double>(n) / ratio * out[n - 1];
  return out;
}

/// Lagrange's cubic through u = -1, 0, 1, 2; at a gap or an end the straight line from 0 to 1.
Step step_of(double ratio, bool has_four) {
  const std::array<double, 4> m = moments(ratio);
  if (!has_four) return {std::exp(-ratio), {0.0, m[0] - m[1], m[1], 0.0}, false, m[1]};
  return {std::exp(-ratio),
          {(-m[3] + 3.0 * m[2] - 2.0 * m[1]) / 6.0, (m[3] - 2.0 * m[2] - m[1] + 2.0 * m[0]) / 2.0,
           (-m[3] + m[2] + 2.0 * m[1]) / 2.0, (m[3] - m[1]) / 6.0},
          false,
          m[1]};
}

std::vector<Step> steps_of(const Eigen::VectorXd& time_s, const Eigen::VectorXi& trajectory,
                           double constant_s) {
  constexpr double kGap = 1.5;  // usual steps: halfway to a missing row
  const Eigen::Index n = time_s.size();
  std::vector<double> spans;
  for (Eigen::Index k = 1; k < n; ++k) {
    if (trajectory[k] == trajectory[k - 1]) spans.push_back(time_s[k] - time_s[k - 1]);
  }
  const double usual_s = spans.empty() ? 0.0 : median_of(spans);
  const auto follows = [&](Eigen::Index k) {
    return k > 0 && k < n && trajectory[k] == trajectory[k - 1] &&
           time_s[k] - time_s[k - 1] < kGap * usual_s;
  };
  std::vector<Step> out(static_cast<std::size_t>(n));
  for (Eigen::Index k = 1; k < n; ++k) {
    if (!follows(k)) continue;
    const double ratio = (time_s[k] - time_s[k - 1]) / constant_s;
    out[static_cast<std::size_t>(k)] = step_of(ratio, follows(k - 1) && follows(k + 1));
  }
  return out;
}

/// y at row `first`, where the low-pass starts, if x before that is its odd reflection about the
/// row, as at the ends of the zero-phase filter: 2 x - what the low-pass makes of x backwards.
double start_of(const Eigen::MatrixXd& values, Eigen::Index column, Eigen::Index first,
                const std::vector<Step>& steps) {
  constexpr double kForgotten = 1e-9;
  double weight = 1.0, backwards = 0.0;
  Eigen::Index k = first;
  for (; k + 1 < values.rows() && weight > kForgotten; ++k) {
    const Step& step = steps[static_cast<std::size_t>(k + 1)];
    if (step.starts) break;
    const double near = step.mean;
    const double far = 1.0 - step.decay - near;
    backwards += weight * (near * values(k, column) + far * values(k + 1, column));
    weight *= step.decay;
  }
  return 2.0 * values(first, column) - backwards - weight * values(k, column);
}

}  // namespace

Eigen::MatrixXd first_order_lag(const Eigen::MatrixXd& values, const Eigen::VectorXd& time_s,
                                const Eigen::VectorXi& trajectory, double constant_s) {
  KINESCOPE_CHECK(values.rows() == time_s.size() && values.rows() == trajectory.size(),
                  "a time and a trajectory of every row");
  if (!(constant_s > 0.0)) return values;
  const std::vector<Step> steps = steps_of(time_s, trajectory, constant_s);
  Eigen::MatrixXd out(values.rows(), values.cols());
  for (Eigen::Index c = 0; c < values.cols(); ++c) {
    for (Eigen::Index k = 0; k < values.rows(); ++k) {
      const Step& step = steps[static_cast<std::size_t>(k)];
      if (step.starts) {
        out(k, c) = start_of(values, c, k, steps);
        continue;
      }
      double y = step.decay * out(k - 1, c);
      for (Eigen::Index i = 0; i < 4; ++i) {
        const double weight = step.weights[static_cast<std::size_t>(i)];
        if (weight != 0.0) y += weight * values(k - 2 + i, c);
      }
      out(k, c) = y;
    }
  }
  return out;
}

}  // namespace kinescope
