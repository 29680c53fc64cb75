// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/first_look.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/structure/linear_motion.h"
#include "kinematics/structure/residual_scale.h"
#include "kinematics/structure/rest.h"
#include "kinematics/structure/tangent.h"
#include "kinematics/structure/wide_turn.h"

namespace kinescope::structure_search {
namespace {

constexpr int kSamples = 64;
// With fewer samples than this there is nothing to be saved.
constexpr std::size_t kFewest = 32;
// What is left across the joint is hopeless above this variance over the declared one, and
constexpr double kHopelessAtFirst = 100.0;
// above this part of the motion's variance.
constexpr double kHopelessShareAtFirst = 0.04;
// Channels that get a robust regression, best first.
constexpr std::size_t kMostChannels = 4;

// Rows of a motion that are linear in the channel that drives it: logarithms about the mean pose
// or, where the turn is too wide for one, from each sample to the next.
struct Rows {
  Eigen::MatrixXd y;   // 6 x samples, whitened alike
  Eigen::MatrixXd q;   // samples x channels
  double noise = 1.0;  // variance that the samples' own noise has so
};

double median(Eigen::ArrayXd values) {
  double* middle = values.data() + values.size() / 2;
  std::nth_element(values.data(), middle, values.data() + values.size());
  return *middle;
}

// A marker that turns before the camera is seen well along ever other directions.
double noise_in(const Matrix6d& whitening, const Motion& motion) {
  Eigen::ArrayXd variance(std::ssize(motion));
  for (Eigen::Index i = 0; i < variance.size(); ++i) {
    const Matrix6d& own = motion[static_cast<std::size_t>(i)].whitening;
    variance[i] =
        own.triangularView<Eigen::Upper>().solve<Eigen::OnTheRight>(whitening).squaredNorm() / 6.0;
  }
  return std::max(1.0, median(std::move(variance)));
}

Rows rows_of(const Motion& motion, const Eigen::MatrixXd& readings) {
  const LinearMotion linear = linear_motion(motion);
  const auto n = static_cast<Eigen::Index>(motion.size());
  Rows rows{linear.y, Eigen::MatrixXd(n, readings.cols()), noise_in(linear.whitening, motion)};
  for (Eigen::Index i = 0; i < n; ++i) {
    rows.q.row(i) = readings.row(motion[static_cast<std::size_t>(i)].instant);
  }
  if (linear.widest <= kWideTurn) return rows;
  // Increments carry the noise of two samples.
  rows.q = (rows.q.bottomRows(n - 1) - rows.q.topRows(n - 1)).eval() / std::sqrt(2.0);
  rows.y.resize(6, n - 1);
  for (Eigen::Index i = 0; i + 1 < n; ++i) {
    const auto at = static_cast<std::size_t>(i);
    rows.y.col(i) = linear.whitening * fast_log(motion[at].pose.inverse() * motion[at + 1].pose) /
                    std::sqrt(2.0);
  }
  return rows;
}

// Weights that leave out what lies far from most.
Eigen::ArrayXd robust(const Eigen::ArrayXd& squared) {
  const double knee = 9.0 * std::max(1e-300, median(squared));
  return (knee / (knee + squared)).square();
}

constexpr int kWeightPasses = 3;

// Median variance across the slope of the rows regressed on one channel.
double left_by_channel(const Eigen::MatrixXd& y, const Eigen::VectorXd& q) {
  Eigen::ArrayXd weight = Eigen::ArrayXd::Ones(q.size());
  double left = 0.0;
  for (int pass = 0; pass < kWeightPasses; ++pass) {
    const double total = weight.sum();
    const Vector6d y_mean = y * weight.matrix() / total;
    const Eigen::VectorXd centred = q.array() - q.dot(weight.matrix()) / total;
    const Eigen::VectorXd weighted = centred.array() * weight;
    const Vector6d slope = y * weighted / std::max(1e-300, weighted.dot(centred));
    const Eigen::Matrix<double, 6, Eigen::Dynamic> r =
        (y.colwise() - y_mean) - slope * centred.transpose();
    const Eigen::ArrayXd squared = r.colwise().squaredNorm().transpose();
    const Eigen::ArrayXd along = r.transpose() * slope.normalized();
    left = median(squared - along.square()) / kMedian5;
    weight = robust(squared);
  }
  return left;
}

// The same across the direction in which most of the motion is.
double left_by_principal(const Eigen::MatrixXd& y) {
  Eigen::ArrayXd weight = Eigen::ArrayXd::Ones(y.cols());
  double left = 0.0;
  for (int pass = 0; pass < kWeightPasses; ++pass) {
    const Vector6d mean = y * weight.matrix() / weight.sum();
    const Eigen::Matrix<double, 6, Eigen::Dynamic> r = y.colwise() - mean;
    const Matrix6d G = r * weight.matrix().asDiagonal() * r.transpose();
    const Vector6d u = symmetric_eigen(G).vectors.col(5);
    const Eigen::ArrayXd along = r.transpose() * u;
    const Eigen::ArrayXd across = r.colwise().squaredNorm().transpose().array() - along.square();
    left = median(across) / kMedian5;
    weight = robust(across);
  }
  return left;
}

// Channels by what least squares on each leave, best first.
std::vector<Eigen::Index> best_channels(const Rows& rows, const std::vector<char>& usable) {
  const Eigen::MatrixXd y = rows.y.colwise() - Vector6d(rows.y.rowwise().mean());
  const Eigen::MatrixXd q = rows.q.rowwise() - Eigen::RowVectorXd(rows.q.colwise().mean());
  const Eigen::MatrixXd B = y * q;
  std::vector<std::pair<double, Eigen::Index>> gains;
  for (Eigen::Index c = 0; c < q.cols(); ++c) {
    const double qq = q.col(c).squaredNorm();
    if (usable[static_cast<std::size_t>(c)] == 0 || !(qq > 0.0)) continue;
    gains.emplace_back(-B.col(c).squaredNorm() / qq, c);
  }
  std::ranges::sort(gains);
  std::vector<Eigen::Index> out;
  for (std::size_t k = 0; k < std::min(kMostChannels, gains.size()); ++k) {
    out.push_back(gains[k].second);
  }
  return out;
}

// Variance across the joint with which a sample costs so much at least, and as much again for the
// errors of few samples.
double variance_of_cost(double cost) {
  constexpr double kCostOfNoise = 6.0;
  constexpr double kSlack = 2.0;
  return kSlack * std::exp(std::max(0.0, cost - kCostOfNoise) / 5.0);
}

bool may_hang(const Motion& motion, const Readings& readings, const std::vector<char>& usable,
              double give_up_above) {
  const Rows rows = rows_of(motion, readings.value);
  const Eigen::MatrixXd centred = rows.y.colwise() - Vector6d(rows.y.rowwise().mean());
  const double spread = median(centred.colwise().squaredNorm().transpose()) / kMedian6;
  const double limit =
      rows.noise * std::min(variance_of_cost(give_up_above),
                            std::max(kHopelessAtFirst, kHopelessShareAtFirst * spread));
  if (spread < limit || left_by_principal(rows.y) < limit) return true;
  return std::ranges::any_of(best_channels(rows, usable), [&](Eigen::Index c) {
    return left_by_channel(rows.y, rows.q.col(c)) < limit;
  });
}

}  // namespace

FirstLook first_look(const Body& body, const LinkPath& path, const Readings& readings,
                     const std::vector<char>& usable, double give_up_above) {
  const Motion motion = relative_motion(body, path, readings, kSamples).motion;
  if (motion.size() < kFewest) return {};
  return {may_hang(motion, readings, usable, give_up_above), may_rest(motion, body)};
}

}  // namespace kinescope::structure_search
