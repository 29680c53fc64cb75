// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/copied_channels.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "kinematics/structure/time_offset.h"

namespace kinescope::structure_search {
namespace {

// Samples that are compared.
constexpr std::size_t kMostSamples = 400;
constexpr std::size_t kFewestSamples = 20;
/// How much alike columns of one quantity are.
struct Likeness {
  double unit = 0.0;    ///< spreads agree to this, slopes of one on the other, too
  double motion = 0.0;  ///< correlation
};
constexpr Likeness kTheSame{.unit = 0.01, .motion = 0.9999};
// Of a servo that stays a twentieth of its motion behind its command.
constexpr Likeness kLoosely{.unit = 0.1, .motion = 0.998};
// Drives follow their command faster than this, s.
constexpr double kMostDelay = 0.25;
// How much better (-2 ln likelihood) another copy has to be.
constexpr double kClearly = 25.0;

double spread(const JointLog& log, int channel) {
  const auto column = log.values.col(channel);
  const auto n = static_cast<double>(std::max<Eigen::Index>(1, column.size()));
  return std::sqrt((column.array() - column.mean()).square().sum() / n);
}

// Two columns at the same samples, the second a delay later, about their means.
struct Sampled {
  Eigen::ArrayXd first;
  Eigen::ArrayXd second;
  Eigen::ArrayXd rate;  // of the second, 1/s

  [[nodiscard]] double slope() const {
    return (first * second).sum() / std::max(1e-300, first.square().sum());
  }
  [[nodiscard]] double correlation() const {
    return (first * second).sum() /
           std::sqrt(std::max(1e-300, first.square().sum() * second.square().sum()));
  }
};

Eigen::ArrayXd centred(const std::vector<double>& values) {
  const Eigen::Map<const Eigen::ArrayXd> all(values.data(),
                                             static_cast<Eigen::Index>(values.size()));
  return all - all.mean();
}

Sampled sampled(const JointLog& log, int first, int second, double delay_s) {
  const std::size_t stride = std::max<std::size_t>(1, log.size() / kMostSamples);
  std::vector<double> values;
  std::vector<double> later_values;
  std::vector<double> later_rates;
  for (std::size_t i = 0; i < log.size(); i += stride) {
    const auto later = interpolate(log, second, log.times_s[i] + delay_s);
    if (!later) continue;
    values.push_back(log.values(static_cast<Eigen::Index>(i), first));
    later_values.push_back(later->value);
    later_rates.push_back(later->rate);
  }
  if (values.size() < kFewestSamples) return {};
  return {centred(values), centred(later_values), centred(later_rates)};
}

bool are_alike(const Sampled& s, const Likeness& least) {
  return std::abs(s.slope() - 1.0) < least.unit && s.correlation() > least.motion;
}

// The correlation at the first delay, of those that lead to the best one, at which they are alike.
std::optional<double> likeness(const JointLog& log, int first, int second, const Likeness& least) {
  const double a = spread(log, first);
  if (!(a > 0.0) || std::abs(spread(log, second) / a - 1.0) > least.unit) return std::nullopt;
  constexpr int kPasses = 5;
  double delay_s = 0.0;
  for (int pass = 0; pass < kPasses; ++pass) {
    const Sampled s = sampled(log, first, second, delay_s);
    if (are_alike(s, least)) return s.correlation();
    // Postures far apart cannot be interpolated.
    if (2 * s.first.size() < static_cast<Eigen::Index>(std::min(log.size(), kMostSamples)))
      return std::nullopt;
    delay_s += (s.rate * (s.first - s.second)).sum() / std::max(1e-300, s.rate.square().sum());
    if (!(std::abs(delay_s) < kMostDelay)) return std::nullopt;
  }
  return std::nullopt;
}

// The tree with its channels renamed.
GrownTree renamed_channels(GrownTree tree, const std::vector<int>& renamed) {
  for (GrownLink& link : tree.links) {
    if (link.founder < 0) continue;
    for (ChainJoint& joint : link.attachment.fit.model.joints) {
      for (ChainTerm& term : joint.terms)
        term.channel = renamed[static_cast<std::size_t>(term.channel)];
    }
  }
  return tree;
}

class Comparison {
 public:
  Comparison(const FoundTree& found, const Series& series, const JointLog& log,
             const std::vector<SameQuantity>& groups, const std::vector<int>& grown_with,
             const StructureOptions& options)
      : found_(found),
        series_(series),
        log_(log),
        groups_(groups),
        grown_with_(grown_with),
        options_(options) {
    for (const GrownBody& body : found.tree.bodies)
      correlation_ = std::max(correlation_, body.attachment.fit.correlation);
  }

  // -2 ln likelihood with these copies, at the clock offset that suits them.
  [[nodiscard]] double cost(const std::vector<int>& chosen) const {
    const JointLog log = with_channels(log_, channels_with(log_, groups_, chosen));
    const GrownTree tree = renamed_channels(found_.tree, renamed(log, chosen));
    double offset_s = found_.offset.value_s;
    Readings readings = readings_at(log, series_, offset_s, options_.max_gap_s);
    GrownTree fitted = refit_tree(tree, series_, readings);
    if (options_.scan_time_offset && series_.smooth) {
      const OffsetBounds bounds{.most_s = options_.max_time_offset_s,
                                .step_s = offset_step(readings),
                                .max_gap_s = options_.max_gap_s};
      offset_s = refine_offset(fitted, series_, readings, log, offset_s, bounds).value_s;
      readings = readings_at(log, series_, offset_s, options_.max_gap_s);
      fitted = refit_tree(fitted, series_, readings);
    }
    return tree_cost(fitted) / correlation_;
  }

 private:
  // Columns of the new readings by those of the tree's.
  [[nodiscard]] std::vector<int> renamed(const JointLog& log,
                                         const std::vector<int>& chosen) const {
    const std::vector<int> kept = channels_with(log_, groups_, grown_with_);
    const std::vector<int> kept_now = channels_with(log_, groups_, chosen);
    const std::vector<int> order = channel_order(log);
    std::vector<int> out;
    for (const int column : found_.readings.log_channel) {
      int channel = kept[static_cast<std::size_t>(column)];
      const auto group = std::ranges::find(grown_with_, channel);
      if (group != grown_with_.end())
        channel = chosen[static_cast<std::size_t>(group - grown_with_.begin())];
      const auto in_log = static_cast<int>(std::ranges::find(kept_now, channel) - kept_now.begin());
      out.push_back(static_cast<int>(std::ranges::find(order, in_log) - order.begin()));
    }
    return out;
  }

  const FoundTree& found_;
  const Series& series_;
  const JointLog& log_;
  const std::vector<SameQuantity>& groups_;
  const std::vector<int> grown_with_;
  const StructureOptions& options_;
  double correlation_ = 1.0;
};

}  // namespace

std::vector<SameQuantity> same_quantities(const JointLog& log) {
  std::vector<SameQuantity> groups;
  for (int c = 0; c < static_cast<int>(log.channels.size()); ++c) {
    const auto group = std::ranges::find_if(groups, [&](const SameQuantity& g) {
      return likeness(log, g.front(), c, kTheSame).has_value();
    });
    if (group == groups.end()) {
      groups.push_back({c});
    } else {
      group->push_back(c);
    }
  }
  std::erase_if(groups, [](const SameQuantity& g) { return g.size() < 2; });
  return groups;
}

JointLog with_channels(const JointLog& log, const std::vector<int>& channels) {
  JointLog out = log;
  out.channels.clear();
  out.values.resize(log.values.rows(), static_cast<Eigen::Index>(channels.size()));
  for (std::size_t k = 0; k < channels.size(); ++k) {
    out.channels.push_back(log.channels[static_cast<std::size_t>(channels[k])]);
    out.values.col(static_cast<Eigen::Index>(k)) = log.values.col(channels[k]);
  }
  return out;
}

std::vector<int> channels_with(const JointLog& log, const std::vector<SameQuantity>& groups,
                               const std::vector<int>& chosen) {
  std::vector<int> out;
  for (int c = 0; c < static_cast<int>(log.channels.size()); ++c) {
    const bool grouped = std::ranges::any_of(
        groups, [&](const SameQuantity& g) { return std::ranges::find(g, c) != g.end(); });
    if (!grouped || std::ranges::find(chosen, c) != chosen.end()) out.push_back(c);
  }
  return out;
}

std::vector<int> best_copies(const FoundTree& found, const Series& series, const JointLog& log,
                             const std::vector<SameQuantity>& groups, std::vector<int> chosen,
                             const StructureOptions& options) {
  const Comparison comparison(found, series, log, groups, chosen, options);
  double least = comparison.cost(chosen);
  const auto consider = [&](const std::vector<int>& other) {
    const double cost = comparison.cost(other);
    if (cost > least - kClearly) return;
    least = cost;
    chosen = other;
  };
  // Columns that belong together (all commands, all measured values) share their delay: first all
  // at once.
  std::size_t most = 0;
  for (const SameQuantity& group : groups) most = std::max(most, group.size());
  for (std::size_t k = 1; k < most; ++k) {
    std::vector<int> other = chosen;
    for (std::size_t g = 0; g < groups.size(); ++g) {
      if (k < groups[g].size()) other[g] = groups[g][k];
    }
    consider(other);
  }
  for (std::size_t g = 0; g < groups.size(); ++g) {
    for (const int channel : groups[g]) {
      std::vector<int> other = chosen;
      other[g] = channel;
      if (other != chosen) consider(other);
    }
  }
  return chosen;
}

std::vector<ChannelCopy> repeated_loosely(const JointLog& log, const std::vector<int>& idle,
                                          const std::vector<int>& driving) {
  std::vector<ChannelCopy> out;
  for (const int c : idle) {
    ChannelCopy copy{c, -1};
    double most = 0.0;
    for (const int d : driving) {
      const double like = likeness(log, d, c, kLoosely).value_or(0.0);
      if (like <= most) continue;
      most = like;
      copy.of = d;
    }
    if (copy.of >= 0) out.push_back(copy);
  }
  return out;
}

}  // namespace kinescope::structure_search
