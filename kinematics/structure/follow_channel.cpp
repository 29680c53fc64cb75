// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/follow_channel.h"

#include <cmath>
#include <numbers>

#include "kinematics/core/median.h"

namespace kinescope::structure_search {
namespace {

// Share of a free coordinate's variance that the channel which drives it explains, at least.
constexpr double kFollows = 0.5;
// The same of two channels together, where none does so alone: a sum or difference of two that move
// as far.
constexpr double kFollowsTwo = 0.95;
// Two channels are told apart when their squared correlation is below one by more than this.
constexpr double kApart = 1e-3;

struct CoordinateFit {
  int channel = -1;
  double slope = 0.0;
  double zero = 0.0;
  double explained = kFollows;
};

Eigen::VectorXd channel_over(const Motion& motion, const Readings& readings, int channel) {
  Eigen::VectorXd q(static_cast<Eigen::Index>(motion.size()));
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    q(i) = readings.value(motion[static_cast<std::size_t>(i)].instant, channel);
  }
  return q;
}

// Coordinates regressed on one channel; a second pass leaves out what lies far from the line.
void regress_on(const Eigen::VectorXd& y, const Eigen::VectorXd& q, int channel,
                CoordinateFit& best) {
  const Eigen::Index n = y.size();
  Eigen::VectorXd weight = Eigen::VectorXd::Ones(n);
  for (int pass = 0; pass < 2; ++pass) {
    const double total = weight.sum();
    const Eigen::VectorXd dq = q.array() - q.dot(weight) / total;
    const Eigen::VectorXd dy = y.array() - y.dot(weight) / total;
    const Eigen::VectorXd w = weight.cwiseProduct(dq);
    const double slope = w.dot(dy) / std::max(1e-300, w.dot(dq));
    Eigen::VectorXd squared = (dy - slope * dq).cwiseAbs2();
    const double variance = weight.dot(Eigen::VectorXd(dy.cwiseAbs2()));
    const double explained = 1.0 - weight.dot(squared) / std::max(1e-300, variance);
    if (explained > best.explained) {
      best = {channel, slope, (y.dot(weight) - slope * q.dot(weight)) / total, explained};
    }
    const double median = median_of({squared.data(), squared.data() + n});
    weight = (squared.array() > 25.0 * median / 0.4549).select(0.0, Eigen::VectorXd::Ones(n));
  }
}

void regress_on_all(const Eigen::VectorXd& y, const Motion& motion, const Readings& readings,
                    const std::vector<char>& usable, CoordinateFit& best) {
  for (int c = 0; c < readings.channels(); ++c) {
    if (usable[static_cast<std::size_t>(c)] == 0) continue;
    regress_on(y, channel_over(motion, readings, c), c, best);
  }
}

struct ChannelsFit {
  std::vector<ChainTerm> terms;
  double zero = 0.0;
  double explained = kFollowsTwo;
};

// Coordinates regressed on all pairs of channels.
void regress_on_pairs(const Eigen::VectorXd& y, const Motion& motion, const Readings& readings,
                      const std::vector<char>& usable, ChannelsFit& best) {
  std::vector<int> channels;
  for (int c = 0; c < readings.channels(); ++c) {
    if (usable[static_cast<std::size_t>(c)] != 0) channels.push_back(c);
  }
  const auto count = static_cast<Eigen::Index>(channels.size());
  Eigen::MatrixXd q(y.size(), count);
  for (Eigen::Index k = 0; k < count; ++k)
    q.col(k) = channel_over(motion, readings, channels[static_cast<std::size_t>(k)]);
  const Eigen::RowVectorXd mean = q.colwise().mean();
  const double y_mean = y.mean();
  q.rowwise() -= mean;
  const Eigen::VectorXd dy = y.array() - y_mean;
  const Eigen::MatrixXd G = q.transpose() * q;
  const Eigen::VectorXd b = q.transpose() * dy;
  const double total = std::max(1e-300, dy.squaredNorm());
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = i + 1; j < count; ++j) {
      const double determinant = G(i, i) * G(j, j) - G(i, j) * G(i, j);
      if (determinant < kApart * G(i, i) * G(j, j)) continue;
      const double first = (G(j, j) * b(i) - G(i, j) * b(j)) / determinant;
      const double second = (G(i, i) * b(j) - G(i, j) * b(i)) / determinant;
      const double explained = (first * b(i) + second * b(j)) / total;
      if (explained <= best.explained) continue;
      best = {{{channels[static_cast<std::size_t>(i)], first},
               {channels[static_cast<std::size_t>(j)], second}},
              y_mean - first * mean(i) - second * mean(j),
              explained};
      if (std::abs(second) > std::abs(first)) std::swap(best.terms[0], best.terms[1]);
    }
  }
}

// Angles within half a turn of their mean direction.
Eigen::VectorXd within_a_turn(const Eigen::VectorXd& angle) {
  const double mean = std::atan2(angle.array().sin().sum(), angle.array().cos().sum());
  const double turn = 2.0 * std::numbers::pi;
  return angle.array() - turn * ((angle.array() - mean) / turn).round();
}

}  // namespace

std::optional<Candidate> driven_by_best_channel(const ChainModel& free, const Motion& motion,
                                                const Readings& readings,
                                                const std::vector<char>& usable) {
  const ChainJoint& joint = free.joints.front();
  const Eigen::VectorXd y = Eigen::Map<const Eigen::VectorXd>(
      free.coordinates.data(), static_cast<Eigen::Index>(free.coordinates.size()));
  std::vector<Eigen::VectorXd> counted{y};
  if (joint.type == JointType::kRevolute) counted.push_back(within_a_turn(y));
  CoordinateFit one;
  for (const Eigen::VectorXd& c : counted) regress_on_all(c, motion, readings, usable, one);
  ChannelsFit fit{
      .terms = {{one.channel, one.slope}}, .zero = one.zero, .explained = one.explained};
  if (one.channel < 0) {
    fit = {};
    for (const Eigen::VectorXd& c : counted) regress_on_pairs(c, motion, readings, usable, fit);
    if (fit.terms.empty()) return std::nullopt;
  }
  Candidate out;
  out.channel = fit.terms.front().channel;
  out.start = free;
  out.start.coordinates.clear();
  out.start.joints.front().terms = fit.terms;
  const Pose shift = joint_motion(joint.type, Eigen::Vector3d::UnitZ(), fit.zero);
  out.start.mount = joint.frame * shift * joint.frame.inverse() * free.mount;
  return out;
}

}  // namespace kinescope::structure_search
