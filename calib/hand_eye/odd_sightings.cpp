// SPDX-License-Identifier: Apache-2.0
#include "calib/hand_eye/odd_sightings.h"

#include <cmath>

#include "kinematics/core/chi_square.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/median.h"

namespace kinescope::hand_eye {
namespace {

constexpr std::size_t kFewestTargets = 3;

// Mean square of each sighting's rows, once the flange is where most of its frame's say.
std::vector<double> squares_beside_others(const Frame& frame, const FrameRows& rows) {
  constexpr int kRounds = 20;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(rows.residual.size());
  std::vector<double> out(frame.sightings.size(), 0.0);
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::MatrixXd G = weights.cwiseSqrt().asDiagonal() * rows.by_flange;
    const Eigen::MatrixXd r = -weights.cwiseSqrt().cwiseProduct(rows.residual);
    const Eigen::VectorXd left = rows.residual + rows.by_flange * least_squares(G, r).col(0);
    Eigen::Index row = 0;
    for (std::size_t s = 0; s < out.size(); ++s) {
      const Eigen::Index n = rows.errors[s].residual.size();
      out[s] = left.segment(row, n).squaredNorm() / static_cast<double>(n);
      row += n;
    }
    const double usual = median_of(out);
    row = 0;
    for (std::size_t s = 0; s < out.size(); ++s) {
      const Eigen::Index n = rows.errors[s].residual.size();
      weights.segment(row, n).setConstant(usual > 0.0 ? 1.0 / (1.0 + out[s] / usual) : 1.0);
      row += n;
    }
  }
  return out;
}

}  // namespace

CleanedData without_odd_sightings(const Model& model, const Fit& fit, double sigma) {
  std::vector<std::vector<double>> squares(model.data().frames.size());
  std::vector<double> all;
  for (std::size_t f = 0; f < squares.size(); ++f) {
    const Frame& frame = model.data().frames[f];
    if (!fit.rows[f] || frame.sightings.size() < kFewestTargets) continue;
    squares[f] = squares_beside_others(frame, *fit.rows[f]);
    all.insert(all.end(), squares[f].begin(), squares[f].end());
  }
  CleanedData out{model.data(), 0};
  const double usual = median_of(all);
  for (std::size_t f = 0; f < squares.size(); ++f) {
    std::vector<bundle::Sighting> kept;
    for (std::size_t s = 0; s < squares[f].size(); ++s) {
      const auto n = static_cast<double>(fit.rows[f]->errors[s].residual.size());
      const double most = chi_square_quantile(n, sigma) / chi_square_quantile(n, 0.0);
      if (squares[f][s] <= most * usual) {
        kept.push_back(out.data.frames[f].sightings[s]);
      } else {
        ++out.left_out;
      }
    }
    if (!squares[f].empty() && !kept.empty()) out.data.frames[f].sightings = std::move(kept);
  }
  return out;
}

}  // namespace kinescope::hand_eye
