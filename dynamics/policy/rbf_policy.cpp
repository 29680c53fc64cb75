// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/rbf_policy.h"

#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "dynamics/policy/state_features.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

// Standard deviation of every column; 1 where it does not vary.
Eigen::RowVectorXd spread_of(const Eigen::MatrixXd& values) {
  const Eigen::RowVectorXd mean = values.colwise().mean();
  Eigen::RowVectorXd out = (values.rowwise() - mean).colwise().squaredNorm();
  out = (out / static_cast<double>(values.rows())).cwiseSqrt();
  return (out.array() > 0.0).select(out, 1.0);
}

}  // namespace

RbfPolicy draw_policy(const StateLayout& layout, const PolicyOptions& options,
                      const Eigen::MatrixXd& states, std::uint64_t seed) {
  check_layout(layout);
  if (options.basis_count < 1 || !(options.weight_sigma >= 0.0) || !(options.centre_range > 0.0)) {
    throw bad_request("policy",
                      fmt::format("{} basis functions, weights of {}, centres over {}",
                                  options.basis_count, options.weight_sigma, options.centre_range),
                      "give 1 or more, 0 or more, above 0");
  }
  if (states.cols() != layout.state_count() || states.rows() < 1 || !states.allFinite()) {
    throw bad_request("policy", "the states to cover do not fit the layout or are not finite",
                      "give rows of positions and speeds");
  }
  const Index features = feature_count(layout);
  const Index linear = 2 * layout.state_count() - features;  // features that are no sine, no cosine
  Eigen::MatrixXd seen(states.rows(), features);
  state_features(layout, states, seen);
  const Eigen::RowVectorXd mean = seen.colwise().mean();
  const Eigen::RowVectorXd spread = spread_of(seen);
  Rng rng = Rng::from_name("policy", seed);
  RbfPolicy out{Eigen::MatrixXd(options.basis_count, features), Eigen::VectorXd::Ones(features),
                Eigen::MatrixXd(options.basis_count, layout.input_count()), layout.input_limit};
  for (Index b = 0; b < options.basis_count; ++b) {
    for (Index f = 0; f < linear; ++f) {
      out.centres(b, f) = mean[f] + options.centre_range * spread[f] * rng.uniform(-1.0, 1.0);
    }
    for (Index f = linear; f < features; f += 2) {
      const double angle = rng.uniform(-std::numbers::pi, std::numbers::pi);
      out.centres(b, f) = std::sin(angle);
      out.centres(b, f + 1) = std::cos(angle);
    }
    for (Index u = 0; u < layout.input_count(); ++u) {
      out.weights(b, u) = rng.normal(options.weight_sigma * layout.input_limit[u]);
    }
  }
  out.length_scales.head(linear) = options.centre_range * 0.5 * spread.head(linear).transpose();
  return out;
}

void check_policy(const RbfPolicy& policy, const StateLayout& layout) {
  const Index features = feature_count(layout);
  const bool fits = policy.centres.cols() == features && policy.length_scales.size() == features &&
                    policy.weights.rows() == policy.centres.rows() && policy.centres.rows() > 0 &&
                    policy.weights.cols() == layout.input_count() &&
                    policy.input_limit.size() == layout.input_count();
  if (!fits) {
    throw bad_request(
        "policy",
        fmt::format("{} basis functions of {} features for {} inputs", policy.centres.rows(),
                    policy.centres.cols(), policy.weights.cols()),
        fmt::format("the system has {} features and {} inputs: give a policy of it", features,
                    layout.input_count()));
  }
  if (!policy.centres.allFinite() || !policy.weights.allFinite() ||
      !policy.length_scales.allFinite() || !policy.input_limit.allFinite()) {
    throw bad_request("policy", "a number is not finite", "learn it again");
  }
  if (!(policy.length_scales.array() > 0.0).all() || !(policy.input_limit.array() > 0.0).all()) {
    throw bad_request("policy", "a length scale or limit is not above 0", "learn it again");
  }
}

Eigen::VectorXd policy_input(const RbfPolicy& policy, const StateLayout& layout,
                             const Eigen::VectorXd& seen) {
  Eigen::MatrixXd features(1, policy.centres.cols());
  state_features(layout, seen.transpose(), features);
  const auto scales = policy.length_scales.cwiseInverse().asDiagonal();
  const Eigen::VectorXd squares =
      ((policy.centres.rowwise() - features.row(0)) * scales).rowwise().squaredNorm();
  const Eigen::VectorXd basis = (-0.5 * squares.array()).exp();
  const Eigen::ArrayXd sums = (policy.weights.transpose() * basis).array();
  return policy.input_limit.array() * (sums / policy.input_limit.array()).tanh();
}

Controller controller_of(RbfPolicy policy, StateLayout layout) {
  return [policy = std::move(policy), layout = std::move(layout)](
             const Eigen::VectorXd& seen, int) { return policy_input(policy, layout, seen); };
}

}  // namespace kinescope::policy
