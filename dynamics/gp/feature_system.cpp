// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/feature_system.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

double log_two_pi() { return std::log(2.0 * std::numbers::pi); }

}  // namespace

Index rows_per_qr(Index features) { return std::max<Index>(1024, 2 * features); }

void absorb_rows(Eigen::MatrixXd& triangle, const Eigen::MatrixXd& rows) {
  const Index d = rows.cols();
  Eigen::MatrixXd stacked(triangle.rows() + rows.rows(), d);
  stacked << triangle, rows;
  upper_of_qr(stacked);
  triangle = stacked.topRows(d).triangularView<Eigen::Upper>();
}

FeatureSystem press(Workers& workers, const KernelNode& node, const Problem& problem,
                    const std::vector<Index>& samples) {
  std::vector<Index> chosen = samples;
  if (chosen.empty()) {
    chosen.resize(static_cast<std::size_t>(problem.samples));
    std::iota(chosen.begin(), chosen.end(), Index{0});
  }
  const Index outputs = problem.outputs;
  const auto total = static_cast<Index>(chosen.size());
  // Exponents come with any basis.
  FeatureSystem out;
  out.exponents = node.basis(problem.inputs.topRows(1)).exponents;
  const Index d = out.features();
  const Index chunk = rows_per_qr(d);
  const Index chunks = (total + chunk - 1) / chunk;
  out.outputs.resize(static_cast<std::size_t>(outputs));
  // One triangle for each chunk and output, made by the workers, joined in order.
  std::vector<Eigen::MatrixXd> parts(static_cast<std::size_t>(chunks * outputs));
  workers.run(chunks, [&](Index task, Scratch&) {
    const Index begin = task * chunk;
    const Index size = std::min(chunk, total - begin);
    const std::vector<Index> part(chosen.begin() + begin, chosen.begin() + begin + size);
    const Basis basis = node.basis(problem.inputs(part, Eigen::all));
    for (Index o = 0; o < outputs; ++o) {
      Eigen::MatrixXd rows(size, d + 1);
      rows.leftCols(d) = basis.values.middleRows(o * size, size);
      for (Index i = 0; i < size; ++i) {
        const Index row = part[static_cast<std::size_t>(i)] * outputs + o;
        rows(i, d) = problem.targets[row];
        rows.row(i) /= std::sqrt(problem.noise_scale[row]);
      }
      Eigen::MatrixXd triangle = Eigen::MatrixXd::Zero(d + 1, d + 1);
      absorb_rows(triangle, rows);
      parts[static_cast<std::size_t>(task * outputs + o)] = std::move(triangle);
    }
  });
  for (Index o = 0; o < outputs; ++o) {
    PressedOutput& pressed = out.outputs[static_cast<std::size_t>(o)];
    pressed.triangle = Eigen::MatrixXd::Zero(d + 1, d + 1);
    for (Index c = 0; c < chunks; ++c) {
      absorb_rows(pressed.triangle, parts[static_cast<std::size_t>(c * outputs + o)]);
    }
    pressed.count = total;
    for (const Index sample : chosen) {
      pressed.log_noise_scale += std::log(problem.noise_scale[sample * outputs + o]);
    }
  }
  return out;
}

FeatureSystem press_together(const std::vector<const FeatureSystem*>& parts) {
  KINESCOPE_CHECK(!parts.empty(), "nothing to press");
  FeatureSystem out = *parts.front();
  for (std::size_t p = 1; p < parts.size(); ++p) {
    for (std::size_t o = 0; o < out.outputs.size(); ++o) {
      const PressedOutput& other = parts[p]->outputs[o];
      absorb_rows(out.outputs[o].triangle, other.triangle);
      out.outputs[o].count += other.count;
      out.outputs[o].log_noise_scale += other.log_noise_scale;
    }
  }
  return out;
}

// QR of [sigma^-1 R S, sigma^-1 z; I, 0]: U, U weights and what is left of the targets.
FeatureSolution solve(const FeatureSystem& system, const Eigen::VectorXd& theta,
                      const Eigen::VectorXd& log_noise) {
  const Index d = system.features();
  const auto outputs = static_cast<Index>(system.outputs.size());
  FeatureSolution out;
  out.root_scale = (0.5 * (system.exponents * theta)).array().exp();
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(outputs * d + d, d + 1);
  double left = 0.0;
  double log_noise_sum = 0.0;
  double count = 0.0;
  for (Index o = 0; o < outputs; ++o) {
    const PressedOutput& pressed = system.outputs[static_cast<std::size_t>(o)];
    const double log_variance = log_noise[o % log_noise.size()];
    const double whitening = std::exp(-0.5 * log_variance);
    auto block = rows.middleRows(o * d, d);
    block.leftCols(d) =
        whitening * pressed.triangle.topLeftCorner(d, d) * out.root_scale.asDiagonal();
    block.col(d) = whitening * pressed.triangle.col(d).head(d);
    const double rho = whitening * pressed.triangle(d, d);
    left += rho * rho;
    const auto n = static_cast<double>(pressed.count);
    count += n;
    log_noise_sum += n * log_variance + pressed.log_noise_scale;
  }
  rows.bottomLeftCorner(d, d).setIdentity();
  upper_of_qr(rows);
  out.lower = rows.topLeftCorner(d, d).transpose().triangularView<Eigen::Lower>();
  out.weights = rows.col(d).head(d);
  if (d > 0) solve_lower_transposed(out.lower, out.weights);
  left += rows(d, d) * rows(d, d);
  const double log_determinant = d > 0 ? 2.0 * out.lower.diagonal().array().abs().log().sum() : 0.0;
  out.log_likelihood = -0.5 * (left + log_determinant + log_noise_sum + count * log_two_pi());
  return out;
}

// With u the weights and A = U'U: d/dlog s_f = 1/2 (u_f^2 - 1 + (A^-1)_ff), and for the noise of an
// output 1/2 (|residual|^2 / sigma^2 - N + sum of leverages).
Eigen::VectorXd likelihood_gradient(const FeatureSystem& system, const FeatureSolution& solution,
                                    const Eigen::VectorXd& log_noise) {
  const Index d = system.features();
  Eigen::MatrixXd inverse = solution.lower;
  invert_lower(inverse);
  const Eigen::VectorXd variances = inverse.colwise().squaredNorm();
  const Eigen::VectorXd by_scale =
      0.5 * (solution.weights.array().square() - 1.0 + variances.array());
  Eigen::VectorXd out(system.exponents.cols() + log_noise.size());
  out.head(system.exponents.cols()) = system.exponents.transpose() * by_scale;
  auto noise = out.tail(log_noise.size());
  noise.setZero();
  for (std::size_t o = 0; o < system.outputs.size(); ++o) {
    const PressedOutput& pressed = system.outputs[o];
    const Index parameter = static_cast<Index>(o) % log_noise.size();
    const double precision = std::exp(-log_noise[parameter]);
    Eigen::MatrixXd scaled =
        pressed.triangle.topLeftCorner(d, d) * solution.root_scale.asDiagonal();
    const double rho = pressed.triangle(d, d);
    const double left =
        (pressed.triangle.col(d).head(d) - scaled * solution.weights).squaredNorm() + rho * rho;
    solve_lower_transposed_right(solution.lower, scaled);
    noise[parameter] += 0.5 * (left * precision - static_cast<double>(pressed.count) +
                               scaled.squaredNorm() * precision);
  }
  return out;
}

}  // namespace kinescope::gp
