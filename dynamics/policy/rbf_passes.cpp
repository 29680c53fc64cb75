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

struct ValuePass {
  const double* scaled;
  Index rows;
  Index stride;
  Index features;
  const double* centre;  // of one basis function
  const double* weights;
  Index inputs;
  double* basis;  // its column
  double* sums;
  Index sums_stride;
};

template <int kFeatures>
[[gnu::always_inline]] inline void value_body(const ValuePass& p) {
  const Index features = kFeatures > 0 ? kFeatures : p.features;
  for (Index i = 0; i < p.rows; i += kLaneCount) {
    Lanes squares = {};
    for (Index f = 0; f < features; ++f) {
      Lanes z;
      load(p.scaled + f * p.stride + i, z);
      z -= p.centre[f];
      squares += z * z;
    }
    squares *= -0.5;
    exp_of(squares);
    Lanes keep;
    load(p.basis + i, keep);
    keep *= squares;
    store(keep, p.basis + i);
    for (Index u = 0; u < p.inputs; ++u) {
      Lanes sums;
      load(p.sums + u * p.sums_stride + i, sums);
      sums += keep * p.weights[u];
      store(sums, p.sums + u * p.sums_stride + i);
    }
  }
}

KINESCOPE_WIDE void value_pass(const ValuePass& p) {
  switch (p.features) {
    case 4:
      return value_body<4>(p);
    case 5:
      return value_body<5>(p);
    case 6:
      return value_body<6>(p);
    default:
      return value_body<0>(p);
  }
}

struct PullbackPass {
  const double* scaled;
  Index rows;
  Index stride;
  Index features;
  const double* centre;
  const double* weights;
  Index inputs;
  const double* basis;
  const double* d_sums;
  Index sums_stride;
  double* d_scaled;
  Index d_stride;
  double* d_centre;
  double* d_weights;
};

constexpr Index kMaxFeatures = 64;

template <int kFeatures>
[[gnu::always_inline]] inline void pullback_body(const PullbackPass& p) {
  const Index features = kFeatures > 0 ? kFeatures : p.features;
  std::array<Lanes, static_cast<std::size_t>(kFeatures > 0 ? kFeatures : kMaxFeatures)> d_centre;
  for (Index f = 0; f < features; ++f) d_centre[static_cast<std::size_t>(f)] = Lanes{};
  for (Index u = 0; u < p.inputs; ++u) {
    Lanes d_weight = {};
    for (Index i = 0; i < p.rows; i += kLaneCount) {
      Lanes basis;
      Lanes d_sum;
      load(p.basis + i, basis);
      load(p.d_sums + u * p.sums_stride + i, d_sum);
      d_weight += basis * d_sum;
    }
    p.d_weights[u] += sum(d_weight);
  }
  for (Index i = 0; i < p.rows; i += kLaneCount) {
    Lanes d_basis = {};
    for (Index u = 0; u < p.inputs; ++u) {
      Lanes d_sum;
      load(p.d_sums + u * p.sums_stride + i, d_sum);
      d_basis += d_sum * p.weights[u];
    }
    Lanes basis;
    load(p.basis + i, basis);
    d_basis *= basis;
    for (Index f = 0; f < features; ++f) {
      Lanes z;
      load(p.scaled + f * p.stride + i, z);
      const Lanes slope = d_basis * (z - p.centre[f]);
      d_centre[static_cast<std::size_t>(f)] += slope;
      Lanes d_z;
      load(p.d_scaled + f * p.d_stride + i, d_z);
      d_z -= slope;
      store(d_z, p.d_scaled + f * p.d_stride + i);
    }
  }
  for (Index f = 0; f < features; ++f) p.d_centre[f] += sum(d_centre[static_cast<std::size_t>(f)]);
}

KINESCOPE_WIDE void pullback_pass(const PullbackPass& p) {
  switch (p.features) {
    case 4:
      return pullback_body<4>(p);
    case 5:
      return pullback_body<5>(p);
    case 6:
      return pullback_body<6>(p);
    default:
      return pullback_body<0>(p);
  }
}

}  // namespace

PreparedPolicy::PreparedPolicy(const RbfPolicy& policy)
    : weights(policy.weights),
      inverse_scales(policy.length_scales.cwiseInverse().transpose()),
      limits(policy.input_limit.transpose()) {
  KINESCOPE_CHECK(policy.centres.cols() <= kMaxFeatures, "at most 64 features of a state");
  scaled_centres = policy.centres * policy.length_scales.cwiseInverse().asDiagonal();
}

PolicyGradient::PolicyGradient(const RbfPolicy& policy)
    : centres(RowMajor::Zero(policy.centres.rows(), policy.centres.cols())),
      weights(RowMajor::Zero(policy.weights.rows(), policy.weights.cols())),
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

void PolicyGradient::scale(double factor) {
  centres *= factor;
  weights *= factor;
  log_scales *= factor;
}

void policy_value(const PreparedPolicy& policy, const ConstBlock& scaled, Block basis,
                  Block inputs) {
  inputs.setZero();
  for (Index b = 0; b < basis.cols(); ++b) {
    value_pass({scaled.data(), scaled.rows(), scaled.outerStride(), scaled.cols(),
                policy.scaled_centres.row(b).data(), policy.weights.row(b).data(), inputs.cols(),
                basis.col(b).data(), inputs.data(), inputs.outerStride()});
  }
  for (Index u = 0; u < inputs.cols(); ++u) {
    const double limit = policy.limits[u];
    for (Index i = 0; i < inputs.rows(); ++i)
      inputs(i, u) = limit * std::tanh(inputs(i, u) / limit);
  }
}

void policy_pullback(const PreparedPolicy& policy, const ConstBlock& scaled,
                     const ConstBlock& basis, const ConstBlock& inputs, Block d_inputs,
                     Block d_scaled, PolicyGradient& gradient) {
  for (Index u = 0; u < inputs.cols(); ++u) {
    d_inputs.col(u).array() *= 1.0 - (inputs.col(u).array() / policy.limits[u]).square();
  }
  d_scaled.setZero();
  for (Index b = 0; b < basis.cols(); ++b) {
    pullback_pass({scaled.data(), scaled.rows(), scaled.outerStride(), scaled.cols(),
                   policy.scaled_centres.row(b).data(), policy.weights.row(b).data(), inputs.cols(),
                   basis.col(b).data(), d_inputs.data(), d_inputs.outerStride(), d_scaled.data(),
                   d_scaled.outerStride(), gradient.centres.row(b).data(),
                   gradient.weights.row(b).data()});
  }
  // e = ((z - c) / l)^2: what scales z and c together by 1 / l.
  gradient.log_scales -= d_scaled.cwiseProduct(scaled).colwise().sum();
}

void finish_gradient(const PreparedPolicy& policy, PolicyGradient& gradient) {
  gradient.log_scales -= gradient.centres.cwiseProduct(policy.scaled_centres).colwise().sum();
  gradient.centres = gradient.centres * policy.inverse_scales.asDiagonal();
}

}  // namespace kinescope::policy
