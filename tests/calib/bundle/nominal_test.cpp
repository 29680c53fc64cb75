// SPDX-License-Identifier: Apache-2.0
//
// Calibration against a nominal robot: from poses, from points, from a ball in sockets.
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "calib/bundle/calibrate.h"
#include "calib/bundle/check_nominal.h"
#include "calib/bundle/place_markers.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"
#include "tests/calib/bundle/random_pose.h"

namespace kinescope {
namespace {

constexpr int kLabPostures = 80;
constexpr double kDistance = std::numbers::sqrt3;  // rms, over the sigma of a coordinate

struct Lab {
  KinematicTree real;     // what the robot is
  KinematicTree nominal;  // what the drawing says: without markers
  Pose T_tracker_base;
  Eigen::MatrixXd values;  // postures x joints
  JointLog log;
  std::vector<double> times_s;
};

// A six-axis arm whose drawing is wrong by `offset_rad` at every zero and `geometry` at every
// frame.
Lab make_lab(const char* name, double offset_rad, double geometry) {
  Rng rng = Rng::from_name(name);
  Lab lab;
  lab.nominal.links.push_back({"base"});
  for (int j = 0; j < 6; ++j) {
    Joint joint;
    joint.name = fmt::format("j{}", j + 1);
    joint.type = JointType::kRevolute;
    joint.parent = LinkId{j};
    joint.child = LinkId{j + 1};
    joint.T_parent_joint = random_pose(rng, 1.0, 0.15);
    joint.channel = joint.name;
    lab.nominal.joints.push_back(joint);
    lab.nominal.links.push_back({fmt::format("l{}", j + 1)});
    lab.log.channels.push_back(joint.name);
  }
  lab.real = lab.nominal;
  for (Joint& joint : lab.real.joints) {
    joint.T_parent_joint = joint.T_parent_joint * random_pose(rng, geometry, 0.5 * geometry) *
                           Pose{exp_rotation({0.0, 0.0, rng.normal(offset_rad)}), {0, 0, 0}};
  }
  lab.T_tracker_base = random_pose(rng, 1.0, 1.0);
  lab.values.resize(kLabPostures, 6);
  for (int f = 0; f < kLabPostures; ++f) {
    lab.times_s.push_back(f);
    for (int j = 0; j < 6; ++j) lab.values(f, j) = rng.uniform(-1.5, 1.5);
  }
  lab.log.times_s = lab.times_s;
  lab.log.values = lab.values;
  return lab;
}

Pose flange(const Lab& lab, int posture) {
  return forward_kinematics(lab.real, lab.values.row(posture)).back();
}

Calibration run(const Lab& lab, const Measurements& measurements, const Placement& placement,
                FreeGeometry free, std::vector<Correction> corrections = {}) {
  CalibrationStart start;
  start.tree = lab.nominal;
  start.tree.markers = placement.markers;
  start.T_camera_base = placement.T_camera_base;
  start.nominal = true;
  start.corrections = std::move(corrections);
  CalibrateOptions options;
  options.free = free;
  return calibrate(measurements, {}, lab.log, start, options);
}

Measurements tracked_poses(const Lab& lab, const Pose& mount, double sigma_rad, double sigma_m) {
  Rng rng = Rng::from_name("tracked poses");
  PoseTrack track{TagId{3}, {}};
  for (int f = 0; f < kLabPostures; ++f) {
    PoseSample sample;
    sample.frame = f;
    Vector6d noise;
    noise << rng.normal3(sigma_rad), rng.normal3(sigma_m);
    sample.T_camera_marker = lab.T_tracker_base * flange(lab, f) * mount * exp_pose(noise);
    sample.covariance.setZero();
    sample.covariance.diagonal() << Eigen::Vector3d::Constant(sigma_rad * sigma_rad),
        Eigen::Vector3d::Constant(sigma_m * sigma_m);
    track.samples.push_back(sample);
  }
  Measurements measurements;
  measurements.times_s = lab.times_s;
  measurements.poses = {lab.times_s, {track}};
  return measurements;
}

TEST(PlaceMarkers, FindsLinkMountAndBase) {
  const Lab lab = make_lab("place markers", 0.0, 0.0);
  Rng rng = Rng::from_name("mount");
  const Pose mount = random_pose(rng, 1.0, 0.1);
  const Measurements measurements = tracked_poses(lab, mount, 1e-7, 1e-7);
  const Placement placement = place_markers(lab.nominal, lab.values, measurements.poses);
  ASSERT_EQ(placement.markers.size(), 1U);
  EXPECT_EQ(placement.markers[0].link, LinkId{6});
  EXPECT_LT(log_pose(placement.markers[0].T_link_marker.inverse() * mount).norm(), 1e-5);
  EXPECT_LT(log_pose(placement.T_camera_base.inverse() * lab.T_tracker_base).norm(), 1e-5);
}

TEST(Nominal, OffsetsAloneExplainWrongZeros) {
  constexpr double kSigmaRad = 2e-4;
  constexpr double kSigmaM = 1e-4;
  const Lab lab = make_lab("wrong zeros", 0.02, 0.0);
  const Measurements measurements = tracked_poses(lab, {}, kSigmaRad, kSigmaM);
  const Placement placement = place_markers(lab.nominal, lab.values, measurements.poses);
  const Calibration before = run(lab, measurements, placement, FreeGeometry::kPlacement);
  const Calibration after = run(lab, measurements, placement, FreeGeometry::kOffsets);
  EXPECT_GT(before.held_out_rms, 10.0 * kSigmaM);
  EXPECT_NEAR(after.held_out_rms, kDistance * kSigmaM, 0.15 * kDistance * kSigmaM);
  EXPECT_NEAR(after.held_out_rotation_rms_rad, kDistance * kSigmaRad, 0.15 * kDistance * kSigmaRad);
  // The joint value stays the reading: the zero went into the frame.
  for (const Joint& joint : after.tree.joints) EXPECT_EQ(joint.offset, 0.0);
  EXPECT_TRUE(after.joints[2].offset_sigma);
}

TEST(Nominal, GeometryExplainsAWrongDrawing) {
  constexpr double kSigmaM = 1e-4;
  const Lab lab = make_lab("wrong drawing", 0.005, 0.004);
  const Measurements measurements = tracked_poses(lab, {}, 2e-4, kSigmaM);
  const Placement placement = place_markers(lab.nominal, lab.values, measurements.poses);
  const Calibration offsets = run(lab, measurements, placement, FreeGeometry::kOffsets);
  const Calibration geometry = run(lab, measurements, placement, FreeGeometry::kGeometry);
  EXPECT_GT(offsets.held_out_rms, 5.0 * kSigmaM);
  EXPECT_LT(geometry.held_out_rms, 1.3 * kDistance * kSigmaM);
  EXPECT_EQ(geometry.status, CalibrationStatus::kConverged);
}

TEST(Nominal, ZerosFarOffDoNotHoldTheGeometryBack) {
  constexpr double kSigmaM = 1e-4;
  const Lab lab = make_lab("far zeros", 0.3, 0.003);
  const Measurements measurements = tracked_poses(lab, {}, 2e-4, kSigmaM);
  const Placement placement = place_markers(lab.nominal, lab.values, measurements.poses);
  const Calibration geometry = run(lab, measurements, placement, FreeGeometry::kGeometry);
  EXPECT_LT(geometry.held_out_rms, 1.3 * kDistance * kSigmaM);
  EXPECT_EQ(geometry.status, CalibrationStatus::kConverged);
  // What the data do not tell (the first zero against the base) the drawing still holds.
  const auto zero = geometry.joints[0].direction_sigma_rad;
  ASSERT_TRUE(zero);
  EXPECT_LT(*zero, 0.05);
}

/// The marker on the flange, and tag_4 on the link before it.
Measurements with_marker_before_flange(const Lab& lab, Measurements measurements) {
  PoseTrack before = measurements.poses.tracks[0];
  before.id = TagId{4};
  for (PoseSample& sample : before.samples) {
    sample.T_camera_marker = lab.T_tracker_base *
                             forward_kinematics(lab.real, lab.values.row(sample.frame))[5] *
                             lab.nominal.joints[5].T_parent_joint;
  }
  measurements.poses.tracks.push_back(before);
  return measurements;
}

Placement placement_of_both(const Lab& lab) {
  Placement placement = {lab.T_tracker_base, {{TagId{3}, LinkId{6}, {}}}};
  placement.markers.push_back({TagId{4}, LinkId{5}, lab.nominal.joints[5].T_parent_joint});
  return placement;
}

TEST(Nominal, AMarkerThatIsMostlyElsewhereIsNoAnswer) {
  const Lab lab = make_lab("mostly elsewhere", 0.01, 0.002);
  Measurements measurements = with_marker_before_flange(lab, tracked_poses(lab, {}, 2e-4, 1e-4));
  Rng rng = Rng::from_name("elsewhere");
  for (PoseSample& sample : measurements.poses.tracks[1].samples) {
    if (sample.frame % 5 < 3) sample.T_camera_marker = random_pose(rng, 0.5, 0.5);
  }
  const Calibration found = run(lab, measurements, placement_of_both(lab), FreeGeometry::kGeometry);
  EXPECT_EQ(found.status, CalibrationStatus::kUndetermined);
  EXPECT_EQ(found.status_reason, "most sightings of tag_4 contradict the robot");
  EXPECT_NE(found.status_remedy.find("axes, units and channels"), std::string::npos);
}

// An effect that the model lacks, in every posture: none of them is an outlier for that.
TEST(Nominal, ALinkThatErrsInMostPosturesKeepsThem) {
  Lab lab = make_lab("errs in most postures", 0.01, 0.002);
  const Measurements measurements =
      with_marker_before_flange(lab, tracked_poses(lab, {}, 2e-4, 1e-4));
  for (int f = 0; f < kLabPostures; ++f)
    lab.log.values(f, 5) += 0.02 * std::sin(3.0 * lab.values(f, 2));
  const Calibration found = run(lab, measurements, placement_of_both(lab), FreeGeometry::kGeometry);
  EXPECT_EQ(found.status, CalibrationStatus::kConverged) << found.status_reason;
  EXPECT_EQ(found.markers[0].rejected, 0);
  EXPECT_GT(found.held_out_rotation_rms_rad, 0.005);
}

CheckedNominal check(const Lab& lab, const Measurements& measurements) {
  const auto place = [&](const KinematicTree& tree) {
    Eigen::MatrixXd values(lab.values.rows(), lab.values.cols());
    for (std::size_t j = 0; j < tree.joints.size(); ++j) {
      values.col(static_cast<Eigen::Index>(j)) =
          lab.values.col(value_of(lab.log.channel(tree.joints[j].channel)));
    }
    const Placement placement = measurements.poses.tracks.empty()
                                    ? place_points(tree, values, measurements.points)
                                    : place_markers(tree, values, measurements.poses);
    CalibrationStart start;
    start.tree = tree;
    start.tree.markers = placement.markers;
    start.T_camera_base = placement.T_camera_base;
    start.nominal = true;
    return start;
  };
  return check_nominal(lab.nominal, place, measurements, {}, lab.log);
}

TEST(CheckNominal, FindsAxesThatPointElsewhere) {
  Lab lab = make_lab("wrong axes", 0.02, 0.003);
  const Measurements measurements = tracked_poses(lab, {}, 2e-4, 1e-4);
  lab.nominal.joints[1].axis = -Eigen::Vector3d::UnitZ();
  lab.nominal.joints[3].axis = Eigen::Vector3d::UnitX();
  const CheckedNominal checked = check(lab, measurements);
  ASSERT_EQ(checked.faults.size(), 2U);
  for (const NominalFault& fault : checked.faults) {
    EXPECT_TRUE(fault.joint == 1 || fault.joint == 3);
    ASSERT_TRUE(fault.axis);
    EXPECT_LT((*fault.axis - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
    EXPECT_LT(fault.after.m, fault.before.m);
  }
  for (const Joint& joint : checked.start.tree.joints)
    EXPECT_LT((joint.axis - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
}

TEST(CheckNominal, FindsExchangedChannels) {
  Lab lab = make_lab("exchanged", 0.02, 0.003);
  const Measurements measurements = tracked_poses(lab, {}, 2e-4, 1e-4);
  std::swap(lab.nominal.joints[1].channel, lab.nominal.joints[4].channel);
  const CheckedNominal checked = check(lab, measurements);
  ASSERT_EQ(checked.faults.size(), 1U);
  EXPECT_EQ(checked.faults[0].joint, 1);
  EXPECT_EQ(checked.faults[0].exchanged_with, 4);
  EXPECT_EQ(checked.start.tree.joints[1].channel, "j2");
}

/// Of a ball on the flange.
Measurements tracked_points(const Lab& lab, double sigma_m) {
  Rng rng = Rng::from_name("tracker noise");
  const Eigen::Vector3d ball(0.05, -0.02, 0.1);
  Measurements measurements;
  measurements.times_s = measurements.points.times_s = lab.times_s;
  for (int f = 0; f < kLabPostures; ++f) {
    const Eigen::Vector3d seen =
        lab.T_tracker_base * (flange(lab, f) * ball) + rng.normal3(sigma_m);
    measurements.points.observations.push_back({f, TagId{1}, seen, "", sigma_m});
  }
  return measurements;
}

// Poses lead a fit to far zeros by themselves; a point does not.
TEST(CheckNominal, FindsZerosThatAreFarOff) {
  for (const double off : {0.7, -1.3, 3.0}) {
    Lab lab = make_lab("far off", 0.02, 0.003);
    const Measurements measurements = tracked_points(lab, 1e-4);
    Pose& frame = lab.nominal.joints[2].T_parent_joint;
    frame = frame * Pose{Eigen::Quaterniond(Eigen::AngleAxisd(off, Eigen::Vector3d::UnitZ())),
                         Eigen::Vector3d::Zero()};
    const CheckedNominal checked = check(lab, measurements);
    ASSERT_EQ(checked.faults.size(), 1U) << off;
    EXPECT_EQ(checked.faults[0].joint, 2) << off;
    ASSERT_TRUE(checked.faults[0].zero) << off;
    EXPECT_NEAR(*checked.faults[0].zero, -off, 0.06);
  }
}

TEST(CheckNominal, LeavesARobotAloneThatIsOnlyInaccurate) {
  const Lab lab = make_lab("only inaccurate", 0.1, 0.01);
  const Measurements measurements = tracked_poses(lab, {}, 2e-4, 1e-4);
  EXPECT_TRUE(check(lab, measurements).faults.empty());
}

TEST(CheckNominal, RefusesColumnsThatNoMendingExplains) {
  Lab lab = make_lab("other columns", 0.02, 0.003);
  for (std::size_t j = 3; j < 6; ++j)
    lab.nominal.joints[j].type = lab.real.joints[j].type = JointType::kFixed;
  Lab other = lab;
  for (int j = 0; j < 3; ++j) other.values.col(j) = lab.values.col((j + 1) % 3);
  const Measurements measurements = tracked_poses(other, {}, 2e-4, 1e-4);
  try {
    static_cast<void>(check(lab, measurements));
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kUndetermined);
    EXPECT_NE(std::string(error.what()).find("does not fit with these columns: tag_3"),
              std::string::npos)
        << error.what();
  }
}

// The frames of a nominal robot are a choice: what is known of its axes is what is known without
// it.
TEST(Nominal, AxesAreAsCertainAsWithoutTheDrawing) {
  const Lab lab = make_lab("nominal and not", 0.01, 0.003);
  Measurements measurements = tracked_poses(lab, {}, 2e-4, 1e-4);
  // A marker on the base and one in the middle, beside that of the flange.
  Rng rng = Rng::from_name("more markers");
  for (const int link : {0, 3}) {
    PoseTrack track = measurements.poses.tracks.front();
    track.id = TagId{10 + link};
    const Pose mount = random_pose(rng, 1.0, 0.1);
    for (PoseSample& sample : track.samples) {
      const auto poses = forward_kinematics(lab.real, lab.values.row(sample.frame));
      Vector6d noise;
      noise << rng.normal3(2e-4), rng.normal3(1e-4);
      sample.T_camera_marker =
          lab.T_tracker_base * poses[static_cast<std::size_t>(link)] * mount * exp_pose(noise);
    }
    measurements.poses.tracks.push_back(std::move(track));
  }
  const Placement placement = place_markers(lab.nominal, lab.values, measurements.poses);
  const Calibration nominal = run(lab, measurements, placement, FreeGeometry::kGeometry);
  CalibrationStart start;
  start.tree = nominal.tree;  // its axes are z, and its frames stay where they are
  start.T_camera_base = nominal.T_camera_base;
  start.camera = nominal.camera;
  const Calibration plain = calibrate(measurements, {}, lab.log, start);
  for (std::size_t j = 0; j < lab.real.joints.size(); ++j) {
    const JointEstimate &with = nominal.joints[j], &without = plain.joints[j];
    ASSERT_TRUE(with.direction_sigma_rad && with.position_sigma_m) << j;
    EXPECT_NEAR(*with.direction_sigma_rad / *without.direction_sigma_rad, 1.0, 0.05) << j;
    EXPECT_NEAR(*with.position_sigma_m / *without.position_sigma_m, 1.0, 0.05) << j;
  }
  EXPECT_EQ(nominal.parameters.size(), plain.parameters.size());
  EXPECT_TRUE(nominal.observability.weak.empty());
  EXPECT_NEAR(nominal.observability.condition_number / plain.observability.condition_number, 1.0,
              0.5);
}

TEST(Nominal, AJointThatStandsStillIsAPartOfItsNeighbours) {
  Lab lab = make_lab("a joint that rests", 0.01, 0.003);
  lab.values.col(1).setConstant(0.3);
  lab.log.values = lab.values;
  const Measurements measurements = tracked_poses(lab, {}, 2e-4, 1e-4);
  const Placement placement = place_markers(lab.nominal, lab.values, measurements.poses);
  const Calibration found = run(lab, measurements, placement, FreeGeometry::kGeometry);
  EXPECT_TRUE(found.observability.weak.empty());
  EXPECT_LT(found.held_out_rms, 1.2 * kDistance * 1e-4);
  for (const std::size_t j : {0U, 2U, 3U, 4U, 5U}) {
    ASSERT_TRUE(found.joints[j].direction_sigma_rad) << j;
    EXPECT_LT(*found.joints[j].direction_sigma_rad, 1e-3) << j;
  }
}

// What it did in that posture nothing can check: it would hold the axis, and pass for an effect.
TEST(Nominal, AJointThatMovesInOnePostureStandsStill) {
  Lab lab = make_lab("a joint that rests", 0.01, 0.003);
  lab.values.col(1).setConstant(0.3);
  lab.values(7, 1) = 0.306;
  lab.log.values = lab.values;
  const Measurements measurements = tracked_poses(lab, {}, 2e-4, 1e-4);
  const Placement placement = place_markers(lab.nominal, lab.values, measurements.poses);
  const Calibration found = run(lab, measurements, placement, FreeGeometry::kGeometry);
  const std::string frame = found.tree.joints[1].name + " turn";
  const auto of = [&](const std::string& start) {
    return std::ranges::count_if(found.parameters, [&](const Parameter& parameter) {
      return parameter.name.starts_with(start);
    });
  };
  EXPECT_EQ(of(frame), 0);
  EXPECT_GT(of(found.tree.joints[2].name + " turn"), 0);
  EXPECT_LT(found.held_out_rms, 1.3 * kDistance * 1e-4);
}

TEST(Nominal, PointsOfATracker) {
  constexpr double kSigma = 5e-5;
  const Lab lab = make_lab("tracker points", 0.01, 0.002);
  const Measurements measurements = tracked_points(lab, kSigma);
  const Placement placement = place_points(lab.nominal, lab.values, measurements.points);
  EXPECT_EQ(placement.markers.at(0).link, LinkId{6});
  const Calibration before = run(lab, measurements, placement, FreeGeometry::kPlacement);
  const Calibration after = run(lab, measurements, placement, FreeGeometry::kGeometry);
  EXPECT_GT(before.held_out_rms, 10.0 * kSigma);
  EXPECT_LT(after.held_out_rms, 1.5 * kDistance * kSigma);
}

// A point that rests fits any base best.
TEST(Nominal, APointOnTheBaseIsPlacedByTheOthers) {
  const Lab lab = make_lab("a point on the base", 0.01, 0.002);
  Measurements measurements = tracked_points(lab, 5e-5);
  Rng rng = Rng::from_name("resting");
  const Eigen::Vector3d resting(0.3, 0.2, 0.0);
  for (int f = 0; f < kLabPostures; ++f) {
    measurements.points.observations.push_back(
        {f, TagId{0}, lab.T_tracker_base * resting + rng.normal3(1e-6), "", 1e-6});
  }
  const Placement placement = place_points(lab.nominal, lab.values, measurements.points);
  ASSERT_EQ(placement.markers.size(), 2U);
  EXPECT_EQ(placement.markers[0].link, LinkId{0});
  EXPECT_EQ(placement.markers[1].link, LinkId{6});
  EXPECT_LT((placement.markers[0].T_link_marker.translation - resting).norm(), 0.02);
  EXPECT_LT(log_pose(placement.T_camera_base.inverse() * lab.T_tracker_base).norm(), 0.05);
}

// A point has no turn: nothing is known of it, and all else as before.
TEST(Nominal, WhatMovesNoMeasurementHasNoUncertainty) {
  const Lab lab = make_lab("a turn of a point", 0.01, 0.002);
  Measurements measurements;
  for (int f = 0; f < kLabPostures; ++f)
    measurements.points.observations.push_back(
        {f, TagId{0}, lab.T_tracker_base * flange(lab, f) * Eigen::Vector3d(0.02, 0.01, 0.12), "",
         1e-4});
  measurements.times_s = measurements.points.times_s = lab.times_s;
  const Placement placement = place_points(lab.nominal, lab.values, measurements.points);
  Correction turn;
  turn.name = "turn of the point";
  turn.block = "tag_0";
  turn.part = CorrectedPart::kMarker;
  turn.direction = Vector6d::Unit(1);
  const Calibration plain = run(lab, measurements, placement, FreeGeometry::kOffsets);
  const Calibration found = run(lab, measurements, placement, FreeGeometry::kOffsets, {turn});
  constexpr double kOneMore = 0.005;  // parameter takes its part of the noise
  int known = 0;
  for (const Parameter& parameter : found.parameters) {
    const auto before = std::ranges::find(plain.parameters, parameter.name, &Parameter::name);
    const bool is_known = before != plain.parameters.end() && before->sigma;
    ASSERT_EQ(parameter.sigma.has_value(), is_known) << parameter.name;
    if (!is_known) continue;
    ++known;
    EXPECT_NEAR(*parameter.sigma, *before->sigma, kOneMore * *before->sigma) << parameter.name;
  }
  EXPECT_GE(known, 5) << "the zeros of the joints behind the first";
}

TEST(Nominal, BallInSocketsWithTheirDistance) {
  // Postures that hold the ball in a socket: solved for by moving the last three joints' mounts is
  // not possible in general, so the sockets are where the ball is, posture by posture, in pairs 50
  // mm apart.
  const Lab lab = make_lab("sockets", 0.0, 0.0);
  Rng rng = Rng::from_name("socket postures");
  const Eigen::Vector3d ball(0.02, 0.01, 0.12);
  // Gauss-Newton on the joint values until the ball is in the socket.
  const auto into_socket = [&](Eigen::VectorXd q, const Eigen::Vector3d& socket) {
    for (int i = 0; i < 100; ++i) {
      const Pose T = forward_kinematics(lab.real, q).back();
      const auto J6 = body_jacobian(lab.real, q, LinkId{6});
      const Eigen::MatrixXd J = T.matrix3() * (J6.bottomRows<3>() - skew(ball) * J6.topRows<3>());
      const Eigen::VectorXd step = J.completeOrthogonalDecomposition().solve(socket - T * ball);
      q += std::min(1.0, 0.3 / step.norm()) * step;
    }
    return q;
  };
  Measurements measurements;
  JointLog log = lab.log;
  log.times_s.clear();
  std::vector<Eigen::VectorXd> postures;
  const Eigen::Vector3d first = flange(lab, 0) * ball;
  const Eigen::Vector3d second = first + Eigen::Vector3d(0.05, 0.0, 0.0);
  for (int i = 0; i < 60; ++i) {
    Eigen::VectorXd q = lab.values.row(0).transpose();
    for (int j = 0; j < 6; ++j) q[j] += rng.uniform(-0.6, 0.6);
    q = into_socket(q, i % 2 == 0 ? first : second);
    if ((forward_kinematics(lab.real, q).back() * ball - (i % 2 == 0 ? first : second)).norm() >
        1e-9)
      continue;
    const int frame = static_cast<int>(postures.size());
    measurements.points.observations.push_back(
        {frame, TagId{0}, std::nullopt, i % 2 == 0 ? "a" : "b", 1e-4});
    postures.push_back(q);
    log.times_s.push_back(frame);
  }
  ASSERT_GT(postures.size(), 40U);
  log.values.resize(static_cast<Eigen::Index>(postures.size()), 6);
  for (std::size_t i = 0; i < postures.size(); ++i) {
    log.values.row(static_cast<Eigen::Index>(i)) = postures[i].transpose();
  }
  measurements.times_s = log.times_s;
  measurements.points.times_s = log.times_s;
  measurements.points.distances.push_back({"a", "b", 0.05, 1e-5});

  Lab wrong = lab;
  Rng errors = Rng::from_name("socket zeros");
  for (Joint& joint : wrong.nominal.joints) {
    joint.T_parent_joint.rotation =
        joint.T_parent_joint.rotation * exp_rotation({0.0, 0.0, errors.normal(0.01)});
  }
  wrong.log = log;
  const Placement placement = place_points(wrong.nominal, log.values, measurements.points);
  EXPECT_LT((placement.markers.at(0).T_link_marker.translation - ball).norm(), 0.05);
  const Calibration before = run(wrong, measurements, placement, FreeGeometry::kPlacement);
  const Calibration after = run(wrong, measurements, placement, FreeGeometry::kOffsets);
  EXPECT_GT(before.final_rms, 1e-4);
  EXPECT_LT(after.final_rms, 1e-6);
  // Where the sockets stand is nobody's to know; the prior of 5 mm is not the axes' uncertainty.
  const Calibration whole = run(wrong, measurements, placement, FreeGeometry::kGeometry);
  for (const JointEstimate& joint : whole.joints) {
    ASSERT_TRUE(joint.position_sigma_m && joint.direction_sigma_rad);
    EXPECT_LT(*joint.position_sigma_m, 1e-6);
    EXPECT_LT(*joint.direction_sigma_rad, 1e-6);
  }
}

}  // namespace
}  // namespace kinescope
