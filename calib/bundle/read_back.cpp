// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/read_back.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <utility>

#include "calib/bundle/axis_uncertainty.h"
#include "calib/bundle/corrected.h"
#include "calib/bundle/linearise.h"
#include "calib/bundle/make_spec.h"

namespace kinescope::bundle {
namespace {

bool all_seen(const Uncertainty& uncertainty, const PoseColumns& columns, int first, int count) {
  for (int i = first; i < first + count; ++i) {
    const int column = columns[static_cast<std::size_t>(i)];
    if (column >= 0 && !uncertainty.parameters[static_cast<std::size_t>(column)].sigma)
      return false;
  }
  return true;
}

Sigma block_sigma(const Uncertainty& uncertainty, const PoseColumns& columns, int first) {
  std::vector<int> present;
  for (int i = first; i < first + 3; ++i) {
    if (columns[static_cast<std::size_t>(i)] >= 0) {
      present.push_back(columns[static_cast<std::size_t>(i)]);
    }
  }
  if (present.empty() || !all_seen(uncertainty, columns, first, 3)) return std::nullopt;
  return length_sigma(uncertainty.covariance(present, present));
}

Eigen::VectorXd mean_values(const Calibration& out) {
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(out.joint_values.cols());
  for (Eigen::Index j = 0; j < mean.size(); ++j) {
    int count = 0;
    for (Eigen::Index f = 0; f < out.joint_values.rows(); ++f) {
      if (!std::isfinite(out.joint_values(f, j))) continue;
      mean[j] += out.joint_values(f, j);
      ++count;
    }
    if (count > 0) mean[j] /= count;
  }
  return mean;
}

// Added to what a reading is in SI units, and what goes into the joint's frame instead.
double offset_of_value(const Spec& spec, const State& state, std::size_t joint) {
  return spec.keeps_offset[joint] ? state.joint_maps[joint][1] : 0.0;
}

double offset_of_frame(const Spec& spec, const State& state, std::size_t joint) {
  return spec.keeps_offset[joint] ? 0.0 : state.joint_maps[joint][1];
}

void fill_joint_values(const Spec& spec, const State& state, const Readings& readings,
                       Calibration& out) {
  const auto frames = static_cast<Eigen::Index>(spec.times_s.size());
  const auto joints = static_cast<Eigen::Index>(spec.tree.joints.size());
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  out.joint_values = Eigen::MatrixXd::Constant(frames, joints, kUnknown);
  for (std::size_t j = 0; j < spec.tree.joints.size(); ++j) {
    for (std::size_t f = 0; f < spec.times_s.size(); ++f) {
      double value = 0.0;
      if (spec.free_value[j]) {
        value = state.values[j][f];
      } else if (spec.channel[j] >= 0) {
        const int joint = static_cast<int>(j);
        value = readings.known(static_cast<int>(f), joint)
                    ? state.joint_maps[j][0] * readings.value(static_cast<int>(f), joint) +
                          offset_of_value(spec, state, j)
                    : kUnknown;
      }
      out.joint_values(static_cast<Eigen::Index>(f), static_cast<Eigen::Index>(j)) = value;
    }
  }
}

void fill_corrected_values(const Spec& spec, const State& state, Calibration& out) {
  out.corrected_values = out.joint_values;
  for (std::size_t c = 0; c < spec.corrections.size(); ++c) {
    const Correction& correction = spec.corrections[c];
    if (correction.part != CorrectedPart::kJoint) continue;
    const Joint& joint = spec.tree.joints[static_cast<std::size_t>(correction.index)];
    for (Eigen::Index f = 0; f < out.corrected_values.rows(); ++f) {
      const Vector6d twist = state.corrections[c] * twist_at(correction, static_cast<int>(f));
      out.corrected_values(f, correction.index) +=
          joint.axis.dot(joint.type == JointType::kRevolute ? twist.head<3>() : twist.tail<3>());
    }
  }
}

// At one value throughout: the data say nothing of its axis.
bool is_held(const Spec& spec, std::size_t joint) {
  return spec.channel[joint] < 0 && !spec.free_value[joint];
}

// The sightings that show a joint move; all of them where the fit left out every one.
std::vector<int> shown_by(const Spec& spec, const RobustSolution& robust, std::size_t joint) {
  const auto shows = [&](int index) {
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(index)];
    const Marker& marker = spec.tree.markers[static_cast<std::size_t>(sighting.marker)];
    const std::vector<int>& path = spec.path[marker.link.index()];
    return std::ranges::find(path, static_cast<int>(joint)) != path.end();
  };
  std::vector<int> out;
  std::ranges::copy_if(robust.used, std::back_inserter(out), shows);
  if (!out.empty()) return out;
  out.resize(spec.sightings.size());
  std::iota(out.begin(), out.end(), 0);
  return out;
}

// Of a joint that no channel drives: known where it was seen, and whole turns are no motion.
void keep_what_was_seen(const Spec& spec, const RobustSolution& robust, Calibration& out) {
  std::vector<Eigen::Index> order(out.times_s.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, {}, [&](Eigen::Index f) {
    return std::pair(out.times_s[static_cast<std::size_t>(f)], f);
  });
  for (std::size_t j = 0; j < spec.tree.joints.size(); ++j) {
    if (!spec.free_value[j]) continue;
    std::vector<bool> shown(out.times_s.size(), false);
    for (const int index : shown_by(spec, robust, j))
      shown[static_cast<std::size_t>(spec.sightings[static_cast<std::size_t>(index)].frame)] = true;
    const bool turns = spec.tree.joints[j].type == JointType::kRevolute;
    double last = 0.0;
    for (const Eigen::Index f : order) {
      double& value = out.corrected_values(f, static_cast<Eigen::Index>(j));
      if (!shown[static_cast<std::size_t>(f)]) {
        value = std::numeric_limits<double>::quiet_NaN();
        continue;
      }
      if (turns) value = last + std::remainder(value - last, 2.0 * std::numbers::pi);
      last = value;
    }
  }
}

// The middle one of the frames in which the camera's place is known.
Pose usual_camera_from_base(const Calibration& out) {
  std::vector<std::pair<int, std::vector<Pose>>> known;
  for (Eigen::Index f = 0; f < out.joint_values.rows(); ++f) {
    const Eigen::VectorXd q = out.joint_values.row(f);
    if (q.allFinite() && out.moving->is_known(static_cast<std::size_t>(f)))
      known.emplace_back(static_cast<int>(f), forward_kinematics(out.tree, q));
  }
  if (known.empty()) return {};
  const auto& [frame, links] = known[known.size() / 2];
  return camera_from_base(out, frame, links);
}

void fill_place_of_camera(const Spec& spec, const State& state, Calibration& out) {
  const Pose before_path = from_block(state.cameras.front().base.data());
  if (!spec.carried && spec.camera_link.value == 0) {
    out.T_camera_base = before_path;
    return;
  }
  out.moving = MovingCamera{spec.camera_link, before_path, {}};
  for (const PoseBlock& pose : state.carried) out.moving->path.push_back(from_block(pose.data()));
  out.T_camera_base = usual_camera_from_base(out);
}

void fill_tree(const Spec& spec, const State& state, const RobustSolution& robust,
               Calibration& out) {
  out.tree = spec.tree;
  for (std::size_t j = 0; j < out.tree.joints.size(); ++j) {
    Joint& joint = out.tree.joints[j];
    joint.T_parent_joint = from_block(state.joint_frames[j].data()) *
                           joint_motion(joint.type, joint.axis, offset_of_frame(spec, state, j));
    joint.scale = state.joint_maps[j][0];
    joint.offset = offset_of_value(spec, state, j);
    if (joint.type == JointType::kFixed || is_held(spec, j)) continue;
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const int index : shown_by(spec, robust, j)) {
      const int frame = spec.sightings[static_cast<std::size_t>(index)].frame;
      const double value = out.joint_values(frame, static_cast<Eigen::Index>(j));
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
    if (low <= high) joint.limits = JointLimits{low, high};
  }
  for (std::size_t m = 0; m < out.tree.markers.size(); ++m) {
    out.tree.markers[m].T_link_marker = from_block(state.mounts[m].data());
  }
  fill_place_of_camera(spec, state, out);
}

void fill_cameras(const Spec& spec, const State& state, const Uncertainty& uncertainty,
                  Calibration& out) {
  const auto is_free = [](bool f) { return f; };
  out.camera = camera_of(spec, state, 0);
  out.intrinsics_estimated = std::ranges::any_of(spec.cameras.front().free_intrinsics, is_free);
  out.camera_name = spec.cameras.front().name;
  out.camera_of_frame = spec.camera_of_frame;
  out.starts_s = spec.starts_s;
  const auto columns = pose_columns(uncertainty.blocks);
  for (std::size_t c = 1; c < spec.cameras.size(); ++c) {
    const CameraState& camera = state.cameras[c];
    CameraEstimate& estimate = out.further_cameras.emplace_back();
    estimate.name = spec.cameras[c].name;
    estimate.T_camera_base = from_block(camera.base.data());
    estimate.camera = camera_of(spec, state, c);
    estimate.intrinsics_estimated = std::ranges::any_of(spec.cameras[c].free_intrinsics, is_free);
    estimate.lag_s = camera.lag[0];
    const auto found = columns.find(camera.base.data());
    if (found == columns.end()) continue;
    estimate.rotation_sigma_rad = block_sigma(uncertainty, found->second, 0);
    estimate.translation_sigma_m = block_sigma(uncertainty, found->second, 3);
  }
}

// What one number of a block is known by.
void take_sigma_of_camera(const State& state, const FreeBlock& block, int component,
                          const Sigma& sigma, Calibration& out) {
  for (std::size_t c = 0; c < state.cameras.size(); ++c) {
    if (block.data == state.cameras[c].intrinsics.data()) {
      auto& sigmas = c == 0 ? out.intrinsics_sigma : out.further_cameras[c - 1].intrinsics_sigma;
      sigmas[static_cast<std::size_t>(component)] = sigma;
    }
    if (c > 0 && block.data == state.cameras[c].lag.data())
      out.further_cameras[c - 1].lag_sigma_s = sigma;
  }
}

// All joints at their mean.
void fill_joints(const Spec& spec, const State& state, const Uncertainty& uncertainty,
                 Calibration& out) {
  const Eigen::VectorXd mean = mean_values(out);
  const std::vector<Pose> T_base_link = forward_kinematics(out.tree, mean);
  std::vector<bool> held;
  for (std::size_t j = 0; j < out.tree.joints.size(); ++j) {
    const Joint& joint = out.tree.joints[j];
    held.push_back(is_held(spec, j));
    JointEstimate estimate;
    const Pose T_base_joint = T_base_link[joint.parent.index()] * joint.T_parent_joint;
    estimate.axis_base = T_base_joint.rotation * joint.axis;
    estimate.point_base = T_base_joint.translation;
    if (joint.limits && !held[j]) estimate.range = *joint.limits;
    estimate.parameters_at = -offset_of_frame(spec, state, j);  // fill_tree moved the frame so far
    out.joints.push_back(estimate);
  }
  fill_axis_uncertainty(spec, state, uncertainty, out.tree, mean, held, out.joints);
}

void fill_numbers(const Spec& spec, const State& state, const Uncertainty& uncertainty,
                  Calibration& out) {
  out.parameters = uncertainty.parameters;
  out.covariance = uncertainty.covariance;
  std::size_t next = 0;
  for (const FreeBlock& block : uncertainty.blocks) {
    const bool pose = !block.block.starts_with("clock") && !block.block.starts_with("intrinsics") &&
                      block.block != "effects" && !block.names.front().ends_with("scale") &&
                      !block.names.front().ends_with("offset") &&
                      !block.block.starts_with("target ");
    for (std::size_t i = 0; i < block.names.size(); ++i, ++next) {
      Parameter& parameter = out.parameters[next];
      if (!pose) parameter.value = block.data[block.components[i]];
      if (block.block == "clock") out.time_offset_sigma_s = parameter.sigma;
      take_sigma_of_camera(state, block, block.components[i], parameter.sigma, out);
      for (std::size_t j = 0; j < spec.tree.joints.size(); ++j) {
        if (block.data != state.joint_maps[j].data()) continue;
        (block.components[i] == 0 ? out.joints[j].scale_sigma : out.joints[j].offset_sigma) =
            parameter.sigma;
      }
    }
  }
}

void fill_markers(const Spec& spec, const State& state, const RobustSolution& robust,
                  const Uncertainty& uncertainty, Calibration& out) {
  const auto columns = pose_columns(uncertainty.blocks);
  out.markers.resize(spec.tree.markers.size());
  for (std::size_t m = 0; m < out.markers.size(); ++m) {
    const auto found = columns.find(state.mounts[m].data());
    if (found == columns.end()) continue;
    out.markers[m].rotation_sigma_rad = block_sigma(uncertainty, found->second, 0);
    out.markers[m].translation_sigma_m = block_sigma(uncertainty, found->second, 3);
  }
  const auto marker_of = [&](int index) {
    return static_cast<std::size_t>(spec.sightings[static_cast<std::size_t>(index)].marker);
  };
  for (const int index : robust.used) ++out.markers[marker_of(index)].used;
  for (const int index : robust.rejected) ++out.markers[marker_of(index)].rejected;
}

}  // namespace

void read_back(const Spec& spec, const State& state, const RobustSolution& robust,
               const Uncertainty& uncertainty, Calibration& out) {
  const Readings readings(spec, state);
  out.times_s = spec.times_s;
  fill_cameras(spec, state, uncertainty, out);
  out.time_offset_s = state.time_offset[0];
  out.gauge = gauge_in_words(spec);
  out.observability = uncertainty.observability;
  out.correlation_time_s = uncertainty.correlation_time_s;
  out.noise_widening = uncertainty.noise_widening;
  fill_joint_values(spec, state, readings, out);
  fill_corrected_values(spec, state, out);
  keep_what_was_seen(spec, robust, out);
  fill_tree(spec, state, robust, out);
  fill_joints(spec, state, uncertainty, out);
  fill_markers(spec, state, robust, uncertainty, out);
  fill_numbers(spec, state, uncertainty, out);
}

}  // namespace kinescope::bundle
