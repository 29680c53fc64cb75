// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/held_out.h"

#include <algorithm>
#include <cmath>

#include "calib/trace/distribution.h"
#include "calib/trace/normal_equations.h"
#include "kinematics/core/error.h"

namespace kinescope::trace {
namespace {

// Steps of the parameters without each fold.
std::vector<Eigen::VectorXd> steps_without_folds(const NormalSystem& system,
                                                 const std::vector<NormalEquations>& cells) {
  const NormalEquations total = total_of(system, cells);
  std::vector<NormalEquations> folds(static_cast<std::size_t>(system.partition().folds),
                                     zero_like(total));
  for (std::size_t c = 0; c < cells.size(); ++c) {
    folds[static_cast<std::size_t>(system.partition().cells[c].fold)] += cells[c];
  }
  std::vector<Eigen::VectorXd> out;
  for (const NormalEquations& fold : folds) out.push_back(solve_without(total, fold));
  return out;
}

// Sums of values per cell or per instant over stretches.
Eigen::VectorXd over_stretches(const Partition& partition, const Eigen::VectorXd& values) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(partition.stretches);
  const bool by_cell = values.size() == static_cast<Eigen::Index>(partition.cells.size());
  KINESCOPE_CHECK(by_cell || values.size() == static_cast<Eigen::Index>(partition.cell.size()),
                  "one value a cell or an instant");
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const auto cell = static_cast<std::size_t>(
        by_cell ? static_cast<int>(i) : partition.cell[static_cast<std::size_t>(i)]);
    out[partition.cells[cell].stretch] += values[i];
  }
  return out;
}

}  // namespace

Eigen::VectorXd held_out_cells(const NormalSystem& system,
                               const std::vector<EffectColumn>& columns) {
  const std::vector<NormalEquations> cells = augmented_cells(
      system, columns.empty() ? std::vector<EffectSums>{} : system.cell_sums(columns));
  const std::vector<Eigen::VectorXd> steps = steps_without_folds(system, cells);
  Eigen::VectorXd out(static_cast<Eigen::Index>(cells.size()));
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const Eigen::VectorXd& step = steps[static_cast<std::size_t>(system.partition().cells[c].fold)];
    out[static_cast<Eigen::Index>(c)] =
        system.cells()[c].rr - 2.0 * step.dot(cells[c].g) + step.dot(cells[c].H * step);
  }
  return out;
}

HeldOutInstants held_out_instants(const NormalSystem& system) {
  const std::vector<Eigen::VectorXd> steps =
      steps_without_folds(system, augmented_cells(system, {}));
  const Linearisation& linear = system.linear();
  const Partition& partition = system.partition();
  HeldOutInstants out;
  for (Eigen::VectorXd* v : {&out.whitened, &out.squared, &out.points}) {
    v->setZero(linear.instants());
  }
  for (Eigen::Index i = 0; i < linear.instants(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const int fold = partition.cells[static_cast<std::size_t>(partition.cell[at])].fold;
    const Eigen::Index first = linear.first_row[at];
    const Eigen::Index rows = linear.first_row[at + 1] - first;
    const Eigen::VectorXd error =
        linear.residual.segment(first, rows) -
        linear.jacobian.middleRows(first, rows) * steps[static_cast<std::size_t>(fold)];
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

double paired_p_value(const Partition& partition, const Eigen::VectorXd& worse,
                      const Eigen::VectorXd& better) {
  const double t = paired_t(partition, worse, better);
  // t^2 is F with (1, n - 1) degrees of freedom.
  const double beyond = 0.5 * f_survival(t * t, 1.0, std::max(1.0, partition.stretches - 1.0));
  return t > 0.0 ? beyond : 1.0 - beyond;
}

}  // namespace kinescope::trace
