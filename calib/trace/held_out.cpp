// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/held_out.h"

#include <algorithm>
#include <cmath>

#include "calib/trace/distribution.h"
#include "calib/trace/normal_equations.h"
#include "kinematics/core/error.h"

namespace kinescope::trace {
namespace {

// Every row's error where it is predicted without its own fold; of local parameters nothing is
// known there.
Eigen::VectorXd held_out_rows(const NormalSystem& system,
                              const std::vector<EffectColumn>& columns) {
  const std::vector<NormalEquations> folds = augmented(
      system.folds(), columns.empty() ? std::vector<EffectSums>{} : system.fold_sums(columns));
  const NormalEquations total = total_of(system, folds);
  const Linearisation& linear = system.linear();
  const std::vector<int>& fold_of = system.partition().fold;
  const auto k = static_cast<Eigen::Index>(columns.size());
  Eigen::VectorXd out = linear.residual;
  if (linear.local_prediction.size() > 0) out += linear.local_prediction;
  for (std::size_t fold = 0; fold < folds.size(); ++fold) {
    const Eigen::VectorXd step = solve_without(total, folds[fold]);
    const auto own = step.head(system.parameters());
    const Eigen::VectorXd moved = system.moved_by(columns, step.tail(k));
    for (std::size_t i = 0; i < fold_of.size(); ++i) {
      if (fold_of[i] != static_cast<int>(fold)) continue;
      const Eigen::Index first = linear.first_row[i];
      const Eigen::Index rows = linear.first_row[i + 1] - first;
      out.segment(first, rows) -=
          moved.segment(first, rows) + linear.jacobian.middleRows(first, rows) * own;
    }
  }
  return out;
}

Eigen::VectorXd over_stretches(const Partition& partition, const Eigen::VectorXd& of_instants) {
  KINESCOPE_CHECK(of_instants.size() == static_cast<Eigen::Index>(partition.stretch.size()),
                  "one value an instant");
  Eigen::VectorXd out = Eigen::VectorXd::Zero(partition.stretches);
  for (Eigen::Index i = 0; i < of_instants.size(); ++i)
    out[partition.stretch[static_cast<std::size_t>(i)]] += of_instants[i];
  return out;
}

}  // namespace

HeldOutInstants held_out_instants(const NormalSystem& system,
                                  const std::vector<EffectColumn>& columns) {
  const Eigen::VectorXd errors = held_out_rows(system, columns);
  const Linearisation& linear = system.linear();
  HeldOutInstants out;
  for (Eigen::VectorXd* v : {&out.whitened, &out.squared, &out.points}) {
    v->setZero(linear.instants());
  }
  for (Eigen::Index i = 0; i < linear.instants(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const Eigen::Index first = linear.first_row[at];
    const Eigen::Index rows = linear.first_row[at + 1] - first;
    const auto error = errors.segment(first, rows);
    out.whitened[i] = error.squaredNorm();
    out.squared[i] = error.cwiseProduct(linear.unit.segment(first, rows)).squaredNorm();
    out.points[i] = linear.points(first, rows);
  }
  return out;
}

HeldOutError held_out_error(const NormalSystem& system, const HeldOutInstants& errors) {
  const Eigen::VectorXd squared = over_stretches(system.partition(), errors.squared);
  const Eigen::VectorXd points = over_stretches(system.partition(), errors.points);
  const auto n = static_cast<double>(squared.size());
  HeldOutError out;
  out.unit = system.linear().unit_name;
  const double mean = squared.sum() / std::max(1.0, points.sum());
  out.value = std::sqrt(mean);
  out.interval = {out.value, out.value};
  if (n < 3.0 || !(mean > 0.0)) return out;
  // A ratio of sums (Cochran 1977, 6.4); the root by the rule for small changes.
  const Eigen::VectorXd rest = squared - mean * points;
  const double sigma = std::sqrt(rest.squaredNorm() * n / (n - 1.0)) / points.sum();
  const double half = t_quantile(0.025, n - 1.0) * sigma / (2.0 * out.value);
  out.interval = {std::max(0.0, out.value - half), out.value + half};
  return out;
}

double paired_t(const Partition& partition, const Eigen::VectorXd& worse,
                const Eigen::VectorXd& better) {
  const Eigen::VectorXd difference = over_stretches(partition, worse - better);
  const auto n = static_cast<double>(difference.size());
  if (n < 3.0) return 0.0;
  const double mean = difference.mean();
  const double variance = (difference.array() - mean).square().sum() / (n - 1.0);
  if (!(variance > 0.0)) return 0.0;
  return mean / std::sqrt(variance / n);
}

bool predicts_clearly_worse(const Partition& partition, const Eigen::VectorXd& one,
                            const Eigen::VectorXd& other) {
  constexpr double kClearlyWorse = 3.0;  // Student's t of the stretches' differences
  return paired_t(partition, one, other) > kClearlyWorse;
}

bool predicts_clearly_worse(const Trace& one, const Trace& other) {
  return predicts_clearly_worse(other.partition, one.held_out_whitened, other.held_out_whitened);
}

double paired_p_value(const Partition& partition, const Eigen::VectorXd& worse,
                      const Eigen::VectorXd& better) {
  const double t = paired_t(partition, worse, better);
  // t^2 is F with (1, n - 1) degrees of freedom.
  const double beyond = 0.5 * f_survival(t * t, 1.0, std::max(1.0, partition.stretches - 1.0));
  return t > 0.0 ? beyond : 1.0 - beyond;
}

}  // namespace kinescope::trace
