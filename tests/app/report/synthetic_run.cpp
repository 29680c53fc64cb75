// SPDX-License-Identifier: Apache-2.0
#include "tests/app/report/synthetic_run.h"

#include <array>
#include <cmath>
#include <numbers>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kFrameRate = 30.0;
constexpr double kCornerNoise = 0.06;    // px
constexpr double kPositionNoise = 1e-4;  // m
constexpr double kTurnNoise = 2e-4;      // rad
constexpr double kTagSize = 0.04;        // m

Pose placed(double x, double y, double z, const Eigen::Vector3d& turn = Eigen::Vector3d::Zero()) {
  return {exp_rotation(turn), {x, y, z}};
}

KinematicTree make_tree(const SyntheticRunOptions& options) {
  KinematicTree tree;
  tree.name = options.robot;
  tree.links = {{"base"}, {"link1"}, {"link2"}, {"link3"}};
  const std::array<std::string, 3> channels = {"q1", options.second_channel, "q3"};
  const std::array<Pose, 3> origins = {placed(0, 0, 0.1), placed(0.25, 0, 0.02),
                                       placed(0.2, 0, 0, {kPi, 0, 0})};
  for (int j = 0; j < 3; ++j) {
    const auto k = static_cast<std::size_t>(j);
    Joint joint;
    joint.name = options.log ? channels[k] : "joint" + std::to_string(j + 1);
    joint.type = j < 2 ? JointType::kRevolute : JointType::kPrismatic;
    joint.parent = LinkId{j};
    joint.child = LinkId{j + 1};
    joint.T_parent_joint = origins[k];
    joint.channel = options.log ? channels[k] : "";
    joint.limits = JointLimits{-1.0, 1.0};
    tree.joints.push_back(joint);
  }
  const Eigen::Vector3d up(kPi, 0, 0);  // a tag's z points into it
  const bool tags = options.kind == MeasurementKind::kCorners;
  tree.markers = {{TagId{0}, LinkId{0}, placed(-0.1, 0, 0, up), tags ? kTagSize : 0.0},
                  {TagId{1}, LinkId{1}, placed(0.12, 0, 0.03, up), tags ? kTagSize : 0.0},
                  {TagId{2}, LinkId{2}, placed(0.1, 0.01, 0.03, up), tags ? kTagSize : 0.0},
                  {TagId{7}, LinkId{3}, placed(0, 0, -0.05, {0.1, 0, 0}), tags ? kTagSize : 0.0}};
  return tree;
}

Eigen::VectorXd posture(double t) {
  Eigen::VectorXd q(3);
  q << 0.9 * std::sin(0.7 * t), 1.1 * std::sin(1.1 * t + 0.4), 0.05 + 0.04 * std::sin(1.7 * t);
  return q;
}

/// Residual of one corner marker: what the true arm shows against what the model says.
void fill_corners(const Calibration& model, const Eigen::VectorXd& truth, double noise, Rng& rng,
                  const Marker& marker, const Eigen::VectorXd& values,
                  std::vector<Eigen::Vector2d>& out) {
  const auto seen = forward_kinematics(model.tree, truth)[marker.link.index()];
  const auto said = forward_kinematics(model.tree, values)[marker.link.index()];
  const double h = 0.5 * marker.size_m;
  for (const Eigen::Vector3d& corner : {Eigen::Vector3d(-h, h, 0), Eigen::Vector3d(h, h, 0),
                                        Eigen::Vector3d(h, -h, 0), Eigen::Vector3d(-h, -h, 0)}) {
    const auto a =
        project(model.camera, model.T_camera_base * (seen * marker.T_link_marker * corner));
    const auto b =
        project(model.camera, model.T_camera_base * (said * marker.T_link_marker * corner));
    out.push_back(*a - *b + Eigen::Vector2d(rng.normal(noise), rng.normal(noise)));
  }
}

Vector6d shift_of(const std::vector<Eigen::Vector2d>& corners, double metres_per_px) {
  Vector6d out = Vector6d::Zero();
  for (const Eigen::Vector2d& corner : corners) out.segment<2>(3) += 0.25 * metres_per_px * corner;
  out(2) = 0.25 * metres_per_px * (corners[0].y() - corners[1].y()) / kTagSize;
  return out;
}

Vector6d random_displacement(MeasurementKind kind, double scale, Rng& rng) {
  Vector6d out = Vector6d::Zero();
  if (kind == MeasurementKind::kPose) out.head<3>() = rng.normal3(scale * kTurnNoise);
  out.tail<3>() = rng.normal3(scale * kPositionNoise);
  return out;
}

void add_residuals(const SyntheticRunOptions& options, Calibration& calibration) {
  Rng rng = Rng::from_name("synthetic_run");
  for (int frame = 0; frame < options.frames; ++frame) {
    const Eigen::VectorXd values = calibration.joint_values.row(frame).transpose();
    Eigen::VectorXd truth = values;
    truth(1) += options.gear_error_rad * std::sin(3.0 * values(1));
    for (const Marker& marker : calibration.tree.markers) {
      if (marker.id == TagId{7} && frame % 5 < 1) continue;  // hidden now and then
      SightingResidual one;
      one.frame = frame;
      one.id = marker.id;
      one.fold = frame * 5 / options.frames;
      one.used = (frame * 7 + marker.id.value) % 97 != 0;
      if (options.kind == MeasurementKind::kCorners) {
        fill_corners(calibration, truth, kCornerNoise, rng, marker, values, one.corners_px);
        fill_corners(calibration, truth, 1.04 * kCornerNoise, rng, marker, values, one.held_out_px);
        fill_corners(calibration, truth, 12 * kCornerNoise, rng, marker, values, one.before_px);
        const double metres_per_px = 1.1 / calibration.camera.fx;
        one.displacement = shift_of(one.corners_px, metres_per_px);
        one.held_out_displacement = shift_of(one.held_out_px, metres_per_px);
        one.before_displacement = shift_of(one.before_px, metres_per_px);
      } else {
        one.displacement = random_displacement(options.kind, 1.0, rng);
        one.held_out_displacement = random_displacement(options.kind, 1.05, rng);
        one.before_displacement = random_displacement(options.kind, 20.0, rng);
      }
      calibration.residuals.push_back(std::move(one));
    }
  }
}

void add_parameters(Calibration& calibration) {
  Rng rng = Rng::from_name("synthetic_run parameters");
  const auto add = [&](std::string name, std::string block, std::string unit, double value,
                       double sigma) {
    calibration.parameters.push_back(
        {std::move(name), std::move(block), std::move(unit), value, sigma, 0.7 * sigma});
  };
  for (const Joint& joint : calibration.tree.joints) {
    const bool turns = joint.type == JointType::kRevolute;
    add(joint.name + " turn x", joint.name, "rad", rng.normal(0.01), 6e-5);
    add(joint.name + " turn y", joint.name, "rad", rng.normal(0.01), 8e-5);
    if (!turns) continue;
    add(joint.name + " shift x", joint.name, "m", rng.normal(0.001), 2e-5);
    add(joint.name + " shift y", joint.name, "m", rng.normal(0.001), 3e-5);
  }
  for (const Marker& marker : calibration.tree.markers) {
    const std::string name = "tag_" + std::to_string(marker.id.value);
    if (marker.id == TagId{0}) continue;
    for (const char axis : {'x', 'y', 'z'})
      add(name + " turn " + axis, name, "rad", rng.normal(0.01), 2e-4);
    for (const char axis : {'x', 'y', 'z'})
      add(name + " shift " + axis, name, "m", rng.normal(0.001), 4e-5);
  }
  for (const char axis : {'x', 'y', 'z'})
    add(std::string("camera turn ") + axis, "camera", "rad", 0.0, 1e-4);
  for (const char axis : {'x', 'y', 'z'})
    add(std::string("camera shift ") + axis, "camera", "m", 0.0, 2e-4);
  add("time offset", "clock", "s", 0.0123, 2.1e-4);
  const auto count = static_cast<Eigen::Index>(calibration.parameters.size());
  Eigen::MatrixXd mix = Eigen::MatrixXd::Identity(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) mix(i, j) = i - j < 6 ? rng.normal(0.5) : 0.0;
    mix.row(i).normalize();
    mix.row(i) *= *calibration.parameters[static_cast<std::size_t>(i)].sigma;
  }
  calibration.covariance = mix * mix.transpose();
}

Calibration make_calibration(const SyntheticRunOptions& options) {
  Calibration calibration;
  calibration.status = CalibrationStatus::kConverged;
  calibration.kind = options.kind;
  calibration.tree = make_tree(options);
  calibration.T_camera_base = placed(0.0, 0.15, 1.1, {2.6, 0.2, 0.0});
  calibration.camera = pinhole_guess(1280, 720, 1000.0);
  calibration.time_offset_s = 0.0123;
  calibration.time_offset_sigma_s = 2.1e-4;
  calibration.joint_values.resize(options.frames, 3);
  for (int frame = 0; frame < options.frames; ++frame) {
    calibration.times_s.push_back(frame / kFrameRate);
    calibration.joint_values.row(frame) = posture(calibration.times_s.back()).transpose();
  }
  for (const Joint& joint : calibration.tree.joints) {
    JointEstimate estimate;
    estimate.point_base = {0.1 * static_cast<double>(joint.child.value), 0.0123456, 0.1};
    estimate.direction_sigma_rad = joint.child.value * 8e-5;
    if (joint.type == JointType::kRevolute) estimate.position_sigma_m = joint.child.value * 2e-5;
    estimate.range =
        joint.type == JointType::kPrismatic ? JointLimits{0.01, 0.09} : JointLimits{-0.9, 1.0};
    calibration.joints.push_back(estimate);
  }
  for (const Marker& marker : calibration.tree.markers) {
    MarkerEstimate estimate;
    if (marker.id != TagId{0}) {
      estimate.rotation_sigma_rad = 2e-4;
      estimate.translation_sigma_m = 4e-5;
    }
    estimate.used = options.frames - 4;
    estimate.rejected = 4;
    calibration.markers.push_back(estimate);
  }
  add_parameters(calibration);
  calibration.gauge = "the base frame is held to tag_0, the first marker of the base link";
  for (int k = 0; k < 33; ++k) {
    calibration.observability.singular_values.push_back(5.0 * std::pow(10.0, -0.05 * k));
  }
  calibration.observability.condition_number = 40.0;
  calibration.observability.weak = {
      {0.025,
       {{4, 0.71}, {8, -0.69}},
       "the zero of q2 and the yaw of tag_2 are told apart only weakly"}};
  const bool corners = options.kind == MeasurementKind::kCorners;
  calibration.training_rms = corners ? kCornerNoise : kPositionNoise;
  calibration.held_out_rms = 1.04 * calibration.training_rms;
  calibration.before_rms = 12 * calibration.training_rms;
  calibration.final_rms = calibration.training_rms;
  calibration.folds = 5;
  calibration.correlation_time_s = 0.05;
  calibration.iterations = 14;
  calibration.initial_cost = 4.2e5;
  calibration.final_cost = 2.3e3;
  return calibration;
}

Structure make_structure(const RunSummary& run) {
  Structure structure;
  structure.status = StructureStatus::kDetermined;
  structure.probability = 0.99993;
  structure.runner_up = "tag_7 turns on q3 in place of sliding";
  structure.runner_up_log_odds = 9.6;
  for (const Marker& marker : run.calibration.tree.markers) {
    structure.links.push_back({{marker.id}, {Pose{}}});
  }
  for (std::size_t j = 0; j < run.calibration.tree.joints.size(); ++j) {
    const Joint& joint = run.calibration.tree.joints[j];
    StructureJoint found;
    found.type = joint.type;
    found.parent_link = joint.parent.value;
    found.child_link = joint.child.value;
    if (!joint.channel.empty()) {
      found.channel = ChannelTerm{static_cast<int>(j), 1.0 + 0.0004 * static_cast<double>(j), 1e-4};
    }
    found.travel = joint.type == JointType::kPrismatic ? 0.08 : 1.8;
    found.rotation_rms_rad = 0.003;
    found.translation_rms_m = 0.0008;
    found.log_odds = 9.6 + 12.0 * static_cast<double>(j);
    found.runner_up = "turn on another channel";
    structure.joints.push_back(found);
  }
  return structure;
}

void add_log(const SyntheticRunOptions& options, RunSummary& run) {
  run.log.source = "joints.csv";
  run.log.channels = {"q1", options.second_channel, "q3", "battery"};
  const int samples = 2 * options.frames;
  run.log.values.resize(samples, 4);
  for (int s = 0; s < samples; ++s) {
    run.log.times_s.push_back(s / (2.0 * kFrameRate));
    run.log.values.row(s).head<3>() = posture(run.log.times_s.back()).transpose();
    run.log.values(s, 3) = 24.1;
  }
}

}  // namespace

RunSummary synthetic_run(const SyntheticRunOptions& options) {
  RunSummary run;
  run.robot = options.robot;
  run.recording = "bench_arm_take_3";
  const bool corners = options.kind == MeasurementKind::kCorners;
  run.entry = corners ? "video" : options.kind == MeasurementKind::kPose ? "poses" : "points";
  run.version = "0.1.0";
  run.command = "kinescope run bench_arm_take_3 --out out";
  run.inputs = {{"video.mp4", "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08"},
                {"joints.csv", "60303ae22b998861bce3b28f33eec1be758a213c86c93c076dbe9f558c11c752"}};
  run.options = {{"folds", "5"}, {"reject-sigma", "4.5"}};
  run.times = {
      {"detect", 6.21}, {"tracks", 0.4}, {"structure", 0.05}, {"calibrate", 3.9}, {"report", 0.2}};
  run.frames = options.frames;
  run.duration_s = options.frames / kFrameRate;
  run.rejected = {{"id not declared", 12}, {"too few bits agree", 3}};
  run.warnings = {"frames 118 to 121 are blurred"};
  run.calibration = make_calibration(options);
  add_residuals(options, run.calibration);
  for (const Marker& marker : run.calibration.tree.markers) {
    run.markers.push_back({marker.id, marker.size_m, options.frames - 10 * marker.id.value,
                           corners ? 38.4 : 0.0, corners ? 0.06 : 0.0});
  }
  if (options.log) add_log(options, run);
  if (options.nominal) {
    run.nominal = run.calibration.tree;
    run.nominal->joints[1].T_parent_joint.translation.x() += 0.0012;
    run.nominal->joints[1].offset -= 0.004;
  } else {
    run.structure = make_structure(run);
    if (options.log) run.structure->idle_channels = {3};
  }
  run.errors = summarise_errors(run.calibration);
  return run;
}

}  // namespace kinescope
