// SPDX-License-Identifier: Apache-2.0
//
// The scan for the offset between the frames' clock and the log's. For a pair of neighbouring
// bodies the logarithm of their relative pose is linear in one channel (few, when coupled) at the
// right offset and at no other, so the offset is where the bodies' best regressions are best
// together.
#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "kinematics/structure/linear_motion.h"
#include "kinematics/structure/readings.h"

namespace kinescope::structure_search {
namespace {

constexpr double kCoarsestStep = 0.1;  // s
constexpr double kFinestStep = 0.02;   // s
constexpr int kMostInstants = 160;
// How much better (-2 ln likelihood) than no offset the best one has to be.
constexpr double kClearly = 25.0;

struct Pair {
  int first = -1;  // body; -1: the camera
  int second = 0;
  LinearMotion linear;
  std::vector<int> instants;
};

Motion pair_motion(const Series& series, int first, int second) {
  Motion motion;
  const auto& b = series.bodies[static_cast<std::size_t>(second)].at;
  for (int i = 0; i < series.size(); ++i) {
    const Sighting& child = b[static_cast<std::size_t>(i)];
    if (!child.seen) continue;
    MotionSample sample;
    sample.instant = i;
    sample.pose = child.pose;
    sample.whitening = child.whitening;
    if (first >= 0) {
      const Sighting& parent =
          series.bodies[static_cast<std::size_t>(first)].at[static_cast<std::size_t>(i)];
      if (!parent.seen) continue;
      sample.pose = parent.pose.inverse() * child.pose;
      const Matrix6d ad = adjoint(sample.pose.inverse());
      sample.whitening = whitening_of(child.covariance + ad * parent.covariance * ad.transpose());
    }
    motion.push_back(std::move(sample));
  }
  return motion;
}

std::vector<Pair> moving_pairs(const Series& series) {
  std::vector<Pair> pairs;
  const int bodies = static_cast<int>(series.bodies.size());
  for (int second = 0; second < bodies; ++second) {
    for (int first = -1; first < bodies; ++first) {
      if (first == second) continue;
      const Motion motion = pair_motion(series, first, second);
      if (motion.size() < 12) continue;
      Pair p{first, second, linear_motion(motion), {}};
      for (const MotionSample& s : motion) p.instants.push_back(s.instant);
      pairs.push_back(std::move(p));
    }
  }
  return pairs;
}

// -2 ln likelihood per sample of the pair with its best channel.
double pair_cost(const Pair& pair, const Readings& readings) {
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < pair.instants.size(); ++i) {
    if (readings.valid[static_cast<std::size_t>(pair.instants[i])] != 0) {
      rows.push_back(static_cast<Eigen::Index>(i));
    }
  }
  const auto n = static_cast<Eigen::Index>(rows.size());
  if (n < 12) return std::nan("");
  Eigen::MatrixXd y(6, n);
  Eigen::MatrixXd q(n, readings.value.cols());
  for (Eigen::Index i = 0; i < n; ++i) {
    y.col(i) = pair.linear.y.col(rows[static_cast<std::size_t>(i)]);
    q.row(i) = readings.value.row(
        pair.instants[static_cast<std::size_t>(rows[static_cast<std::size_t>(i)])]);
  }
  y.colwise() -= Vector6d(y.rowwise().mean());
  q.rowwise() -= Eigen::RowVectorXd(q.colwise().mean());
  const Matrix6d G = y * y.transpose();
  const Eigen::MatrixXd B = y * q;
  double best = split_cost(0.0, G.trace(), static_cast<int>(n));
  for (Eigen::Index k = 0; k < q.cols(); ++k) {
    const double qq = q.col(k).squaredNorm();
    if (qq < 1e-6 * static_cast<double>(n)) continue;
    const Vector6d u = B.col(k).normalized();
    const double total = u.dot(G * u);
    const double cost = split_cost(std::max(0.0, total - B.col(k).squaredNorm() / qq),
                                   std::max(0.0, G.trace() - total), static_cast<int>(n));
    best = std::min(best, cost);
  }
  return best / static_cast<double>(n);
}

// Sum over bodies of their best pair.
double total_cost(const std::vector<Pair>& pairs, const Series& series, const Readings& readings) {
  std::vector<double> best(series.bodies.size(), std::nan(""));
  for (const Pair& pair : pairs) {
    const double cost =
        pair_cost(pair, readings) * series.bodies[static_cast<std::size_t>(pair.second)].seen;
    double& b = best[static_cast<std::size_t>(pair.second)];
    if (std::isnan(b) || cost < b) b = cost;
  }
  double sum = 0.0;
  for (const double b : best) sum += std::isnan(b) ? 0.0 : b;
  return sum;
}

// A fraction of the time in which the fastest channel changes.
double scan_step(const Readings& readings) {
  double fastest = 0.0;
  for (Eigen::Index c = 0; c < readings.value.cols(); ++c) {
    if (!readings.moves(static_cast<int>(c))) continue;
    const double n = static_cast<double>(std::max<Eigen::Index>(1, readings.rate.rows()));
    fastest = std::max(fastest, std::sqrt(readings.rate.col(c).squaredNorm() / n));
  }
  return fastest > 0.0 ? std::clamp(0.25 / fastest, kFinestStep, kCoarsestStep) : kCoarsestStep;
}

}  // namespace

double scan_time_offset(const Series& series, const JointLog& log, double half_width_s,
                        double max_gap_s) {
  const Series thin = thinned(series, kMostInstants);
  const std::vector<Pair> pairs = moving_pairs(thin);
  const double step = scan_step(readings_at(log, thin, 0.0, max_gap_s));
  const int steps = static_cast<int>(std::floor(half_width_s / step));
  std::vector<double> cost;
  for (int s = -steps; s <= steps; ++s) {
    cost.push_back(total_cost(pairs, thin, readings_at(log, thin, s * step, max_gap_s)));
  }
  const auto best = static_cast<int>(std::ranges::min_element(cost) - cost.begin());
  if (cost[static_cast<std::size_t>(best)] > cost[static_cast<std::size_t>(steps)] - kClearly)
    return 0.0;
  double shift = 0.0;
  if (best > 0 && best < 2 * steps) {
    const double left = cost[static_cast<std::size_t>(best - 1)];
    const double right = cost[static_cast<std::size_t>(best + 1)];
    const double curvature = left - 2.0 * cost[static_cast<std::size_t>(best)] + right;
    if (curvature > 0.0) shift = std::clamp(0.5 * (left - right) / curvature, -0.5, 0.5);
  }
  return (best - steps + shift) * step;
}

}  // namespace kinescope::structure_search
