// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/pair_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "kinematics/structure/linear_motion.h"
#include "kinematics/structure/residual_scale.h"
#include "kinematics/structure/wide_turn.h"

namespace kinescope::structure_search {
namespace {

constexpr std::size_t kFewestOfAPair = 12;

struct PairMotion {
  Motion motion;
  double log_det = 0.0;  // a sample: ln det of the covariances over those of either body alone
};

double log_det_of(const Matrix6d& whitening) {
  return -2.0 * whitening.diagonal().array().abs().log().sum();
}

PairMotion pair_motion(const Series& series, int first, int second, int stride) {
  PairMotion out;
  const auto& b = series.bodies[static_cast<std::size_t>(second)].at;
  for (int i = 0; i < series.size(); i += stride) {
    const auto at = static_cast<std::size_t>(i);
    const Sighting& child = b[at];
    if (!child.seen) continue;
    MotionSample sample;
    sample.instant = i;
    sample.pose = child.pose;
    sample.whitening = child.whitening;
    if (first >= 0) {
      const Sighting& parent = series.bodies[static_cast<std::size_t>(first)].at[at];
      if (!parent.seen) continue;
      sample.pose = parent.pose.inverse() * child.pose;
      const Matrix6d ad = adjoint(sample.pose.inverse());
      sample.whitening = whitening_of(child.covariance + ad * parent.covariance * ad.transpose());
      out.log_det += log_det_of(sample.whitening) -
                     0.5 * (log_det_of(child.whitening) + log_det_of(parent.whitening));
    }
    out.motion.push_back(std::move(sample));
  }
  out.log_det /= std::max<double>(1.0, static_cast<double>(out.motion.size()));
  return out;
}

// Increments carry the noise of two samples.
void use_increments(const Motion& motion, const LinearMotion& linear, BodyPair& pair) {
  const auto n = static_cast<Eigen::Index>(motion.size()) - 1;
  pair.y.resize(6, n);
  pair.from.clear();
  pair.to.clear();
  for (Eigen::Index i = 0; i < n; ++i) {
    const MotionSample& a = motion[static_cast<std::size_t>(i)];
    const MotionSample& b = motion[static_cast<std::size_t>(i) + 1];
    pair.y.col(i) = linear.whitening * log_pose(a.pose.inverse() * b.pose) / std::sqrt(2.0);
    pair.from.push_back(a.instant);
    pair.to.push_back(b.instant);
  }
}

double free_cost_of(const Series& series, int body, int stride) {
  const Motion motion = pair_motion(series, -1, body, stride).motion;
  return free_motion_cost(linear_motion(motion)) / static_cast<double>(motion.size());
}

// The part of a pair that the log covers at one offset.
struct Covered {
  Eigen::MatrixXd y;  // 6 x samples, centred
  Eigen::MatrixXd q;  // samples x channels, centred
};

Covered covered_part(const BodyPair& pair, const Readings& readings) {
  std::vector<Eigen::Index> rows;
  const auto valid = [&](int instant) {
    return instant < 0 || readings.valid[static_cast<std::size_t>(instant)] != 0;
  };
  for (std::size_t i = 0; i < pair.to.size(); ++i) {
    if (valid(pair.from[i]) && valid(pair.to[i])) rows.push_back(static_cast<Eigen::Index>(i));
  }
  const auto n = static_cast<Eigen::Index>(rows.size());
  Covered c{Eigen::MatrixXd(6, n), Eigen::MatrixXd(n, readings.value.cols())};
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto row = static_cast<std::size_t>(rows[static_cast<std::size_t>(i)]);
    c.y.col(i) = pair.y.col(static_cast<Eigen::Index>(row));
    c.q.row(i) = readings.value.row(pair.to[row]);
    if (pair.from[row] >= 0) c.q.row(i) -= readings.value.row(pair.from[row]);
  }
  if (n == 0) return c;
  c.y.colwise() -= Vector6d(c.y.rowwise().mean());
  c.q.rowwise() -= Eigen::RowVectorXd(c.q.colwise().mean());
  return c;
}

ResidualParts split_residuals(const Eigen::MatrixXd& residual, const Vector6d& along) {
  ResidualParts parts;
  parts.split = along.squaredNorm() > 0.0;
  for (Eigen::Index i = 0; i < residual.cols(); ++i) {
    const double a = along.dot(residual.col(i));
    parts.along.push_back(a);
    parts.across.push_back(std::max(0.0, residual.col(i).squaredNorm() - a * a));
    parts.penalty.push_back(0.0);
  }
  return parts;
}

// Robust cost of y regressed on one channel: a second pass gives outliers no say in the slope.
double regression_cost(const Eigen::MatrixXd& y, const Eigen::VectorXd& q) {
  Eigen::VectorXd weight = Eigen::VectorXd::Ones(q.size());
  double cost = 0.0;
  for (int pass = 0; pass < 2; ++pass) {
    const double total = weight.sum();
    const Vector6d y_mean = y * weight / total;
    const Eigen::VectorXd centred = q.array() - q.dot(weight) / total;
    const Eigen::VectorXd weighted = centred.cwiseProduct(weight);
    const Vector6d slope = y * weighted / std::max(1e-300, weighted.dot(centred));
    const Eigen::MatrixXd residual = (y.colwise() - y_mean) - slope * centred.transpose();
    const ResidualParts parts = split_residuals(residual, slope.normalized());
    const ResidualScale scale = residual_scale(parts);
    if (pass == 0 || scale.cost < cost) cost = scale.cost;
    const std::vector<double> robust = robust_weights(parts, scale);
    weight = Eigen::Map<const Eigen::VectorXd>(robust.data(), q.size()).cwiseMax(1e-6);
  }
  return cost;
}

// -2 ln likelihood a sample of the pair with its best channel, or at rest.
double pair_cost(const BodyPair& pair, const Readings& readings) {
  const Covered c = covered_part(pair, readings);
  const auto n = static_cast<int>(c.y.cols());
  if (n < static_cast<int>(kFewestOfAPair)) return pair.free_cost;
  const Matrix6d G = c.y * c.y.transpose();
  const Eigen::MatrixXd B = c.y * c.q;
  Eigen::Index best = -1;
  double least = 0.0;
  for (Eigen::Index k = 0; k < c.q.cols(); ++k) {
    const double qq = c.q.col(k).squaredNorm();
    if (qq < 1e-6 * n) continue;
    const Vector6d u = B.col(k).normalized();
    const double total = u.dot(G * u);
    const double cost = split_cost(std::max(0.0, total - B.col(k).squaredNorm() / qq),
                                   std::max(0.0, G.trace() - total), n);
    if (best >= 0 && cost >= least) continue;
    least = cost;
    best = k;
  }
  double cost = residual_scale(split_residuals(c.y, Vector6d::Zero())).cost;
  if (best >= 0) cost = std::min(cost, regression_cost(c.y, c.q.col(best)));
  return cost / n;
}

int root_of(std::vector<int>& parent, int i) {
  while (parent[static_cast<std::size_t>(i)] != i) i = parent[static_cast<std::size_t>(i)];
  return i;
}

}  // namespace

std::vector<BodyPair> body_pairs(const Series& series, int most_instants) {
  const int stride = std::max(1, (series.size() + most_instants - 1) / most_instants);
  std::vector<BodyPair> pairs;
  std::vector<double> free;
  const int bodies = static_cast<int>(series.bodies.size());
  for (int b = 0; b < bodies; ++b) {
    const bool seen = series.bodies[static_cast<std::size_t>(b)].seen > 0;
    free.push_back(seen ? free_cost_of(series, b, stride) : 0.0);
  }
  for (int second = 0; second < bodies; ++second) {
    for (int first = -1; first < second; ++first) {
      const PairMotion relative = pair_motion(series, first, second, stride);
      if (relative.motion.size() < kFewestOfAPair) continue;
      const LinearMotion linear = linear_motion(relative.motion);
      const double own = free[static_cast<std::size_t>(second)];
      const double other = first < 0 ? own : free[static_cast<std::size_t>(first)];
      BodyPair pair{first, second, linear.y, {}, {}, 0.5 * (own + other) - relative.log_det};
      for (const MotionSample& s : relative.motion) pair.to.push_back(s.instant);
      pair.from.assign(pair.to.size(), -1);
      if (linear.widest > kWideTurn) use_increments(relative.motion, linear, pair);
      pairs.push_back(std::move(pair));
    }
  }
  return pairs;
}

PairTree pair_tree(const std::vector<BodyPair>& pairs, std::size_t bodies,
                   const Readings& readings) {
  struct Gain {
    double cost = 0.0;  // of the pair over free bodies
    double a_sample = 0.0;
    std::size_t pair = 0;
  };
  std::vector<Gain> gains;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const double a_sample = pair_cost(pairs[p], readings);
    const auto samples = static_cast<double>(pairs[p].to.size());
    gains.push_back({samples * (a_sample - pairs[p].free_cost), a_sample, p});
  }
  std::ranges::stable_sort(gains, {}, &Gain::cost);
  // Kruskal 1956; node 0 is the camera.
  std::vector<int> parent(bodies + 1);
  std::iota(parent.begin(), parent.end(), 0);
  PairTree tree;
  for (const Gain& gain : gains) {
    if (gain.cost >= 0.0) break;
    const BodyPair& pair = pairs[gain.pair];
    const int a = root_of(parent, pair.first + 1);
    const int b = root_of(parent, pair.second + 1);
    if (a == b) continue;
    parent[static_cast<std::size_t>(a)] = b;
    tree.edges.push_back({pair.first, pair.second, gain.a_sample});
    tree.gain -= gain.cost;
  }
  return tree;
}

std::vector<double> likely_costs(const PairTree& tree, std::size_t bodies) {
  // A link's path is exact, while the noise of a partner hides errors of the model.
  constexpr double kMargin = 12.0;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  std::vector<double> costs(bodies, -kInfinity);
  for (const PairEdge& edge : tree.edges) {
    for (const int body : {edge.first, edge.second}) {
      if (body < 0) continue;
      double& cost = costs[static_cast<std::size_t>(body)];
      cost = std::max(cost, edge.cost + kMargin);
    }
  }
  std::ranges::replace(costs, -kInfinity, kInfinity);
  return costs;
}

}  // namespace kinescope::structure_search
