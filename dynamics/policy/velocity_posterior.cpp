// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/velocity_posterior.h"

#include <cmath>

#include "dynamics/gp/blas.h"
#include "dynamics/policy/kernel_matrix.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

// A variance below this share of the noise's is rounding: k** - |V|^2 of a kernel whose prior
// variance is 1e6 times the noise's keeps ten digits. The pullback is zero there.
constexpr double kFloorOfNoise = 1e-6;

}  // namespace

PosteriorTape::PosteriorTape(Index particles, Index columns, Index samples)
    : scaled(particles, columns),
      smooth(particles, samples),
      solved(particles, samples),
      mean(particles, 1),
      deviation(particles, 1) {}

PosteriorScratch::PosteriorScratch(Index particles, Index columns, Index linear, Index samples)
    : kernel(particles, samples),
      rotated(particles, samples),
      sums(particles, 1),
      d_variance(particles, 1),
      d_scaled(particles, std::max(columns, linear)) {}

VelocityPosterior::VelocityPosterior(const VelocityProcess& process, const PhysicsFeatures* physics)
    : target_scale_(process.target_scale),
      factors_(process.kernel.factors),
      floor_(kFloorOfNoise * process.kernel.noise_variance) {
  const SingleThreadedBlas one_thread;
  Eigen::MatrixXd matrix = kernel_matrix(process.kernel, process.inputs, process.inputs, physics);
  matrix.diagonal().array() += process.kernel.noise_variance;
  Factor factor = robust_cholesky(matrix);
  Eigen::MatrixXd weights = process.targets;
  gp::solve_lower(factor.lower, weights);
  gp::solve_lower_transposed(factor.lower, weights);
  gp::invert_lower(factor.lower);
  product_ = TriangleProduct(factor.lower);
  prepared_ = PreparedSamples(process.kernel, process.inputs,
                              linear_columns(process.inputs, physics), weights.col(0));
}

void VelocityPosterior::add_prior(const ConstBlock& linear, Block variance) const {
  variance.array() += prepared_.variance;
  for (Index i = 0; !factors_.empty() && i < linear.rows(); ++i) {
    double product = 1.0;
    for (const LinearFactor& factor : factors_) {
      product *= factor.offset + linear.row(i).cwiseAbs2().dot(factor.weights.transpose());
    }
    variance(i, 0) += product;
  }
}

void VelocityPosterior::pull_back_prior(const ConstBlock& linear, const ConstBlock& d_variance,
                                        Block d_linear) const {
  for (Index i = 0; !factors_.empty() && i < linear.rows(); ++i) {
    for (std::size_t f = 0; f < factors_.size(); ++f) {
      double others = 2.0 * d_variance(i, 0);
      for (std::size_t g = 0; g < factors_.size(); ++g) {
        if (g == f) continue;
        others *=
            factors_[g].offset + linear.row(i).cwiseAbs2().dot(factors_[g].weights.transpose());
      }
      for (Index d = 0; d < linear.cols(); ++d) {
        d_linear(i, d) += others * factors_[f].weights[d] * linear(i, d);
      }
    }
  }
}

void VelocityPosterior::predict(const ConstBlock& inputs, const ConstBlock& linear, bool with_tape,
                                PosteriorTape& tape, PosteriorScratch& scratch) const {
  for (Index d = 0; d < inputs.cols(); ++d) {
    tape.scaled.col(d) = inputs.col(d) * prepared_.inverse_scales[d];
  }
  kernel_value(prepared_, tape.scaled, linear, tape.smooth, scratch.kernel, tape.mean);
  product_.times_transposed(scratch.kernel, scratch.rotated);
  if (with_tape) product_.times(scratch.rotated, tape.solved);
  squared_rows(scratch.rotated, scratch.sums);
  tape.deviation = -scratch.sums;
  add_prior(linear, tape.deviation);
  tape.deviation = tape.deviation.cwiseMax(floor_).cwiseSqrt();
}

void VelocityPosterior::pullback(const ConstBlock& linear, const PosteriorTape& tape,
                                 const ConstBlock& d_mean, const ConstBlock& d_deviation,
                                 PosteriorScratch& scratch, Block d_inputs, Block d_linear) const {
  const double clamped = std::sqrt(floor_);
  for (Index i = 0; i < tape.deviation.rows(); ++i) {
    const double deviation = tape.deviation(i, 0);
    scratch.d_variance(i, 0) = deviation > clamped ? 0.5 * d_deviation(i, 0) / deviation : 0.0;
  }
  kernel_pullback(prepared_, tape.scaled, linear, tape.smooth, tape.solved, d_mean,
                  scratch.d_variance, scratch.d_scaled, d_linear);
  for (Index d = 0; d < d_inputs.cols(); ++d) {
    d_inputs.col(d) += scratch.d_scaled.col(d) * prepared_.inverse_scales[d];
  }
  pull_back_prior(linear, scratch.d_variance, d_linear);
}

}  // namespace kinescope::policy
