// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/stage.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "calib/trace/distribution.h"

namespace kinescope::trace {

Stage::Stage(std::vector<AddedEffect> effects, TracedFit fitted)
    : added(std::move(effects)),
      fit(std::move(fitted)),
      system(fit.linear, make_partition(fit.linear)),
      held_out(held_out_instants(system)),
      error(held_out_error(system, held_out)) {}

double Stage::rms() const {
  const Linearisation& linear = fit.linear;
  return std::sqrt(linear.residual.cwiseProduct(linear.unit).squaredNorm() /
                   std::max(1.0, linear.points(0, linear.unit.size())));
}

Linearisation without_effect(const Stage& stage, std::size_t index) {
  const std::vector<Eigen::VectorXd>& values = stage.fit.values;
  const Linearisation& linear = stage.fit.linear;
  Eigen::Index first = linear.jacobian.cols();
  for (std::size_t i = index; i < values.size(); ++i) first -= values[i].size();
  const Eigen::Index count = values[index].size();
  std::vector<Eigen::Index> kept;
  for (Eigen::Index c = 0; c < linear.jacobian.cols(); ++c)
    if (c < first || c >= first + count) kept.push_back(c);
  Linearisation out = linear;
  out.residual += linear.jacobian.middleCols(first, count) * values[index];
  out.jacobian = linear.jacobian(Eigen::all, kept);
  if (linear.prior.size() > 0) out.prior = linear.prior(kept, kept);
  if (linear.prior_gradient.size() > 0) out.prior_gradient = linear.prior_gradient(kept);
  return out;
}

double held_out_sum_without(const Stage& stage, std::size_t index) {
  const Linearisation less = without_effect(stage, index);
  return held_out_instants(NormalSystem(less, stage.system.partition())).whitened.sum();
}

StagePtr make_stage(const TracedModel& model, std::vector<AddedEffect> effects) {
  TracedFit fit = model.fit(effects);
  return std::make_shared<const Stage>(std::move(effects), std::move(fit));
}

const Candidate* find_candidate(const TracedFit& fit, const EffectId& id) {
  const auto found = std::ranges::find(fit.candidates, id, &Candidate::id);
  return found == fit.candidates.end() ? nullptr : &*found;
}

std::string name_of(const EffectId& id) { return fmt::format("{} at {}", id.effect, id.place); }

std::string found_words(std::string_view found, const std::vector<TracedEffect>& accepted) {
  std::string names;
  for (const TracedEffect& effect : accepted) {
    names += (names.empty() ? "" : ", ") + name_of(effect.id);
  }
  return fmt::format("{} {}", found, names);
}

bool is_possible(const Candidate& candidate, const Eigen::VectorXd& theta) {
  return !candidate.possible || candidate.possible(theta);
}

bool refines(const Candidate& candidate, const EffectId& id) {
  return std::ranges::find(candidate.refines, id) != candidate.refines.end();
}

bool contains(const Candidate& candidate, const EffectId& id) {
  return std::ranges::find(candidate.contains, id) != candidate.contains.end();
}

std::vector<AddedEffect> without(std::vector<AddedEffect> effects, std::size_t index) {
  effects.erase(effects.begin() + static_cast<std::ptrdiff_t>(index));
  return effects;
}

Linearisation extend(const Linearisation& linear, const Eigen::MatrixXd& columns,
                     const Eigen::MatrixXd& prior) {
  Linearisation out = linear;
  const Eigen::Index p = linear.jacobian.cols();
  const Eigen::Index k = columns.cols();
  out.jacobian.conservativeResize(Eigen::NoChange, p + k);
  out.jacobian.rightCols(k) = columns;
  if (linear.prior.size() == 0 && prior.size() == 0) return out;
  out.prior = Eigen::MatrixXd::Zero(p + k, p + k);
  if (linear.prior.size() > 0) out.prior.topLeftCorner(p, p) = linear.prior;
  if (prior.size() > 0) out.prior.bottomRightCorner(k, k) = prior;
  if (linear.prior_gradient.size() > 0) {
    out.prior_gradient.conservativeResize(p + k);
    out.prior_gradient.tail(k).setZero();
  }
  return out;
}

Eigen::MatrixXd rows_of(const Linearisation& linear, const std::vector<EffectColumn>& columns) {
  Eigen::MatrixXd rows =
      Eigen::MatrixXd::Zero(linear.residual.size(), static_cast<Eigen::Index>(columns.size()));
  std::vector<Eigen::Index> instant(static_cast<std::size_t>(linear.residual.size()));
  for (std::size_t i = 0; i + 1 < linear.first_row.size(); ++i) {
    std::fill(instant.begin() + linear.first_row[i], instant.begin() + linear.first_row[i + 1],
              static_cast<Eigen::Index>(i));
  }
  for (Eigen::Index a = 0; a < rows.cols(); ++a) {
    const EffectColumn& column = columns[static_cast<std::size_t>(a)];
    for (Eigen::SparseMatrix<double>::InnerIterator entry(linear.carriers, column.carrier); entry;
         ++entry) {
      const double share = column.share.size() == 0
                               ? 1.0
                               : column.share[instant[static_cast<std::size_t>(entry.row())]];
      rows(entry.row(), a) = share * entry.value();
    }
  }
  return rows;
}

Linearisation extend(const Linearisation& linear, const std::vector<EffectColumn>& columns,
                     const Eigen::MatrixXd& prior) {
  return extend(linear, rows_of(linear, columns), prior);
}

double lost_p_value(const Stage& less, const Stage& with, double parameters) {
  if (with.fit.linear.independent_instants) return 1.0;
  const double freedom = with.system.partition().stretches - 1.0;
  const double left = std::max(1e-300, with.system.total().rr);
  const double lost = std::max(0.0, less.system.total().rr - left) / left;
  return freedom < 1.0 ? 1.0 : f_survival(lost * freedom / parameters, parameters, freedom);
}

}  // namespace kinescope::trace
