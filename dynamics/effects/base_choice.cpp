// SPDX-License-Identifier: Apache-2.0
#include "dynamics/effects/base_choice.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynamics/data/statistics.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/median.h"

namespace kinescope::effects {
namespace {

constexpr int kRobustSteps = 8;
constexpr double kHuber = 1.345;
constexpr int kLoadSteps = 20;      // chosen; of friction of a tenth of the load, four are enough
constexpr double kSameLoad = 1e-5;  // chosen: far below what a share of the load is known to

/// Least squares over joints that share columns: H and g sum up.
struct Normal {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;

  explicit Normal(Eigen::Index n) : H(Eigen::MatrixXd::Zero(n, n)), g(Eigen::VectorXd::Zero(n)) {}
  void add(const Eigen::MatrixXd& X, const Eigen::VectorXd& y) {
    H.selfadjointView<Eigen::Lower>().rankUpdate(X.transpose());
    g.noalias() += X.transpose() * y;
  }
  [[nodiscard]] Eigen::VectorXd solve() const {
    const Eigen::MatrixXd full = H.selfadjointView<Eigen::Lower>();
    const Eigen::VectorXd scale = unit_scale(full);
    const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * full * scale.asDiagonal());
    const Eigen::VectorXd& values = eigen.values;
    const double least = kUnobservable * std::max(values[values.size() - 1], 1e-300);
    const Eigen::VectorXd inverse =
        values.unaryExpr([least](double v) { return v > least ? 1.0 / v : 0.0; });
    const Eigen::VectorXd turned = eigen.vectors.transpose() * (scale.asDiagonal() * g);
    return scale.asDiagonal() * (eigen.vectors * inverse.cwiseProduct(turned));
  }
};

double robust_sigma(const Eigen::VectorXd& residual, Eigen::Index parameters) {
  const auto rows = static_cast<double>(residual.size());
  const double freedom = std::max(1.0, rows - static_cast<double>(parameters));
  return kSigmaOverMedian * median_of(to_vector(residual.cwiseAbs())) * std::sqrt(rows / freedom);
}

/// A joint's friction in proportion to its load.
Eigen::VectorXd load_friction(const BaseData& data, const Eigen::MatrixXd& load, Eigen::Index j) {
  return data.way.col(j).cwiseProduct(load.col(j).cwiseAbs());
}

/// The drive's columns with friction of its load and a gain.
Eigen::MatrixXd loaded_drive(const BaseData& data, std::size_t joint) {
  const auto j = static_cast<Eigen::Index>(joint);
  const Eigen::MatrixXd& drive = data.drives[joint];
  Eigen::MatrixXd out(drive.rows(), drive.cols() + 2);
  out << drive, load_friction(data, data.load, j), data.load.col(j);
  return out;
}

std::vector<Eigen::MatrixXd> loaded_drives(const BaseData& data) {
  std::vector<Eigen::MatrixXd> out;
  for (std::size_t j = 0; j < data.drives.size(); ++j) out.push_back(loaded_drive(data, j));
  return out;
}

Eigen::MatrixXd load_of(const BaseData& data, const Eigen::VectorXd& bodies) {
  Eigen::MatrixXd out(data.torque.rows(), data.torque.cols());
  for (std::size_t j = 0; j < data.rigid.size(); ++j)
    out.col(static_cast<Eigen::Index>(j)) = data.rigid[j] * bodies;
  return out;
}

Eigen::MatrixXd columns_that_act(const Eigen::MatrixXd& all) {
  std::vector<Eigen::Index> kept;
  for (Eigen::Index c = 0; c < all.cols(); ++c) {
    if (!all.col(c).isZero(0.0)) kept.push_back(c);
  }
  return all(Eigen::all, kept);
}

Eigen::VectorXd robust_residual(const Eigen::MatrixXd& X, const Eigen::VectorXd& y, double& sigma) {
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(y.size());
  Eigen::VectorXd residual = y;
  for (int step = 0; step < kRobustSteps; ++step) {
    Normal normal(X.cols());
    normal.add(weights.asDiagonal() * X, weights.cwiseProduct(y));
    residual = y - X * normal.solve();
    sigma = robust_sigma(residual, X.cols());
    if (!(sigma > 0.0)) break;
    const Eigen::ArrayXd size = residual.array().abs() / (kHuber * sigma);
    weights = size.max(1.0).inverse().sqrt().matrix();
  }
  return residual;
}

/// Columns of one joint in a system in which the drives of all joints stand side by side after the
/// shared columns.
Eigen::MatrixXd system_columns(const std::vector<Eigen::MatrixXd>& drives, std::size_t joint,
                               const std::vector<Eigen::MatrixXd>& shared) {
  Eigen::Index columns = 0;
  Eigen::Index first = 0;
  for (std::size_t j = 0; j < drives.size(); ++j) {
    if (j == joint) first = columns;
    columns += drives[j].cols();
  }
  const Eigen::MatrixXd& own = shared[joint];
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(own.rows(), own.cols() + columns);
  out.leftCols(own.cols()) = own;
  out.middleCols(own.cols() + first, drives[joint].cols()) = drives[joint];
  return out;
}

/// Held-out mean square of `target` (instants x joints, whitened by sigma) in each fold.
Eigen::VectorXd held_out(const BaseData& data, const Eigen::MatrixXd& target,
                         const std::vector<Eigen::MatrixXd>& shared, const Eigen::VectorXd& sigma) {
  const int folds = 1 + *std::ranges::max_element(data.fold);
  std::vector<std::vector<Eigen::Index>> rows(static_cast<std::size_t>(folds));
  for (std::size_t i = 0; i < data.fold.size(); ++i) {
    rows[static_cast<std::size_t>(data.fold[i])].push_back(static_cast<Eigen::Index>(i));
  }
  const std::vector<Eigen::MatrixXd> drives = loaded_drives(data);
  std::vector<Eigen::MatrixXd> X;
  for (std::size_t j = 0; j < shared.size(); ++j) {
    X.push_back(system_columns(drives, j, shared) / sigma[static_cast<Eigen::Index>(j)]);
  }
  std::vector<Normal> parts;
  Normal total(X.front().cols());
  for (const auto& chosen : rows) {
    Normal part(X.front().cols());
    for (std::size_t j = 0; j < X.size(); ++j) {
      const auto c = static_cast<Eigen::Index>(j);
      part.add(X[j](chosen, Eigen::all), target(chosen, c) / sigma[c]);
    }
    total.H += part.H;
    total.g += part.g;
    parts.push_back(std::move(part));
  }
  std::vector<std::vector<double>> squares(rows.size());
  std::vector<double> all;
  for (std::size_t f = 0; f < rows.size(); ++f) {
    Normal others(total.g.size());
    others.H = total.H - parts[f].H;
    others.g = total.g - parts[f].g;
    const Eigen::VectorXd solution = others.solve();
    for (std::size_t j = 0; j < X.size(); ++j) {
      const auto c = static_cast<Eigen::Index>(j);
      const Eigen::VectorXd error =
          target(rows[f], c) / sigma[c] - X[j](rows[f], Eigen::all) * solution;
      for (const double e : error) squares[f].push_back(e * e);
    }
    all.insert(all.end(), squares[f].begin(), squares[f].end());
  }
  // Contacts and outliers must not decide: the bulk does.
  constexpr double kBulk = 0.9;
  const double limit = quantile(all, kBulk);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(std::ssize(rows));
  for (std::size_t f = 0; f < rows.size(); ++f) {
    double count = 0.0;
    for (const double s : squares[f]) {
      if (s > limit) continue;
      out[static_cast<Eigen::Index>(f)] += s;
      count += 1.0;
    }
    out[static_cast<Eigen::Index>(f)] /= std::max(1.0, count);
  }
  return out;
}

/// The bodies where friction grows with this load.
Eigen::VectorXd bodies_beside(const BaseData& data, const Eigen::MatrixXd& load,
                              const Eigen::VectorXd& sigma) {
  std::vector<Eigen::MatrixXd> drives;
  for (std::size_t j = 0; j < data.drives.size(); ++j) {
    const Eigen::MatrixXd& drive = data.drives[j];
    Eigen::MatrixXd all(drive.rows(), drive.cols() + 1);
    all << drive, load_friction(data, load, static_cast<Eigen::Index>(j));
    drives.push_back(std::move(all));
  }
  Normal normal(system_columns(drives, 0, data.rigid).cols());
  for (std::size_t j = 0; j < data.rigid.size(); ++j) {
    const auto c = static_cast<Eigen::Index>(j);
    normal.add(system_columns(drives, j, data.rigid) / sigma[c], data.torque.col(c) / sigma[c]);
  }
  return normal.solve().head(data.rigid.front().cols());
}

}  // namespace

double paired_t(const Eigen::VectorXd& worse, const Eigen::VectorXd& better) {
  const auto n = static_cast<double>(worse.size());
  const Eigen::VectorXd difference = worse - better;
  const double variance =
      (difference.array() - difference.mean()).square().sum() / std::max(1.0, n - 1.0);
  return variance > 0.0 ? difference.mean() / std::sqrt(variance / n) : 0.0;
}

WidestFit widest_fit(const BaseData& data) {
  WidestFit out{Eigen::MatrixXd(data.torque.rows(), data.torque.cols()),
                Eigen::VectorXd(data.torque.cols())};
  for (Eigen::Index j = 0; j < data.torque.cols(); ++j) {
    const auto joint = static_cast<std::size_t>(j);
    const Eigen::MatrixXd rigid = columns_that_act(data.rigid[joint]);
    const Eigen::MatrixXd drive = loaded_drive(data, joint);
    Eigen::MatrixXd X(rigid.rows(), rigid.cols() + drive.cols());
    X << rigid, drive;
    const Eigen::VectorXd residual = robust_residual(X, data.torque.col(j), out.sigma[j]);
    // A torque that is described exactly (no noise at all) still needs a scale.
    const double size = data.torque.col(j).norm() / std::sqrt(static_cast<double>(X.rows()));
    out.sigma[j] = std::max({out.sigma[j], 1e-9 * size, 1e-12});
    out.residual.col(j) = residual / out.sigma[j];
  }
  return out;
}

BaseData without_outliers(const BaseData& data, const Eigen::MatrixXd& whitened) {
  constexpr double kFar = 5.0;
  constexpr double kFewest = 0.7;  // of the instants; else it is the description that is too narrow
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < whitened.rows(); ++i) {
    if (whitened.row(i).cwiseAbs().maxCoeff() < kFar) rows.push_back(i);
  }
  if (static_cast<double>(rows.size()) < kFewest * static_cast<double>(whitened.rows())) {
    return data;
  }
  BaseData out;
  const auto chosen = [&](const Eigen::MatrixXd& all) {
    return Eigen::MatrixXd(all(rows, Eigen::all));
  };
  out.q = chosen(data.q);
  out.dq = chosen(data.dq);
  out.ddq = chosen(data.ddq);
  out.torque = chosen(data.torque);
  out.declared = chosen(data.declared);
  out.way = chosen(data.way);
  out.load = chosen(data.load);
  for (std::size_t j = 0; j < data.rigid.size(); ++j) {
    out.rigid.push_back(chosen(data.rigid[j]));
    out.drives.push_back(chosen(data.drives[j]));
    out.common.push_back(chosen(data.common[j]));
  }
  for (const Eigen::Index row : rows) out.fold.push_back(data.fold[static_cast<std::size_t>(row)]);
  return out;
}

BaseErrors compare_bases(const BaseData& data, const Eigen::VectorXd& sigma) {
  const Eigen::VectorXd declared = held_out(data, data.torque - data.declared, data.common, sigma);
  const Eigen::VectorXd identified = held_out(data, data.torque, data.rigid, sigma);
  return {.declared = std::sqrt(declared.mean()),
          .identified = std::sqrt(identified.mean()),
          .t = paired_t(declared, identified)};
}

Eigen::VectorXd identified_bodies(const BaseData& data, const Eigen::VectorXd& sigma) {
  Eigen::MatrixXd load = data.load;
  Eigen::VectorXd bodies;
  for (int step = 0; step < kLoadSteps; ++step) {
    bodies = bodies_beside(data, load, sigma);
    const Eigen::MatrixXd last = std::exchange(load, load_of(data, bodies));
    if ((load - last).norm() <= kSameLoad * load.norm()) break;
  }
  return bodies;
}

}  // namespace kinescope::effects
