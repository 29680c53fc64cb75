// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/expected_rows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "calib/bundle/axis_uncertainty.h"
#include "calib/bundle/linearise.h"
#include "calib/bundle/make_spec.h"
#include "calib/bundle/solve.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using bundle::FreeBlock;
using bundle::Spec;
using bundle::State;
using bundle::TangentMask;

// As the bundle names the components of a pose (problem.cpp).
constexpr std::array<const char*, 6> kComponents{" turn x",  " turn y",  " turn z",
                                                 " shift x", " shift y", " shift z"};

std::set<std::string> names_of(const std::vector<Parameter>& parameters) {
  std::set<std::string> out;
  for (const Parameter& parameter : parameters) out.insert(parameter.name);
  return out;
}

TangentMask mask_of(const std::set<std::string>& names, const std::string& block) {
  TangentMask out{};
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = names.contains(block + kComponents[i]);
  return out;
}

// The joint frames stand where the calibration's parameters mean them.
KinematicTree tree_at_parameters(const Calibration& calibration) {
  KinematicTree out = calibration.tree;
  for (std::size_t j = 0; j < out.joints.size(); ++j) {
    Joint& joint = out.joints[j];
    const double at = calibration.joints[j].parameters_at;
    joint.T_parent_joint = joint.T_parent_joint * joint_motion(joint.type, joint.axis, at);
    joint.offset -= at;
  }
  return out;
}

// Free is what the calibration had free of the robot, whatever this recording shows of it.
void take_masks(const Calibration& calibration, Spec& spec) {
  const std::set<std::string> names = names_of(calibration.parameters);
  for (std::size_t j = 0; j < spec.tree.joints.size(); ++j) {
    const std::string& name = spec.tree.joints[j].name;
    spec.free_joint[j] = mask_of(names, name);
    spec.free_scale[j] = names.contains(name + " scale");
    spec.free_offset[j] = names.contains(name + " offset");
  }
  for (std::size_t m = 0; m < spec.tree.markers.size(); ++m)
    spec.free_mount[m] = mask_of(names, "tag_" + std::to_string(spec.tree.markers[m].id.value));
  spec.cameras.front().free_pose.fill(true);
}

Spec spec_of(const Calibration& calibration, const ExpectedRecording& recording,
             const CalibrationStart& start) {
  MarkerSet markers;
  for (const Marker& marker : calibration.tree.markers) markers.sizes_m[marker.id] = marker.size_m;
  CalibrateOptions options;
  options.estimate_intrinsics = calibration.intrinsics_estimated;
  Spec spec = bundle::make_spec(recording.measurements, markers, recording.log, start, options);
  take_masks(calibration, spec);
  spec.postures = recording.postures;
  spec.free_time_offset = false;  // for now: frames may stand at the very ends of the log
  return spec;
}

// Where each of the bundle's columns stands among the parameters.
std::vector<Eigen::Index> order_parameters(const Calibration& calibration,
                                           const std::vector<FreeBlock>& blocks,
                                           std::vector<Parameter>& parameters) {
  std::map<std::string, Eigen::Index> column;
  std::vector<Parameter> own;
  for (const FreeBlock& block : blocks)
    for (std::size_t i = 0; i < block.names.size(); ++i)
      own.push_back({block.names[i], block.block, block.units[i], 0.0, {}, {}});
  for (std::size_t i = 0; i < own.size(); ++i) column[own[i].name] = static_cast<Eigen::Index>(i);
  std::set<std::string> taken;
  const auto take = [&](const Parameter& parameter, std::vector<Eigen::Index>& order) {
    if (!taken.insert(parameter.name).second) return;
    const auto found = column.find(parameter.name);
    order.push_back(found == column.end() ? -1 : found->second);
    parameters.push_back(parameter);
  };
  const auto is_absent_effect = [&](const Parameter& parameter) {
    return parameter.block == "effects" && !column.contains(parameter.name);
  };
  std::vector<Eigen::Index> order;
  for (const Parameter& parameter : calibration.parameters)
    if (!is_of_recording(parameter) && !is_absent_effect(parameter)) take(parameter, order);
  for (const Parameter& parameter : own)
    if (!is_of_recording(parameter)) take(parameter, order);
  for (const Parameter& parameter : own) take(parameter, order);
  return order;
}

}  // namespace

bool is_of_recording(const Parameter& parameter) {
  const auto is_block = [&](const std::string& name) {
    return parameter.block == name || parameter.block.starts_with(name + " ");
  };
  return is_block("camera") || is_block("clock") || is_block("intrinsics");
}

ExpectedRows expected_rows(const Calibration& calibration, const ExpectedRecording& recording) {
  CalibrationStart start;
  start.tree = tree_at_parameters(calibration);
  start.T_camera_base = calibration.T_camera_base;
  start.camera = calibration.camera;
  start.corrections = recording.corrections;
  Spec spec = spec_of(calibration, recording, start);
  State state = bundle::initial_state(spec, start);
  const std::vector<int> used = bundle::usable_sightings(spec, state);
  if (used.empty()) {
    throw undetermined("plan", "no marker would be seen", "check the ranges of the joints");
  }
  spec.free_time_offset = !recording.postures;
  const bundle::LinearBundle linear = bundle::linearise(spec, state, used);

  ExpectedRows out;
  const auto order = order_parameters(calibration, linear.blocks, out.parameters);
  const auto width = static_cast<Eigen::Index>(order.size());
  out.J.assign(spec.times_s.size(), Eigen::MatrixXd(0, width));
  for (const auto& [frame, rows] : linear.frames) {
    const Eigen::MatrixXd own = rows.dense(bundle::width_of(linear.blocks));
    Eigen::MatrixXd& J = out.J[static_cast<std::size_t>(frame)];
    J = Eigen::MatrixXd::Zero(rows.J.rows(), width);
    for (Eigen::Index i = 0; i < width; ++i)
      if (order[static_cast<std::size_t>(i)] >= 0)
        J.col(i) = own.col(order[static_cast<std::size_t>(i)]);
  }
  return out;
}

std::vector<JointEstimate> axes_by_covariance(const Calibration& calibration,
                                              const std::vector<Parameter>& parameters,
                                              const Eigen::MatrixXd& covariance,
                                              const Eigen::VectorXd& values) {
  Spec spec;
  spec.tree = tree_at_parameters(calibration);
  State state;
  state.joint_frames.resize(spec.tree.joints.size());
  bundle::Uncertainty uncertainty;
  std::vector<Eigen::Index> chosen;
  std::vector<bool> held;
  for (std::size_t j = 0; j < spec.tree.joints.size(); ++j) {
    FreeBlock block{state.joint_frames[j].data(), spec.tree.joints[j].name, {}, {}, {}, -1};
    for (std::size_t c = 0; c < kComponents.size(); ++c) {
      const auto found =
          std::ranges::find(parameters, block.block + kComponents[c], &Parameter::name);
      if (found == parameters.end()) continue;
      block.names.push_back(found->name);
      block.units.push_back(found->unit);
      block.components.push_back(static_cast<int>(c));
      uncertainty.parameters.push_back(*found);
      chosen.push_back(found - parameters.begin());
    }
    held.push_back(block.names.empty());
    if (!block.names.empty()) uncertainty.blocks.push_back(std::move(block));
  }
  uncertainty.covariance = covariance(chosen, chosen);
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    uncertainty.parameters[i].sigma = std::sqrt(uncertainty.covariance(at, at));
  }
  std::vector<JointEstimate> out(spec.tree.joints.size());
  Eigen::VectorXd from_parameters = values;
  for (std::size_t j = 0; j < out.size(); ++j)
    from_parameters[static_cast<Eigen::Index>(j)] -= calibration.joints[j].parameters_at;
  bundle::fill_axis_uncertainty(spec, state, uncertainty, spec.tree, from_parameters, held, out);
  return out;
}

}  // namespace kinescope
