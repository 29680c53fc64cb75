// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/uncertainty.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "calib/bundle/gauge.h"
#include "calib/bundle/linearise.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/stretch_widening.h"

namespace kinescope::bundle {
namespace {

// Scaled singular values below this, relative to the largest, are called weak: the combination is
// known a thousand times worse than the best one.
constexpr double kWeak = 1e-3;
// Below this the data say nothing at all and the direction is left out of the covariance.
constexpr double kUnseen = 1e-8;
// Blocks of the sandwich: no fewer than this many, or its scatter says nothing.
constexpr int kMinStretches = 12;

// Which stretch of time each frame belongs to, and what the stretches' sums miss of the variance.
struct Stretches {
  std::map<int, int> of_frame;
  double widening = 1.0;
};

Stretches stretches(const Spec& spec, const LinearBundle& linear, double correlation_s) {
  Stretches out;
  const double begin = spec.times_s.front();
  const double duration = std::max(1e-9, spec.times_s.back() - begin);
  const double length = std::clamp(4.0 * correlation_s, duration / 200.0, duration / kMinStretches);
  // Half a step is the integral time of white noise.
  const double step = duration / std::max(1.0, static_cast<double>(spec.times_s.size()) - 1.0);
  if (!spec.postures) out.widening = stretch_widening(length, correlation_s - 0.5 * step);
  int next = 1 << 20;
  for (const auto& [frame, rows] : linear.frames) {
    if (spec.postures || frame < 0) {
      out.of_frame[frame] = next++;
    } else {
      out.of_frame[frame] =
          static_cast<int>((spec.times_s[static_cast<std::size_t>(frame)] - begin) / length);
    }
  }
  return out;
}

// Factors by which the variances grow because the residuals are not independent.
Eigen::VectorXd inflation(const LinearBundle& linear, const Stretches& stretch,
                          const Eigen::MatrixXd& covariance) {
  std::map<int, Eigen::VectorXd> scores;
  const Eigen::Index n = covariance.rows();
  for (const auto& [frame, rows] : linear.frames) {
    auto [entry, fresh] = scores.try_emplace(stretch.of_frame.at(frame), Eigen::VectorXd::Zero(n));
    entry->second += rows.J.transpose() * rows.r;
  }
  Eigen::MatrixXd meat = Eigen::MatrixXd::Zero(n, n);
  for (const auto& [key, g] : scores) meat += g * g.transpose();
  const auto count = static_cast<double>(scores.size());
  if (count < 3.0) return Eigen::VectorXd::Ones(n);
  const Eigen::MatrixXd sandwich =
      covariance * meat * covariance * (stretch.widening * count / (count - 1.0));
  Eigen::VectorXd ratio(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    ratio[i] = covariance(i, i) > 0.0 ? sandwich(i, i) / covariance(i, i) : 1.0;
  }
  // The ratio of one parameter scatters by sqrt(2 / stretches); half of it is taken from the pool.
  const double pooled = ratio.mean();
  return (0.5 * (ratio.array() + pooled)).max(1.0);
}

std::string in_words(const std::vector<Parameter>& parameters, const WeakDirection& direction) {
  std::string words;
  const std::size_t count = std::min<std::size_t>(3, direction.parameters.size());
  for (std::size_t i = 0; i < count; ++i) {
    const std::string& name =
        parameters[static_cast<std::size_t>(direction.parameters[i].first)].name;
    words += (i == 0 ? "" : i + 1 == count ? " and " : ", ") + name;
  }
  return words + (count > 1 ? " cannot be told apart" : " is not seen");
}

// Singular values of the Jacobian with its columns scaled to unit length, and the directions behind
// the small ones. Returns the information matrix's pseudo-inverse in the scaled space, unseen
// directions left out, and marks the parameters they touch.
Eigen::MatrixXd observe(const Eigen::MatrixXd& data, const Eigen::MatrixXd& total,
                        std::vector<Parameter>& parameters, Observability& out,
                        std::vector<bool>& unseen) {
  const Eigen::Index n = data.rows();
  const Eigen::VectorXd scale = data.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * data * scale.asDiagonal());
  const double largest = std::sqrt(std::max(eigen.values[n - 1], 1e-300));
  for (Eigen::Index k = n; k-- > 0;) {
    out.singular_values.push_back(std::sqrt(std::max(eigen.values[k], 0.0)));
  }
  out.condition_number = largest / std::max(out.singular_values.back(), 1e-300);
  for (Eigen::Index k = 0; k < n; ++k) {
    const double relative = std::sqrt(std::max(eigen.values[k], 0.0)) / largest;
    if (relative > kWeak) break;
    WeakDirection weak{relative, {}, {}};
    for (Eigen::Index i = 0; i < n; ++i) {
      const double weight = eigen.vectors(i, k);
      if (std::abs(weight) > 0.2) weak.parameters.emplace_back(static_cast<int>(i), weight);
      if (relative < kUnseen && std::abs(weight) > 1e-3) unseen[static_cast<std::size_t>(i)] = true;
    }
    std::ranges::stable_sort(weak.parameters, [](const auto& a, const auto& b) {
      return std::abs(a.second) > std::abs(b.second);
    });
    weak.words = in_words(parameters, weak);
    out.weak.push_back(std::move(weak));
  }
  const Eigen::VectorXd total_scale = total.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const SymmetricEigen full =
      symmetric_eigen(total_scale.asDiagonal() * total * total_scale.asDiagonal());
  Eigen::VectorXd inverse = Eigen::VectorXd::Zero(n);
  const double floor = kUnseen * kUnseen * full.values[n - 1];
  for (Eigen::Index k = 0; k < n; ++k) {
    if (full.values[k] > floor) inverse[k] = 1.0 / full.values[k];
  }
  return total_scale.asDiagonal() * full.vectors * inverse.asDiagonal() * full.vectors.transpose() *
         total_scale.asDiagonal();
}

}  // namespace

Uncertainty estimate_uncertainty(const Spec& spec, State& state, const std::vector<int>& used) {
  LinearBundle linear = linearise(spec, state, used);
  if (spec.prior) linear = with_frames_held(spec, state, std::move(linear));
  Uncertainty out;
  out.blocks = linear.blocks;
  const int n = width_of(out.blocks);
  for (const FreeBlock& block : out.blocks) {
    for (std::size_t i = 0; i < block.names.size(); ++i) {
      out.parameters.push_back({block.names[i], block.block, block.units[i], 0.0, {}, {}});
    }
  }
  if (n == 0) return out;
  Eigen::MatrixXd data = Eigen::MatrixXd::Zero(n, n);
  for (const auto& [frame, rows] : linear.frames) {
    data.selfadjointView<Eigen::Lower>().rankUpdate(rows.J.transpose());
    out.chi_square += rows.r.squaredNorm();
    out.rows += static_cast<int>(rows.r.size());
  }
  data = Eigen::MatrixXd(data.selfadjointView<Eigen::Lower>());

  std::vector<bool> unseen(static_cast<std::size_t>(n), false);
  const Eigen::MatrixXd white =
      observe(data, data + linear.prior_information, out.parameters, out.observability, unseen);
  out.correlation_time_s = spec.postures ? 0.0 : correlation_time(spec, state, used);
  const Eigen::VectorXd factor =
      inflation(linear, stretches(spec, linear, out.correlation_time_s), white).cwiseSqrt();
  out.covariance = factor.asDiagonal() * white * factor.asDiagonal();
  for (int i = 0; i < n; ++i) {
    // With a prior the posterior is finite even where the data are silent, and says so by its size.
    if (unseen[static_cast<std::size_t>(i)] && !spec.prior) continue;
    Parameter& parameter = out.parameters[static_cast<std::size_t>(i)];
    parameter.sigma_white = std::sqrt(white(i, i));
    parameter.sigma = std::sqrt(out.covariance(i, i));
  }
  return out;
}

}  // namespace kinescope::bundle
