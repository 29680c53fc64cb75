// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "calib/trace/distribution.h"
#include "calib/trace/own_space.h"
#include "calib/trace/smoothness.h"
#include "kinematics/core/dense_algebra.h"

namespace kinescope::trace {
namespace {

constexpr int kMostNodes = 240;  // of a component
constexpr int kRowsANode = 16;   // fewer nodes where few rows judge them
// Smoothness, in spacings of the grid: what is finer the grid does not show.
constexpr std::array<double, 4> kFieldLengths{1.0, 2.0, 4.0, 8.0};
constexpr double kFieldVarianceStep = 0.5;  // decades
constexpr int kFieldNoiseSteps = 6;
constexpr double kMostWidening = 100.0;
// Of the directions of the field the data show those by more than this part of their prior, and at
// most so many are kept.
constexpr double kShown = 0.05;
constexpr Eigen::Index kMostDirections = 150;

FieldGrid grid_of(const Linearisation& linear, const RestField& field) {
  const auto rows = static_cast<int>(linear.residual.size());
  return make_field_grid(linear, field, std::min(kMostNodes, rows / kRowsANode));
}

// What the rows say about the nodes' values, the model's own parameters taken out.
struct FieldEvidence {
  OwnSpace own;
  Eigen::MatrixXd QE;        // own basis x nodes' values: their products
  Eigen::VectorXd residual;  // rows, after the model's own step
  Eigen::MatrixXd S;
  Eigen::VectorXd score;
  double freedom = 0.0;  // rows beyond the model's own parameters

  // The rows' values less what the model's own parameters can do of them.
  [[nodiscard]] Eigen::VectorXd freed(const Eigen::VectorXd& rows) const {
    return rows - own.basis() * own.solve(own.basis().transpose() * rows);
  }
};

FieldEvidence gather(const NormalSystem& system, const FieldGrid& grid) {
  const Linearisation& linear = system.linear();
  FieldEvidence out{OwnSpace(system), {}, {}, {}, {}, 0.0};
  out.QE = (grid.columns.transpose() * out.own.basis()).transpose();
  out.residual = out.freed(linear.residual);
  const Eigen::SparseMatrix<double> EE = grid.columns.transpose() * grid.columns;
  out.S = -out.QE.transpose() * out.own.solve(out.QE);
  out.S += EE;
  out.score = grid.columns.transpose() * out.residual;
  out.freedom = system.freedom();
  return out;
}

// Nodes x stretches: what each stretch says of the field, E' residual.
Eigen::MatrixXd by_stretch(const NormalSystem& system, const FieldGrid& grid,
                           const Eigen::VectorXd& residual) {
  const Linearisation& linear = system.linear();
  const Partition& partition = system.partition();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(grid.columns.cols(), partition.stretches);
  for (std::size_t i = 0; i < partition.stretch.size(); ++i) {
    const int stretch = partition.stretch[i];
    for (Eigen::Index row = linear.first_row[i]; row < linear.first_row[i + 1]; ++row) {
      using Entries = Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator;
      for (Entries entry(grid.columns, row); entry; ++entry) {
        out(entry.col(), stretch) += entry.value() * residual[row];
      }
    }
  }
  return out;
}

// The same freed of what the model's own parameters can do.
Eigen::MatrixXd projected_by_stretch(const NormalSystem& system, const FieldGrid& grid,
                                     const FieldEvidence& evidence) {
  const Linearisation& linear = system.linear();
  const Partition& partition = system.partition();
  const Eigen::MatrixXd& basis = evidence.own.basis();
  Eigen::MatrixXd own = Eigen::MatrixXd::Zero(basis.cols(), partition.stretches);
  for (std::size_t i = 0; i < partition.stretch.size(); ++i) {
    const Eigen::Index first = linear.first_row[i];
    const Eigen::Index rows = linear.first_row[i + 1] - first;
    own.col(partition.stretch[i]).noalias() +=
        basis.middleRows(first, rows).transpose() * evidence.residual.segment(first, rows);
  }
  return by_stretch(system, grid, evidence.residual) -
         evidence.QE.transpose() * evidence.own.solve(own);
}

Smoothness diagonalise(const FieldGrid& grid, const FieldEvidence& evidence, double length) {
  const Eigen::Index n = grid.nodes.rows();
  const Eigen::MatrixXd factor = CholeskyFactor(grid.correlation(length)).lower();
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  L.topLeftCorner(n, n) = factor;
  L.bottomRightCorner(n, n) = factor;
  const SymmetricEigen eigen = symmetric_eigen(L.transpose() * evidence.S * L);
  Smoothness out;
  out.length = length;
  out.directions = L * eigen.vectors;
  out.shown = eigen.values.cwiseMax(0.0);
  out.score = out.directions.transpose() * evidence.score;
  return out;
}

// Of a whitened row, when the field that it makes likeliest is taken away: the noise and the field
// in turn.
double noise_without_field(const std::vector<Smoothness>& all, const FieldEvidence& evidence) {
  const double whole = evidence.residual.squaredNorm();
  double noise = whole / evidence.freedom;
  for (int i = 0; i < kFieldNoiseSteps; ++i) {
    noise = noise_beside(likeliest_smoothness(all, noise, kFieldVarianceStep), noise, whole,
                         evidence.freedom);
  }
  return noise;
}

// By how much what stretches say about single nodes scatters more than white noise lets it.
double widening(const NormalSystem& system, const FieldGrid& grid, const FieldEvidence& evidence,
                const Eigen::VectorXd& nodes, double noise) {
  const Eigen::VectorXd residual = evidence.residual - evidence.freed(grid.columns * nodes);
  const Eigen::VectorXd scatter = by_stretch(system, grid, residual).rowwise().squaredNorm();
  Eigen::VectorXd information = Eigen::VectorXd::Zero(scatter.size());
  for (Eigen::Index row = 0; row < grid.columns.rows(); ++row) {
    using Entries = Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator;
    for (Entries entry(grid.columns, row); entry; ++entry) {
      information[entry.col()] += entry.value() * entry.value();
    }
  }
  const double ratio = (scatter.array() / information.array().max(1e-300)).mean();
  return std::clamp(ratio / std::max(noise, 1e-300), 1.0, kMostWidening);
}

FieldMap map_of(const FieldGrid& grid, const SmoothnessChoice& choice, double noise) {
  const Smoothness& s = *choice.smoothness;
  const Eigen::Index n = grid.nodes.rows();
  const Eigen::VectorXd mean = s.directions * mean_of(choice, noise);
  const Eigen::VectorXd variance =
      choice.variance / (1.0 + choice.variance / noise * s.shown.array());
  const Eigen::VectorXd sigma = (s.directions.cwiseAbs2() * variance).cwiseSqrt();
  FieldMap out;
  out.at = grid.nodes;
  out.mean = mean.reshaped(n, 2);
  out.sigma = sigma.reshaped(n, 2);
  out.spacing = grid.spacing;
  return out;
}

// Root mean square of what takes `gain` from the sum of squares, over the rows that it touches.
double shift_of(const Linearisation& linear, const FieldGrid& grid, double gain) {
  double weight = 0.0;
  for (Eigen::Index row = 0; row < grid.columns.rows(); ++row) {
    const bool touched = grid.columns.outerIndexPtr()[row + 1] > grid.columns.outerIndexPtr()[row];
    if (touched && linear.unit[row] > 0.0) weight += 1.0 / (linear.unit[row] * linear.unit[row]);
  }
  return weight > 0.0 ? std::sqrt(std::max(0.0, gain) / weight) : 0.0;
}

// The field as columns of the model: the directions that the data show, the prior's information on
// each beside whitened rows.
FoundRest fit_field(const NormalSystem& system, const FieldGrid& grid,
                    const FieldEvidence& evidence, const RestField& field) {
  std::vector<Smoothness> all;
  for (const double length : kFieldLengths) {
    if (length * grid.spacing > grid.extent) break;
    all.push_back(diagonalise(grid, evidence, length * grid.spacing));
  }
  const double white = noise_without_field(all, evidence);
  const SmoothnessChoice first = likeliest_smoothness(all, white, kFieldVarianceStep);
  const Eigen::VectorXd nodes = first.smoothness->directions * mean_of(first, white);
  const double noise = white * widening(system, grid, evidence, nodes, white);
  const SmoothnessChoice choice = likeliest_smoothness(all, noise, kFieldVarianceStep);
  const Smoothness& s = *choice.smoothness;
  // Eigenvalues grow.
  Eigen::Index kept = 0;
  while (kept < std::min(kMostDirections, s.shown.size()) &&
         choice.variance * s.shown[s.shown.size() - 1 - kept] > kShown * noise) {
    ++kept;
  }
  FoundRest out;
  out.rows = grid.columns * (s.directions.rightCols(kept) * std::sqrt(choice.variance));
  out.prior = noise * Eigen::MatrixXd::Identity(kept, kept);
  out.rest.place = field.name;
  out.rest.unit = field.unit;
  out.rest.covariate = field.covariate;
  out.rest.covariate_unit = field.covariate_unit;
  out.rest.field = map_of(grid, choice, noise);
  return out;
}

// See field_p_value().
double p_value_of(const NormalSystem& system, const FieldGrid& grid,
                  const FieldEvidence& evidence) {
  const Eigen::Index n = grid.nodes.rows();
  const Eigen::MatrixXd scores = projected_by_stretch(system, grid, evidence);
  double best = 1.0;
  double tests = 0.0;
  for (const double length : kFieldLengths) {
    if (length * grid.spacing > grid.extent) break;
    const Eigen::MatrixXd K = grid.correlation(length * grid.spacing);
    Eigen::MatrixXd agreement = scores.topRows(n).transpose() * K * scores.topRows(n) +
                                scores.bottomRows(n).transpose() * K * scores.bottomRows(n);
    // Neighbouring stretches have noise in common.
    for (Eigen::Index s = 0; s < agreement.rows(); ++s) {
      for (Eigen::Index t = std::max<Eigen::Index>(0, s - 1);
           t <= std::min(s + 1, agreement.rows() - 1); ++t) {
        agreement(s, t) = 0.0;
      }
    }
    best =
        std::min(best, quadratic_form_survival(agreement.sum(), symmetric_eigenvalues(agreement)));
    tests += 1.0;
  }
  return std::min(1.0, best * tests);
}

}  // namespace

double field_p_value(const NormalSystem& system, const FieldGrid& grid) {
  return p_value_of(system, grid, gather(system, grid));
}

bool shows_field(const NormalSystem& system, const std::vector<RestField>& fields, double level) {
  return std::ranges::any_of(fields, [&](const RestField& field) {
    const FieldGrid grid = grid_of(system.linear(), field);
    return grid.nodes.rows() > 0 &&
           field_p_value(system, grid) * static_cast<double>(fields.size()) <= level;
  });
}

std::optional<FoundRest> find_field(const NormalSystem& system,
                                    const std::vector<RestField>& fields, double level) {
  std::optional<FoundRest> best;
  for (const RestField& field : fields) {
    const FieldGrid grid = grid_of(system.linear(), field);
    if (grid.nodes.rows() == 0) continue;
    const FieldEvidence evidence = gather(system, grid);
    const double p_value =
        std::min(1.0, p_value_of(system, grid, evidence) * static_cast<double>(fields.size()));
    if (p_value > level) continue;
    FoundRest found = fit_field(system, grid, evidence, field);
    found.rest.p_value = p_value;
    double gain = 0.0;
    if (found.rows.cols() == 0 || !earns_its_place(system, found, gain)) continue;
    if (shift_of(system.linear(), grid, gain) < field.floor) continue;
    const bool better = !best || found.rest.held_out_after.value < best->rest.held_out_after.value;
    if (better) best = std::move(found);
  }
  return best;
}

}  // namespace kinescope::trace
