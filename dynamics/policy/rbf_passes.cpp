// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/rbf_passes.h"

#include <array>
#include <cmath>

#include "dynamics/gp/simd.h"
#include "dynamics/policy/lanes.h"
#include "kinematics/core/error.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

// Two basis functions at a time share what they read of the particles.
constexpr Index kMaxFeatures = 64;
struct BasisPair {
  const double* centre[2];  // over the length scales
  double half_square[2];    // -1/2 |centre|^2
  const double* weights[2];
};

struct Particles {
  const double* scaled;
  Index rows;
  Index stride;
  Index features;
};

struct Sums {
  double* values;  // rows x inputs
  Index stride;
  Index inputs;
};

template <int kFeatures>
[[gnu::always_inline]] inline void value_body(const Particles& p, const BasisPair& pair,
                                              double* basis0, double* basis1, const Sums& sums) {
  const Index features = kFeatures > 0 ? kFeatures : p.features;
  for (Index i = 0; i < p.rows; i += kLaneCount) {
    Lanes own = {};
    Lanes a = Lanes{} + pair.half_square[0];
    Lanes b = Lanes{} + pair.half_square[1];
#pragma GCC unroll 8
    for (Index f = 0; f < features; ++f) {
      Lanes z;
      load(p.scaled + f * p.stride + i, z);
      own += z * z;
      a += z * pair.centre[0][f];
      b += z * pair.centre[1][f];
    }
    a -= 0.5 * own;
    b -= 0.5 * own;
    exp_of(a);
    exp_of(b);
    Lanes keep;
    load(basis0 + i, keep);
    a *= keep;
    load(basis1 + i, keep);
    b *= keep;
    store(a, basis0 + i);
    store(b, basis1 + i);
    for (Index u = 0; u < sums.inputs; ++u) {
      Lanes sum_u;
      load(sums.values + u * sums.stride + i, sum_u);
      sum_u += a * pair.weights[0][u] + b * pair.weights[1][u];
      store(sum_u, sums.values + u * sums.stride + i);
    }
  }
}

KINESCOPE_WIDE void value_pass(const Particles& p, const BasisPair& pair, double* basis0,
                               double* basis1, const Sums& sums) {
  if (p.features == 5) return value_body<5>(p, pair, basis0, basis1, sums);
  if (p.features == 6) return value_body<6>(p, pair, basis0, basis1, sums);
  return value_body<0>(p, pair, basis0, basis1, sums);
}

struct PairGradient {
  double* d_centre[2];
  double* d_weights[2];
};

// With s the pullback to the exponents: d z = sum_b s_b c_b - z sum_b s_b, d c_b = sum_i s_i z_i -
// c_b sum_i s_i. `totals`: sum_b s_b of each particle.
template <int kFeatures>
[[gnu::always_inline]] inline void pullback_body(const Particles& p, const BasisPair& pair,
                                                 const double* basis0, const double* basis1,
                                                 const Sums& d_sums, double* d_scaled,
                                                 Index d_stride, double* totals,
                                                 const PairGradient& gradient) {
  constexpr auto kCapacity = static_cast<std::size_t>(kFeatures > 0 ? kFeatures : kMaxFeatures);
  const Index features = kFeatures > 0 ? kFeatures : p.features;
  std::array<Lanes, kCapacity> d_centre0;
  std::array<Lanes, kCapacity> d_centre1;
#pragma GCC unroll 8
  for (Index f = 0; f < features; ++f) {
    d_centre0[static_cast<std::size_t>(f)] = Lanes{};
    d_centre1[static_cast<std::size_t>(f)] = Lanes{};
  }
  Lanes total0 = {};
  Lanes total1 = {};
  for (Index i = 0; i < p.rows; i += kLaneCount) {
    Lanes a = {};
    Lanes b = {};
    for (Index u = 0; u < d_sums.inputs; ++u) {
      Lanes d_sum;
      load(d_sums.values + u * d_sums.stride + i, d_sum);
      a += d_sum * pair.weights[0][u];
      b += d_sum * pair.weights[1][u];
    }
    Lanes basis;
    load(basis0 + i, basis);
    a *= basis;
    load(basis1 + i, basis);
    b *= basis;
    total0 += a;
    total1 += b;
    Lanes total;
    load(totals + i, total);
    total += a + b;
    store(total, totals + i);
#pragma GCC unroll 8
    for (Index f = 0; f < features; ++f) {
      Lanes z;
      load(p.scaled + f * p.stride + i, z);
      d_centre0[static_cast<std::size_t>(f)] += a * z;
      d_centre1[static_cast<std::size_t>(f)] += b * z;
      load(d_scaled + f * d_stride + i, z);
      z += a * pair.centre[0][f] + b * pair.centre[1][f];
      store(z, d_scaled + f * d_stride + i);
    }
  }
  for (Index f = 0; f < features; ++f) {
    gradient.d_centre[0][f] +=
        sum(d_centre0[static_cast<std::size_t>(f)]) - pair.centre[0][f] * sum(total0);
    gradient.d_centre[1][f] +=
        sum(d_centre1[static_cast<std::size_t>(f)]) - pair.centre[1][f] * sum(total1);
  }
}

[[gnu::always_inline]] inline void weight_body(const double* basis, const Sums& d_sums, Index rows,
                                               double* d_weights) {
  for (Index u = 0; u < d_sums.inputs; ++u) {
    Lanes d_weight = {};
    for (Index i = 0; i < rows; i += kLaneCount) {
      Lanes value;
      Lanes d_sum;
      load(basis + i, value);
      load(d_sums.values + u * d_sums.stride + i, d_sum);
      d_weight += value * d_sum;
    }
    d_weights[u] += sum(d_weight);
  }
}

KINESCOPE_WIDE void pullback_pass(const Particles& p, const BasisPair& pair, const double* basis0,
                                  const double* basis1, const Sums& d_sums, double* d_scaled,
                                  Index d_stride, double* totals, const PairGradient& gradient) {
  weight_body(basis0, d_sums, p.rows, gradient.d_weights[0]);
  weight_body(basis1, d_sums, p.rows, gradient.d_weights[1]);
  if (p.features == 5) {
    pullback_body<5>(p, pair, basis0, basis1, d_sums, d_scaled, d_stride, totals, gradient);
  } else if (p.features == 6) {
    pullback_body<6>(p, pair, basis0, basis1, d_sums, d_scaled, d_stride, totals, gradient);
  } else {
    pullback_body<0>(p, pair, basis0, basis1, d_sums, d_scaled, d_stride, totals, gradient);
  }
}

BasisPair pair_of(const PreparedPolicy& policy, Index first) {
  return {{policy.scaled_centres.row(first).data(), policy.scaled_centres.row(first + 1).data()},
          {policy.half_squares[first], policy.half_squares[first + 1]},
          {policy.weights.row(first).data(), policy.weights.row(first + 1).data()}};
}

}  // namespace

PreparedPolicy::PreparedPolicy(const RbfPolicy& policy)
    : inverse_scales(policy.length_scales.cwiseInverse().transpose()),
      limits(policy.input_limit.transpose()) {
  KINESCOPE_CHECK(policy.centres.cols() <= kMaxFeatures, "at most 64 features of a state");
  const Index basis = policy.basis_count();
  scaled_centres = RowMajor::Zero(even(basis), policy.centres.cols());
  scaled_centres.topRows(basis) = policy.centres * inverse_scales.asDiagonal();
  half_squares = -0.5 * scaled_centres.rowwise().squaredNorm();
  weights = RowMajor::Zero(even(basis), policy.input_count());
  weights.topRows(basis) = policy.weights;
}

PolicyGradient::PolicyGradient(const RbfPolicy& policy)
    : basis_count(policy.basis_count()),
      centres(RowMajor::Zero(even(policy.basis_count()), policy.centres.cols())),
      weights(RowMajor::Zero(even(policy.basis_count()), policy.weights.cols())),
      log_scales(Eigen::RowVectorXd::Zero(policy.length_scales.size())) {}

void PolicyGradient::set_zero() {
  centres.setZero();
  weights.setZero();
  log_scales.setZero();
}

void PolicyGradient::add(const PolicyGradient& other) {
  centres += other.centres;
  weights += other.weights;
  log_scales += other.log_scales;
}

double PolicyGradient::norm() const {
  return std::sqrt(centres.squaredNorm() + weights.squaredNorm() + log_scales.squaredNorm());
}

void policy_value(const PreparedPolicy& policy, const ConstBlock& scaled, Block basis,
                  Block inputs) {
  KINESCOPE_CHECK(basis.cols() == policy.weights.rows() && scaled.rows() % kLaneCount == 0,
                  "an even number of basis functions and a multiple of eight particles");
  inputs.setZero();
  const Particles particles{scaled.data(), scaled.rows(), scaled.outerStride(), scaled.cols()};
  const Sums sums{inputs.data(), inputs.outerStride(), inputs.cols()};
  for (Index b = 0; b < basis.cols(); b += 2) {
    value_pass(particles, pair_of(policy, b), basis.col(b).data(), basis.col(b + 1).data(), sums);
  }
  for (Index u = 0; u < inputs.cols(); ++u) {
    const double limit = policy.limits[u];
    for (Index i = 0; i < inputs.rows(); ++i) {
      inputs(i, u) = limit * std::tanh(inputs(i, u) / limit);
    }
  }
}

void policy_pullback(const PreparedPolicy& policy, const ConstBlock& scaled,
                     const ConstBlock& basis, const ConstBlock& inputs, Block d_inputs,
                     Block d_scaled, PolicyGradient& gradient) {
  for (Index u = 0; u < inputs.cols(); ++u) {
    d_inputs.col(u).array() *= 1.0 - (inputs.col(u).array() / policy.limits[u]).square();
  }
  d_scaled.setZero();
  gradient.totals.setZero(scaled.rows());
  const Particles particles{scaled.data(), scaled.rows(), scaled.outerStride(), scaled.cols()};
  const Sums d_sums{d_inputs.data(), d_inputs.outerStride(), d_inputs.cols()};
  for (Index b = 0; b < basis.cols(); b += 2) {
    pullback_pass(particles, pair_of(policy, b), basis.col(b).data(), basis.col(b + 1).data(),
                  d_sums, d_scaled.data(), d_scaled.outerStride(), gradient.totals.data(),
                  {{gradient.centres.row(b).data(), gradient.centres.row(b + 1).data()},
                   {gradient.weights.row(b).data(), gradient.weights.row(b + 1).data()}});
  }
  for (Index f = 0; f < scaled.cols(); ++f) {
    d_scaled.col(f) -= scaled.col(f).cwiseProduct(gradient.totals);
    // e = ((z - c) / l)^2: the length scale moves z and c together.
    gradient.log_scales[f] -= d_scaled.col(f).dot(scaled.col(f));
  }
}

void finish_gradient(const PreparedPolicy& policy, PolicyGradient& gradient) {
  const Index padding = gradient.centres.rows() - gradient.basis_count;
  gradient.centres.bottomRows(padding).setZero();
  gradient.weights.bottomRows(padding).setZero();
  gradient.log_scales -= gradient.centres.cwiseProduct(policy.scaled_centres).colwise().sum();
  gradient.centres = gradient.centres * policy.inverse_scales.asDiagonal();
}

}  // namespace kinescope::policy
