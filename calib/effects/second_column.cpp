// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/second_column.h"

#include <algorithm>
#include <cmath>

#include "calib/effects/joint_shares.h"
#include "calib/effects/traced_columns.h"
#include "calib/trace/trace.h"

namespace kinescope {
namespace {

// Enough to follow a reversal; play is computed over all of them.
constexpr std::size_t kMostSamples = 20000;
constexpr Eigen::Index kFewestRows = 100;
constexpr Eigen::Index kFewestPostures = 15;
// What moves a column by less is nothing that anybody asks for; 2000 samples hardly show it.
constexpr double kOfNoise = 0.1;
// Of the column's size: what is written with all its digits is rounded by as much.
constexpr double kRounding = 1e-12;

JointLog thinned(const JointLog& log) {
  const std::size_t stride = (log.size() + kMostSamples - 1) / kMostSamples;
  if (stride <= 1) return log;
  JointLog out = log;
  out.times_s.clear();
  std::vector<Eigen::Index> kept;
  for (std::size_t i = 0; i < log.size(); i += stride) {
    out.times_s.push_back(log.times_s[i]);
    kept.push_back(static_cast<Eigen::Index>(i));
  }
  out.values = log.values(kept, Eigen::all);
  return out;
}

void take_difference(const effects::ColumnPair& pair, SecondColumn& out) {
  const Eigen::VectorXd difference = pair.other - pair.used.value.col(pair.joint);
  out.offset = difference.mean();
  out.before = std::sqrt((difference.array() - out.offset).square().mean());
  if (out.before <= kRounding * pair.other.cwiseAbs().maxCoeff()) out.before = 0.0;
  out.after = out.before;
}

void say_nothing(const std::string& reason, TraceVerdict verdict, SecondColumn& out) {
  out.trace.verdict = verdict;
  out.trace.reason = reason;
}

void trace_difference(const effects::ColumnPair& pair, const KinematicTree& tree,
                      const std::optional<Eigen::Vector3d>& gravity_base, SecondColumn& out) {
  if (out.before == 0.0) return say_nothing("the columns are equal", TraceVerdict::kClean, out);
  const effects::TracedColumns model(pair, tree, gravity_base);
  if (model.rows() < (pair.postures ? kFewestPostures : kFewestRows))
    return say_nothing("too few samples", TraceVerdict::kNothingToSay, out);
  if (!pair.postures) out.noise = model.noise();
  out.trace = trace_effects(model, {.noise_floor = kOfNoise});
  if (out.trace.verdict == TraceVerdict::kNothingToSay) return;
  out.after = out.trace.noise;
  out.lifted = model.is_lifted(out.trace.added);
}

}  // namespace

std::vector<SecondColumn> second_columns(const JointLog& log, const KinematicTree& tree,
                                         const std::optional<Eigen::Vector3d>& gravity_base,
                                         bool postures) {
  std::vector<SecondColumn> out;
  if (log.empty() ||
      std::ranges::all_of(tree.joints, &std::vector<std::string>::empty, &Joint::copies))
    return out;
  const JointLog samples = thinned(log);
  const JointMotion used = effects::motion_of(samples, tree);
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    for (const std::string& column : joint.copies) {
      const auto other = samples.channel(column);
      if (!other || !samples.channel(joint.channel)) continue;
      const effects::ColumnPair pair{column, static_cast<int>(j), used,
                                     effects::joint_values(samples, joint, *other), postures};
      SecondColumn& second = out.emplace_back();
      second.column = column;
      second.channel = joint.channel;
      second.joint = joint.name;
      second.unit = joint.type == JointType::kRevolute ? "rad" : "m";
      take_difference(pair, second);
      trace_difference(pair, tree, gravity_base, second);
    }
  }
  return out;
}

}  // namespace kinescope
