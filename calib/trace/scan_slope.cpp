// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/scan_slope.h"

#include <algorithm>
#include <cmath>

#include "calib/trace/score_test.h"

namespace kinescope::trace {
namespace {

// Half of a central difference's step, of the value.
constexpr double kStep = 1e-4;
// A slope that is less than this share of itself, freed of the model's parameters, does not show.
constexpr double kUnseenShare = 1e-10;

}  // namespace

bool is_continuous(const Candidate& candidate) {
  return !candidate.scan.empty() && !candidate.scan_listed && candidate.scan_step == 0.0;
}

std::optional<Eigen::VectorXd> scan_slope(const Stage& stage, std::size_t index) {
  const AddedEffect& added = stage.added[index];
  const Candidate* candidate = find_candidate(stage.fit, added.id);
  if (candidate == nullptr || candidate->is_curve() || !is_continuous(*candidate)) return {};
  const double half = kStep * std::abs(added.scan);
  const Linearisation& linear = stage.fit.linear;
  const Eigen::VectorXd& theta = stage.fit.values[index];
  const Eigen::VectorXd above = rows_of(linear, candidate->columns(added.scan + half)) * theta;
  const Eigen::VectorXd below = rows_of(linear, candidate->columns(added.scan - half)) * theta;
  return (above - below) / (2.0 * half);
}

std::optional<ScanStep> scan_step(const NormalSystem& system, const Eigen::VectorXd& slope) {
  const Linearisation& linear = system.linear();
  const Eigen::VectorXd freed = system.freed(slope);
  const Eigen::VectorXd beside = linear.jacobian.transpose() * freed;
  const Eigen::VectorXd taken_up = system.inverse() * beside;
  const double information = slope.dot(freed) - beside.dot(taken_up);
  if (!(information > kUnseenShare * slope.squaredNorm())) return {};
  const double score = slope.dot(linear.residual) - taken_up.dot(system.total().g);
  return ScanStep{score / information,
                  std::sqrt(system.total().rr / system.freedom() / information)};
}

Eigen::MatrixXd effect_covariance(const Stage& stage, Eigen::Index count) {
  std::vector<Eigen::VectorXd> slopes;
  for (std::size_t i = 0; i < stage.added.size(); ++i) {
    if (auto slope = scan_slope(stage, i)) slopes.push_back(std::move(*slope));
  }
  if (slopes.empty()) return jackknife_covariance(stage.system, count);
  const auto more = static_cast<Eigen::Index>(slopes.size());
  Eigen::MatrixXd columns(stage.fit.linear.residual.size(), more);
  for (Eigen::Index k = 0; k < more; ++k) columns.col(k) = slopes[static_cast<std::size_t>(k)];
  const Linearisation with = extend(stage.fit.linear, columns, {});
  return jackknife_covariance(NormalSystem(with, stage.system.partition()), count + more)
      .topLeftCorner(count, count);
}

}  // namespace kinescope::trace
