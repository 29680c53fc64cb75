// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/screening.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/median.h"
#include "kinematics/structure/chain_residuals.h"
#include "kinematics/structure/line_regression.h"
#include "kinematics/structure/residual_scale.h"
#include "kinematics/structure/series.h"
#include "kinematics/structure/tangent.h"
#include "kinematics/structure/wide_turn.h"

namespace kinescope::structure_search {
namespace {

// Rotation slopes below this many standard deviations are no evidence for a turn.
constexpr double kTurnEvidence = 3.5;
// Cost beyond which, with one more a sample, a direction is not looked at any further.
constexpr double kFar = 100.0;
// Channels that tell most by least squares.
constexpr std::size_t kLeading = 2;

// What one direction of y explains: sums of squares along it after regression, and across it.
struct Direction {
  int channel = -1;
  Vector6d slope = Vector6d::Zero();  // whitened, per unit coordinate
  double cost = 0.0;
};

Direction driven_direction(const Matrix6d& G, const Vector6d& b, double qq, int channel,
                           int samples) {
  Direction d;
  d.channel = channel;
  d.slope = b / qq;
  const Vector6d u = b.normalized();
  const double total = u.dot(G * u);
  d.cost = split_cost(std::max(0.0, total - b.squaredNorm() / qq), std::max(0.0, G.trace() - total),
                      samples);
  return d;
}

Direction principal_direction(const Matrix6d& G, int samples) {
  const SymmetricEigen eigen = symmetric_eigen(G);
  Direction d;
  const double along = eigen.values(5);
  d.slope = eigen.vectors.col(5) * std::sqrt(along / samples);
  const double variance = along / samples;
  d.cost = split_cost(samples, std::max(0.0, G.trace() - along), samples) +
           samples * std::log(1.0 + variance);
  return d;
}

void add_candidate(const LinearMotion& linear, const LineFit& line, int channel, JointType type,
                   const Eigen::VectorXd& coordinate, std::vector<Candidate>& out) {
  const bool turns = type == JointType::kRevolute;
  const double scale = turns ? line.slope.head<3>().norm() : line.slope.tail<3>().norm();
  if (!(scale > 1e-12)) return;
  Candidate c;
  c.channel = channel;
  c.cost = line.cost;
  c.across = line.across;
  const Pose centre = linear.mean * exp_pose(line.mean);
  ChainJoint joint = joint_from_twist(centre, line.slope, type);
  c.start.mount = centre;
  if (channel >= 0) {
    joint.terms = {{channel, scale}};
  } else {
    for (const double value : coordinate) c.start.coordinates.push_back(scale * value);
  }
  c.start.joints = {std::move(joint)};
  out.push_back(std::move(c));
}

// The line through the whitened average as a start in tangent coordinates.
LineFit start_of(const LinearMotion& linear, const Eigen::VectorXd& coordinate,
                 const Direction& d) {
  const auto W = linear.whitening.triangularView<Eigen::Upper>();
  LineFit start;
  start.slope = W.solve(d.slope);
  const Eigen::MatrixXd left = linear.tangent - start.slope * coordinate.transpose();
  for (Eigen::Index c = 0; c < 6; ++c) {
    const Eigen::VectorXd row = left.row(c);
    start.mean(c) = median_of({row.data(), row.data() + row.size()});
  }
  return start;
}

// A turn where the rotation shows, and a slide; each with the cost it leaves.
void add_candidates(const LinearMotion& linear, const LineProblem& problem, const Direction& d,
                    const Eigen::VectorXd& q, std::vector<Candidate>& out) {
  const LineFit start = start_of(linear, q, d);
  const auto fit = [&](JointType type) {
    Eigen::VectorXd coordinate = q;
    const LineFit line = d.channel >= 0 ? fit_line(problem, coordinate, type, start)
                                        : fit_free_line(problem, coordinate, type, start);
    const bool shows = type == JointType::kPrismatic || line.turn_evidence > kTurnEvidence;
    if (shows) add_candidate(linear, line, d.channel, type, coordinate, out);
  };
  fit(JointType::kRevolute);
  fit(JointType::kPrismatic);
}

// Squared residuals of all samples about one direction (none: about the mean).
std::vector<double> squared_residuals(const LinearMotion& linear, const Eigen::MatrixXd& q,
                                      const Direction& d) {
  Eigen::MatrixXd left = linear.y;
  if (d.channel >= 0) {
    left -= d.slope * q.row(d.channel);
  } else if (d.slope.squaredNorm() > 0.0) {
    const Vector6d u = d.slope.normalized();
    left -= u * (u.transpose() * linear.y).eval();
  }
  // About where most are: the mean of a motion that is at rest for a while is in neither.
  for (Eigen::Index k = 0; k < left.rows(); ++k) {
    const Eigen::VectorXd row = left.row(k);
    left.row(k).array() -= median_of({row.data(), row.data() + row.size()});
  }
  const Eigen::VectorXd squared =
      left.colwise().squaredNorm().transpose().cwiseProduct(linear.weight);
  return {squared.data(), squared.data() + squared.size()};
}

// What the direction leaves across itself is far above the noise and a fair part of the motion
// (median squared lengths).
bool is_hopeless(const LinearMotion& linear, const Eigen::MatrixXd& q, const Direction& d) {
  constexpr double kVariance = 100.0;
  constexpr double kShare = 0.04;
  const Vector6d u = d.slope.normalized();
  std::vector<double> across;
  std::vector<double> all;
  for (Eigen::Index i = 0; i < linear.y.cols(); ++i) {
    const Vector6d r = d.channel >= 0 ? Vector6d(linear.y.col(i) - d.slope * q(d.channel, i))
                                      : Vector6d(linear.y.col(i));
    const double along = u.dot(r);
    across.push_back(linear.weight(i) * std::max(0.0, r.squaredNorm() - along * along));
    all.push_back(linear.weight(i) * linear.y.col(i).squaredNorm());
  }
  const double left = median_of(std::move(across)) / kMedian5;
  return left > kVariance && left > kShare * median_of(std::move(all)) / kMedian6;
}

// Rest about the median, which few outliers do not move.
Candidate rest_candidate(const LinearMotion& linear, const LineProblem& problem) {
  const LineFit line =
      fit_point(problem, start_of(linear, Eigen::VectorXd::Zero(linear.y.cols()), Direction{}));
  Candidate rest;
  rest.start.mount = linear.mean * exp_pose(line.mean);
  rest.cost = line.cost;
  rest.across = line.across;
  return rest;
}

struct Regression {
  std::vector<Direction> driven;  // by cost
  Direction principal;
};

double cost_of(const std::vector<double>& squared) {
  double sum = 0.0;
  for (const double s : squared) sum += tailed_cost(s);
  return sum;
}

// Leaves out the samples that lie far from the direction most samples follow; true when there are
// any. Of directions that fit most samples alike (a joint that moves for a while only rests in all
// the others) it is the one that fits more of them.
bool trim(LinearMotion& linear, const Eigen::MatrixXd& q, const Regression& r) {
  std::vector<Direction> tried{Direction{}, r.principal};
  for (std::size_t k = 0; k < std::min(kLeading, r.driven.size()); ++k)
    tried.push_back(r.driven[k]);
  std::vector<double> best;
  double least = std::numeric_limits<double>::infinity();
  for (const Direction& d : tried) {
    std::vector<double> squared = squared_residuals(linear, q, d);
    const double sum = cost_of(squared);
    if (sum >= least) continue;
    least = sum;
    best = std::move(squared);
  }
  const double limit = kTrim * std::max(1.0, median_of(best) / kMedian6) * 1.5;
  bool any = false;
  for (std::size_t i = 0; i < best.size(); ++i) {
    if (linear.kept[i] == 0 || best[i] <= limit) continue;
    linear.kept[i] = 0;
    --linear.count;
    any = true;
  }
  return any;
}

Regression regress(const LinearMotion& linear, const Eigen::MatrixXd& q,
                   const std::vector<char>& usable) {
  Eigen::VectorXd weight = linear.weight;
  for (Eigen::Index i = 0; i < weight.size(); ++i)
    weight(i) *= linear.kept[static_cast<std::size_t>(i)];
  const double n = std::max(1, linear.count);
  const double total = std::max(1e-12, weight.sum());
  const Vector6d y_mean = linear.y * weight / total;
  weight = weight.cwiseSqrt();
  const Eigen::MatrixXd y = (linear.y.colwise() - y_mean) * weight.asDiagonal();
  const Matrix6d G = y * y.transpose();
  Regression out;
  out.principal = principal_direction(G, linear.count);
  if (q.rows() == 0) return out;
  const Eigen::VectorXd q_mean = q * weight.cwiseAbs2() / total;
  const Eigen::MatrixXd centred = (q.colwise() - q_mean) * weight.asDiagonal();
  const Eigen::MatrixXd B = y * centred.transpose();
  for (Eigen::Index k = 0; k < q.rows(); ++k) {
    const double qq = centred.row(k).squaredNorm();
    if (usable[static_cast<std::size_t>(k)] == 0 || qq < 1e-6 * n) continue;
    out.driven.push_back(driven_direction(G, B.col(k), qq, static_cast<int>(k), linear.count));
  }
  std::ranges::stable_sort(out.driven, {}, &Direction::cost);
  return out;
}

// Of the motion about its mean, over the declared one.
double whole_variance(const LineProblem& problem) {
  const Eigen::VectorXd squared = problem.white.colwise().squaredNorm();
  return std::max(1.0, median_of({squared.data(), squared.data() + squared.size()}) / kMedian6);
}

Eigen::MatrixXd readings_of(const Motion& motion, const Eigen::MatrixXd& readings) {
  Eigen::MatrixXd q(readings.cols(), static_cast<Eigen::Index>(motion.size()));
  for (std::size_t i = 0; i < motion.size(); ++i) {
    q.col(static_cast<Eigen::Index>(i)) = readings.row(motion[i].instant).transpose();
  }
  return q;
}

// How far a sighting is from a pose, by the branch that is nearer.
double distance_from(const Pose& inverse, const MotionSample& sample) {
  const double own = (sample.whitening * fast_log(inverse * sample.pose)).squaredNorm();
  if (!sample.alternative) return own;
  const Vector6d other = sample.alternative_whitening * fast_log(inverse * *sample.alternative);
  return std::min(own, other.squaredNorm() + sample.alternative_cost);
}

// Rest where one branch of most sightings is: what the first branches leave of a marker at rest
// tells nothing when every other one is wrong. Nothing for sightings with one branch.
std::optional<Candidate> rest_of_branches(const Motion& motion, const Eigen::MatrixXd& readings) {
  constexpr std::size_t kPlaces = 12;
  constexpr std::size_t kJudges = 40;
  if (std::ranges::none_of(motion, [](const MotionSample& s) { return s.alternative.has_value(); }))
    return std::nullopt;
  Candidate best;
  double least = std::numeric_limits<double>::infinity();
  const auto judge = [&](const Pose& place) {
    const Pose inverse = place.inverse();
    double sum = 0.0;
    const std::size_t stride = std::max<std::size_t>(1, motion.size() / kJudges);
    for (std::size_t i = 0; i < motion.size(); i += stride) {
      sum += tailed_cost(distance_from(inverse, motion[i]));
    }
    if (sum >= least) return;
    least = sum;
    best.start.mount = place;
  };
  for (std::size_t i = 0; i < motion.size();
       i += std::max<std::size_t>(1, motion.size() / kPlaces)) {
    judge(motion[i].pose);
    if (motion[i].alternative) judge(*motion[i].alternative);
  }
  const ResidualScale scale = residual_scale(chain_residuals(motion, best.start, readings).parts);
  best.cost = scale.cost;
  best.across = scale.across;
  return best;
}

}  // namespace

ChainJoint joint_from_twist(const Pose& T0, const Vector6d& twist, JointType type) {
  const Eigen::Vector3d w = twist.head<3>();
  const Eigen::Vector3d v = twist.tail<3>();
  ChainJoint joint;
  joint.type = type;
  Pose local;
  if (type == JointType::kRevolute) {
    local.rotation = rotation_to_axis(w.normalized());
    local.translation = w.cross(v) / std::max(w.squaredNorm(), 1e-30);
  } else {
    local.rotation = rotation_to_axis(v.normalized());
  }
  joint.frame = T0 * local;
  return joint;
}

std::vector<Candidate> screen_motion(const Motion& motion, const Eigen::MatrixXd& readings,
                                     const std::vector<char>& usable,
                                     const ScreeningOptions& options) {
  std::vector<Candidate> out;
  if (motion.empty()) return out;  // of bodies that were never seen together
  LinearMotion linear = linear_motion(motion);
  const Eigen::MatrixXd q = readings_of(motion, readings);
  Regression r = regress(linear, q, usable);
  const LinearMotion untrimmed = linear;
  const Regression first = r;
  for (int pass = 0; pass < 2 && trim(linear, q, r) && linear.count > 8; ++pass)
    r = regress(linear, q, usable);

  const LineProblem problem = line_problem(linear, motion);
  out.push_back(rest_candidate(linear, problem));
  const auto rest = rest_of_branches(motion, readings);
  if (rest && rest->cost < out.back().cost) out.back() = *rest;
  if (linear.widest > kWideTurn) {
    for (Candidate& c : wide_turn_candidates(motion, q, usable, options.coordinate_free)) {
      out.push_back(std::move(c));
    }
  }
  // In this first regression, with one whitening for all samples, nothing that comes close to the
  // best is further from it.
  const double far = (r.driven.empty() ? r.principal.cost : r.driven.front().cost) + kFar +
                     static_cast<double>(linear.count);
  const auto channels = std::min(r.driven.size(), static_cast<std::size_t>(options.max_channels));
  for (std::size_t k = 0; k < channels; ++k) {
    if (k > 0 && is_hopeless(linear, q, r.driven[k])) continue;
    if (r.driven[k].cost > far) continue;
    const Eigen::VectorXd readings_k = q.row(r.driven[k].channel).transpose();
    add_candidates(linear, problem, r.driven[k], readings_k, out);
  }
  // Of a joint that moves for a while, and then errs by far more than at rest, all that it moved
  // may have been left out.
  for (std::size_t k = 0; k < std::min(kLeading, first.driven.size()); ++k) {
    if (linear.count == untrimmed.count) break;
    const Eigen::VectorXd readings_k = q.row(first.driven[k].channel).transpose();
    add_candidates(untrimmed, problem, first.driven[k], readings_k, out);
  }
  if (options.coordinate_free && r.principal.slope.squaredNorm() > 0.0 && r.principal.cost < far) {
    const Eigen::VectorXd along =
        linear.y.transpose() * r.principal.slope / r.principal.slope.squaredNorm();
    add_candidates(linear, problem, r.principal, along, out);
  }
  const double spread = whole_variance(problem);
  for (Candidate& c : out) c.share = c.across / spread;
  std::ranges::stable_sort(out, {}, &Candidate::cost);
  return out;
}

}  // namespace kinescope::structure_search
