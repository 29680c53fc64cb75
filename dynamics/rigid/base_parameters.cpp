// SPDX-License-Identifier: Apache-2.0
#include "dynamics/rigid/base_parameters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/QR>
#include <fmt/format.h>

#include "dynamics/rigid/regressor.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

/// What is left of a vector after projecting out an orthonormal basis. Twice is enough (Kahan;
/// Giraud, Langou 2002).
Eigen::VectorXd residual(const Eigen::MatrixXd& basis, Eigen::Index count,
                         const Eigen::VectorXd& vector) {
  Eigen::VectorXd left = vector;
  for (int pass = 0; pass < 2; ++pass) {
    left -= basis.leftCols(count) * (basis.leftCols(count).transpose() * left).eval();
  }
  return left;
}

/// The first `rank` columns, in the order of preference, that add a direction; when several cannot
/// be told from rounding, those that add most.
std::vector<int> keep_in_order(const Eigen::MatrixXd& unit_columns,
                               const std::vector<int>& preference, Eigen::Index rank,
                               double tolerance) {
  Eigen::MatrixXd basis(unit_columns.rows(), rank);
  std::vector<int> kept;
  std::vector<std::pair<double, int>> passed_over;
  for (const int column : preference) {
    const auto count = static_cast<Eigen::Index>(kept.size());
    if (count == rank) break;
    const Eigen::VectorXd left = residual(basis, count, unit_columns.col(column));
    if (left.norm() > tolerance) {
      basis.col(count) = left.normalized();
      kept.push_back(column);
    } else {
      passed_over.emplace_back(-left.norm(), column);
    }
  }
  std::ranges::sort(passed_over);
  for (const auto& [size, column] : passed_over) {
    if (static_cast<Eigen::Index>(kept.size()) == rank) break;
    kept.push_back(column);
  }
  std::ranges::sort(kept);
  return kept;
}

/// Coefficients of geometry below this are rounding of the least squares.
constexpr double kZeroCoefficient = 1e-9;

Eigen::MatrixXd regroup_on(const Eigen::MatrixXd& R, const std::vector<int>& kept) {
  const Eigen::MatrixXd independent = R(Eigen::all, kept);
  Eigen::MatrixXd regroup = independent.householderQr().solve(R);
  regroup = (regroup.array().abs() < kZeroCoefficient).select(0.0, regroup);
  for (std::size_t k = 0; k < kept.size(); ++k) {
    regroup.col(kept[k]).setZero();
    regroup(static_cast<Eigen::Index>(k), kept[k]) = 1.0;
  }
  return regroup;
}

}  // namespace

ColumnBasis independent_columns(const Eigen::MatrixXd& W, const std::vector<int>& preference,
                                double tolerance) {
  KINESCOPE_CHECK(static_cast<Eigen::Index>(preference.size()) == W.cols(),
                  "every column has its place in the order");
  ColumnBasis out;
  const Eigen::VectorXd norms = W.colwise().norm();
  const double largest = norms.size() > 0 ? norms.maxCoeff() : 0.0;
  std::vector<int> candidates;
  for (const int column : preference) {
    if (norms[column] > tolerance * largest) candidates.push_back(column);
  }
  for (int c = 0; c < W.cols(); ++c) {
    if (!(norms[c] > tolerance * largest)) out.without_effect.push_back(c);
  }
  out.regroup = Eigen::MatrixXd::Zero(0, W.cols());
  if (candidates.empty()) return out;
  Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(W.rows(), W.cols());
  for (const int c : candidates) unit.col(c) = W.col(c) / norms[c];
  // The triangle holds all inner products of the columns, in few rows.
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(unit);
  const Eigen::Index rows = std::min(W.rows(), W.cols());
  const Eigen::MatrixXd R = qr.matrixQR().topRows(rows).template triangularView<Eigen::Upper>();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> pivoted(R);
  pivoted.setThreshold(tolerance);
  out.singular_values = singular_values(R);
  out.kept = keep_in_order(R, candidates, pivoted.rank(), tolerance);
  out.regroup = regroup_on(R * norms.asDiagonal(), out.kept);
  return out;
}

std::vector<int> usual_preference(const RigidModel& model) {
  constexpr std::array<int, 10> kOrder = {5, 6, 8, 9, 4, 7, 1, 2, 3, 0};
  std::vector<int> preference;
  for (int b = 0; b < static_cast<int>(model.size()); ++b) {
    for (const int k : kOrder) preference.push_back(10 * b + k);
  }
  return preference;
}

RandomMotion random_motion(const RigidModel& model, Eigen::Index samples, std::uint64_t seed) {
  Rng rng = Rng::from_name("random_motion", seed);
  const Eigen::Index n = model.size();
  RandomMotion out{.q = Eigen::MatrixXd(samples, n),
                   .dq = Eigen::MatrixXd(samples, n),
                   .ddq = Eigen::MatrixXd(samples, n)};
  // Rates and accelerations as large as gravity makes them on arms of a metre.
  const double scale = std::sqrt(std::max(1.0, model.gravity_m_s2.norm()));
  for (Eigen::Index t = 0; t < samples; ++t) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const bool turns = model.bodies[static_cast<std::size_t>(j)].type == JointType::kRevolute;
      const double reach = turns ? std::numbers::pi : 0.5;
      out.q(t, j) = rng.uniform(-reach, reach);
      out.dq(t, j) = rng.uniform(-scale, scale);
      out.ddq(t, j) = rng.uniform(-scale * scale, scale * scale);
    }
  }
  return out;
}

std::vector<std::string> body_parameter_names(const RigidModel& model) {
  std::vector<std::string> names;
  for (const RigidBody& body : model.bodies) {
    for (const std::string_view name : kInertialNames) {
      names.push_back(fmt::format("{}({})", name, body.name));
    }
  }
  return names;
}

std::string combination_name(const Eigen::VectorXd& row, const std::vector<std::string>& names,
                             int kept, int digits) {
  constexpr double kRounding = 1e-7;  // what a decomposition leaves where there is nothing
  const double largest = row.cwiseAbs().maxCoeff();
  std::string out = names[static_cast<std::size_t>(kept)];
  for (Eigen::Index c = 0; c < row.size(); ++c) {
    if (c == kept || std::abs(row[c]) <= kRounding * largest) continue;
    const std::string size = fmt::format("{:.{}g}", std::abs(row[c]), digits);
    out += fmt::format(" {} {}{}", row[c] < 0.0 ? '-' : '+', size == "1" ? "" : size + " ",
                       names[static_cast<std::size_t>(c)]);
  }
  return out;
}

BaseParameters base_parameters(const RigidModel& model, const BaseParameterOptions& options) {
  BaseParameters out;
  const Eigen::Index n = model.size();
  const Eigen::Index samples = 40 + 4 * n;  // six rows a column and more
  const RandomMotion motion = random_motion(model, samples, options.seed);
  const std::vector<Eigen::MatrixXd> Y =
      regressors_of_samples(model, motion.q, motion.dq, motion.ddq);
  Eigen::MatrixXd W(samples * n, 10 * n);
  for (Eigen::Index j = 0; j < n; ++j) {
    W.middleRows(samples * j, samples) = Y[static_cast<std::size_t>(j)];
  }
  out.basis = independent_columns(W, usual_preference(model), options.tolerance);
  const std::vector<std::string> names = body_parameter_names(model);
  for (std::size_t k = 0; k < out.basis.kept.size(); ++k) {
    out.names.push_back(combination_name(out.basis.regroup.row(static_cast<Eigen::Index>(k)), names,
                                         out.basis.kept[k]));
  }
  return out;
}

}  // namespace kinescope
