// SPDX-License-Identifier: Apache-2.0
//
// Measured recordings of others: joint types, order and channels from the tracks. Skipped where
// they are absent.
#include <cmath>
#include <filesystem>
#include <numbers>

#include <gtest/gtest.h>

#include "kinematics/core/csv.h"
#include "kinematics/structure/structure.h"
#include "tests/kinematics/structure/scenes.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

Matrix6d noise(double sigma_rad, double sigma_m) {
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal().head<3>().setConstant(sigma_rad * sigma_rad);
  covariance.diagonal().tail<3>().setConstant(sigma_m * sigma_m);
  return covariance;
}

Pose pose_of(const CsvTable& table, std::size_t row, std::size_t first) {
  const auto at = [&](std::size_t c) { return table.number(row, first + c); };
  return {Eigen::Quaterniond(at(6), at(3), at(4), at(5)).normalized(),
          Eigen::Vector3d(at(0), at(1), at(2))};
}

struct Recording {
  PoseTracks tracks;
  JointLog log;
};

// Postures measured at rest: frame k has stamp k, and so has the log.
void add_posture(Recording& r, const Pose& pose, const Matrix6d& covariance) {
  const auto frame = static_cast<int>(r.tracks.times_s.size());
  r.tracks.times_s.push_back(frame);
  r.log.times_s.push_back(frame);
  PoseSample sample;
  sample.frame = frame;
  sample.T_camera_marker = pose;
  sample.covariance = covariance;
  r.tracks.tracks.front().samples.push_back(std::move(sample));
}

Recording read_positioner(const std::filesystem::path& path) {
  const CsvTable table = read_csv(path);
  Recording r;
  r.tracks.tracks.push_back({TagId{0}, {}});
  r.log.channels = {"joint_1", "joint_2"};
  r.log.values.resize(static_cast<Eigen::Index>(table.rows.size()), 2);
  const std::size_t first = table.require_column("cam_T_target_x_m");
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const auto i = static_cast<Eigen::Index>(row);
    r.log.values(i, 0) = table.number(row, table.require_column("joint_1_rad"));
    r.log.values(i, 1) = table.number(row, table.require_column("joint_2_rad"));
    add_posture(r, pose_of(table, row, first), noise(1e-3, 5e-4));
  }
  return r;
}

// Frame of three points: x to the second, z across.
Pose pose_of_points(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d x = (b - a).normalized();
  const Eigen::Vector3d z = x.cross(c - a).normalized();
  Eigen::Matrix3d R;
  R << x, z.cross(x), z;
  return {Eigen::Quaterniond(R), (a + b + c) / 3.0};
}

Recording read_sweeps(const std::filesystem::path& path) {
  const CsvTable table = read_csv(path);
  Recording r;
  r.tracks.tracks.push_back({TagId{0}, {}});
  r.log.values.resize(static_cast<Eigen::Index>(table.rows.size()), 6);
  const std::size_t points = table.require_column("n1_x_mm");
  const std::size_t joints = table.require_column("j1_deg");
  for (std::size_t k = 0; k < 6; ++k) r.log.channels.push_back(table.header[joints + k]);
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const auto point = [&](std::size_t n) {
      return Eigen::Vector3d(1e-3 * Eigen::Vector3d(table.number(row, points + 3 * n),
                                                    table.number(row, points + 3 * n + 1),
                                                    table.number(row, points + 3 * n + 2)));
    };
    for (std::size_t k = 0; k < 6; ++k) {
      r.log.values(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(k)) =
          table.number(row, joints + k);
    }
    add_posture(r, pose_of_points(point(0), point(1), point(2)), noise(2e-4, 4e-5));
  }
  return r;
}

Recording read_door(const std::filesystem::path& path) {
  const CsvTable table = read_csv(path);
  Recording r;
  r.tracks.tracks.push_back({TagId{1}, {}});
  const std::size_t first = table.require_column("cam_T_tag_x_m");
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    PoseSample sample;
    sample.frame = static_cast<int>(row);
    r.tracks.times_s.push_back(table.number(row, table.require_column("t_s")));
    sample.T_camera_marker = pose_of(table, row, first);
    sample.covariance = noise(5e-3, 1e-3);
    r.tracks.tracks.front().samples.push_back(std::move(sample));
  }
  return r;
}

TEST(RealRecordings, PositionerIsTwoTurningJointsInOrder) {
  const auto path = shared_data("vision/positioner_2r/measurements.csv");
  if (!path) GTEST_SKIP() << "vision/positioner_2r is not on this machine";
  const Recording r = read_positioner(*path);
  const Structure s = find_structure(r.tracks, r.log);
  ASSERT_EQ(s.joints.size(), 2U);
  ASSERT_EQ(s.links.size(), 3U);
  EXPECT_TRUE(s.links[1].markers.empty());
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(s.joints[k].type, JointType::kRevolute);
    ASSERT_TRUE(s.joints[k].channel);
    EXPECT_EQ(s.joints[k].channel->channel, static_cast<int>(k));
    // The encoders are in rad.
    EXPECT_NEAR(s.joints[k].channel->scale, 1.0, 2e-3);
  }
  EXPECT_EQ(s.joints[1].parent_link, 1);
  EXPECT_EQ(s.status, StructureStatus::kDetermined);
  // First fits by others: 0.40 mm, 0.053 deg.
  EXPECT_LT(s.joints[1].translation_rms_m, 0.45e-3);
  EXPECT_LT(s.joints[1].rotation_rms_rad, 0.06 * kDegree);
  RecordProperty("translation_rms_um", static_cast<int>(1e6 * s.joints[1].translation_rms_m));
}

TEST(RealRecordings, LaserSweepsAreSixTurningJointsWithOneCoupling) {
  const auto path = shared_data("vision/industrial_arm_laser_sweeps/sweeps.csv");
  if (!path) GTEST_SKIP() << "vision/industrial_arm_laser_sweeps is not on this machine";
  const Recording r = read_sweeps(*path);
  const Structure s = find_structure(r.tracks, r.log);
  ASSERT_EQ(s.joints.size(), 6U);
  for (std::size_t k = 0; k < 6; ++k) {
    EXPECT_EQ(s.joints[k].type, JointType::kRevolute) << k;
    ASSERT_TRUE(s.joints[k].channel);
    EXPECT_EQ(s.joints[k].channel->channel, static_cast<int>(k));
    // The arm bends under its weight: 0.3 % of the swing of joint 2.
    EXPECT_NEAR(s.joints[k].channel->scale, kDegree, 5e-3 * kDegree) << k;
  }
  // While joint 2 moves, the third is counter-commanded: it turns by j2 + j3.
  ASSERT_EQ(s.joints[2].couplings.size(), 1U);
  EXPECT_EQ(s.joints[2].couplings.front().channel, 1);
  EXPECT_NEAR(std::abs(s.joints[2].couplings.front().scale), kDegree, 0.01 * kDegree);
  // Joints swept one by one from one posture do not show their order: that has to be said.
  EXPECT_NE(s.status, StructureStatus::kDetermined);
  EXPECT_FALSE(s.doubts.empty());
  EXPECT_LT(s.probability, 0.5);
  // All sweeps with one model; each sweep by itself is fitted to 0.02 to 0.04 mm.
  EXPECT_LT(s.joints[5].translation_rms_m, 0.15e-3);
}

TEST(RealRecordings, DoorWithoutALogIsAHinge) {
  const auto path = shared_data("vision/door_hinge_aruco/derived_marker1_track.csv");
  if (!path) GTEST_SKIP() << "vision/door_hinge_aruco is not on this machine";
  const Recording r = read_door(*path);
  const Structure s = find_structure(r.tracks, JointLog{});
  ASSERT_EQ(s.joints.size(), 1U);
  EXPECT_EQ(s.joints[0].type, JointType::kRevolute);
  EXPECT_FALSE(s.joints[0].channel);
  EXPECT_EQ(s.joint_values.cols(), 1);
  EXPECT_EQ(s.status, StructureStatus::kDetermined);
  // By others: 70 deg of travel, 0.40 m radius, medians 0.45 mm and 0.26 deg.
  EXPECT_NEAR(s.joints[0].travel, 70.0 * kDegree, 4.0 * kDegree);
  EXPECT_NEAR(s.joints[0].T_joint_child.translation.head<2>().norm(), 0.40, 0.02);
  EXPECT_LT(s.joints[0].translation_rms_m, 1e-3);
}

}  // namespace
}  // namespace kinescope
