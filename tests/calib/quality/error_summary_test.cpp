// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/error_summary.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr double kExact = 1e-12;

Calibration two_links(MeasurementKind kind) {
  Calibration calibration;
  calibration.kind = kind;
  calibration.tree.links = {{"base"}, {"arm"}};
  calibration.tree.markers = {{TagId{5}, LinkId{1}, {}, 0.1},
                              {TagId{2}, LinkId{0}, {}, 0.1},
                              {TagId{9}, LinkId{1}, {}, 0.1}};
  return calibration;
}

// Between the two links, along z.
void add_slide(Calibration& calibration) {
  calibration.tree.joints.push_back({.name = "slide",
                                     .type = JointType::kPrismatic,
                                     .parent = LinkId{0},
                                     .child = LinkId{1},
                                     .T_parent_joint = {},
                                     .channel = "",
                                     .copies = {},
                                     .couplings = {},
                                     .limits = {},
                                     .effort = {},
                                     .velocity = {}});
}

Vector6d twist(double rx, double ry, double rz, double x, double y, double z) {
  Vector6d v;
  v << rx, ry, rz, x, y, z;
  return v;
}

SightingResidual sighting_of(int frame, int id, bool used = true) {
  SightingResidual sighting;
  sighting.frame = frame;
  sighting.id = TagId{id};
  sighting.used = used;
  return sighting;
}

TEST(Statistics, OfHandMadeNumbers) {
  const ErrorStatistics s = statistics({4.0, 1.0, 2.0, 3.0, 5.0});
  EXPECT_EQ(s.count, 5);
  EXPECT_NEAR(s.rms, std::sqrt(11.0), kExact);
  EXPECT_NEAR(s.median, 3.0, kExact);
  EXPECT_NEAR(s.p95, 4.8, kExact);  // between the 4th and 5th of 5: place 0.95 * 4 = 3.8
  EXPECT_NEAR(s.max, 5.0, kExact);
  EXPECT_NEAR(statistics({1.0, 2.0}).median, 1.5, kExact);
}

TEST(Statistics, OfNothingAndOfNaN) {
  EXPECT_EQ(statistics({}).count, 0);
  EXPECT_EQ(statistics({}).rms, 0.0);
  const ErrorStatistics s = statistics({3.0, std::numeric_limits<double>::quiet_NaN()});
  EXPECT_EQ(s.count, 1);
  EXPECT_EQ(s.rms, 3.0);
}

TEST(SummariseErrors, CornersAreLengthsAndGroupedByLinkAndMarker) {
  Calibration calibration = two_links(MeasurementKind::kCorners);
  SightingResidual arm = sighting_of(0, 5);
  arm.corners_px = {{3, 4}, {0, 0}};
  arm.held_out_px = {{6, 8}, {0, 0}};
  arm.before_px = {{30, 40}, {0, 0}};
  arm.displacement = twist(0.5, 0.5, -0.01, 0.003, 0.004, 9.0);
  arm.held_out_displacement = twist(0.5, 0.5, 0.02, 0.006, 0.008, 9.0);
  arm.before_displacement = twist(0.5, 0.5, 0.03, 0.03, 0.04, 9.0);
  SightingResidual base = sighting_of(1, 2);
  base.corners_px = {{1, 0}};
  base.displacement = twist(0, 0, 0.001, 0.001, 0, 0);
  calibration.residuals = {arm, base};
  const ErrorSummary summary = summarise_errors(calibration);

  EXPECT_EQ(summary.all.name, "all");
  EXPECT_EQ(summary.all.training_px.count, 3);
  EXPECT_NEAR(summary.all.training_px.rms, std::sqrt(26.0 / 3.0), kExact);
  EXPECT_NEAR(summary.all.held_out_px.max, 10.0, kExact);
  EXPECT_NEAR(summary.all.before_px.max, 50.0, kExact);
  EXPECT_EQ(summary.all.held_out_px.count, 2);  // the base's sighting was never held out
  EXPECT_EQ(summary.all.before_px.count, 2);

  // Of one camera's corners: the shift across the line of sight, the turn about it.
  EXPECT_NEAR(summary.all.training_m.max, 0.005, kExact);
  EXPECT_NEAR(summary.all.held_out_m.max, 0.010, kExact);
  EXPECT_NEAR(summary.all.before_m.max, 0.050, kExact);
  EXPECT_EQ(summary.all.held_out_m.count, 1);
  EXPECT_NEAR(summary.all.training_rad.max, 0.01, kExact);
  EXPECT_NEAR(summary.all.held_out_rad.max, 0.02, kExact);

  ASSERT_EQ(summary.links.size(), 2U);  // in the tree's order
  EXPECT_EQ(summary.links[0].name, "base");
  EXPECT_EQ(summary.links[0].training_px.count, 1);
  EXPECT_EQ(summary.links[1].name, "arm");
  EXPECT_EQ(summary.links[1].training_px.count, 2);
  ASSERT_EQ(summary.markers.size(), 2U);  // by id; tag_9 was never seen
  EXPECT_EQ(summary.markers[0].name, "tag_2");
  EXPECT_EQ(summary.markers[1].name, "tag_5");
}

TEST(SummariseErrors, CornersAreJudgedAcrossTheirOwnLineOfSight) {
  // A marker at 45 degrees: a displacement along the ray to it is depth, and counts for nothing.
  Calibration calibration = two_links(MeasurementKind::kCorners);
  add_slide(calibration);
  calibration.tree.joints[0].axis = Eigen::Vector3d::UnitX();
  calibration.T_camera_base.translation = {0.0, 0.0, 2.0};
  calibration.joint_values =
      Eigen::MatrixXd::Constant(1, 1, 2.0);  // the marker stands at (2, 0, 2)
  SightingResidual along = sighting_of(0, 5);
  along.corners_px = {{1, 0}};
  along.displacement = twist(0.1, 0, 0.1, 0.5, 0, 0.5);
  calibration.residuals = {along};
  EXPECT_NEAR(summarise_errors(calibration).all.training_m.max, 0.0, kExact);
  EXPECT_NEAR(summarise_errors(calibration).all.training_rad.max, 0.1 * std::sqrt(2.0), kExact);
  calibration.residuals[0].displacement = twist(-0.1, 0, 0.1, 0.5, 0.2, -0.5);
  EXPECT_NEAR(summarise_errors(calibration).all.training_m.max, std::sqrt(0.54), kExact);
  EXPECT_NEAR(summarise_errors(calibration).all.training_rad.max, 0.0, kExact);
}

// Where the log has nothing the base's markers are where they always are.
TEST(SummariseErrors, TheBasesLineOfSightNeedsNoJointValue) {
  Calibration calibration = two_links(MeasurementKind::kCorners);
  add_slide(calibration);
  Marker& base = calibration.tree.markers.at(0);
  base.link = LinkId{0};
  base.T_link_marker = {};
  calibration.T_camera_base.translation = {2.0, 0.0, 2.0};
  calibration.joint_values = Eigen::MatrixXd::Constant(1, 1, std::nan(""));
  SightingResidual along = sighting_of(0, base.id.value);
  along.corners_px = {{1, 0}};
  along.displacement = twist(0.0, 0, 0.0, 0.5, 0, 0.5);
  calibration.residuals = {along};
  EXPECT_NEAR(summarise_errors(calibration).all.training_m.max, 0.0, kExact);
}

TEST(SummariseErrors, RejectedSightingsAreInNoFigure) {
  Calibration calibration = two_links(MeasurementKind::kCorners);
  SightingResidual good = sighting_of(0, 5);
  good.corners_px = {{1, 0}};
  SightingResidual bad = sighting_of(1, 5, false);
  bad.corners_px = bad.held_out_px = bad.before_px = {{100, 0}};
  bad.displacement = bad.held_out_displacement = bad.before_displacement = twist(1, 1, 1, 1, 1, 1);
  calibration.residuals = {good, bad};
  const ErrorSummary summary = summarise_errors(calibration);
  EXPECT_EQ(summary.all.training_px.count, 1);
  EXPECT_EQ(summary.all.training_px.max, 1.0);
  EXPECT_EQ(summary.all.held_out_px.count, 0);
  EXPECT_EQ(summary.all.before_m.count, 0);
}

TEST(SummariseErrors, PosesHaveWholeLengthsPointsNoTurns) {
  for (const auto kind : {MeasurementKind::kPose, MeasurementKind::kPoint}) {
    Calibration calibration = two_links(kind);
    SightingResidual one = sighting_of(0, 5);
    one.displacement = twist(0.002, 0.001, 0.002, 0.001, 0.002, 0.002);
    one.held_out_displacement = 2.0 * one.displacement;
    one.before_displacement = 10.0 * one.displacement;
    calibration.residuals = {one};
    const ErrorSummary summary = summarise_errors(calibration);
    EXPECT_EQ(summary.all.training_px.count, 0);
    EXPECT_NEAR(summary.all.training_m.rms, 0.003, kExact);
    EXPECT_NEAR(summary.all.held_out_m.rms, 0.006, kExact);
    EXPECT_NEAR(summary.all.before_m.rms, 0.030, kExact);
    const bool poses = kind == MeasurementKind::kPose;
    EXPECT_EQ(summary.all.training_rad.count, poses ? 1 : 0);
    EXPECT_NEAR(summary.all.held_out_rad.rms, poses ? 0.006 : 0.0, kExact);
  }
}

}  // namespace
}  // namespace kinescope
