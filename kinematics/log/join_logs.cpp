// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/join_logs.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

std::vector<std::string> missing_channels(const JointLog& of, const JointLog& in) {
  std::vector<std::string> out;
  for (const std::string& channel : of.channels)
    if (!in.channel(channel)) out.push_back(channel);
  return out;
}

void require_channels_of(const JointLog& of, const JointLog& in) {
  const std::vector<std::string> missing = missing_channels(of, in);
  if (missing.empty()) return;
  throw bad_input(
      in.source,
      fmt::format("has no column '{}', which {} has", fmt::join(missing, "', '"), of.source),
      "recordings of one robot have the same channels, under the same names");
}

}  // namespace

JointLog joined_logs(JointLog first, const JointLog& second, double start_s, bool apart) {
  require_channels_of(first, second);
  require_channels_of(second, first);
  const double begin_s = second.times_s.front() + start_s;
  KINESCOPE_CHECK(begin_s > first.times_s.back(), "a log begins behind the end of the one before");
  if (apart) first.joined_at_s.push_back(begin_s);
  for (const double at_s : second.joined_at_s) first.joined_at_s.push_back(at_s + start_s);
  for (const double t : second.times_s) first.times_s.push_back(t + start_s);
  const Eigen::Index before = first.values.rows();
  first.values.conservativeResize(before + second.values.rows(), Eigen::NoChange);
  for (std::size_t c = 0; c < first.channels.size(); ++c) {
    first.values.col(static_cast<Eigen::Index>(c)).tail(second.values.rows()) =
        second.values.col(*second.channel(first.channels[c]));
  }
  return first;
}

}  // namespace kinescope
