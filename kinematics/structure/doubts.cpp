// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/doubts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/structure/time_offset.h"
#include "kinematics/structure/unexplained.h"

namespace kinescope::structure_search {
namespace {

// Most that an answer is worth in which a joint has no channel and a channel has no joint.
constexpr double kUnpaired = 0.9;

// RMS share of a link's motion that its joint leaves: worth a word, and so much of what no value of
// the joint makes that it may be another joint, or several.
constexpr double kNoticed = 0.1;
constexpr double kOfAnotherKind = 0.25;

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
    const Answer other = answer_with(full, 0.0, shifted(log, -start_s), options);
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
        answer_with(part, 0.0, with_clock(log, clock, full.times_s.front()), options);
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

}  // namespace

void doubt_clocks(const GrownTree& fitted, const Readings& readings, const Series& full,
                  const JointLog& log, const StructureOptions& options, Structure& out) {
  const auto used = static_cast<int>(used_channels(fitted));
  const int moving = moving_channels(readings);
  if (out.links.size() < 2 || moving == 0 || 2 * used > moving || is_whole(fitted, readings))
    return;
  const bool nothing_driven = used == 0;
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

void doubt_allowance(const Answer& answer, Structure& out) {
  if (answer.allowance == 0.0) return;
  // First: whatever else is doubtful may come of it.
  out.doubts.insert(
      out.doubts.begin(),
      {fmt::format("predicted and measured motion of the markers differ by {:.1f} % of their "
                   "distance, which is more than their noise",
                   100.0 * answer.allowance),
       "check the camera's intrinsics and the markers' sizes, that no marker has slipped and that "
       "the camera stood still",
       {},
       true});
}

void doubt_shared_channels(const JointLog& log, Structure& out) {
  std::erase_if(out.doubts, [](const StructureDoubt& doubt) { return doubt.of_shared_channel; });
  std::map<int, int> joints;
  for (const StructureJoint& joint : out.joints) {
    if (joint.channel) ++joints[joint.channel->channel];
  }
  for (const auto& [channel, count] : joints) {
    if (count < 2) continue;
    const std::string& name = log.channels[static_cast<std::size_t>(channel)];
    StructureDoubt doubt{fmt::format("{} drives {} joints", name, count),
                         "right where one motor moves them all; else check that their markers sit "
                         "firmly and are wholly in view",
                         {name}};
    doubt.of_shared_channel = true;
    out.doubts.push_back(std::move(doubt));
  }
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

void judge_fit(const Answer& answer, const Series& plain, const JointLog& log, const OwnLog& own,
               const StructureOptions& options, Structure& out) {
  const FoundTree& found = answer.found;
  // Without an allowance it was found with that noise.
  const GrownTree tree = answer.allowance == 0.0
                             ? found.tree
                             : refit_tree(found.tree, plain,
                                          readings_like(found.readings, own.log, plain,
                                                        found.offset.value_s, options.max_gap_s));
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
      founder = plain.bodies[static_cast<std::size_t>(tree.links[l].founder)].id;
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
  out.rivals.clear();  // that they are ruled out would not be enough
}

}  // namespace kinescope::structure_search
