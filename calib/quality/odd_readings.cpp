// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/odd_readings.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>
#include <optional>

#include "kinematics/core/mean_step.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

// Of the marker's distance from where the reading has it: what a right value may leave.
constexpr double kBroughtBack = 0.1;

// Markers of one frame: the pose seen, and whether the fit left it out.
struct Seen {
  const Marker* marker = nullptr;
  Pose T_camera_marker;
  bool used = true;
};

// By its own channel, and no other one.
bool is_read_alone(const Joint& joint) {
  return is_movable(joint) && !joint.channel.empty() && joint.couplings.empty();
}

using Frames = std::map<int, std::vector<Seen>>;

// What a camera that is carried would see from its usual place.
Pose as_if_at_rest(const Calibration& calibration, const PoseSample& sample) {
  if (!calibration.moving) return sample.T_camera_marker;
  const Pose& T_camera_base = calibration.moving->path[static_cast<std::size_t>(sample.frame)];
  return calibration.T_camera_base * T_camera_base.inverse() * sample.T_camera_marker;
}

Frames frames_of(const Calibration& calibration, const PoseTracks& tracks) {
  // Of a camera on the robot a reading moves what is seen of all that is before the joint.
  if (calibration.moving && calibration.moving->on_robot()) return {};
  std::map<std::pair<int, TagId>, bool> used;
  for (const SightingResidual& residual : calibration.residuals)
    used[{residual.frame, residual.id}] = residual.used;
  Frames out;
  for (const PoseTrack& track : tracks.tracks) {
    const Marker* marker = calibration.tree.marker(track.id);
    if (marker == nullptr) continue;
    for (const PoseSample& sample : track.samples) {
      const auto at = used.find({sample.frame, track.id});
      out[sample.frame].push_back(
          {marker, as_if_at_rest(calibration, sample), at != used.end() && at->second});
    }
  }
  return out;
}

class Reader {
 public:
  explicit Reader(const Calibration& calibration) : calibration_(calibration) {
    for (std::size_t l = 0; l < calibration.tree.links.size(); ++l)
      paths_.push_back(calibration.tree.path_to(LinkId{static_cast<int>(l)}));
  }

  [[nodiscard]] bool is_behind(const Marker& marker, JointId joint) const {
    return std::ranges::find(paths_[marker.link.index()], joint) !=
           paths_[marker.link.index()].end();
  }

  /// Every marker behind the joint was left out, and none before it.
  [[nodiscard]] bool is_suspect(JointId joint, const std::vector<Seen>& frame) const {
    bool any = false;
    for (const Seen& seen : frame) {
      if (is_behind(*seen.marker, joint) == seen.used) return false;
      any = any || !seen.used;
    }
    return any;
  }

  /// The joint's value under which every marker behind it is where it was seen; nothing where there
  /// is none.
  [[nodiscard]] std::optional<double> value_seen(JointId joint, const Eigen::VectorXd& q,
                                                 const std::vector<Seen>& frame) const {
    double sum = 0.0, before = 0.0, after = 0.0;
    int count = 0;
    for (const Seen& seen : frame) {
      if (!is_behind(*seen.marker, joint)) continue;
      sum += value_from(joint, q, seen);
      ++count;
    }
    if (count == 0) return std::nullopt;
    Eigen::VectorXd moved = q;
    moved[joint.value] = sum / count;
    for (const Seen& seen : frame) {
      if (!is_behind(*seen.marker, joint)) continue;
      before += missed(q, seen);
      after += missed(moved, seen);
    }
    if (!(after < kBroughtBack * before)) return std::nullopt;
    return moved[joint.value];
  }

 private:
  [[nodiscard]] Pose predicted(const Eigen::VectorXd& q, const Marker& marker) const {
    return calibration_.T_camera_base *
           forward_kinematics(calibration_.tree, q)[marker.link.index()] * marker.T_link_marker;
  }

  // A turn counts as it moves a point at the distance of a link.
  [[nodiscard]] double missed(const Eigen::VectorXd& q, const Seen& seen) const {
    constexpr double kLever = 0.1;  // m
    const Pose T = predicted(q, *seen.marker);
    return (T.translation - seen.T_camera_marker.translation).norm() +
           kLever * angle_between(T.rotation, seen.T_camera_marker.rotation);
  }

  // From the one pose alone, along or about the joint's axis; the turn nearest to the reading.
  [[nodiscard]] double value_from(JointId id, const Eigen::VectorXd& q, const Seen& seen) const {
    const Joint& joint = calibration_.tree.joints[id.index()];
    const std::vector<Pose> links = forward_kinematics(calibration_.tree, q);
    const Pose T_camera_joint =
        calibration_.T_camera_base * links[joint.parent.index()] * joint.T_parent_joint;
    const Pose T_child_marker = links[joint.child.index()].inverse() *
                                links[seen.marker->link.index()] * seen.marker->T_link_marker;
    const Pose motion = T_camera_joint.inverse() * seen.T_camera_marker * T_child_marker.inverse();
    if (joint.type == JointType::kPrismatic) return motion.translation.dot(joint.axis);
    const double angle = log_rotation(motion.rotation).dot(joint.axis);
    const double turn = 2.0 * std::numbers::pi;
    return angle + turn * std::round((usual_value(id) - angle) / turn);
  }

  [[nodiscard]] double usual_value(JointId id) const {
    std::vector<double> values;
    for (const double value : calibration_.joint_values.col(id.value))
      if (std::isfinite(value)) values.push_back(value);
    return values.empty() ? 0.0 : median_of(std::move(values));
  }

  const Calibration& calibration_;
  std::vector<std::vector<JointId>> paths_;
};

}  // namespace

std::optional<double> reading_shown(const Calibration& calibration, const PoseTracks& tracks,
                                    int frame, const std::string& channel) {
  const Eigen::VectorXd q = calibration.joint_values.row(frame);
  const Frames frames = frames_of(calibration, tracks);
  const auto seen = frames.find(frame);
  const auto joint = std::ranges::find(calibration.tree.joints, channel, &Joint::channel);
  if (!q.allFinite() || seen == frames.end() || joint == calibration.tree.joints.end() ||
      !is_read_alone(*joint))
    return std::nullopt;
  const JointId id{static_cast<int>(joint - calibration.tree.joints.begin())};
  const std::optional<double> value = Reader(calibration).value_seen(id, q, seen->second);
  if (!value) return std::nullopt;
  return *value / joint->scale;
}

std::vector<OddReading> odd_readings(const Calibration& calibration, const PoseTracks& tracks,
                                     const JointLog& log) {
  std::vector<OddReading> out;
  const Reader reader(calibration);
  for (const auto& [frame, seen] : frames_of(calibration, tracks)) {
    if (std::ranges::all_of(seen, &Seen::used)) continue;
    const Eigen::VectorXd q = calibration.joint_values.row(frame);
    if (!q.allFinite()) continue;
    for (std::size_t j = 0; j < calibration.tree.joints.size(); ++j) {
      const Joint& joint = calibration.tree.joints[j];
      const JointId id{static_cast<int>(j)};
      if (!is_read_alone(joint) || !log.channel(joint.channel) || !reader.is_suspect(id, seen))
        continue;
      const std::optional<double> value = reader.value_seen(id, q, seen);
      if (!value) continue;
      const double read = (q[id.value] - joint.offset) / joint.scale;
      out.push_back({calibration.times_s[static_cast<std::size_t>(frame)], joint.channel, read,
                     read + (*value - q[id.value]) / joint.scale});
      break;
    }
  }
  return out;
}

std::vector<OddStretch> odd_stretches(const Calibration& calibration,
                                      const std::vector<OddReading>& readings) {
  // Where the joint comes by what it reads, a frame between two others is none of them.
  constexpr double kMostApart = 4.0;  // usual steps; chosen
  const double apart_s = kMostApart * median_step_s(calibration.times_s);
  std::map<std::string, std::vector<OddStretch>> by_channel;
  for (const OddReading& odd : readings) {
    std::vector<OddStretch>& own = by_channel[odd.channel];
    const double at_s = odd.time_s + calibration.time_offset_s;
    const auto off = [](const OddReading& one) { return std::abs(one.expected - one.read); };
    if (own.empty() || at_s - own.back().to_s > apart_s) {
      own.push_back({odd.channel, at_s, at_s, 1, odd, true});
      continue;
    }
    OddStretch& last = own.back();
    last.stands_still = last.stands_still && odd.read == last.most.read;
    last.to_s = at_s;
    ++last.frames;
    if (off(odd) > off(last.most)) last.most = odd;
  }
  std::vector<OddStretch> out;
  for (auto& [channel, own] : by_channel) {
    std::ranges::copy_if(own, std::back_inserter(out),
                         [](const OddStretch& stretch) { return stretch.frames > 1; });
  }
  std::ranges::stable_sort(out, {}, &OddStretch::from_s);
  return out;
}

}  // namespace kinescope
