// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/postures.h"

#include <set>
#include <string>

namespace kinescope {

bool shows_postures(const KinematicTree& tree, const JointLog& log,
                    const std::vector<double>& times_s) {
  std::set<int> channels;
  const auto add = [&](const std::string& name) {
    if (const auto channel = log.channel(name)) channels.insert(*channel);
  };
  for (const Joint& joint : tree.joints) {
    if (is_movable(joint)) add(joint.channel);
    for (const ChannelShare& share : joint.couplings) add(share.channel);
  }
  return !log.empty() && is_posture_log(log, times_s, {channels.begin(), channels.end()});
}

}  // namespace kinescope
