// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/unsteady_reading.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "kinematics/log/smoothing_spline.h"

namespace kinescope {
namespace {

// Of a grid rounded to its steps, and of any value within one.
const double kRoundedSigma = 1.0 / std::sqrt(12.0);
constexpr Eigen::Index kFewestChanges = 32;
// Of the range: a grid or noise that is finer is no matter beside what a camera sees.
constexpr double kFinest = 1e-4;

/// A value that is known at a time.
struct Node {
  double t_s = 0.0;
  double value = 0.0;
  double weight = 0.0;  ///< inverse variance
};

struct Columns {
  Eigen::VectorXd t_s;
  Eigen::VectorXd value;
  Eigen::VectorXd weight;
};

Columns columns_of(const std::vector<Node>& nodes) {
  const auto n = static_cast<Eigen::Index>(nodes.size());
  Columns out{Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::VectorXd(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Node& node = nodes[static_cast<std::size_t>(i)];
    out.t_s[i] = node.t_s;
    out.value[i] = node.value;
    out.weight[i] = node.weight;
  }
  out.weight /= out.weight.mean();
  return out;
}

SmoothingSpline spline_through(const std::vector<Node>& nodes, double cutoff_hz) {
  const Columns columns = columns_of(nodes);
  return {columns.t_s, columns.value, columns.weight, cutoff_hz};
}

// Samples that are left out to choose a cut-off: neighbours are off alike, so every other one. What
// is left of edges would be too sparse to follow a motion of few steps then: cut-offs of 1.2 to
// 3.4 Hz where tenths say 2.0 to 2.1 (`undeclared`, 9405, 9595, 9693).
constexpr std::size_t kSamplesApart = 2;
constexpr std::size_t kEdgesApart = 10;

// Mean square, over their variances, by which every `apart`-th node misses the spline through the
// rest.
double missed_squares(const std::vector<Node>& nodes, std::size_t apart, double cutoff_hz) {
  double out = 0.0;
  double count = 0.0;
  for (std::size_t first = 0; first < apart; ++first) {
    std::vector<Node> kept;
    std::vector<Node> left_out;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const bool at_end = i == 0 || i + 1 == nodes.size();
      (i % apart == first && !at_end ? left_out : kept).push_back(nodes[i]);
    }
    if (left_out.empty()) continue;
    const Columns there = columns_of(left_out);
    const Eigen::VectorXd predicted = spline_through(kept, cutoff_hz).evaluate(there.t_s);
    for (std::size_t i = 0; i < left_out.size(); ++i) {
      const double off = left_out[i].value - predicted[static_cast<Eigen::Index>(i)];
      out += left_out[i].weight * off * off;
      count += 1.0;
    }
  }
  return out / count;
}

/// How quickly a motion changes, and how far from it nodes are by their own variances.
struct Cutoff {
  double hz = 0.0;
  double missed_squares = std::numeric_limits<double>::infinity();
};

// The cut-off under which nodes that are left out are predicted best.
Cutoff best_cutoff(std::vector<Node> nodes, std::size_t apart) {
  constexpr std::size_t kMostNodes = 4000;  // that is enough to know it by
  constexpr int kCutoffs = 12;
  constexpr double kSlowest = 0.5;  // Hz, of a motion
  if (nodes.size() > kMostNodes) {
    const auto skipped = static_cast<std::ptrdiff_t>((nodes.size() - kMostNodes) / 2);
    nodes = {nodes.begin() + skipped, nodes.begin() + skipped + kMostNodes};
  }
  const double rate_hz =
      static_cast<double>(nodes.size() - 1) / (nodes.back().t_s - nodes.front().t_s);
  Cutoff best;
  for (int k = 0; k < kCutoffs; ++k) {
    // Up to the rate of the nodes: the spline passes through them.
    const double hz = kSlowest * std::pow(std::max(1.0, rate_hz / kSlowest), k / (kCutoffs - 1.0));
    if (const double squares = missed_squares(nodes, apart, hz); squares < best.missed_squares)
      best = {hz, squares};
  }
  return best;
}

std::vector<Node> samples(const std::vector<double>& times_s, const Eigen::VectorXd& values,
                          double weight) {
  std::vector<Node> out;
  for (std::size_t i = 0; i < times_s.size(); ++i)
    out.push_back({times_s[i], values[static_cast<Eigen::Index>(i)], weight});
  return out;
}

// Edges of the steps, where a reading goes from one to another: some time between two samples.
std::vector<Node> edges(const std::vector<double>& times_s, const Eigen::VectorXd& values) {
  std::vector<Node> out;
  std::size_t since = 0;  // sample from which the reading has not changed
  for (std::size_t i = 1; i < times_s.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    if (values[at] == values[at - 1]) continue;
    const double change = values[at] - values[at - 1];
    const double between_s = times_s[i] - times_s[i - 1];
    const double held_s = std::max(between_s, times_s[i] - times_s[since]);
    const double sigma = kRoundedSigma * change * between_s / held_s;
    out.push_back({0.5 * (times_s[i - 1] + times_s[i]), 0.5 * (values[at - 1] + values[at]),
                   1.0 / (sigma * sigma)});
    since = i;
  }
  return out;
}

// Where a reading rests it says that the value is within its step, once, however long it rests.
std::vector<Node> with_rests(std::vector<Node> out, const std::vector<double>& times_s,
                             const Eigen::VectorXd& values, double step) {
  const double information = 1.0 / (kRoundedSigma * kRoundedSigma * step * step);
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= times_s.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    if (i < times_s.size() && values[at] == values[at - 1]) continue;
    for (std::size_t k = begin; k < i; ++k)
      out.push_back({times_s[k], values[at - 1], information / static_cast<double>(i - begin)});
    begin = i;
  }
  std::ranges::stable_sort(out, {}, &Node::t_s);
  return out;
}

// Of steps on which the reading rests, or turns back: the value may be anywhere within. Near an
// edge it is known.
std::vector<Doubt> doubts_of_rests(const std::vector<double>& times_s,
                                   const Eigen::VectorXd& values, double change_s, double sigma) {
  std::vector<Doubt> out;
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= times_s.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    if (i < times_s.size() && values[at] == values[at - 1]) continue;
    Doubt rest{times_s.front(), times_s.back(), 0.0, 0.0, sigma};
    if (begin > 0) {
      rest.first_s = 0.5 * (times_s[begin - 1] + times_s[begin]);
      rest.rise_s = 0.5 * change_s;
    }
    if (i < times_s.size()) {
      rest.last_s = 0.5 * (times_s[i - 1] + times_s[i]);
      rest.fall_s = 0.5 * change_s;
    }
    if (rest.last_s - rest.first_s > 0.5 * change_s) out.push_back(rest);
    begin = i;
  }
  return out;
}

// Every half change: what the nodes near it leave open, no more than a step does.
std::vector<Doubt> doubts_of_motion(const std::vector<Node>& nodes, double change_s, double most) {
  const double step_s = 0.5 * change_s;
  const double first_s = nodes.front().t_s;
  const double last_s = nodes.back().t_s;
  std::vector<Doubt> out;
  std::size_t begin = 0;
  for (int k = 0; first_s + k * step_s < last_s + step_s; ++k) {
    const double t_s = first_s + k * step_s;
    while (begin < nodes.size() && nodes[begin].t_s < t_s - step_s) ++begin;
    double information = 0.0;
    for (std::size_t i = begin; i < nodes.size() && nodes[i].t_s <= t_s + step_s; ++i)
      information += nodes[i].weight;
    const double sigma = std::min(most, 1.0 / std::sqrt(information));
    out.push_back({t_s - step_s, t_s + step_s, step_s, step_s, sigma});
  }
  return out;
}

// What fifth differences leave: noise, and little of a motion.
double noise_at_most(const Eigen::VectorXd& values) {
  constexpr int kOrder = 5;
  constexpr double kOfNoise = 252.0;  // squares of 1 5 10 10 5 1
  Eigen::VectorXd d = values;
  for (int k = 0; k < kOrder; ++k) d = (d.tail(d.size() - 1) - d.head(d.size() - 1)).eval();
  return std::sqrt(d.squaredNorm() / (kOfNoise * static_cast<double>(d.size())));
}

Eigen::Index changes_of(const Eigen::VectorXd& values) {
  Eigen::Index out = 0;
  for (Eigen::Index i = 1; i < values.size(); ++i) out += values[i] != values[i - 1] ? 1 : 0;
  return out;
}

}  // namespace

double Doubt::share(double t_s) const {
  if (t_s < first_s || t_s > last_s) return 0.0;
  const double rise = rise_s > 0.0 ? std::min(1.0, (t_s - first_s) / rise_s) : 1.0;
  const double fall = fall_s > 0.0 ? std::min(1.0, (last_s - t_s) / fall_s) : 1.0;
  return std::min(rise, fall);
}

void UnsteadyReading::keep_visible(const Eigen::VectorXd& seen_s,
                                   const Eigen::VectorXd& information) {
  std::erase_if(doubts, [&](const Doubt& doubt) {
    double seen = 0.0;
    for (Eigen::Index i = 0; i < seen_s.size(); ++i)
      seen += information[i] * std::pow(doubt.share(seen_s[i]), 2);
    return !(seen * doubt.sigma * doubt.sigma > 1.0);
  });
}

std::optional<double> step_of(const Eigen::VectorXd& values) {
  constexpr double kOnGrid = 0.02;  // of a step: digits that were cut off
  std::vector<double> changes;
  for (Eigen::Index i = 1; i < values.size(); ++i)
    if (values[i] != values[i - 1]) changes.push_back(std::abs(values[i] - values[i - 1]));
  if (changes.empty()) return std::nullopt;
  std::ranges::sort(changes);
  const double range = values.maxCoeff() - values.minCoeff();
  if (changes.front() < kFinest * range) return std::nullopt;
  // The smallest first: each says the step more exactly than those before.
  double step = changes.front();
  double count = 0.0;
  double sum = 0.0;
  for (const double change : changes) {
    const double steps = std::round(change / step);
    if (std::abs(change - steps * step) > kOnGrid * changes.front()) return std::nullopt;
    count += steps;
    sum += change;
    step = sum / count;
  }
  return step;
}

std::optional<UnsteadyReading> reading_in_steps(Eigen::VectorXd values) {
  std::ranges::sort(values);
  const std::optional<double> step = step_of(values);
  if (!step) return std::nullopt;
  return UnsteadyReading{{}, true, *step, kRoundedSigma * *step, {}, {}};
}

std::optional<UnsteadyReading> unsteady_reading(const std::vector<double>& times_s,
                                                const Eigen::VectorXd& values) {
  const Eigen::Index changes = changes_of(values);
  if (changes < kFewestChanges) return std::nullopt;
  const std::optional<double> step = step_of(values);
  const double range = values.maxCoeff() - values.minCoeff();
  if (!step && noise_at_most(values) < kFinest * range) return std::nullopt;
  // Of a wild value the squares are no finite numbers.
  if (!std::isfinite(values.squaredNorm())) return std::nullopt;
  UnsteadyReading out;
  out.times_s = times_s;
  out.in_steps = step.has_value();
  const bool rests_on_steps = step && changes < values.size() / 2;
  const double sigma = kRoundedSigma * step.value_or(1.0);
  std::vector<Node> nodes =
      rests_on_steps ? edges(times_s, values) : samples(times_s, values, 1.0 / (sigma * sigma));
  const Cutoff cutoff = best_cutoff(nodes, rests_on_steps ? kEdgesApart : kSamplesApart);
  if (rests_on_steps) nodes = with_rests(std::move(nodes), times_s, values, *step);
  const Eigen::Map<const Eigen::VectorXd> at(times_s.data(), values.size());
  out.motion = spline_through(nodes, cutoff.hz).evaluate(at);
  if (step) {
    const double change_s = 1.0 / cutoff.hz;
    // A motion that few edges tell is off by more than they are.
    for (Node& node : nodes) node.weight /= std::max(1.0, cutoff.missed_squares);
    out.doubts = doubts_of_rests(times_s, values, change_s, sigma);
    std::ranges::copy(doubts_of_motion(nodes, change_s, sigma), std::back_inserter(out.doubts));
    const double half = 0.5 * *step;
    out.motion = out.motion.cwiseMax((values.array() - half).matrix())
                     .cwiseMin((values.array() + half).matrix());
  }
  out.size = step.value_or(std::sqrt((out.motion - values).array().square().mean()));
  if (!(out.size > 0.0)) return std::nullopt;
  out.error = step ? kRoundedSigma * out.size : out.size;
  return out;
}

JointLog steadied(JointLog log) {
  for (Eigen::Index c = 0; c < log.values.cols(); ++c) {
    if (const auto found = unsteady_reading(log.times_s, log.values.col(c)))
      log.values.col(c) = found->motion;
  }
  return log;
}

}  // namespace kinescope
