// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/local_elimination.h"

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope::trace {
namespace {

using RowEntries = Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator;

Eigen::VectorXd rows_of(const Eigen::VectorXd& all, const std::vector<Eigen::Index>& rows) {
  return all(rows);
}

// L^-1 m.
Eigen::MatrixXd whitened(const Eigen::MatrixXd& L, const Eigen::MatrixXd& m) {
  return m.size() == 0 ? m : L.triangularView<Eigen::Lower>().solve(m);
}

}  // namespace

LocalElimination::LocalElimination(const Linearisation& linear, std::vector<Part> parts)
    : linear_(&linear) {
  if (linear.local.cols() == 0) return;
  KINESCOPE_CHECK(linear.local.rows() == linear.residual.size() &&
                      linear.local_residual.size() == linear.residual.size() &&
                      linear.local_prediction.size() == linear.residual.size() &&
                      linear.local_information.size() == linear.local.cols(),
                  "local parameters are of these rows");
  for (Part& part : parts) {
    parts_.push_back(local_of(std::move(part)));
    determined_ += parts_.back().K.squaredNorm();
  }
}

LocalElimination::Local LocalElimination::local_of(Part part) const {
  const Linearisation& linear = *linear_;
  Local out;
  out.part = std::move(part);
  out.of_local.assign(static_cast<std::size_t>(linear.local.cols()), -1);
  std::vector<Eigen::Index> here;
  for (const std::size_t i : out.part.instants) {
    for (Eigen::Index row = linear.first_row[i]; row < linear.first_row[i + 1]; ++row) {
      out.rows.push_back(row);
      for (RowEntries entry(linear.local, row); entry; ++entry) {
        int& number = out.of_local[static_cast<std::size_t>(entry.col())];
        if (number >= 0) continue;
        number = static_cast<int>(here.size());
        here.push_back(entry.col());
      }
    }
  }
  const auto count = static_cast<Eigen::Index>(out.rows.size());
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(count, static_cast<Eigen::Index>(here.size()));
  for (Eigen::Index k = 0; k < count; ++k) {
    for (RowEntries entry(linear.local, out.rows[static_cast<std::size_t>(k)]); entry; ++entry)
      C(k, out.of_local[static_cast<std::size_t>(entry.col())]) = entry.value();
  }
  Eigen::MatrixXd normal = C.transpose() * C;
  normal.diagonal() += linear.local_information(here);
  if (!here.empty()) {
    const CholeskyFactor factor(normal);
    KINESCOPE_CHECK(factor.positive_definite(), "every local parameter has a prior");
    out.L = factor.lower();
  }
  out.K = whitened(out.L, C.transpose()).transpose();
  out.KJ = out.K.transpose() * linear.jacobian(out.rows, Eigen::all);
  out.Ks = out.K.transpose() *
           (rows_of(linear.residual, out.rows) - rows_of(linear.local_residual, out.rows));
  return out;
}

void LocalElimination::eliminate(std::size_t p, GroupSums& sums) const {
  const Local& local = parts_[p];
  sums.H.noalias() -= local.KJ.transpose() * local.KJ;
  sums.g.noalias() -= local.KJ.transpose() * local.Ks;
  sums.rr -= local.Ks.squaredNorm();
}

Eigen::MatrixXd LocalElimination::taken(std::size_t p,
                                        const std::vector<const LocalProducts*>& products,
                                        const Eigen::MatrixXd& shares) const {
  const Local& local = parts_[p];
  Eigen::MatrixXd CE = Eigen::MatrixXd::Zero(local.K.cols(), shares.cols());
  for (Eigen::Index a = 0; a < CE.cols(); ++a) {
    for (const std::size_t i : local.part.instants) {
      const auto instant = static_cast<Eigen::Index>(i);
      const double share = shares(instant, a);
      if (share == 0.0) continue;
      for (RowEntries entry(*products[static_cast<std::size_t>(a)], instant); entry; ++entry)
        CE(local.of_local[static_cast<std::size_t>(entry.col())], a) += share * entry.value();
    }
  }
  return whitened(local.L, CE);
}

void LocalElimination::take(std::size_t p, const Eigen::Ref<const Eigen::MatrixXd>& taken,
                            EffectSums& sums) const {
  const Local& local = parts_[p];
  sums.JE.noalias() -= local.KJ.transpose() * taken;
  sums.EE.noalias() -= taken.transpose() * taken;
  sums.Er.noalias() -= taken.transpose() * local.Ks;
}

Eigen::VectorXd LocalElimination::freed(Eigen::VectorXd rows) const {
  for (const Local& local : parts_) {
    const Eigen::VectorXd own = rows_of(rows, local.rows);
    rows(local.rows) -= local.K * (local.K.transpose() * own);
  }
  return rows;
}

Eigen::VectorXd LocalElimination::residual() const {
  Eigen::VectorXd out = linear_->residual;
  for (const Local& local : parts_) out(local.rows) -= local.K * local.Ks;
  return out;
}

}  // namespace kinescope::trace
