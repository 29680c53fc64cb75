// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/assemble.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace kinescope::structure_search {
namespace {

const Eigen::Vector3d kZ = Eigen::Vector3d::UnitZ();

// One joint as it goes into the structure, with everything counted in SI units from the channels'
// zero.
struct SiJoint {
  JointType type = JointType::kRevolute;
  Pose frame;                      // z = axis, turned so that the main scale is positive
  double zero = 0.0;               // the joint's value where the search's coordinate is zero
  double sign = 1.0;               // of the search's coordinate in the new frame
  std::vector<ChannelTerm> terms;  // main first
};

// The first component of noticeable size is positive: a choice of direction that depends on nothing
// else.
bool points_forward(const Eigen::Vector3d& axis) {
  Eigen::Index largest = 0;
  axis.cwiseAbs().maxCoeff(&largest);
  return axis(largest) > 0.0;
}

SiJoint si_joint(const ChainJoint& joint, const Pose& mount, const Readings& readings,
                 const std::vector<double>& scale_sigma, std::size_t first_term) {
  SiJoint out;
  out.type = joint.type;
  out.frame = joint.frame;
  const bool forward = joint.terms.empty() ? points_forward(joint.frame.rotation * kZ)
                                           : joint.terms.front().scale > 0.0;
  if (!forward) {
    out.sign = -1.0;
    out.frame.rotation = out.frame.rotation * Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);
  }
  // Slide the origin along the axis to the child's marker (for a slide: onto it).
  const Eigen::Vector3d p = out.frame.inverse() * mount.translation;
  const Eigen::Vector3d origin =
      joint.type == JointType::kRevolute ? Eigen::Vector3d(0.0, 0.0, p.z()) : p;
  out.frame.translation = out.frame * origin;
  for (std::size_t t = 0; t < joint.terms.size(); ++t) {
    const auto c = static_cast<std::size_t>(joint.terms[t].channel);
    const double scale = out.sign * joint.terms[t].scale / readings.rms[c];
    out.terms.push_back(
        {readings.log_channel[c], scale, scale_sigma[first_term + t] / readings.rms[c]});
    out.zero += scale * readings.mean[c];
  }
  return out;
}

// Places of the bodies on the links: the reference marker, and how founders' frames relate to it.
struct Places {
  std::vector<Pose> T_reference_founder;  // of every grown link
};

Places place_markers(const GrownTree& tree, const Series& series, Structure& out,
                     const std::vector<int>& number) {
  Places places;
  for (std::size_t l = 0; l < tree.links.size(); ++l) {
    StructureLink& link = out.links[static_cast<std::size_t>(number[l])];
    std::vector<Pose> in_founder;
    for (std::size_t b = 0; b < tree.bodies.size(); ++b) {
      if (tree.bodies[b].link != static_cast<int>(l)) continue;
      const bool founder = tree.links[l].founder == static_cast<int>(b);
      link.markers.push_back(series.bodies[b].id);
      in_founder.push_back(founder ? Pose{} : tree.bodies[b].attachment.fit.model.mount);
    }
    const Pose T_reference = l == 0 || in_founder.empty() ? Pose{} : in_founder.front().inverse();
    for (const Pose& T : in_founder) link.T_reference_marker.push_back(T_reference * T);
    places.T_reference_founder.push_back(T_reference);
  }
  return places;
}

double travel_of(const SiJoint& joint, const Readings& readings,
                 const std::vector<double>& coordinates, const ChainJoint& chain) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (std::size_t i = 0; i < readings.valid.size(); ++i) {
    double value = 0.0;
    if (!joint.terms.empty()) {
      if (readings.valid[i] == 0) continue;
      value = chain_coordinate(chain, readings.value, static_cast<int>(i));
    } else {
      if (i >= coordinates.size() || std::isnan(coordinates[i])) continue;
      value = coordinates[i];
    }
    low = std::min(low, value);
    high = std::max(high, value);
  }
  return high > low ? high - low : 0.0;
}

// Adds the joints (and unseen links between them) of one grown link.
void add_joints(const GrownTree& tree, std::size_t l, const Readings& readings,
                const Verdict& verdict, const Places& places, const std::vector<int>& number,
                Structure& out) {
  const GrownLink& link = tree.links[l];
  const ChainFit& fit = link.attachment.fit;
  Pose tail = places.T_reference_founder[static_cast<std::size_t>(link.parent)];
  int parent = number[static_cast<std::size_t>(link.parent)];
  std::size_t term = 0;
  const std::size_t count = fit.model.joints.size();
  for (std::size_t k = 0; k < count; ++k) {
    const ChainJoint& chain = fit.model.joints[k];
    const SiJoint si = si_joint(chain, fit.model.mount, readings, fit.scale_sigma, term);
    term += chain.terms.size();
    StructureJoint joint;
    joint.type = si.type;
    joint.parent_link = parent;
    joint.child_link = number[l] - static_cast<int>(count - 1 - k);
    joint.T_parent_joint = tail * si.frame;
    // The search's zero is at `zero` in readings: take that motion back on the child's side.
    const Pose back = joint_motion(si.type, kZ, -si.zero) * si.frame.inverse();
    tail = back;
    joint.T_joint_child = Pose{};
    if (k + 1 == count) {
      joint.T_joint_child = back * fit.model.mount * places.T_reference_founder[l].inverse();
    }
    if (!si.terms.empty()) {
      joint.channel = si.terms.front();
      joint.couplings.assign(si.terms.begin() + 1, si.terms.end());
    }
    joint.travel = travel_of(si, readings, link.path.coordinate, chain);
    joint.rotation_rms_rad = fit.rotation_rms;
    joint.translation_rms_m = fit.translation_rms;
    joint.log_odds = verdict.link_log_odds[l];
    joint.runner_up = verdict.link_runner_up[l];
    const auto column = static_cast<Eigen::Index>(out.joints.size());
    if (si.terms.empty()) {
      for (std::size_t i = 0; i < link.path.coordinate.size(); ++i) {
        out.joint_values(static_cast<Eigen::Index>(i), column) = si.sign * link.path.coordinate[i];
      }
    }
    parent = joint.child_link;
    out.joints.push_back(std::move(joint));
  }
}

}  // namespace

Structure assemble(const GrownTree& tree, const Series& full, const Readings& readings,
                   const Verdict& verdict) {
  Structure out;
  out.status = verdict.status;
  out.probability = verdict.probability;
  out.runner_up = verdict.runner_up;
  out.runner_up_log_odds = verdict.runner_up_log_odds;
  out.doubts = verdict.doubts;
  std::vector<int> number(tree.links.size(), 0);
  Eigen::Index joints = 0;
  int links = 1;
  for (std::size_t l = 1; l < tree.links.size(); ++l) {
    const auto count = static_cast<int>(tree.links[l].attachment.fit.model.joints.size());
    links += count;
    joints += count;
    number[l] = links - 1;
  }
  out.links.resize(static_cast<std::size_t>(links));
  out.joint_values =
      Eigen::MatrixXd::Constant(full.size(), joints, std::numeric_limits<double>::quiet_NaN());
  const Places places = place_markers(tree, full, out, number);
  for (std::size_t l = 1; l < tree.links.size(); ++l) {
    add_joints(tree, l, readings, verdict, places, number, out);
  }
  for (std::size_t b = 0; b < tree.bodies.size(); ++b) {
    if (tree.bodies[b].link < 0) out.free_markers.push_back(full.bodies[b].id);
  }
  std::vector<char> used(readings.log_channel.size(), 0);
  for (const StructureJoint& j : out.joints) {
    if (j.channel) used[static_cast<std::size_t>(j.channel->channel)] = 1;
    for (const ChannelTerm& t : j.couplings) used[static_cast<std::size_t>(t.channel)] = 1;
  }
  for (std::size_t c = 0; c < used.size(); ++c) {
    if (used[c] == 0) out.idle_channels.push_back(static_cast<int>(c));
  }
  return out;
}

}  // namespace kinescope::structure_search
