// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/information.h"

#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/SparseCholesky>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope::bundle {
namespace {

Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& information, std::vector<bool>& unseen) {
  constexpr double kTouched = 1e-3;  // of a direction of unit length
  const Eigen::Index n = information.rows();
  const Eigen::VectorXd scale = unit_scale(information);
  const SymmetricEigen eigen =
      symmetric_eigen(scale.asDiagonal() * information * scale.asDiagonal());
  const double rounding =
      static_cast<double>(n) * std::numeric_limits<double>::epsilon() * eigen.values[n - 1];
  Eigen::VectorXd inverse = Eigen::VectorXd::Zero(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    if (eigen.values[k] > rounding) {
      inverse[k] = 1.0 / eigen.values[k];
      continue;
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      if (std::abs(eigen.vectors(i, k)) > kTouched) unseen[static_cast<std::size_t>(i)] = true;
    }
  }
  return scale.asDiagonal() * eigen.vectors * inverse.asDiagonal() * eigen.vectors.transpose() *
         scale.asDiagonal();
}

}  // namespace

Information::Information(const ParameterPlaces& places)
    : places_(places),
      other_(Eigen::MatrixXd::Zero(std::ssize(places.other), std::ssize(places.other))),
      beside_(Eigen::MatrixXd::Zero(std::ssize(places.local), std::ssize(places.other))) {}

void Information::add(const FrameRows& rows) {
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(rows.J.cols(), rows.J.cols());
  products.selfadjointView<Eigen::Lower>().rankUpdate(rows.J.transpose());
  for (Eigen::Index b = 0; b < products.cols(); ++b) {
    for (Eigen::Index a = b; a < products.rows(); ++a) {
      add_lower(rows.shown[static_cast<std::size_t>(a)], rows.shown[static_cast<std::size_t>(b)],
                products(a, b));
    }
  }
}

void Information::add(const Eigen::SparseMatrix<double>& priors,
                      const std::function<bool(Eigen::Index, Eigen::Index)>& is_meant) {
  for (Eigen::Index c = 0; c < priors.outerSize(); ++c)
    for (Eigen::SparseMatrix<double>::InnerIterator prior(priors, c); prior; ++prior)
      if (prior.row() >= prior.col() && is_meant(prior.row(), prior.col()))
        add_lower(prior.row(), prior.col(), prior.value());
}

void Information::add_lower(Eigen::Index i, Eigen::Index j, double value) {
  const auto first = static_cast<std::size_t>(i);
  const auto second = static_cast<std::size_t>(j);
  const Eigen::Index a = places_.place[first];
  const Eigen::Index b = places_.place[second];
  if (places_.is_local[first] != places_.is_local[second]) {
    (places_.is_local[first] ? beside_(a, b) : beside_(b, a)) += value;
  } else if (places_.is_local[first]) {
    local_.emplace_back(a, b, value);
  } else {
    other_(a, b) += value;
  }
}

Information::Reduced Information::reduced_with_answer() const {
  Reduced out{other_.selfadjointView<Eigen::Lower>(), {}};
  if (places_.local.empty()) return out;
  Eigen::SparseMatrix<double> local(beside_.rows(), beside_.rows());
  local.setFromTriplets(local_.begin(), local_.end());
  const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower> factor(local);
  KINESCOPE_CHECK(factor.info() == Eigen::Success, "local corrections have priors");
  out.answer = factor.solve(beside_);
  out.information -= beside_.transpose() * out.answer;
  return out;
}

Eigen::MatrixXd Information::covariance_rows(std::vector<bool>& unseen) const {
  const Reduced reduced = reduced_with_answer();
  const Eigen::MatrixXd others = inverse_of(reduced.information, unseen);
  Eigen::MatrixXd out(std::ssize(places_.other), std::ssize(places_.place));
  out(Eigen::all, places_.other) = others;
  if (!places_.local.empty()) out(Eigen::all, places_.local) = -others * reduced.answer.transpose();
  return out;
}

}  // namespace kinescope::bundle
