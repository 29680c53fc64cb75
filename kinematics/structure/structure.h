// SPDX-License-Identifier: Apache-2.0
//
// Takes   PoseTracks (marker poses over time) and, where there is one, a JointLog.
// Gives   Structure: which marker is on which link, what joins what, joint types, driving channels
//         with sign and scale, a start for the calibration, and how probable that answer is.
// Frames  link 0 holds the camera (or tracker) and every marker that never moves against it.
// Method  Dalla Libera et al. 2019, 2021 in the rigid-body form: relative motion of every pair of
//         bodies as rest, turn or slide along one coordinate; that coordinate regressed on all
//         channels; the most probable spanning tree.
// Not here: images, corners, refinement (calib/bundle).
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/log/joint_log.h"
#include "kinematics/model/kinematic_tree.h"
#include "kinematics/structure/channel_unit.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

/// One term of what drives a joint: value = sum over terms of scale * reading + offset.
struct ChannelTerm {
  int channel = -1;    ///< index into JointLog::channels
  double scale = 1.0;  ///< rad or m per unit of the channel
  double scale_sigma = 0.0;
};

/// A joint of the found structure with the evidence for it.
struct StructureJoint {
  JointType type = JointType::kRevolute;
  int parent_link = 0;
  int child_link = 0;
  std::optional<ChannelTerm> channel;  ///< the main channel; none when no log drives it
  std::vector<ChannelTerm> couplings;  ///< further channels that also move it
  Pose T_parent_joint;  ///< parent's reference marker (camera for link 0) to the joint; z = axis
  Pose T_joint_child;   ///< joint (at value 0) to the child's reference marker
  double offset = 0.0;  ///< value = scale * reading + offset, rad or m
  double travel = 0.0;  ///< range of the value seen, rad or m
  double rotation_rms_rad = 0.0;  ///< what the joint leaves of the relative motion
  double translation_rms_m = 0.0;
  /// Of its link's squared motion, beyond the noise: what the joint leaves, and what of that no
  /// value of the joint could make. 0 to 1.
  double unexplained = 0.0;
  double unexplained_across = 0.0;
  double log_odds = 0.0;  ///< ln of the odds of this joint's hypothesis against its runner-up
  std::string runner_up;  ///< the next best hypothesis for this joint, in words
};

/// A rigid body of the structure.
struct StructureLink {
  std::vector<TagId> markers;  ///< by id; the first is the reference (for link 0: the camera is)
  std::vector<Pose> T_reference_marker;  ///< of each marker, in the reference's frame
};

/// A channel that tells the same as one that drives a joint (its command, say), and was left aside.
struct ChannelCopy {
  int channel = -1;  ///< index into JointLog::channels
  int of = -1;       ///< the one that is used
};

enum class StructureStatus { kNotRun, kDetermined, kAmbiguous, kUndetermined };

/// "not_run", "determined", "ambiguous", "undetermined".
[[nodiscard]] std::string_view to_string(StructureStatus status);

/// Something that the recording cannot decide, and what to record instead.
struct StructureDoubt {
  std::string what;
  std::string remedy;
  std::vector<std::string> names;  ///< channels or tags concerned
  bool of_model = false;           ///< an effect that the model lacks may be its cause
  bool of_rivals = false;          ///< about Structure::rivals, and gone with them
  bool of_shared_channel = false;  ///< one channel drives several joints
};

struct RivalStructure;

struct Structure {
  StructureStatus status = StructureStatus::kNotRun;
  std::vector<StructureLink>
      links;  ///< links[0]: at rest in the camera's frame; may hold no marker
  std::vector<StructureJoint> joints;  ///< parents stand before children
  /// The link that carries the camera; other than 0 (rerooted.h): links[0] is at rest in the world,
  /// in the frame of its first marker, and the camera is this link's reference.
  int camera_link = 0;
  std::vector<TagId> free_markers;  ///< markers that move with no joint we know (free bodies)
  std::vector<int> idle_channels;   ///< channels that drive nothing
  std::vector<ChannelCopy> copied_channels;  ///< none of them is idle
  double probability = 0.0;  ///< of the whole answer against all alternatives looked at; at most
                             ///< the share of each joint's squared motion that it explains
  std::string runner_up;     ///< the next best whole structure, in words
  double runner_up_log_odds = 0.0;  ///< ln(odds) of the answer against it
  double time_offset_s = 0.0;       ///< joint-log time = frame time + offset, from the scan
  double time_offset_sigma_s = 0.0;
  std::vector<StructureDoubt> doubts;
  /// Those that the poses alone do not rule out (1:100), the closest first: what the poses come
  /// from tells more (with_rivals_judged()).
  std::vector<RivalStructure> rivals;
  /// Without a log (or for joints that no channel drives): value of each joint in each frame,
  /// frames x joints; NaN where unknown or driven by a channel.
  Eigen::MatrixXd joint_values;
};

/// Another answer for the same markers; of its own doubts nothing is known.
struct RivalStructure {
  std::string words;
  std::string instead_of;  ///< in words: what the structure has there
  Structure structure;
};

struct StructureOptions {
  double max_time_offset_s = 1.0;  ///< half width of the scan for the time offset
  double min_log_odds = 4.6;       ///< below this (1:100) an answer is called ambiguous
  double max_gap_s = 0.5;          ///< gaps of the log longer than this are not bridged
  bool scan_time_offset = true;    ///< off for postures measured at rest
  /// Errors of the poses that are no noise, as a share of the distance to the camera and in rad.
  /// Nothing: none, or where that makes no whole robot the smallest that does.
  std::optional<double> allowance = {};
  /// Declared, by channel: a turn by one in rad or a slide by one in m moves as far as its channel
  /// says, unless the motion clearly says otherwise. Channels that are absent: any unit.
  std::map<std::string, ChannelUnit> units = {};
  /// The camera rides on the robot: of orders of joints that fit alike the one is taken in which
  /// the log's channels stand from the far end of the chain to the camera.
  bool camera_on_robot = false;
};

/// Cost O(bodies^2 * channels * frames). Deterministic; independent of the order of markers and
/// channels but for their numbering in the result.
[[nodiscard]] Structure find_structure(const PoseTracks& tracks, const JointLog& log,
                                       const StructureOptions& options = {});

/// The rival in the structure's place, and the structure among its rivals. What was in doubt about
/// the recording is still, what was about the model is not: none is known of the rival.
[[nodiscard]] Structure with_rival(const Structure& structure, std::size_t rival,
                                   const JointLog& log);

/// Judged by more than poses: `log_odds` of the structure against each of its rivals. Determined
/// where all are ruled out; without rivals after that.
[[nodiscard]] Structure with_rivals_judged(Structure structure,
                                           const std::vector<double>& log_odds);

/// The found structure as a tree with SI joint values: joints named after their channels (or
/// joint<k>), links link<k>, root "base" = the frame of the camera.
[[nodiscard]] KinematicTree structure_tree(const Structure& structure, const JointLog& log);

}  // namespace kinescope
