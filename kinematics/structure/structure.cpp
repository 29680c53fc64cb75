// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"
#include "kinematics/structure/assemble.h"
#include "kinematics/structure/copied_channels.h"
#include "kinematics/structure/natural_units.h"
#include "kinematics/structure/readings.h"
#include "kinematics/structure/search.h"
#include "kinematics/structure/series.h"
#include "kinematics/structure/time_offset.h"
#include "kinematics/structure/unexplained.h"
#include "kinematics/structure/verdict.h"

namespace kinescope {
namespace {

using namespace structure_search;  // NOLINT(google-build-using-namespace): this file is its front
                                   // door

// Instants the search looks at; averages of the frames around them.
constexpr int kInstants = 240;
// A body has to be seen this often to take part.
constexpr int kFewestSightings = 8;
// Most that an answer is worth in which a joint has no channel and a channel has no joint.
constexpr double kUnpaired = 0.9;

void check(const PoseTracks& tracks) {
  for (std::size_t f = 1; f < tracks.times_s.size(); ++f) {
    KINESCOPE_CHECK(tracks.times_s[f] > tracks.times_s[f - 1], "frame times increase");
  }
}

PoseTracks without_rare(const PoseTracks& tracks) {
  PoseTracks out = tracks;
  std::erase_if(out.tracks, [](const PoseTrack& t) { return t.samples.size() < kFewestSightings; });
  return out;
}

// Errors that are no noise, as a share of the distance to the camera and in rad, that are allowed
// for where the sightings' own noise makes no whole robot or leaves far more than itself: a marker
// of another size than declared or one that slips, a camera that is bumped.
constexpr std::array kAllowances{0.003, 0.01};
// Variance across a joint over the declared one.
constexpr double kFarMore = 10.0;

// RMS share of a link's motion that its joint leaves: worth a word, and so much of what no value of
// the joint makes that it may be another joint, or several.
constexpr double kNoticed = 0.1;
constexpr double kOfAnotherKind = 0.25;

struct Answer {
  FoundTree found;
  Series full;  ///< with the allowance
  Series thin;
  double allowance = 0.0;
};

// The log without the columns that repeat others.
struct OwnLog {
  JointLog log;
  std::vector<int> channels;         // of the whole log
  std::vector<SameQuantity> groups;  // of the whole log
  std::vector<int> chosen;           // of each group
};

OwnLog own_log(const JointLog& log, std::vector<SameQuantity> groups, std::vector<int> chosen) {
  OwnLog out;
  out.channels = channels_with(log, groups, chosen);
  out.log = with_channels(log, out.channels);
  out.groups = std::move(groups);
  out.chosen = std::move(chosen);
  return out;
}

OwnLog own_log(const JointLog& log, std::vector<SameQuantity> groups) {
  std::vector<int> first;
  for (const SameQuantity& group : groups) first.push_back(group.front());
  return own_log(log, std::move(groups), std::move(first));
}

Series with_allowance(Series series, double share) {
  Vector6d variance;
  variance << Eigen::Vector3d::Constant(share * share),
      Eigen::Vector3d::Constant(std::pow(share * distance_of(series.bodies), 2));
  for (Body& body : series.bodies) {
    for (Sighting& s : body.at) {
      if (!s.seen) continue;
      s.covariance.diagonal() += variance;
      s.whitening = whitening_of(s.covariance);
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

// Every body hangs by joints that channels drive, each by its own or one that plainly drives
// several.
bool is_whole(const GrownTree& tree, const Readings& readings) {
  const bool driven = std::ranges::all_of(tree.links, [](const GrownLink& link) {
    return link.founder < 0 || link.attachment.driven();
  });
  const bool free = std::ranges::any_of(tree.bodies, [](const GrownBody& b) { return b.link < 0; });
  return driven && !free && tree.links.size() > 1 && shares_rightly(tree, readings);
}

bool leaves_far_more(const GrownTree& tree) {
  return std::ranges::any_of(
      tree.bodies, [](const GrownBody& b) { return b.attachment.fit.variance > kFarMore; });
}

std::size_t used_channels(const GrownTree& tree) {
  std::vector<int> channels = driving_channels(tree);
  const auto rest = std::ranges::unique(channels);
  return channels.size() - rest.size();
}

Answer search_with(Series full, double allowance, const JointLog& log,
                   const StructureOptions& options) {
  Answer out;
  out.full = std::move(full);
  out.thin = thinned(out.full, kInstants);
  out.allowance = allowance;
  out.found = search_tree(out.full, out.thin, log, options);
  out.found.tree = with_likely_exchanges(
      in_natural_units(std::move(out.found.tree), out.thin, out.found.readings),
      out.found.readings);
  return out;
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
                      OwnLog& own) {
  own = own_log(log, same_quantities(log));
  Answer plain = search_with(std::move(full), 0.0, own.log, options);
  const bool enough =
      is_whole(plain.found.tree, plain.found.readings) && !shares_channels(plain.found.tree);
  if (own.groups.empty() || enough) return plain;
  Answer every = search_with(plain.full, 0.0, log, options);
  std::vector<SameQuantity> copies = copies_only(own.groups, every);
  if (copies.size() == own.groups.size()) return plain;
  own = own_log(log, std::move(copies));
  if (own.groups.empty()) return every;
  return search_with(std::move(every.full), 0.0, own.log, options);
}

// With the sightings' own noise or, where that makes no whole robot or leaves far more than itself,
// with the smallest allowance that makes one of as many channels.
Answer search_allowing(Series full, const JointLog& log, const StructureOptions& options,
                       OwnLog& own) {
  Answer plain = search_plainly(std::move(full), log, options, own);
  const bool whole = is_whole(plain.found.tree, plain.found.readings);
  if (log.channels.empty() || (whole && !leaves_far_more(plain.found.tree))) return plain;
  for (const double allowance : kAllowances) {
    Answer other = search_with(with_allowance(plain.full, allowance), allowance, own.log, options);
    const bool as_many = used_channels(other.found.tree) >= used_channels(plain.found.tree);
    if (as_many && is_whole(other.found.tree, other.found.readings)) return other;
  }
  return plain;
}

// Of columns that tell the same, with those that the markers follow best.
Answer search(Series full, const JointLog& log, const StructureOptions& options, OwnLog& own) {
  Answer answer = search_allowing(std::move(full), log, options, own);
  if (own.groups.empty()) return answer;
  std::vector<int> chosen =
      best_copies(answer.found, answer.thin, log, own.groups, own.chosen, options);
  if (chosen == own.chosen) return answer;
  own = own_log(log, std::move(own.groups), std::move(chosen));
  return search_with(std::move(answer.full), answer.allowance, own.log, options);
}

JointLog shifted(JointLog log, double by_s) {
  for (double& t : log.times_s) t += by_s;
  return log;
}

int moving_channels(const Readings& readings) {
  int count = 0;
  for (int c = 0; c < readings.channels(); ++c) count += readings.moves(c) ? 1 : 0;
  return count;
}

// An offset beyond the scanned ones at which most channels that move drive a joint each: joint-log
// time = frame time + offset.
std::optional<double> offset_beyond(const Series& full, const JointLog& log,
                                    const StructureOptions& options) {
  const Series thin = thinned(full, kInstants);
  const Readings now = readings_at(log, thin, 0.0, options.max_gap_s);
  const auto [first, last] = std::ranges::minmax(full.times_s);
  const double widest_s = 0.5 * std::min(last - first, log.times_s.back() - log.times_s.front());
  if (!(widest_s > options.max_time_offset_s)) return std::nullopt;
  for (const double start_s :
       scan_time_offsets(full, log, offset_step(now), widest_s, options.max_gap_s)) {
    if (std::abs(start_s) <= options.max_time_offset_s) continue;
    const Answer other = search_with(full, 0.0, shifted(log, -start_s), options);
    if (2 * static_cast<int>(used_channels(other.found.tree)) <= moving_channels(now)) continue;
    return start_s + other.found.offset.value_s;
  }
  return std::nullopt;
}

// A rate of the log's clock against the frames' at which the channels drive a whole robot.
std::optional<double> rate_apart(const Series& full, const JointLog& log,
                                 const StructureOptions& options) {
  if (!options.scan_time_offset || !full.smooth) return std::nullopt;
  const Readings now = readings_at(log, thinned(full, kInstants), 0.0, options.max_gap_s);
  const Series part = first_part(full, kRatePart);
  for (const ClockRate& clock : scan_clock_rates(full, log, offset_step(now),
                                                 options.max_time_offset_s, options.max_gap_s)) {
    const Answer other =
        search_with(part, 0.0, with_clock(log, clock, full.times_s.front()), options);
    if (is_whole(other.found.tree, other.found.readings)) return clock.rate;
  }
  return std::nullopt;
}

StructureDoubt offset_doubt(double offset_s) {
  return {fmt::format("no channel drives a joint as the clocks are, which is {:.2f} s apart from "
                      "where they do",
                      std::abs(offset_s)),
          fmt::format("add {:+.3f} s to the frames' times (of a video: to video_start in "
                      "recording.yaml), or {:+.3f} s to the log's",
                      offset_s, -offset_s),
          {}};
}

StructureDoubt rate_doubt(double rate) {
  return {fmt::format(
              "the log's clock runs about {:.3f} times as fast as the frames': the channels do not "
              "drive the joints as it is",
              rate),
          fmt::format("give the video the frame rate that it was taken with ({:.3f} times the one "
                      "it has), or divide the log's times by {:.3f}",
                      1.0 / rate, rate),
          {}};
}

// The markers move, the channels move, but not together, or few of them.
void doubt_clocks(const Series& full, const JointLog& log, const StructureOptions& options,
                  bool nothing_driven, Structure& out) {
  const auto put = [&](StructureDoubt doubt) {
    out.status = StructureStatus::kUndetermined;
    out.doubts.insert(out.doubts.begin(), std::move(doubt));
  };
  const bool scanned = nothing_driven && options.scan_time_offset && full.smooth;
  if (const auto offset_s = scanned ? offset_beyond(full, log, options) : std::nullopt)
    return put(offset_doubt(*offset_s));
  if (const auto rate = rate_apart(full, log, options)) return put(rate_doubt(*rate));
  if (!nothing_driven) return;
  put({"the markers move, but no channel of the log moves with them",
       "check that the log belongs to this recording and that its clock agrees with the frames' to "
       "a second (video_start in recording.yaml); without joints.csv the joints are found from the "
       "markers alone",
       {}});
}

StructureDoubt allowance_doubt(double allowance) {
  return {
      fmt::format("predicted and measured motion of the markers differ by {:.1f} % of their "
                  "distance, which is more than their noise",
                  100.0 * allowance),
      "check the camera's intrinsics and the markers' sizes, that no marker has slipped and that "
      "the camera stood still",
      {},
      true};
}

// One motor may move several joints; a marker seen wrongly looks like a second joint, too.
void doubt_shared_channels(const JointLog& log, Structure& out) {
  std::map<int, int> joints;
  for (const StructureJoint& joint : out.joints) {
    if (joint.channel) ++joints[joint.channel->channel];
  }
  for (const auto& [channel, count] : joints) {
    if (count < 2) continue;
    const std::string& name = log.channels[static_cast<std::size_t>(channel)];
    out.doubts.push_back({fmt::format("{} drives {} joints", name, count),
                          "right where one motor moves them all; else check that their markers sit "
                          "firmly and are wholly in view",
                          {name}});
  }
}

// Channels of the log without copies become those of the whole log; copies of such that drive a
// joint are listed, the others are idle.
void in_whole_log(const OwnLog& own, Structure& out) {
  const auto whole = [&](int c) { return own.channels[static_cast<std::size_t>(c)]; };
  std::vector<int> driving;
  for (StructureJoint& joint : out.joints) {
    if (!joint.channel) continue;
    joint.channel->channel = whole(joint.channel->channel);
    driving.push_back(joint.channel->channel);
    for (ChannelTerm& term : joint.couplings) {
      term.channel = whole(term.channel);
      driving.push_back(term.channel);
    }
  }
  for (int& c : out.idle_channels) c = whole(c);
  for (std::size_t g = 0; g < own.groups.size(); ++g) {
    const bool drives = std::ranges::find(driving, own.chosen[g]) != driving.end();
    for (const int c : own.groups[g]) {
      if (c == own.chosen[g]) continue;
      if (drives) {
        out.copied_channels.push_back({c, own.chosen[g]});
      } else {
        out.idle_channels.push_back(c);
      }
    }
  }
  std::ranges::sort(out.idle_channels);
  std::ranges::sort(out.copied_channels, {}, &ChannelCopy::channel);
}

void doubt_copies(const JointLog& log, Structure& out) {
  if (out.copied_channels.empty()) return;
  std::vector<std::string> copies;
  std::vector<std::string> used;
  for (const ChannelCopy& copy : out.copied_channels) {
    copies.push_back(log.channels[static_cast<std::size_t>(copy.channel)]);
    used.push_back(log.channels[static_cast<std::size_t>(copy.of)]);
  }
  const bool one = copies.size() == 1;
  out.doubts.push_back(
      {fmt::format("{} '{}' repeat{} '{}' (a command beside its measured value, say): the latter "
                   "{} used",
                   one ? "column" : "columns", fmt::join(copies, "', '"), one ? "s" : "",
                   fmt::join(used, "', '"), one ? "is" : "are"),
       "if a column belongs to a joint of its own, put a marker on its link and record it moving "
       "at another time",
       copies});
}

// A joint without a channel beside channels without a joint: they may belong together in a way
// that the model lacks (values that wrap, a channel with a delay of its own).
void doubt_unpaired(const Readings& readings, const OwnLog& own, Structure& out) {
  const bool undriven =
      std::ranges::any_of(out.joints, [](const StructureJoint& j) { return !j.channel; });
  std::vector<std::string> names;
  for (int c = 0; c < readings.channels(); ++c) {
    const int channel = readings.log_channel[static_cast<std::size_t>(c)];
    const bool idle = std::ranges::find(out.idle_channels, channel) != out.idle_channels.end();
    if (idle && readings.moves(c))
      names.push_back(own.log.channels[static_cast<std::size_t>(channel)]);
  }
  if (!undriven || names.empty()) return;
  out.probability = std::min(out.probability, kUnpaired);
  out.doubts.push_back(
      {fmt::format("a joint moves without a channel while '{}' move{} without a joint",
                   fmt::join(names, "', '"), names.size() == 1 ? "s" : ""),
       "check the values of the channels concerned for jumps and stretches that stand still; right "
       "where no drive moves that joint",
       names});
}

std::string joint_words(const StructureJoint& joint, const JointLog& log) {
  const std::string type = joint.type == JointType::kRevolute ? "turning" : "sliding";
  if (!joint.channel) return fmt::format("the {} joint without a channel", type);
  return fmt::format("the {} joint of '{}'", type,
                     log.channels[static_cast<std::size_t>(joint.channel->channel)]);
}

StructureDoubt misfit_doubt(const StructureJoint& joint, TagId founder, const JointLog& log,
                            bool of_another_kind) {
  const std::string name = fmt::format("tag {}", founder.value);
  const double share = of_another_kind ? joint.unexplained_across : joint.unexplained;
  std::string what = fmt::format(
      "{} leaves {:.0f} % of the motion of {} unexplained, which is far more than the "
      "noise",
      joint_words(joint, log), 100.0 * std::sqrt(share), name);
  if (of_another_kind) what += ": it may be another joint, or several";
  return {
      std::move(what),
      fmt::format("check that every link on the way to {} carries a marker, that {} sits firmly "
                  "and has the size that tags.yaml says, and that the log has every channel",
                  name, name),
      {fmt::format("tag_{}", founder.value)},
      !of_another_kind};
}

// The likelihoods compare answers with each other. How far the data are from the best of them is
// judged with the sightings' own noise; a wrong answer is worth no more than what it explains.
void judge_fit(const FoundTree& found, const Series& thin, const JointLog& log, const OwnLog& own,
               const StructureOptions& options, Structure& out) {
  const Readings readings =
      readings_like(found.readings, own.log, thin, found.offset.value_s, options.max_gap_s);
  const GrownTree tree = refit_tree(found.tree, thin, readings);
  std::size_t next = 0;
  const StructureJoint* worst = nullptr;
  TagId founder;
  for (std::size_t l = 1; l < tree.links.size(); ++l) {
    const Unexplained left = unexplained_motion(tree.links[l].attachment);
    for (std::size_t k = 0; k < tree.links[l].attachment.fit.model.joints.size(); ++k) {
      StructureJoint& joint = out.joints[next++];
      joint.unexplained = left.all();
      joint.unexplained_across = left.across;
      if (worst != nullptr && joint.unexplained <= worst->unexplained) continue;
      worst = &joint;
      founder = thin.bodies[static_cast<std::size_t>(tree.links[l].founder)].id;
    }
  }
  if (worst == nullptr) return;
  out.probability = std::min(out.probability, 1.0 - worst->unexplained);
  if (worst->unexplained < kNoticed * kNoticed) return;
  const bool of_another_kind = worst->unexplained_across > kOfAnotherKind * kOfAnotherKind;
  StructureDoubt doubt = misfit_doubt(*worst, founder, log, of_another_kind);
  if (!of_another_kind) {
    out.doubts.push_back(std::move(doubt));
    return;
  }
  out.doubts.insert(out.doubts.begin(), std::move(doubt));
  if (out.status == StructureStatus::kDetermined) out.status = StructureStatus::kAmbiguous;
}

Structure nothing(StructureDoubt doubt) {
  Structure out;
  out.status = StructureStatus::kUndetermined;
  out.links.resize(1);
  out.doubts.push_back(std::move(doubt));
  return out;
}

}  // namespace

std::string_view to_string(StructureStatus status) {
  switch (status) {
    case StructureStatus::kNotRun:
      return "not_run";
    case StructureStatus::kDetermined:
      return "determined";
    case StructureStatus::kAmbiguous:
      return "ambiguous";
    case StructureStatus::kUndetermined:
      return "undetermined";
  }
  return "unknown";
}

Structure find_structure(const PoseTracks& tracks, const JointLog& log,
                         const StructureOptions& options) {
  check(tracks);
  const PoseTracks seen = without_rare(tracks);
  if (seen.tracks.empty()) {
    return nothing(
        {"no marker was seen often enough", "record with the markers in view of the camera", {}});
  }
  Series clean = clean_series(seen);
  const Series plain = thinned(clean, kInstants);
  const Readings overlap = readings_at(log, plain, 0.0, options.max_gap_s);
  if (!log.channels.empty() && std::ranges::count(overlap.valid, 1) < kFewestSightings) {
    return nothing({"the joint log and the frames share no time",
                    "check that both clocks start together, or give the offset between them",
                    {}});
  }
  OwnLog own;
  const Answer answer = search(std::move(clean), log, options, own);
  const FoundTree& s = answer.found;
  const Series& full = answer.full;
  const Verdict verdict = judge(s.tree, answer.thin, s.readings, own.log, options);
  const Readings every =
      readings_like(s.readings, own.log, full, s.offset.value_s, options.max_gap_s);
  const GrownTree fitted = refit_tree(s.tree, full, every);
  Structure out = assemble(fitted, full, every, verdict);
  if (used_channels(fitted) > 0) doubt_unpaired(every, own, out);
  in_whole_log(own, out);
  doubt_shared_channels(log, out);
  doubt_copies(log, out);
  // Whatever else is doubtful may come of it.
  if (answer.allowance > 0.0)
    out.doubts.insert(out.doubts.begin(), allowance_doubt(answer.allowance));
  judge_fit(s, plain, log, own, options, out);
  const std::size_t used = used_channels(fitted);
  const auto moving = static_cast<std::size_t>(moving_channels(every));
  if (out.links.size() > 1 && moving > 0 && 2 * used <= moving && !is_whole(fitted, every)) {
    doubt_clocks(full, own.log, options, used == 0, out);
  }
  out.time_offset_s = s.offset.value_s;
  out.time_offset_sigma_s = s.offset.sigma_s;
  for (const PoseTrack& t : tracks.tracks) {
    if (t.samples.size() < kFewestSightings) {
      out.doubts.push_back(
          {"tag " + std::to_string(t.id.value) + " is seen too rarely to be placed",
           "keep it in view for longer",
           {"tag_" + std::to_string(t.id.value)}});
    }
  }
  return out;
}

}  // namespace kinescope
