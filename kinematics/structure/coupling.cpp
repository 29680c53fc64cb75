// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/coupling.h"

#include <algorithm>
#include <cmath>

namespace kinescope::structure_search {
namespace {

constexpr int kMostTerms = 4;
// -2 ln likelihood that every further channel has to gain, correlation allowed for.
constexpr double kMinGain = 18.0;
// Least share of the variance along the joint that each has to remove, in the end: systematic
// errors of other kinds (backlash, gear error) are always a little correlated with something.
constexpr double kMinShare = 0.15;
// The same while terms are added: of two that almost cancel, the first alone removes little.
constexpr double kLeastShare = 0.01;

// Coordinate error of every sample, rad or m, with its weight 1 / variance.
struct AxisResidual {
  Eigen::VectorXd value;
  Eigen::VectorXd weight;
};

AxisResidual axis_residual(const ChainFit& fit, const Motion& motion) {
  AxisResidual out{Eigen::VectorXd::Zero(static_cast<Eigen::Index>(motion.size())),
                   Eigen::VectorXd::Zero(static_cast<Eigen::Index>(motion.size()))};
  const Vector6d axis = axis_in_child(fit.model);
  const double limit = 25.0 * fit.axis_variance;
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const Vector6d u = motion[i].whitening.triangularView<Eigen::Upper>() * axis;
    const double lever = u.norm();
    const double along = u.dot(fit.residuals[i]) / lever;
    const double across = fit.residuals[i].squaredNorm() - along * along;
    if (along * along > limit || across > 30.0 * fit.variance) continue;
    out.value(static_cast<Eigen::Index>(i)) = along / lever;
    out.weight(static_cast<Eigen::Index>(i)) = lever * lever;
  }
  return out;
}

struct Addition {
  int channel = -1;
  double scale = 0.0;
  double share = 0.0;  // of the variance removed
};

// The channel that, beside those already there, removes most of the residual along the axis.
Addition best_addition(const ChainFit& fit, const Motion& motion, const Readings& readings,
                       const std::vector<char>& usable) {
  const AxisResidual r = axis_residual(fit, motion);
  std::vector<int> present;
  for (const ChainTerm& t : fit.model.joints.front().terms) present.push_back(t.channel);
  const auto n = static_cast<Eigen::Index>(motion.size());
  const auto column = [&](int c) {
    Eigen::VectorXd q(n);
    for (Eigen::Index i = 0; i < n; ++i)
      q(i) = readings.value(motion[static_cast<std::size_t>(i)].instant, c);
    return q;
  };
  // Project out the constant and the channels already present.
  std::vector<Eigen::VectorXd> basis;
  const auto dot = [&](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    return (a.array() * b.array() * r.weight.array()).sum();
  };
  const auto reduce = [&](Eigen::VectorXd v) {
    for (const Eigen::VectorXd& b : basis) v -= dot(b, v) * b;
    return v;
  };
  const auto extend = [&](const Eigen::VectorXd& v) {
    const Eigen::VectorXd left = reduce(v);
    const double norm = std::sqrt(dot(left, left));
    if (norm > 1e-9) basis.push_back(left / norm);
  };
  extend(Eigen::VectorXd::Ones(n));
  for (const int c : present) extend(column(c));
  const Eigen::VectorXd left = reduce(r.value);
  const double total = dot(left, left);
  Addition best;
  for (int c = 0; c < readings.channels(); ++c) {
    if (usable[static_cast<std::size_t>(c)] == 0 || std::ranges::find(present, c) != present.end())
      continue;
    const Eigen::VectorXd q = column(c);
    const Eigen::VectorXd qr = reduce(q);
    const double qq = dot(qr, qr);
    if (qq < 1e-4 * dot(q, q) || total <= 0.0) continue;
    const double slope = dot(qr, left) / qq;
    const double share = slope * slope * qq / total;
    if (share > best.share) best = {c, slope, share};
  }
  return best;
}

// Takes out terms within three sigma of nothing.
ChainFit pruned(ChainFit fit, const Motion& motion, const Readings& readings) {
  while (fit.model.joints.front().terms.size() > 1) {
    const std::vector<ChainTerm>& terms = fit.model.joints.front().terms;
    std::size_t weakest = 0;
    double least = 1e300;
    for (std::size_t t = 0; t < terms.size(); ++t) {
      const double z = std::abs(terms[t].scale) /
                       std::max(1e-300, fit.scale_sigma[t] * std::sqrt(fit.correlation));
      if (z < least) {
        least = z;
        weakest = t;
      }
    }
    if (least > 4.0) break;
    ChainModel model = fit.model;
    model.joints.front().terms.erase(model.joints.front().terms.begin() +
                                     static_cast<std::ptrdiff_t>(weakest));
    fit = fit_chain(motion, readings.value, std::move(model));
  }
  return fit;
}

}  // namespace

ChainFit with_couplings(ChainFit fit, const Motion& motion, const Readings& readings,
                        const std::vector<char>& usable) {
  // Less than this cannot lose kMinShare and stay above the noise.
  if (fit.model.joints.size() != 1 || readings.channels() < 2 ||
      fit.axis_variance < 0.99 / (1.0 - kMinShare)) {
    return fit;
  }
  // Terms are added greedily first and judged together afterwards: with one of two that are
  // missing, what is left still looks like a slow error.
  std::vector<ChainFit> grown;
  grown.push_back(fit);
  while (static_cast<int>(grown.size()) < kMostTerms && grown.back().axis_variance > 1.05) {
    const Addition addition = best_addition(grown.back(), motion, readings, usable);
    if (addition.channel < 0 || addition.share < kLeastShare) break;
    ChainModel model = grown.back().model;
    model.joints.front().terms.push_back({addition.channel, addition.scale});
    grown.push_back(fit_chain(motion, readings.value, std::move(model), {.with_residuals = true}));
  }
  double correlation = grown.front().correlation;
  for (const ChainFit& g : grown) correlation = std::min(correlation, g.correlation);
  std::size_t chosen = 0;
  const auto judged = [&](std::size_t n) {
    return grown[n].cost / correlation + kMinGain * static_cast<double>(n);
  };
  for (std::size_t n = 1; n < grown.size(); ++n) {
    const double most =
        grown.front().axis_variance * std::pow(1.0 - kMinShare, static_cast<double>(n));
    if (grown[n].axis_variance <= most && judged(n) < judged(chosen)) chosen = n;
  }
  if (chosen == 0) return fit;
  fit = std::move(grown[chosen]);
  fit = pruned(std::move(fit), motion, readings);
  // By size, so that the main channel stands first.
  auto& terms = fit.model.joints.front().terms;
  std::vector<std::size_t> order(terms.size());
  for (std::size_t t = 0; t < order.size(); ++t) order[t] = t;
  std::ranges::stable_sort(order, std::greater<>{},
                           [&](std::size_t t) { return std::abs(terms[t].scale); });
  std::vector<ChainTerm> sorted;
  std::vector<double> sigma;
  for (const std::size_t t : order) {
    sorted.push_back(terms[t]);
    sigma.push_back(fit.scale_sigma[t]);
  }
  terms = std::move(sorted);
  fit.scale_sigma = std::move(sigma);
  fit.residuals.clear();
  return fit;
}

}  // namespace kinescope::structure_search
