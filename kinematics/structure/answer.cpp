// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/answer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "kinematics/structure/natural_units.h"

namespace kinescope::structure_search {
namespace {

// Errors that are no noise, as a share of the distance to the camera and in rad, that are allowed
// for where the sightings' own noise makes no whole robot or leaves far more than itself: a marker
// of another size than declared or one that slips, a camera that is bumped.
constexpr std::array kAllowances{0.003, 0.01};
// Variance across a joint over the declared one.
constexpr double kFarMore = 10.0;

void add_variance(Branch& branch, const Vector6d& variance) {
  branch.covariance.diagonal() += variance;
  branch.whitening = whitening_of(branch.covariance);
}

Series with_allowance(Series series, double share) {
  Vector6d variance;
  variance << Eigen::Vector3d::Constant(share * share),
      Eigen::Vector3d::Constant(std::pow(share * distance_of(series.bodies), 2));
  for (Body& body : series.bodies) {
    for (Sighting& s : body.at) {
      if (!s.seen) continue;
      add_variance(s, variance);
      if (s.alternative) add_variance(*s.alternative, variance);
    }
  }
  return series;
}

// Channels that drive joints, each once for every joint.
std::vector<int> driving_channels(const GrownTree& tree) {
  std::vector<int> channels;
  for (const GrownLink& link : tree.links) {
    if (link.founder < 0) continue;
    for (const ChainJoint& joint : link.attachment.fit.model.joints) {
      if (!joint.terms.empty()) channels.push_back(joint.terms.front().channel);
    }
  }
  std::ranges::sort(channels);
  return channels;
}

bool shares_channels(const GrownTree& tree) {
  const std::vector<int> channels = driving_channels(tree);
  return std::ranges::adjacent_find(channels) != channels.end();
}

// No channel drives two joints, but for those that plainly do.
bool shares_rightly(const GrownTree& tree, const Readings& readings) {
  if (!shares_channels(tree)) return true;
  for (std::size_t l = 1; l < tree.links.size(); ++l) {
    for (std::size_t m = l + 1; m < tree.links.size(); ++m) {
      const Attachment& a = tree.links[l].attachment;
      const Attachment& b = tree.links[m].attachment;
      const bool several = a.fit.model.joints.size() > 1 || b.fit.model.joints.size() > 1;
      if (several || (a.channel() == b.channel() && !share_a_channel(a, b, readings))) return false;
    }
  }
  return true;
}

bool leaves_far_more(const GrownTree& tree) {
  return std::ranges::any_of(
      tree.bodies, [](const GrownBody& b) { return b.attachment.fit.variance > kFarMore; });
}

// Columns that tell the same and yet drive a joint each are of joints that move alike.
std::vector<SameQuantity> copies_only(std::vector<SameQuantity> groups, const Answer& every) {
  std::vector<int> driving;
  for (const int c : driving_channels(every.found.tree))
    driving.push_back(every.found.readings.log_channel[static_cast<std::size_t>(c)]);
  driving.erase(std::ranges::unique(driving).begin(), driving.end());
  std::erase_if(groups, [&](const SameQuantity& group) {
    return std::ranges::count_if(
               group, [&](int c) { return std::ranges::find(driving, c) != driving.end(); }) > 1;
  });
  return groups;
}

// With the sightings' own noise, and the log without the columns that repeat others.
Answer search_plainly(Series full, const JointLog& log, const StructureOptions& options,
                      UnseenLinks unseen, OwnLog& own) {
  own = own_log(log, same_quantities(log));
  Answer plain = answer_with(std::move(full), 0.0, own.log, options, unseen);
  const bool enough =
      is_whole(plain.found.tree, plain.found.readings) && !shares_channels(plain.found.tree);
  if (own.groups.empty() || enough) return plain;
  Answer every = answer_with(plain.full, 0.0, log, options, unseen);
  std::vector<SameQuantity> copies = copies_only(own.groups, every);
  if (copies.size() == own.groups.size()) return plain;
  own = own_log(log, std::move(copies));
  if (own.groups.empty()) return every;
  return answer_with(std::move(every.full), 0.0, own.log, options, unseen);
}

// The smallest allowance with which every channel drives a joint that a marker shows.
std::optional<Answer> search_shown_joints(const Series& full, const JointLog& log,
                                          const StructureOptions& options) {
  for (const double allowance : kAllowances) {
    Answer out =
        answer_with(with_allowance(full, allowance), allowance, log, options, UnseenLinks::kNone);
    if (is_whole(out.found.tree, out.found.readings) && uses_all(out.found) &&
        !leaves_far_more(out.found.tree))
      return out;
  }
  return std::nullopt;
}

// With the sightings' own noise or, where that makes no whole robot or leaves far more than itself,
// with the smallest allowance that makes one of as many channels.
Answer search_allowing(Series full, const JointLog& log, const StructureOptions& options,
                       OwnLog& own) {
  if (options.allowance) {
    own = own_log(log, same_quantities(log));
    return answer_with(with_allowance(std::move(full), *options.allowance), *options.allowance,
                       own.log, options);
  }
  Answer plain = search_plainly(std::move(full), log, options, UnseenLinks::kNone, own);
  if (is_unfinished(plain.found)) {
    // Errors that are no noise look like links that no marker shows, and are sooner found.
    if (!log.channels.empty()) {
      if (auto shown = search_shown_joints(plain.full, own.log, options)) return std::move(*shown);
    }
    plain = search_plainly(std::move(plain.full), log, options, UnseenLinks::kWhereNeeded, own);
  }
  const bool whole = is_whole(plain.found.tree, plain.found.readings);
  if (log.channels.empty() || (whole && !leaves_far_more(plain.found.tree))) return plain;
  for (const double allowance : kAllowances) {
    Answer other = answer_with(with_allowance(plain.full, allowance), allowance, own.log, options);
    const bool as_many = used_channels(other.found.tree) >= used_channels(plain.found.tree);
    if (as_many && is_whole(other.found.tree, other.found.readings)) return other;
  }
  return plain;
}

}  // namespace

bool is_whole(const GrownTree& tree, const Readings& readings) {
  const bool driven = std::ranges::all_of(tree.links, [](const GrownLink& link) {
    return link.founder < 0 || link.attachment.driven();
  });
  const bool free = std::ranges::any_of(tree.bodies, [](const GrownBody& b) { return b.link < 0; });
  return driven && !free && tree.links.size() > 1 && shares_rightly(tree, readings);
}

std::size_t used_channels(const GrownTree& tree) {
  std::vector<int> channels = driving_channels(tree);
  const auto rest = std::ranges::unique(channels);
  return channels.size() - rest.size();
}

Answer answer_with(Series full, double allowance, const JointLog& log,
                   const StructureOptions& options, UnseenLinks unseen) {
  Answer out;
  out.full = std::move(full);
  out.thin = thinned(out.full, kInstants);
  out.allowance = allowance;
  out.found = search_tree(out.full, out.thin, log, options, unseen);
  out.found.tree = with_likely_exchanges(
      in_natural_units(std::move(out.found.tree), out.thin, out.found.readings),
      out.found.readings);
  return out;
}

// Of columns that tell the same, with those that the markers follow best.
Answer find_answer(Series full, const JointLog& log, const StructureOptions& options, OwnLog& own) {
  Answer answer = search_allowing(std::move(full), log, options, own);
  if (own.groups.empty()) return answer;
  std::vector<int> chosen =
      best_copies(answer.found, answer.thin, log, own.groups, own.chosen, options);
  if (chosen == own.chosen) return answer;
  own = own_log(log, std::move(own.groups), std::move(chosen));
  return answer_with(std::move(answer.full), answer.allowance, own.log, options);
}

}  // namespace kinescope::structure_search
