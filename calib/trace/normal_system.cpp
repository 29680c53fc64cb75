// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/normal_system.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope::trace {
namespace {

// Directions of the model's own parameters below this (scaled) are not seen by the data.
constexpr double kUnseen = 1e-13;

CellSums zero_sums(Eigen::Index parameters) {
  return {Eigen::MatrixXd::Zero(parameters, parameters), Eigen::VectorXd::Zero(parameters), 0.0};
}

}  // namespace

Eigen::MatrixXd scaled_pseudo_inverse(const Eigen::MatrixXd& matrix, double floor) {
  const Eigen::Index n = matrix.rows();
  if (n == 0) return matrix;
  const Eigen::VectorXd scale = matrix.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * matrix * scale.asDiagonal());
  const double least = floor * std::max(eigen.values[n - 1], 1e-300);
  const Eigen::VectorXd inverse =
      eigen.values.unaryExpr([&](double v) { return v > least ? 1.0 / v : 0.0; });
  return scale.asDiagonal() * eigen.vectors * inverse.asDiagonal() * eigen.vectors.transpose() *
         scale.asDiagonal();
}

NormalSystem::NormalSystem(const Linearisation& linear, Partition partition)
    : linear_(&linear), partition_(std::move(partition)) {
  const Eigen::Index parameters = linear.jacobian.cols();
  KINESCOPE_CHECK(linear.first_row.size() == partition_.cell.size() + 1,
                  "one cell an instant, one first row more");
  KINESCOPE_CHECK(linear.jacobian.rows() == linear.residual.size(), "one row a residual");
  cells_.assign(partition_.cells.size(), zero_sums(parameters));
  total_ = zero_sums(parameters);
  instant_.resize(static_cast<std::size_t>(linear.residual.size()));
  for (std::size_t i = 0; i < partition_.cell.size(); ++i) {
    const Eigen::Index first = linear.first_row[i];
    const Eigen::Index rows = linear.first_row[i + 1] - first;
    std::fill_n(instant_.begin() + first, rows, static_cast<int>(i));
    CellSums& cell = cells_[static_cast<std::size_t>(partition_.cell[i])];
    const auto J = linear.jacobian.middleRows(first, rows);
    const auto r = linear.residual.segment(first, rows);
    cell.H.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose());
    cell.g.noalias() += J.transpose() * r;
    cell.rr += r.squaredNorm();
  }
  for (CellSums& cell : cells_) {
    cell.H = Eigen::MatrixXd(cell.H.selfadjointView<Eigen::Lower>());
    total_.H += cell.H;
    total_.g += cell.g;
    total_.rr += cell.rr;
  }
  if (linear.prior_gradient.size() > 0) total_.g -= linear.prior_gradient;
  inverse_ = scaled_pseudo_inverse(
      linear.prior.size() == 0 ? total_.H : Eigen::MatrixXd(total_.H + linear.prior), kUnseen);
}

double NormalSystem::freedom() const {
  return std::max(1.0, static_cast<double>(linear_->residual.size() - parameters()));
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
                   Eigen::MatrixXd::Zero(linear_->instants(), parameters()),
                   Eigen::VectorXd::Zero(linear_->instants())};
  RowMatrix with_jacobian = RowMatrix::Zero(linear_->instants(), parameters());
  for (Eigen::SparseMatrix<double>::InnerIterator entry(linear_->carriers, index); entry; ++entry) {
    const auto i = static_cast<Eigen::Index>(instant_[static_cast<std::size_t>(entry.row())]);
    sums.with_residual[i] += entry.value() * linear_->residual[entry.row()];
    with_jacobian.row(i) += entry.value() * linear_->jacobian.row(entry.row());
    const double unit = linear_->unit[entry.row()];
    if (unit > 0.0) sums.weight[i] += 1.0 / (unit * unit);
  }
  sums.with_jacobian = with_jacobian;
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
  const auto k = static_cast<Eigen::Index>(columns.size());
  EffectSums out{Eigen::MatrixXd(parameters(), k), Eigen::MatrixXd(k, k), Eigen::VectorXd(k)};
  std::vector<Eigen::VectorXd> shares;
  for (Eigen::Index a = 0; a < k; ++a) {
    const EffectColumn& column = columns[static_cast<std::size_t>(a)];
    const CarrierSums& sums = carrier(column.carrier);
    shares.push_back(share_of(column));
    out.Er[a] = shares.back().dot(sums.with_residual);
    out.JE.col(a).noalias() = sums.with_jacobian.transpose() * shares.back();
    for (Eigen::Index b = 0; b <= a; ++b) {
      const EffectColumn& other = columns[static_cast<std::size_t>(b)];
      out.EE(a, b) = (shares[static_cast<std::size_t>(b)].array() * shares.back().array() *
                      product(column.carrier, other.carrier).array())
                         .sum();
      out.EE(b, a) = out.EE(a, b);
    }
  }
  return out;
}

std::vector<EffectSums> NormalSystem::cell_sums(const std::vector<EffectColumn>& columns) const {
  const auto k = static_cast<Eigen::Index>(columns.size());
  std::vector<EffectSums> out(cells_.size(),
                              {Eigen::MatrixXd::Zero(parameters(), k), Eigen::MatrixXd::Zero(k, k),
                               Eigen::VectorXd::Zero(k)});
  std::vector<Eigen::VectorXd> shares;
  for (Eigen::Index a = 0; a < k; ++a) {
    const EffectColumn& column = columns[static_cast<std::size_t>(a)];
    const CarrierSums& sums = carrier(column.carrier);
    shares.push_back(share_of(column));
    const RowMatrix with_jacobian = shares.back().asDiagonal() * sums.with_jacobian;
    for (Eigen::Index i = 0; i < linear_->instants(); ++i) {
      EffectSums& cell =
          out[static_cast<std::size_t>(partition_.cell[static_cast<std::size_t>(i)])];
      cell.Er[a] += shares.back()[i] * sums.with_residual[i];
      cell.JE.col(a) += with_jacobian.row(i);
    }
    for (Eigen::Index b = 0; b <= a; ++b) {
      const Eigen::VectorXd& products =
          product(column.carrier, columns[static_cast<std::size_t>(b)].carrier);
      for (Eigen::Index i = 0; i < linear_->instants(); ++i) {
        EffectSums& cell =
            out[static_cast<std::size_t>(partition_.cell[static_cast<std::size_t>(i)])];
        cell.EE(a, b) += shares[static_cast<std::size_t>(b)][i] * shares.back()[i] * products[i];
      }
    }
  }
  for (EffectSums& cell : out) cell.EE = Eigen::MatrixXd(cell.EE.selfadjointView<Eigen::Lower>());
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
  const double rows = touched(columns, linear_->residual).rows;
  return rows > 0.0 ? std::sqrt(std::max(0.0, gain) / rows) : 0.0;
}

Eigen::VectorXd NormalSystem::residual_after(const Eigen::VectorXd& delta,
                                             const std::vector<EffectColumn>& columns,
                                             const Eigen::VectorXd& theta) const {
  Eigen::VectorXd out = linear_->residual - linear_->jacobian * delta;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const Eigen::VectorXd share = share_of(columns[k]);
    const double size = theta[static_cast<Eigen::Index>(k)];
    using Entries = Eigen::SparseMatrix<double>::InnerIterator;
    for (Entries entry(linear_->carriers, columns[k].carrier); entry; ++entry) {
      out[entry.row()] -=
          size * share[instant_[static_cast<std::size_t>(entry.row())]] * entry.value();
    }
  }
  return out;
}

NormalSystem::Touched NormalSystem::touched(const std::vector<EffectColumn>& columns,
                                            const Eigen::VectorXd& residual) const {
  Touched out;
  std::vector<bool> counted(static_cast<std::size_t>(residual.size()), false);
  for (const EffectColumn& column : columns) {
    const Eigen::VectorXd share = share_of(column);
    using Entries = Eigen::SparseMatrix<double>::InnerIterator;
    for (Entries entry(linear_->carriers, column.carrier); entry; ++entry) {
      const auto row = static_cast<std::size_t>(entry.row());
      if (counted[row] || share[instant_[row]] == 0.0) continue;
      counted[row] = true;
      out.rows += 1.0;
      out.squares += residual[entry.row()] * residual[entry.row()];
    }
  }
  return out;
}

}  // namespace kinescope::trace
