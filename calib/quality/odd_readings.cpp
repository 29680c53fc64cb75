// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/odd_readings.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/dense_algebra.h"
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
    for (Eigen::Index j = 0; j < calibration.joint_values.cols(); ++j) {
      std::vector<double> values;
      for (const double one : calibration.joint_values.col(j))
        if (std::isfinite(one)) values.push_back(one);
      usual_.push_back(values.empty() ? 0.0 : median_of(std::move(values)));
    }
  }

  /// Values of all joints, those of `wrong` such that every marker is where it was seen; nothing
  /// where there are none.
  [[nodiscard]] std::optional<Eigen::VectorXd> values_seen(const std::vector<JointId>& wrong,
                                                           const Eigen::VectorXd& q,
                                                           const std::vector<Seen>& frame) const {
    Eigen::VectorXd moved = fitted(wrong, q, frame);
    if (!(missed(moved, frame) < kBroughtBack * missed(q, frame))) return std::nullopt;
    return moved;
  }

  /// The fewest of `candidates` that, read otherwise, have every marker where it was seen.
  [[nodiscard]] std::vector<JointId> wrong_in(std::vector<JointId> candidates,
                                              const Eigen::VectorXd& q,
                                              const std::vector<Seen>& frame) const {
    std::erase_if(candidates, [&](JointId joint) {
      return std::ranges::none_of(frame,
                                  [&](const Seen& seen) { return is_behind(*seen.marker, joint); });
    });
    if (candidates.empty() || !values_seen(candidates, q, frame)) return {};
    while (candidates.size() > 1) {
      std::size_t least = 0;
      double least_missed = std::numeric_limits<double>::infinity();
      for (std::size_t k = 0; k < candidates.size(); ++k) {
        const double left = missed(fitted(without(candidates, k), q, frame), frame);
        if (left < least_missed) {
          least_missed = left;
          least = k;
        }
      }
      if (!(least_missed < kBroughtBack * missed(q, frame))) break;
      candidates = without(std::move(candidates), least);
    }
    return candidates;
  }

 private:
  static std::vector<JointId> without(std::vector<JointId> joints, std::size_t k) {
    joints.erase(joints.begin() + static_cast<std::ptrdiff_t>(k));
    return joints;
  }

  [[nodiscard]] bool is_behind(const Marker& marker, JointId joint) const {
    return std::ranges::find(paths_[marker.link.index()], joint) !=
           paths_[marker.link.index()].end();
  }

  // Least squares over the markers' poses, from what each joint's nearest marker says alone.
  [[nodiscard]] Eigen::VectorXd fitted(const std::vector<JointId>& free, Eigen::VectorXd q,
                                       const std::vector<Seen>& frame) const {
    constexpr int kMostSteps = 10;
    constexpr double kSettled = 1e-9;  // rad or m
    for (const JointId joint : free) {
      if (const Seen* seen = nearest_behind(joint, frame))
        q[joint.value] = value_from(joint, q, *seen);
    }
    const auto columns = static_cast<Eigen::Index>(free.size());
    for (int step = 0; step < kMostSteps; ++step) {
      const std::vector<Pose> links = forward_kinematics(calibration_.tree, q);
      Eigen::MatrixXd H = Eigen::MatrixXd::Zero(columns, columns);
      Eigen::VectorXd g = Eigen::VectorXd::Zero(columns);
      for (const Seen& seen : frame) {
        const Pose T = predicted(links, *seen.marker);
        const Vector6d r = off(T, seen);
        Eigen::Matrix<double, 6, Eigen::Dynamic> J = Eigen::MatrixXd::Zero(6, columns);
        for (Eigen::Index k = 0; k < columns; ++k) {
          const JointId joint = free[static_cast<std::size_t>(k)];
          if (is_behind(*seen.marker, joint)) J.col(k) = moves(joint, links, T.translation);
        }
        H += J.transpose() * J;
        g += J.transpose() * r;
      }
      const Eigen::VectorXd d = shortest_least_squares(H, g);
      for (Eigen::Index k = 0; k < columns; ++k) q[free[static_cast<std::size_t>(k)].value] += d[k];
      if (d.norm() < kSettled) break;
    }
    for (const JointId joint : free) q[joint.value] = at_usual_turn(joint, q[joint.value]);
    return q;
  }

  [[nodiscard]] const Seen* nearest_behind(JointId joint, const std::vector<Seen>& frame) const {
    const Seen* nearest = nullptr;
    for (const Seen& seen : frame) {
      if (is_behind(*seen.marker, joint) &&
          (nearest == nullptr ||
           paths_[seen.marker->link.index()].size() < paths_[nearest->marker->link.index()].size()))
        nearest = &seen;
    }
    return nearest;
  }

  [[nodiscard]] Pose predicted(const std::vector<Pose>& links, const Marker& marker) const {
    return calibration_.T_camera_base * links[marker.link.index()] * marker.T_link_marker;
  }

  // In the camera's frame: how far it was seen from there, and turned; a turn counts as it moves a
  // point at the distance of a link.
  [[nodiscard]] static Vector6d off(const Pose& T, const Seen& seen) {
    Vector6d out;
    out << seen.T_camera_marker.translation - T.translation,
        kLever * log_rotation(seen.T_camera_marker.rotation * T.rotation.inverse());
    return out;
  }

  // What a point at `at` does per unit of the joint, as off().
  [[nodiscard]] Vector6d moves(JointId id, const std::vector<Pose>& links,
                               const Eigen::Vector3d& at) const {
    const Joint& joint = calibration_.tree.joints[id.index()];
    const Pose T = calibration_.T_camera_base * links[joint.parent.index()] * joint.T_parent_joint;
    const Eigen::Vector3d axis = T.rotation * joint.axis;
    Vector6d out;
    if (joint.type == JointType::kPrismatic)
      out << axis, Eigen::Vector3d::Zero();
    else
      out << axis.cross(at - T.translation), kLever * axis;
    return out;
  }

  [[nodiscard]] double missed(const Eigen::VectorXd& q, const std::vector<Seen>& frame) const {
    const std::vector<Pose> links = forward_kinematics(calibration_.tree, q);
    double sum = 0.0;
    for (const Seen& seen : frame) sum += off(predicted(links, *seen.marker), seen).norm();
    return sum;
  }

  // From the one pose alone, along or about the joint's axis.
  [[nodiscard]] double value_from(JointId id, const Eigen::VectorXd& q, const Seen& seen) const {
    const Joint& joint = calibration_.tree.joints[id.index()];
    const std::vector<Pose> links = forward_kinematics(calibration_.tree, q);
    const Pose T_camera_joint =
        calibration_.T_camera_base * links[joint.parent.index()] * joint.T_parent_joint;
    const Pose T_child_marker = links[joint.child.index()].inverse() *
                                links[seen.marker->link.index()] * seen.marker->T_link_marker;
    const Pose motion = T_camera_joint.inverse() * seen.T_camera_marker * T_child_marker.inverse();
    if (joint.type == JointType::kPrismatic) return motion.translation.dot(joint.axis);
    return log_rotation(motion.rotation).dot(joint.axis);
  }

  [[nodiscard]] double at_usual_turn(JointId id, double value) const {
    if (calibration_.tree.joints[id.index()].type == JointType::kPrismatic) return value;
    const double turn = 2.0 * std::numbers::pi;
    return value + turn * std::round((usual_[id.index()] - value) / turn);
  }

  static constexpr double kLever = 0.1;  // m; chosen

  const Calibration& calibration_;
  std::vector<std::vector<JointId>> paths_;
  std::vector<double> usual_;  // of each joint
};

// Those of one frame, an entry for every joint that was read wrongly.
std::vector<OddReading> odd_in_frame(const Calibration& calibration, const Reader& reader,
                                     const JointLog& log, int frame,
                                     const std::vector<Seen>& seen) {
  const Eigen::VectorXd q = calibration.joint_values.row(frame);
  const auto left_out = std::ranges::count(seen, false, &Seen::used);
  if (left_out == 0 || !q.allFinite()) return {};
  std::vector<JointId> candidates;
  for (std::size_t j = 0; j < calibration.tree.joints.size(); ++j) {
    const Joint& joint = calibration.tree.joints[j];
    if (is_read_alone(joint) && log.channel(joint.channel))
      candidates.push_back(JointId{static_cast<int>(j)});
  }
  const std::vector<JointId> wrong = reader.wrong_in(std::move(candidates), q, seen);
  // As many joints as there are directions in a pose bring any marker back.
  if (wrong.empty() || std::ssize(wrong) > left_out) return {};
  const std::optional<Eigen::VectorXd> shown = reader.values_seen(wrong, q, seen);
  if (!shown) return {};
  std::vector<OddReading> out;
  for (const JointId id : wrong) {
    const Joint& joint = calibration.tree.joints[id.index()];
    const double read = (q[id.value] - joint.offset) / joint.scale;
    out.push_back({calibration.times_s[static_cast<std::size_t>(frame)], joint.channel, read,
                   read + ((*shown)[id.value] - q[id.value]) / joint.scale});
  }
  return out;
}

void add_channels(const OddStretch& of, OddStretch& to) {
  for (const std::string& channel : of.channels)
    if (std::ranges::find(to.channels, channel) == to.channels.end())
      to.channels.push_back(channel);
}

void add_alongside(const OddStretch& of, OddStretch& to) {
  add_channels(of, to);
  to.from_s = std::min(to.from_s, of.from_s);
  to.to_s = std::max(to.to_s, of.to_s);
  to.frames = std::max(to.frames, of.frames);
  to.stands_still = to.stands_still && of.stands_still;
}

// Where the same readings stand in the log before, that is how long the stretch is, and what it is:
// readings of these channels that stay, or whole rows, at least as many as chance does not make of
// a log with few digits.
void look_for_repeated(OddStretch& stretch, const JointLog& log) {
  const auto row_at = [&](double time_s) {
    return std::ranges::lower_bound(log.times_s, time_s) - log.times_s.begin();
  };
  std::vector<int> channels;
  for (const std::string& name : stretch.channels)
    if (const std::optional<int> channel = log.channel(name)) channels.push_back(*channel);
  std::ptrdiff_t first = row_at(stretch.from_s), end = row_at(stretch.to_s);
  constexpr std::ptrdiff_t kFewestRows = 5;  // chosen
  if (end - first < 2 || channels.empty()) return;
  const auto is_again = [&](std::ptrdiff_t row, std::ptrdiff_t shift) {
    if (row < shift || row >= std::ssize(log.times_s)) return false;
    if (shift > 1) return log.values.row(row) == log.values.row(row - shift);
    return std::ranges::all_of(channels, [&](int channel) {
      return log.values(row, channel) == log.values(row - 1, channel);
    });
  };
  for (std::ptrdiff_t shift = 1; shift <= first; ++shift) {
    if (shift > 1 && end - first < kFewestRows) return;
    std::ptrdiff_t row = first;
    while (row < end && is_again(row, shift)) ++row;
    if (row < end) continue;
    while (is_again(first - 1, shift)) --first;
    while (is_again(end, shift)) ++end;
    const auto time_of = [&](std::ptrdiff_t k) { return log.times_s[static_cast<std::size_t>(k)]; };
    stretch.stands_still = shift == 1;
    if (shift > 1) stretch.repeats_s = time_of(first) - time_of(first - shift);
    stretch.from_s = time_of(first);
    stretch.to_s = time_of(end - 1);
    return;
  }
}

// How much later the log has what the markers show; nothing where it nowhere has.
std::optional<double> late_by(const OddStretch& stretch, const Calibration& calibration,
                              const JointLog& log, const std::vector<OddReading>& readings) {
  constexpr double kMost_s = 2.0;  // chosen
  struct Shown {
    int channel;
    double at_s, value;
  };
  std::vector<Shown> all;
  const Eigen::RowVectorXd centre = log.values.colwise().mean();
  const Eigen::RowVectorXd motion = (log.values.rowwise() - centre).colwise().norm();
  for (const OddReading& odd : readings) {
    const double at_s = odd.time_s + calibration.time_offset_s;
    const std::optional<int> channel = log.channel(odd.channel);
    if (at_s < stretch.from_s || at_s > stretch.to_s || !channel || !(motion[*channel] > 0.0) ||
        std::ranges::find(stretch.channels, odd.channel) == stretch.channels.end())
      continue;
    all.push_back({*channel, at_s, odd.expected});
  }
  if (all.empty()) return std::nullopt;
  const auto missed = [&](double late_s) {
    std::vector<double> off;
    for (const Shown& one : all) {
      const auto read = interpolate(log, one.channel, one.at_s + late_s);
      off.push_back(read ? std::abs(read->value - one.value) / motion[one.channel]
                         : std::numeric_limits<double>::infinity());
    }
    return median_of(std::move(off));  // what came last may have been lost
  };
  const double step_s =
      0.5 * std::min(median_step_s(calibration.times_s), median_step_s(log.times_s));
  double best_s = 0.0;
  double least = missed(0.0);
  const double usual = least;
  for (int k = static_cast<int>(-kMost_s / step_s); k * step_s <= kMost_s; ++k) {
    const double now = missed(k * step_s);
    if (now < least) {
      least = now;
      best_s = k * step_s;
    }
  }
  if (!(least < kBroughtBack * usual)) return std::nullopt;
  return best_s;
}

// Between two times at which the log is as late, the joints were slow.
bool is_late_throughout(const OddStretch& a, const OddStretch& b) {
  return a.late_s && b.late_s &&
         std::abs(*a.late_s - *b.late_s) < kBroughtBack * std::abs(*a.late_s) &&
         b.from_s - a.to_s < (a.to_s - a.from_s) + (b.to_s - b.from_s);
}

std::vector<OddStretch> with_late_ones_joined(std::vector<OddStretch> stretches) {
  std::vector<OddStretch> out;
  for (OddStretch& stretch : stretches) {
    if (out.empty() || !is_late_throughout(out.back(), stretch)) {
      out.push_back(std::move(stretch));
      continue;
    }
    OddStretch& last = out.back();
    last.frames += stretch.frames;
    last.to_s = stretch.to_s;
    add_channels(stretch, last);
  }
  return out;
}

// Of channels that were wrong together.
std::string line_of(const std::vector<OddStretch>& stretches, const JointLog& log) {
  const OddStretch& worst = *std::ranges::max_element(stretches, {}, [](const OddStretch& one) {
    return std::abs(one.most.expected - one.most.read);
  });
  int frames = 0;
  for (const OddStretch& one : stretches) frames += one.frames;
  const bool one = worst.channels.size() == 1;
  std::vector<std::string> quoted;
  for (const std::string& channel : worst.channels) quoted.push_back(fmt::format("'{}'", channel));
  std::string out =
      fmt::format("{}: from {} = {:.6g} to {:.6g} {} {} wrong", log.source, log.time_column,
                  worst.from_s, worst.to_s, fmt::join(quoted, ", "), one ? "is" : "are");
  if (worst.stands_still) {
    out += " (readings that froze, or a row that was repeated)";
  } else if (worst.repeats_s) {
    out += fmt::format(" (the rows of {:.4g} s before, once more)", *worst.repeats_s);
  } else if (worst.late_s) {
    out += fmt::format(" ({:.3g} s {})", std::abs(*worst.late_s),
                       *worst.late_s > 0.0 ? "late" : "early");
  }
  out += fmt::format(": at {:.6g} {} {:.6g}, but the markers it moves say {:.6g}",
                     worst.most.time_s, one ? "it reads" : fmt::format("{} reads", quoted.front()),
                     worst.most.read, worst.most.expected);
  if (stretches.size() > 1) {
    out += fmt::format("; so {} {} more stretch{}", one ? "it is in" : "they are in",
                       stretches.size() - 1, stretches.size() == 2 ? "" : "es");
  }
  return fmt::format("{}: {} frames left out", out, frames);
}

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
  const std::optional<Eigen::VectorXd> shown =
      Reader(calibration).values_seen({id}, q, seen->second);
  if (!shown) return std::nullopt;
  return ((*shown)[id.value] - joint->offset) / joint->scale;
}

std::vector<OddReading> odd_readings(const Calibration& calibration, const PoseTracks& tracks,
                                     const JointLog& log) {
  std::vector<OddReading> out;
  const Reader reader(calibration);
  for (const auto& [frame, seen] : frames_of(calibration, tracks))
    std::ranges::move(odd_in_frame(calibration, reader, log, frame, seen), std::back_inserter(out));
  return out;
}

std::vector<OddStretch> odd_stretches(const Calibration& calibration, const JointLog& log,
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
      own.push_back({{odd.channel}, at_s, at_s, 1, odd, true});
      own.back().most.time_s = at_s;
      continue;
    }
    OddStretch& last = own.back();
    last.stands_still = last.stands_still && odd.read == last.most.read;
    last.to_s = at_s;
    ++last.frames;
    if (off(odd) <= off(last.most)) continue;
    last.most = odd;
    last.most.time_s = at_s;
  }
  std::vector<OddStretch> all;
  for (auto& [channel, own] : by_channel) {
    std::ranges::copy_if(own, std::back_inserter(all),
                         [](const OddStretch& stretch) { return stretch.frames > 1; });
  }
  std::ranges::stable_sort(all, {}, &OddStretch::from_s);
  std::vector<OddStretch> out;
  for (OddStretch& stretch : all) {
    if (out.empty() || stretch.from_s > out.back().to_s)
      out.push_back(std::move(stretch));
    else
      add_alongside(stretch, out.back());
  }
  for (OddStretch& stretch : out) {
    std::ranges::sort(stretch.channels, {},
                      [&](const std::string& name) { return log.channel(name); });
    look_for_repeated(stretch, log);
    if (!stretch.stands_still && !stretch.repeats_s)
      stretch.late_s = late_by(stretch, calibration, log, readings);
  }
  return with_late_ones_joined(std::move(out));
}

std::vector<std::string> lines_of(const std::vector<OddStretch>& stretches, const JointLog& log) {
  std::map<std::vector<std::string>, std::vector<OddStretch>> by_channels;
  for (const OddStretch& stretch : stretches) by_channels[stretch.channels].push_back(stretch);
  std::vector<std::string> out;
  for (const auto& [channels, alike] : by_channels) out.push_back(line_of(alike, log));
  return out;
}

}  // namespace kinescope
