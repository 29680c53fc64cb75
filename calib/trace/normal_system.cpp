// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/normal_system.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope::trace {
namespace {

GroupSums sums_of(const RowMatrix& J, const Eigen::VectorXd& r) {
  const Eigen::Index parameters = J.cols();
  // Eigen's product refers to the first of no numbers.
  if (J.size() == 0)
    return {Eigen::MatrixXd::Zero(parameters, parameters), Eigen::VectorXd::Zero(parameters),
            r.squaredNorm()};
  GroupSums out{Eigen::MatrixXd::Zero(parameters, parameters), J.transpose() * r, r.squaredNorm()};
  out.H.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose());
  out.H = Eigen::MatrixXd(out.H.selfadjointView<Eigen::Lower>());
  return out;
}

GroupSums& operator+=(GroupSums& sum, const GroupSums& other) {
  sum.H += other.H;
  sum.g += other.g;
  sum.rr += other.rr;
  return sum;
}

// Of the rows of these instants.
GroupSums sums_over(const Linearisation& linear, const std::vector<std::size_t>& instants) {
  Eigen::Index rows = 0;
  for (const std::size_t i : instants) rows += linear.first_row[i + 1] - linear.first_row[i];
  RowMatrix J(rows, linear.jacobian.cols());
  Eigen::VectorXd r(rows);
  Eigen::Index at = 0;
  for (const std::size_t i : instants) {
    const Eigen::Index count = linear.first_row[i + 1] - linear.first_row[i];
    J.middleRows(at, count) = linear.jacobian.middleRows(linear.first_row[i], count);
    r.segment(at, count) = linear.residual.segment(linear.first_row[i], count);
    at += count;
  }
  return sums_of(J, r);
}

struct SumsOfGroups {
  std::vector<GroupSums> stretches;
  std::vector<GroupSums> folds;
};

std::vector<LocalElimination::Part> parts_of(const Partition& partition) {
  std::map<std::pair<int, int>, std::vector<std::size_t>> parts;
  for (std::size_t i = 0; i < partition.stretch.size(); ++i)
    parts[{partition.stretch[i], partition.fold[i]}].push_back(i);
  std::vector<LocalElimination::Part> out;
  for (auto& [groups, instants] : parts)
    out.push_back({groups.first, groups.second, std::move(instants)});
  return out;
}

// Every row once: a fold is made of its parts of the stretches.
SumsOfGroups grouped(const Linearisation& linear, const Partition& partition,
                     const std::vector<LocalElimination::Part>& parts,
                     const LocalElimination& local) {
  const Eigen::Index n = linear.jacobian.cols();
  const GroupSums none{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n), 0.0};
  SumsOfGroups out{std::vector<GroupSums>(static_cast<std::size_t>(partition.stretches), none),
                   std::vector<GroupSums>(static_cast<std::size_t>(partition.folds), none)};
  for (std::size_t p = 0; p < parts.size(); ++p) {
    GroupSums sums = sums_over(linear, parts[p].instants);
    if (!local.empty()) local.eliminate(p, sums);
    out.stretches[static_cast<std::size_t>(parts[p].stretch)] += sums;
    out.folds[static_cast<std::size_t>(parts[p].fold)] += sums;
  }
  return out;
}

}  // namespace

Eigen::MatrixXd scaled_pseudo_inverse(const Eigen::MatrixXd& matrix, double floor) {
  const Eigen::Index n = matrix.rows();
  if (n == 0) return matrix;
  const Eigen::VectorXd scale = unit_scale(matrix);
  const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * matrix * scale.asDiagonal());
  const double least = floor * std::max(eigen.values[n - 1], 1e-300);
  const Eigen::VectorXd inverse =
      eigen.values.unaryExpr([&](double v) { return v > least ? 1.0 / v : 0.0; });
  return scale.asDiagonal() * eigen.vectors * inverse.asDiagonal() * eigen.vectors.transpose() *
         scale.asDiagonal();
}

NormalSystem::NormalSystem(const Linearisation& linear, Partition partition)
    : linear_(&linear), partition_(std::move(partition)) {
  KINESCOPE_CHECK(linear.first_row.size() == partition_.stretch.size() + 1,
                  "one stretch an instant, one first row more");
  KINESCOPE_CHECK(linear.jacobian.rows() == linear.residual.size(), "one row a residual");
  instant_.resize(static_cast<std::size_t>(linear.residual.size()));
  for (std::size_t i = 0; i < partition_.stretch.size(); ++i) {
    const Eigen::Index first = linear.first_row[i];
    std::fill_n(instant_.begin() + first, linear.first_row[i + 1] - first, static_cast<int>(i));
  }
  const std::vector<LocalElimination::Part> parts = parts_of(partition_);
  local_ = LocalElimination(linear, parts);
  auto [stretches, folds] = grouped(linear, partition_, parts, local_);
  stretches_ = std::move(stretches);
  folds_ = std::move(folds);
  const Eigen::Index parameters = linear.jacobian.cols();
  total_ = {Eigen::MatrixXd::Zero(parameters, parameters), Eigen::VectorXd::Zero(parameters), 0.0};
  for (const GroupSums& stretch : stretches_) total_ += stretch;
  if (linear.prior_gradient.size() > 0) total_.g -= linear.prior_gradient;
  inverse_ = scaled_pseudo_inverse(
      linear.prior.size() == 0 ? total_.H : Eigen::MatrixXd(total_.H + linear.prior), kUnseen);
  step_ = inverse_ * total_.g;
}

double NormalSystem::spent() const {
  return static_cast<double>(parameters()) + local_.determined();
}

double NormalSystem::freedom() const {
  return std::max(1.0, static_cast<double>(linear_->residual.size()) - spent());
}

double NormalSystem::memory() const {
  const Eigen::Index n = linear_->instants();
  if (linear_->independent_instants || n < 2) return 1.0;
  const double step = (linear_->time_s[n - 1] - linear_->time_s[0]) / static_cast<double>(n - 1);
  return std::max(1.0, 2.0 * linear_->correlation_time_s / step);
}

const NormalSystem::CarrierSums& NormalSystem::carrier(int index) const {
  return carriers_.get(index, [&] { return carrier_sums(index); });
}

NormalSystem::CarrierSums NormalSystem::carrier_sums(int index) const {
  CarrierSums sums{Eigen::VectorXd::Zero(linear_->instants()),
                   RowMatrix::Zero(linear_->instants(), parameters()),
                   LocalProducts(linear_->instants(), linear_->local.cols()),
                   Eigen::VectorXd::Zero(linear_->instants())};
  std::vector<Eigen::Triplet<double>> with_local;
  for (Eigen::SparseMatrix<double>::InnerIterator entry(linear_->carriers, index); entry; ++entry) {
    const auto i = static_cast<Eigen::Index>(instant_[static_cast<std::size_t>(entry.row())]);
    sums.with_residual[i] += entry.value() * linear_->residual[entry.row()];
    sums.with_jacobian.row(i) += entry.value() * linear_->jacobian.row(entry.row());
    const double unit = linear_->unit[entry.row()];
    if (unit > 0.0) sums.weight[i] += 1.0 / (unit * unit);
    if (local_.empty()) continue;
    using RowEntries = Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator;
    for (RowEntries own(linear_->local, entry.row()); own; ++own)
      with_local.emplace_back(static_cast<int>(i), static_cast<int>(own.col()),
                              entry.value() * own.value());
  }
  sums.with_local.setFromTriplets(with_local.begin(), with_local.end());
  return sums;
}

const Eigen::VectorXd& NormalSystem::product(int a, int b) const {
  const std::pair<int, int> key = std::minmax(a, b);
  return products_.get(key, [&] { return products_of(key.first, key.second); });
}

Eigen::VectorXd NormalSystem::products_of(int a, int b) const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(linear_->instants());
  using Entries = Eigen::SparseMatrix<double>::InnerIterator;
  Entries left(linear_->carriers, a);
  Entries right(linear_->carriers, b);
  while (left && right) {
    if (left.row() < right.row()) {
      ++left;
    } else if (right.row() < left.row()) {
      ++right;
    } else {
      out[instant_[static_cast<std::size_t>(left.row())]] += left.value() * right.value();
      ++left;
      ++right;
    }
  }
  return out;
}

Eigen::VectorXd NormalSystem::share_of(const EffectColumn& column) const {
  if (column.share.size() == 0) return Eigen::VectorXd::Ones(linear_->instants());
  KINESCOPE_CHECK(column.share.size() == linear_->instants(), "one share an instant");
  return column.share;
}

EffectSums NormalSystem::sums(const std::vector<EffectColumn>& columns) const {
  std::vector<EffectSums> one = sums(std::vector<std::vector<EffectColumn>>{columns});
  return std::move(one.front());
}

std::vector<EffectSums> NormalSystem::sums(
    const std::vector<std::vector<EffectColumn>>& effects) const {
  // Every column of the effects, its carrier's together.
  struct Place {
    std::size_t effect;
    std::size_t column;
  };
  std::map<int, std::vector<Place>> carried;
  std::vector<EffectSums> out;
  std::vector<Eigen::MatrixXd> shares;
  for (std::size_t e = 0; e < effects.size(); ++e) {
    const auto k = static_cast<Eigen::Index>(effects[e].size());
    out.push_back({Eigen::MatrixXd(parameters(), k), Eigen::MatrixXd(k, k), Eigen::VectorXd(k)});
    shares.emplace_back(linear_->instants(), k);
    for (std::size_t a = 0; a < effects[e].size(); ++a) {
      shares[e].col(static_cast<Eigen::Index>(a)) = share_of(effects[e][a]);
      carried[effects[e][a].carrier].push_back({e, a});
    }
  }
  for (const auto& [index, places] : carried) {
    const CarrierSums& own = carrier(index);
    Eigen::MatrixXd of_carrier(linear_->instants(), static_cast<Eigen::Index>(places.size()));
    for (std::size_t k = 0; k < places.size(); ++k) {
      of_carrier.col(static_cast<Eigen::Index>(k)) =
          shares[places[k].effect].col(static_cast<Eigen::Index>(places[k].column));
    }
    const Eigen::MatrixXd JE = own.with_jacobian.transpose() * of_carrier;
    const Eigen::VectorXd Er = of_carrier.transpose() * own.with_residual;
    for (std::size_t k = 0; k < places.size(); ++k) {
      EffectSums& effect = out[places[k].effect];
      const auto a = static_cast<Eigen::Index>(places[k].column);
      effect.JE.col(a) = JE.col(static_cast<Eigen::Index>(k));
      effect.Er[a] = Er[static_cast<Eigen::Index>(k)];
    }
  }
  for (std::size_t e = 0; e < effects.size(); ++e) {
    for (Eigen::Index a = 0; a < shares[e].cols(); ++a) {
      for (Eigen::Index b = 0; b <= a; ++b) {
        const Eigen::VectorXd& both = product(effects[e][static_cast<std::size_t>(a)].carrier,
                                              effects[e][static_cast<std::size_t>(b)].carrier);
        const double sum =
            (shares[e].col(a).array() * shares[e].col(b).array() * both.array()).sum();
        out[e].EE(a, b) = sum;
        out[e].EE(b, a) = sum;
      }
    }
    for (std::size_t p = 0; p < local_.parts(); ++p)
      local_.take(p, local_.taken(p, local_products(effects[e]), shares[e]), out[e]);
  }
  return out;
}

std::vector<EffectSums> NormalSystem::stretch_sums(const std::vector<EffectColumn>& columns) const {
  return grouped_sums(columns, partition_.stretch, partition_.stretches);
}

std::vector<EffectSums> NormalSystem::fold_sums(const std::vector<EffectColumn>& columns) const {
  return grouped_sums(columns, partition_.fold, partition_.folds);
}

std::vector<EffectSums> NormalSystem::grouped_sums(const std::vector<EffectColumn>& columns,
                                                   const std::vector<int>& group,
                                                   int groups) const {
  const auto k = static_cast<Eigen::Index>(columns.size());
  std::vector<EffectSums> out(static_cast<std::size_t>(groups),
                              {Eigen::MatrixXd::Zero(parameters(), k), Eigen::MatrixXd::Zero(k, k),
                               Eigen::VectorXd::Zero(k)});
  std::vector<Eigen::VectorXd> shares;
  for (Eigen::Index a = 0; a < k; ++a) {
    const EffectColumn& column = columns[static_cast<std::size_t>(a)];
    const CarrierSums& sums = carrier(column.carrier);
    shares.push_back(share_of(column));
    for (Eigen::Index i = 0; i < linear_->instants(); ++i) {
      const double share = shares.back()[i];
      if (share == 0.0) continue;
      EffectSums& own = out[static_cast<std::size_t>(group[static_cast<std::size_t>(i)])];
      own.Er[a] += share * sums.with_residual[i];
      own.JE.col(a) += share * sums.with_jacobian.row(i);
    }
    for (Eigen::Index b = 0; b <= a; ++b) {
      const Eigen::VectorXd& products =
          product(column.carrier, columns[static_cast<std::size_t>(b)].carrier);
      for (Eigen::Index i = 0; i < linear_->instants(); ++i) {
        if (shares.back()[i] == 0.0) continue;
        EffectSums& own = out[static_cast<std::size_t>(group[static_cast<std::size_t>(i)])];
        own.EE(a, b) += shares[static_cast<std::size_t>(b)][i] * shares.back()[i] * products[i];
      }
    }
  }
  for (EffectSums& own : out) own.EE = Eigen::MatrixXd(own.EE.selfadjointView<Eigen::Lower>());
  if (local_.empty()) return out;
  const std::vector<const LocalProducts*> products = local_products(columns);
  Eigen::MatrixXd all(linear_->instants(), k);
  for (Eigen::Index a = 0; a < k; ++a) all.col(a) = shares[static_cast<std::size_t>(a)];
  for (std::size_t p = 0; p < local_.parts(); ++p) {
    const std::size_t instant = local_.part(p).instants.front();
    local_.take(p, local_.taken(p, products, all), out[static_cast<std::size_t>(group[instant])]);
  }
  return out;
}

std::vector<const LocalProducts*> NormalSystem::local_products(
    const std::vector<EffectColumn>& columns) const {
  std::vector<const LocalProducts*> out;
  for (const EffectColumn& column : columns) out.push_back(&carrier(column.carrier).with_local);
  return out;
}

double NormalSystem::shift_of(double gain, const std::vector<EffectColumn>& columns) const {
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(linear_->instants());
  for (const EffectColumn& column : columns) {
    const Eigen::VectorXd share = share_of(column);
    const Eigen::VectorXd& touched = carrier(column.carrier).weight;
    for (Eigen::Index i = 0; i < weight.size(); ++i) {
      if (share[i] != 0.0) weight[i] = std::max(weight[i], touched[i]);
    }
  }
  const double sum = weight.sum();
  return sum > 0.0 ? std::sqrt(std::max(0.0, gain) / sum) : 0.0;
}

double NormalSystem::noise_share_of(double gain, const std::vector<EffectColumn>& columns) const {
  const std::vector<bool> rows = touches(columns);
  const auto count = std::ranges::count(rows, true);
  return count > 0 ? std::sqrt(std::max(0.0, gain) / static_cast<double>(count)) : 0.0;
}

Eigen::VectorXd NormalSystem::moved_by(const std::vector<EffectColumn>& columns,
                                       const Eigen::VectorXd& theta) const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(linear_->residual.size());
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const Eigen::VectorXd share = share_of(columns[k]);
    const double size = theta[static_cast<Eigen::Index>(k)];
    using Entries = Eigen::SparseMatrix<double>::InnerIterator;
    for (Entries entry(linear_->carriers, columns[k].carrier); entry; ++entry) {
      out[entry.row()] +=
          size * share[instant_[static_cast<std::size_t>(entry.row())]] * entry.value();
    }
  }
  return out;
}

std::vector<bool> NormalSystem::touches(const std::vector<EffectColumn>& columns) const {
  std::vector<bool> out(instant_.size(), false);
  for (const EffectColumn& column : columns) {
    const Eigen::VectorXd share = share_of(column);
    using Entries = Eigen::SparseMatrix<double>::InnerIterator;
    for (Entries entry(linear_->carriers, column.carrier); entry; ++entry) {
      const auto row = static_cast<std::size_t>(entry.row());
      if (share[instant_[row]] != 0.0) out[row] = true;
    }
  }
  return out;
}

NormalSystem::Touched NormalSystem::touched_after(const Eigen::VectorXd& delta,
                                                  const std::vector<EffectColumn>& columns,
                                                  const Eigen::VectorXd& theta) const {
  const std::vector<bool> counts = touches(columns);
  const Eigen::VectorXd left =
      local_.residual() - freed(moved_by(columns, theta) + linear_->jacobian * delta);
  Touched out;
  for (Eigen::Index row = 0; row < left.size(); ++row) {
    if (!counts[static_cast<std::size_t>(row)]) continue;
    out.rows += 1.0;
    out.squares += left[row] * left[row];
  }
  return out;
}

}  // namespace kinescope::trace
