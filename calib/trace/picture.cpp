// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/picture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "kinematics/core/error.h"

namespace kinescope::trace {
namespace {

constexpr Eigen::Index kBins = 24;

// What the rows of each instant say of a carrier's factor, least squares; NaN where they say
// nothing.
Eigen::VectorXd factor_of(const Linearisation& linear, const Eigen::VectorXd& residual,
                          int carrier) {
  Eigen::VectorXd up = Eigen::VectorXd::Zero(linear.instants());
  Eigen::VectorXd down = Eigen::VectorXd::Zero(linear.instants());
  Eigen::Index instant = 0;
  for (Eigen::SparseMatrix<double>::InnerIterator entry(linear.carriers, carrier); entry; ++entry) {
    while (linear.first_row[static_cast<std::size_t>(instant) + 1] <= entry.row()) ++instant;
    up[instant] += entry.value() * residual[entry.row()];
    down[instant] += entry.value() * entry.value();
  }
  for (Eigen::Index i = 0; i < up.size(); ++i) {
    up[i] = down[i] > 0.0 ? up[i] / down[i] : std::numeric_limits<double>::quiet_NaN();
  }
  return up;
}

// What an effect does to every row, whitened.
Eigen::VectorXd rows_of(const Linearisation& linear, const std::vector<EffectColumn>& columns,
                        const Eigen::VectorXd& values) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(linear.residual.size());
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const EffectColumn& column = columns[k];
    const double theta = values[static_cast<Eigen::Index>(k)];
    Eigen::Index instant = 0;
    for (Eigen::SparseMatrix<double>::InnerIterator entry(linear.carriers, column.carrier); entry;
         ++entry) {
      while (linear.first_row[static_cast<std::size_t>(instant) + 1] <= entry.row()) ++instant;
      const double share = column.share.size() == 0 ? 1.0 : column.share[instant];
      out[entry.row()] += theta * share * entry.value();
    }
  }
  return out;
}

// Where an effect is seen best that is one constant factor on many rows (a load on all joints): as
// the factor of the place whose rows it moves most; none where it moves none of them.
struct SeenAt {
  const RestPlace* place = nullptr;
  Eigen::VectorXd factor;
};
SeenAt seen_at(const TracedFit& fit, const std::vector<EffectColumn>& columns,
               const Eigen::VectorXd& values) {
  const Eigen::VectorXd rows = rows_of(fit.linear, columns, values);
  SeenAt out;
  double most = 0.0;
  for (const RestPlace& place : fit.rest_places) {
    const Eigen::VectorXd factor = factor_of(fit.linear, rows, place.carrier);
    double energy = 0.0;
    Eigen::Index instant = 0;
    for (Eigen::SparseMatrix<double>::InnerIterator entry(fit.linear.carriers, place.carrier);
         entry; ++entry) {
      while (fit.linear.first_row[static_cast<std::size_t>(instant) + 1] <= entry.row()) ++instant;
      energy += std::pow(factor[instant] * entry.value(), 2);
    }
    if (energy <= most) continue;
    most = energy;
    out = {&place, factor.array().isFinite().select(factor, 0.0)};
  }
  return out;
}

// Share of the curve's variance that bins of the covariate explain.
double explained_by(const Eigen::VectorXd& covariate, const Eigen::VectorXd& curve) {
  std::vector<Eigen::Index> order(static_cast<std::size_t>(covariate.size()));
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  std::ranges::stable_sort(order, {}, [&](Eigen::Index i) { return covariate[i]; });
  const auto at = [&](Eigen::Index k) { return covariate[order[static_cast<std::size_t>(k)]]; };
  const Eigen::Index n = covariate.size();
  const Eigen::Index bins = std::min(kBins, std::max<Eigen::Index>(1, n / 4));
  double within = 0.0;
  Eigen::Index last = 0;
  for (Eigen::Index b = 0; b < bins; ++b) {
    const Eigen::Index first = last;
    last = std::max(last, (b + 1) * n / bins);
    // Equal values stay together, or their order in time would explain what they do not.
    while (last > 0 && last < n && at(last) == at(last - 1)) ++last;
    if (first == last) continue;
    double sum = 0.0;
    double squares = 0.0;
    for (Eigen::Index k = first; k < last; ++k) {
      const double value = curve[order[static_cast<std::size_t>(k)]];
      sum += value;
      squares += value * value;
    }
    within += squares - sum * sum / static_cast<double>(last - first);
  }
  constexpr double kConstant = 1e-20;  // of the curve's square
  const double total = (curve.array() - curve.mean()).square().sum();
  return total > kConstant * curve.squaredNorm() ? 1.0 - within / total : 0.0;
}

}  // namespace

EffectPicture picture_of(const Stage& without, const Stage& with, const Candidate& candidate,
                         const std::vector<EffectColumn>& columns, const Eigen::VectorXd& values) {
  KINESCOPE_CHECK(values.size() == std::ssize(columns), "one value a column");
  // The carrier through which the effect does most.
  const Linearisation& linear = without.fit.linear;
  int carrier = -1;
  double most = 0.0;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const EffectColumn& column = columns[k];
    const double weight =
        std::abs(values[static_cast<Eigen::Index>(k)]) * linear.carriers.col(column.carrier).norm();
    if (weight > most) {
      most = weight;
      carrier = column.carrier;
    }
  }
  EffectPicture out;
  if (carrier < 0 || std::ranges::all_of(without.fit.covariates, &Covariate::is_product))
    return out;
  out.effect = Eigen::VectorXd::Zero(linear.instants());
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const EffectColumn& column = columns[k];
    if (column.carrier != carrier) continue;
    const double theta = values[static_cast<Eigen::Index>(k)];
    if (column.share.size() == 0) {
      out.effect.array() += theta;
    } else {
      out.effect += theta * column.share;
    }
  }
  std::string unit =
      candidate.parameters.empty() ? candidate.size_unit : candidate.parameters.front().unit;
  for (const RestPlace& place : without.fit.rest_places) {
    if (place.carrier == carrier) unit = place.unit;
  }
  const bool constant = (out.effect.array() == out.effect[0]).all();
  const SeenAt seen =
      constant && columns.size() > 1 ? seen_at(without.fit, columns, values) : SeenAt{};
  if (seen.place != nullptr) {
    carrier = seen.place->carrier;
    unit = seen.place->unit;
    out.effect = seen.factor;
  }
  // A constant depends on nothing: it is shown over the last one, time.
  const auto& covariates = without.fit.covariates;
  const Covariate* best =
      &*std::ranges::find(covariates.rbegin(), covariates.rend(), false, &Covariate::is_product);
  double share = 0.0;
  for (const Covariate& covariate : without.fit.covariates) {
    if (covariate.is_product) continue;
    // A load depends on the posture; any slow motion is a curve over time, too.
    if (seen.place != nullptr && covariate.name == "time") continue;
    const double explained = explained_by(covariate.value, out.effect);
    // The first of equals: a joint's value comes before what follows from it.
    if (explained > share + 0.02) {
      share = explained;
      best = &covariate;
    }
  }
  out.covariate = best->name;
  out.covariate_unit = best->unit;
  out.unit = std::move(unit);
  out.at = best->value;
  // The residual with the effect in the model, and the effect on top of it: what the plain model's
  // parameters took of the effect is given back. Component-plus-residual plot, Cook 1993.
  out.after = factor_of(with.fit.linear, with.fit.linear.residual, carrier);
  out.before = out.after + out.effect;
  return out;
}

}  // namespace kinescope::trace
