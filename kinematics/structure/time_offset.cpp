// SPDX-License-Identifier: Apache-2.0
//
// The logarithm of the relative pose of two neighbouring bodies is linear in one channel at the
// right offset and at no other. Which bodies are neighbours is not known: every pair is regressed
// on every channel, and the pairs that tell most are joined to a tree (Chow and Liu 1968: the tree
// of pairs with the largest sum of mutual informations is the most likely one). Pairs enter by the
// likelihood of one body's sightings given the other's, so that a noisy partner explains nothing.
#include "kinematics/structure/time_offset.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "kinematics/structure/linear_motion.h"
#include "kinematics/structure/residual_scale.h"
#include "kinematics/structure/wide_turn.h"

namespace kinescope::structure_search {
namespace {

constexpr double kCoarsestStep = 0.1;  // s
constexpr double kFinestStep = 0.02;   // s
constexpr int kMostInstants = 160;
constexpr std::size_t kFewestSamples = 12;
// Minima that get a structure of their own.
constexpr std::size_t kMostLikely = 4;
constexpr double kDeep = 0.5;  // of the deepest, below the median

// The relative motion of two bodies in a form linear in the channel that drives it: logarithms
// about the mean pose or, where the turn is too wide for one, from each sample to the next.
struct Pair {
  int first = -1;  // body; -1: the camera
  int second = 0;
  Eigen::MatrixXd y;      // 6 x samples, whitened
  std::vector<int> from;  // instants; -1: from the mean
  std::vector<int> to;
  double free_cost = 0.0;  // -2 ln likelihood a sample, without any channel
};

struct PairMotion {
  Motion motion;
  double log_det = 0.0;  // a sample: ln det of the covariances over those of either body alone
};

double log_det_of(const Matrix6d& whitening) {
  return -2.0 * whitening.diagonal().array().abs().log().sum();
}

PairMotion pair_motion(const Series& series, int first, int second) {
  PairMotion out;
  const auto& b = series.bodies[static_cast<std::size_t>(second)].at;
  for (int i = 0; i < series.size(); ++i) {
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
void use_increments(const Motion& motion, const LinearMotion& linear, Pair& pair) {
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

double free_cost_of(const Series& series, int body) {
  const Motion motion = pair_motion(series, -1, body).motion;
  return free_motion_cost(linear_motion(motion)) / static_cast<double>(motion.size());
}

std::vector<Pair> all_pairs(const Series& series) {
  std::vector<Pair> pairs;
  std::vector<double> free;
  const int bodies = static_cast<int>(series.bodies.size());
  for (int b = 0; b < bodies; ++b) {
    const bool seen = series.bodies[static_cast<std::size_t>(b)].seen > 0;
    free.push_back(seen ? free_cost_of(series, b) : 0.0);
  }
  for (int second = 0; second < bodies; ++second) {
    for (int first = -1; first < second; ++first) {
      const PairMotion relative = pair_motion(series, first, second);
      if (relative.motion.size() < kFewestSamples) continue;
      const LinearMotion linear = linear_motion(relative.motion);
      const double own = free[static_cast<std::size_t>(second)];
      const double other = first < 0 ? own : free[static_cast<std::size_t>(first)];
      Pair pair{first, second, linear.y, {}, {}, 0.5 * (own + other) - relative.log_det};
      for (const MotionSample& s : relative.motion) pair.to.push_back(s.instant);
      pair.from.assign(pair.to.size(), -1);
      if (linear.widest > kWideTurn) use_increments(relative.motion, linear, pair);
      pairs.push_back(std::move(pair));
    }
  }
  return pairs;
}

// The part of a pair that the log covers at one offset.
struct Covered {
  Eigen::MatrixXd y;  // 6 x samples, centred
  Eigen::MatrixXd q;  // samples x channels, centred
};

Covered covered_part(const Pair& pair, const Readings& readings) {
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
double pair_cost(const Pair& pair, const Readings& readings) {
  const Covered c = covered_part(pair, readings);
  const auto n = static_cast<int>(c.y.cols());
  if (n < static_cast<int>(kFewestSamples)) return pair.free_cost;
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

// Minus the gain of the best tree over free bodies (Kruskal; node 0 is the camera).
double tree_cost_at(const std::vector<Pair>& pairs, std::size_t bodies, const Readings& readings) {
  std::vector<std::pair<double, std::size_t>> gains;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const auto samples = static_cast<double>(pairs[p].to.size());
    gains.emplace_back(samples * (pair_cost(pairs[p], readings) - pairs[p].free_cost), p);
  }
  std::ranges::sort(gains);
  std::vector<int> parent(bodies + 1);
  std::iota(parent.begin(), parent.end(), 0);
  double sum = 0.0;
  for (const auto& [cost, p] : gains) {
    if (cost >= 0.0) break;
    const int a = root_of(parent, pairs[p].first + 1);
    const int b = root_of(parent, pairs[p].second + 1);
    if (a == b) continue;
    parent[static_cast<std::size_t>(a)] = b;
    sum += cost;
  }
  return sum;
}

// Local minima by cost, down to half as deep below the usual cost as the best; the middle one (no
// offset) is always among them.
std::vector<int> minima_of(const std::vector<double>& cost) {
  std::vector<int> out;
  const auto n = static_cast<int>(cost.size());
  const auto at = [&](int s) { return cost[static_cast<std::size_t>(s)]; };
  for (int s = 0; s < n; ++s) {
    if ((s == 0 || at(s) <= at(s - 1)) && (s == n - 1 || at(s) < at(s + 1))) out.push_back(s);
  }
  std::ranges::stable_sort(out, {}, at);
  const double usual = median_of(cost);
  std::erase_if(out, [&](int s) { return usual - at(s) < kDeep * (usual - at(out.front())); });
  if (out.size() > kMostLikely) out.resize(kMostLikely);
  const bool agreeing = std::ranges::any_of(out, [&](int s) { return std::abs(s - n / 2) <= 1; });
  if (!agreeing) out.push_back(n / 2);
  return out;
}

// The minimum of the parabola through a minimum and its neighbours, in steps.
double vertex(const std::vector<double>& cost, int s) {
  if (s == 0 || s + 1 == static_cast<int>(cost.size())) return s;
  const auto at = static_cast<std::size_t>(s);
  const double curvature = cost[at - 1] - 2.0 * cost[at] + cost[at + 1];
  if (!(curvature > 0.0)) return s;
  return s + std::clamp(0.5 * (cost[at - 1] - cost[at + 1]) / curvature, -0.5, 0.5);
}

}  // namespace

double offset_step(const Readings& readings) {
  double fastest = 0.0;
  for (Eigen::Index c = 0; c < readings.value.cols(); ++c) {
    if (!readings.moves(static_cast<int>(c))) continue;
    const double n = static_cast<double>(std::max<Eigen::Index>(1, readings.rate.rows()));
    fastest = std::max(fastest, std::sqrt(readings.rate.col(c).squaredNorm() / n));
  }
  return fastest > 0.0 ? std::clamp(0.25 / fastest, kFinestStep, kCoarsestStep) : kCoarsestStep;
}

std::vector<double> scan_time_offsets(const Series& series, const JointLog& log, double step_s,
                                      double half_width_s, double max_gap_s) {
  const Series thin = thinned(series, kMostInstants);
  const std::vector<Pair> pairs = all_pairs(thin);
  const int steps = std::max(1, static_cast<int>(std::floor(half_width_s / step_s)));
  std::vector<double> cost;
  for (int s = -steps; s <= steps; ++s) {
    const Readings readings = readings_at(log, thin, s * step_s, max_gap_s);
    cost.push_back(tree_cost_at(pairs, thin.bodies.size(), readings));
  }
  std::vector<double> likely;
  for (const int s : minima_of(cost)) likely.push_back((vertex(cost, s) - steps) * step_s);
  return likely;
}

}  // namespace kinescope::structure_search
