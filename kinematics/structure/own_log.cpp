// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/own_log.h"

#include <algorithm>

#include "kinematics/log/commanded.h"

namespace kinescope::structure_search {

OwnLog own_log(const JointLog& log, std::vector<SameQuantity> groups, std::vector<int> chosen) {
  OwnLog out;
  out.channels = channels_with(log, groups, chosen);
  out.log = with_channels(log, out.channels);
  out.groups = std::move(groups);
  out.chosen = std::move(chosen);
  return out;
}

OwnLog own_log(const JointLog& log, std::vector<SameQuantity> groups) {
  // Where the markers follow a command and its measured value alike, the latter.
  std::vector<int> first;
  for (const SameQuantity& group : groups) {
    const auto measured = std::ranges::find_if(group, [&](int channel) {
      return !is_commanded(log.channels[static_cast<std::size_t>(channel)]);
    });
    first.push_back(measured == group.end() ? group.front() : *measured);
  }
  return own_log(log, std::move(groups), std::move(first));
}

void in_whole_log(const OwnLog& own, const JointLog& log, Structure& out) {
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
  std::ranges::sort(driving);
  driving.erase(std::ranges::unique(driving).begin(), driving.end());
  for (const ChannelCopy& copy : repeated_loosely(log, out.idle_channels, driving)) {
    std::erase(out.idle_channels, copy.channel);
    out.copied_channels.push_back(copy);
  }
  std::ranges::sort(out.idle_channels);
  std::ranges::sort(out.copied_channels, {}, &ChannelCopy::channel);
}

}  // namespace kinescope::structure_search
