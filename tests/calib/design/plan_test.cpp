// SPDX-License-Identifier: Apache-2.0
//
// Plans from calibrations of simulated robots, and what their recordings give: plan_promises asks
// the same of many.
#include "calib/design/plan.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "calib/design/information.h"
#include "kinematics/core/error.h"
#include "tests/truth/commanded_world.h"
#include "tests/truth/joined_recordings.h"

namespace kinescope::design {
namespace {

constexpr double kFirst_s = 4.0;
constexpr double kRate_hz = 15.0;
constexpr double kSigma_px = 0.1;
constexpr double kRounding = 1e-12;

truth::FilmedRobot test_robot(double seconds, double reach) {
  truth::FilmedRobotOptions options;
  options.seed = 9501;
  options.duration_s = seconds;
  options.amplitude_rad = reach;
  options.tag_size_m = 0.06;
  return draw_filmed_robot(options);
}

truth::World filmed(const JointLog& log, double seconds, std::uint64_t noise) {
  truth::CommandedOptions options;
  options.camera.rate_hz = kRate_hz;
  options.camera.sigma_px = kSigma_px;
  options.noise = noise;
  options.end_s = seconds;
  return commanded_world(test_robot(seconds, 1.0), log, options);
}

Calibration calibrated_together(const std::vector<truth::World>& worlds) {
  const truth::JoinedRecordings joined = truth::joined_recordings(worlds);
  CalibrateOptions options;
  options.folds = 0;
  return calibrate(joined.measurements, worlds.front().markers, joined.log,
                   truth::perturbed_starts(worlds, 1), options);
}

// The short first recording in a part of the ranges, calibrated once.
class Plan : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    first_ = new truth::World(filmed(rig_log(test_robot(kFirst_s, 0.4), 200.0), kFirst_s, 1));
    calibration_ = new Calibration(calibrated_together({*first_}));
  }
  static void TearDownTestSuite() {
    delete calibration_;
    delete first_;
  }
  static PlannedRobot robot() {
    PlannedRobot out;
    out.calibration = *calibration_;
    out.noise.all_px = kSigma_px;
    out.sight.most_tilt_rad = 1.3;
    return out;
  }
  static JointSpace space() {
    MotionLimits limits;
    limits.range.assign(3, {-1.0, 1.0});
    limits.velocity = Eigen::Vector3d::Constant(2.0);
    limits.acceleration = Eigen::Vector3d::Constant(6.0);
    return {calibration_->tree, limits};
  }
  static PlanOptions options() {
    PlanOptions out;
    out.seconds = 6.0;
    out.frame_rate_hz = kRate_hz;
    out.candidates = 150;
    return out;
  }
  static truth::World* first_;
  static Calibration* calibration_;
};
truth::World* Plan::first_ = nullptr;
Calibration* Plan::calibration_ = nullptr;

TEST_F(Plan, PromisesWhatItsRecordingGives) {
  const RecordingPlan plan = plan_recording(robot(), space(), {}, options());
  EXPECT_LT(plan.after.goal_m, 0.6 * plan.before.goal_m);
  const JointLog log = recording_along(robot(), space(), *plan.path, kRate_hz).log;
  const Calibration both = calibrated_together({*first_, filmed(log, 6.0, 2)});
  const Eigen::MatrixXd covariance = covariance_of(known_information(both, both.parameters));
  const std::vector<JointEstimate> axes =
      axes_by_covariance(both, both.parameters, covariance, space().values(space().middle()));
  for (std::size_t j = 0; j < axes.size(); ++j) {
    // The issue's own measure: within 20 %.
    EXPECT_NEAR(*axes[j].among_position_sigma_m / *plan.after.axes[j].among_position_sigma_m, 1.0,
                0.2);
    EXPECT_NEAR(*axes[j].among_direction_sigma_rad / *plan.after.axes[j].among_direction_sigma_rad,
                1.0, 0.2);
  }
}

TEST_F(Plan, BeforeIsWhatTheCalibrationClaims) {
  const RecordingPlan plan = plan_recording(robot(), space(), {}, options());
  Eigen::VectorXd mean = calibration_->joint_values.colwise().mean();
  const auto axes =
      axes_by_covariance(*calibration_, calibration_->parameters, calibration_->covariance, mean);
  for (std::size_t j = 0; j < axes.size(); ++j)
    EXPECT_NEAR(*axes[j].among_position_sigma_m, *calibration_->joints[j].among_position_sigma_m,
                1e-6 * *axes[j].among_position_sigma_m);
  EXPECT_GT(plan.before.goal_m, 0.0);
}

TEST_F(Plan, IsTheSameBySeedAndAnotherByAnother) {
  const RecordingPlan a = plan_recording(robot(), space(), {}, options());
  const RecordingPlan b = plan_recording(robot(), space(), {}, options());
  EXPECT_EQ(a.postures, b.postures);
  EXPECT_EQ(a.after.goal_m, b.after.goal_m);
  PlanOptions other = options();
  other.seed = 2;
  EXPECT_NE(plan_recording(robot(), space(), {}, other).postures, a.postures);
}

TEST_F(Plan, PosturesTellMoreThanDrawnOnesAndShowMarkers) {
  PlanOptions asked = options();
  asked.seconds = 0.0;
  asked.postures = 8;
  for (const Goal goal : {Goal::kTip, Goal::kAxes}) {
    asked.goal = goal;
    const RecordingPlan plan = plan_recording(robot(), space(), {}, asked);
    ASSERT_EQ(plan.postures.size(), 8U);
    EXPECT_EQ(plan.frames, 8);
    for (const Eigen::VectorXd& readings : plan.postures)
      EXPECT_FALSE(expected_sightings(robot().calibration, space().values(readings), robot().sight,
                                      robot().noise)
                       .empty());
    PlanOptions twice = asked;
    twice.postures = 16;
    EXPECT_LT(plan_recording(robot(), space(), {}, twice).after.goal_m, plan.after.goal_m);
    PlanOptions blind = asked;
    blind.candidates = 8;  // next to nothing to choose from
    EXPECT_GT(plan_recording(robot(), space(), {}, blind).after.goal_m, plan.after.goal_m);
  }
}

// The order of the postures tells from which side a joint comes.
TEST_F(Plan, BacklashShowsAtPosturesAndInMotion) {
  const double width = 0.01;
  const ConsideredEffect play{
      {"backlash", "q2"}, width, Eigen::VectorXd::Constant(1, width), Eigen::VectorXd::Ones(1)};
  const Eigen::VectorXd there = space().middle();
  const Eigen::VectorXd here = there + Eigen::VectorXd::Constant(3, 0.2);
  const ExpectedRecording postures = recording_at(robot(), space(), {there, here, there, here});
  const std::vector<Correction> at_postures = corrections_of(robot(), postures, play);
  ASSERT_EQ(at_postures.size(), 1U);
  EXPECT_NEAR((at_postures.front().share - Eigen::Vector4d(-0.5, -0.5, 0.5, -0.5)).norm(), 0.0,
              kRounding);
  const RecordingPlan plan = plan_recording(robot(), space(), {}, options());
  const ExpectedRecording motion = recording_along(robot(), space(), *plan.path, kRate_hz);
  const std::vector<Correction> in_motion = corrections_of(robot(), motion, play);
  ASSERT_EQ(in_motion.size(), 1U);
  EXPECT_NEAR(in_motion.front().share.minCoeff(), -0.5, kRounding);
  EXPECT_NEAR(in_motion.front().share.maxCoeff(), 0.5, kRounding);
}

TEST_F(Plan, RefusesWhatNothingIsSeenOfAndWhatIsTooShort) {
  PlannedRobot blind = robot();
  blind.sight.least_edge_px = 1e4;
  EXPECT_THROW(static_cast<void>(plan_recording(blind, space(), {}, options())), Error);
  PlanOptions brief = options();
  brief.seconds = 0.05;
  EXPECT_THROW(static_cast<void>(plan_recording(robot(), space(), {}, brief)), Error);
}

TEST_F(Plan, MarkersAreExpectedWhereTheyAreSeen) {
  const PlannedRobot planned = robot();
  int expected = 0, both = 0, seen = 0;
  for (std::size_t f = 0; f < first_->measurements.times_s.size(); ++f) {
    std::vector<TagId> found;
    for (const TagObservation& tag : first_->measurements.corners)
      if (tag.frame == static_cast<int>(f)) found.push_back(tag.id);
    seen += static_cast<int>(found.size());
    const auto row = static_cast<Eigen::Index>(f);
    for (const TagObservation& tag :
         expected_sightings(planned.calibration, calibration_->joint_values.row(row), planned.sight,
                            planned.noise)) {
      ++expected;
      both += static_cast<int>(std::ranges::count(found, tag.id));
    }
  }
  EXPECT_EQ(both, expected);         // nothing is promised that is not seen
  EXPECT_GT(expected, 0.95 * seen);  // and little is missed: near the limits
}

TEST(Sight, FromBehindTooSmallOrCutOffIsNotSeen) {
  Calibration one;
  one.tree.links = {{"base"}};
  one.camera = pinhole_guess(640, 480, 500.0);
  one.tree.markers = {{TagId{3}, LinkId{0}, {}, 0.1}};
  one.T_camera_base.translation << 0.0, 0.0, 1.0;  // its z, into the tag, away from the camera
  const auto count = [&] {
    return expected_sightings(one, Eigen::VectorXd(0), SightLimits{}, MarkerNoise{}).size();
  };
  EXPECT_EQ(count(), 1U);
  one.T_camera_base.translation.x() = 0.58;  // its border is cut off, its black square is not
  EXPECT_EQ(count(), 0U);
  one.T_camera_base.translation << 0.0, 0.0, 11.0;
  EXPECT_EQ(count(), 0U);  // 4.5 px
  one.T_camera_base.translation << 0.0, 0.0, 1.0;
  one.T_camera_base.rotation = exp_rotation({0.0, 1.45, 0.0});
  EXPECT_EQ(count(), 0U);
  one.T_camera_base.rotation = exp_rotation({0.0, 3.1, 0.0});
  EXPECT_EQ(count(), 0U);
}

}  // namespace
}  // namespace kinescope::design
