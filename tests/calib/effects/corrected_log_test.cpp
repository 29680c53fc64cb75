// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/corrected_log.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "calib/effects/observed_range.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr double kExact = 1e-12;  // rad: a sine and a sum

// Two hinges; the second one's channel counts ticks.
constexpr double kRadPerTick = 1e-3;
constexpr double kZero = 0.2;

KinematicTree robot() {
  KinematicTree tree;
  tree.links = {{"base"}, {"upper"}, {"fore"}};
  for (int j = 0; j < 2; ++j) {
    Joint joint;
    joint.name = "q" + std::to_string(j + 1);
    joint.channel = "axis" + std::to_string(j + 1);
    joint.type = JointType::kRevolute;
    joint.parent = LinkId{j};
    joint.child = LinkId{j + 1};
    joint.T_parent_joint.translation = {0.3, 0.0, 0.1};
    tree.joints.push_back(joint);
  }
  tree.joints[1].scale = kRadPerTick;
  tree.joints[1].offset = kZero;
  return tree;
}

// What the encoders say, as joint values.
Eigen::MatrixXd values_as_logged() {
  Eigen::MatrixXd out(600, 2);
  for (Eigen::Index i = 0; i < out.rows(); ++i) {
    const double t = 0.02 * static_cast<double>(i);
    out(i, 0) = 1.1 * std::sin(0.7 * t) + 0.3 * std::sin(2.3 * t);
    out(i, 1) = 0.9 * std::sin(1.1 * t + 0.5);
  }
  return out;
}

JointLog log_of(const Eigen::MatrixXd& joint_values) {
  JointLog log;
  log.source = "new_joints.csv";
  log.channels = {"axis2", "axis1"};
  log.values.resize(joint_values.rows(), 2);
  log.values.col(0) = (joint_values.col(1).array() - kZero) / kRadPerTick;
  log.values.col(1) = joint_values.col(0);
  for (Eigen::Index i = 0; i < joint_values.rows(); ++i)
    log.times_s.push_back(5.0 + 0.02 * static_cast<double>(i));
  return log;
}

Eigen::MatrixXd values_of(const JointLog& log) {
  Eigen::MatrixXd out(log.values.rows(), 2);
  out.col(0) = log.values.col(1);
  out.col(1) = (kRadPerTick * log.values.col(0).array() + kZero).matrix();
  return out;
}

FittedEffect fitted(const std::string& effect, const std::string& place,
                    std::initializer_list<double> values, double scan = 0.0) {
  FittedEffect out;
  out.id = {effect, place};
  out.scan = scan;
  out.values.resize(static_cast<Eigen::Index>(values.size()));
  std::ranges::copy(values, out.values.begin());
  out.parameters.resize(values.size());
  out.references = Eigen::VectorXd::Ones(out.values.size());
  return out;
}

CorrectedLog undo(const std::vector<FittedEffect>& effects, const JointLog& log) {
  return corrected_log(log, robot(), effects, std::nullopt);
}

void expect_values(const CorrectedLog& corrected, const Eigen::MatrixXd& truth) {
  EXPECT_LT((values_of(corrected.log) - truth).cwiseAbs().maxCoeff(), kExact);
}

TEST(CorrectedLog, AScaleErrorIsUndoneInTheChannelsOwnUnit) {
  const Eigen::MatrixXd logged = values_as_logged();
  Eigen::MatrixXd truth = logged;
  truth.col(1) *= 1.01;
  const CorrectedLog corrected = undo({fitted("encoder_scale", "q2", {0.01})}, log_of(logged));
  expect_values(corrected, truth);
  EXPECT_EQ(corrected.undone, (std::vector<EffectId>{{"encoder_scale", "q2"}}));
  EXPECT_TRUE(corrected.left.empty());
  EXPECT_EQ(corrected.log.times_s, log_of(logged).times_s);
}

// Scans over a range that one wild value makes would take all memory.
TEST(CorrectedLog, AWildValueCostsNoMemory) {
  Eigen::MatrixXd logged = values_as_logged();
  logged(300, 0) = 1e12;
  Eigen::MatrixXd truth = logged;
  truth.col(1) *= 1.01;
  expect_values(undo({fitted("encoder_scale", "q2", {0.01})}, log_of(logged)), truth);
}

TEST(CorrectedLog, AnEccentricityIsUndone) {
  const Eigen::MatrixXd logged = values_as_logged();
  Eigen::MatrixXd truth = logged;
  const Eigen::ArrayXd q = logged.col(0).array();
  truth.col(0).array() += 0.004 * q.sin() - 0.003 * q.cos();
  expect_values(undo({fitted("eccentricity", "q1", {0.004, -0.003}, 1.0)}, log_of(logged)), truth);
}

// Behind a universal joint: tan q' = tan q cos bend.
TEST(CorrectedLog, ABentCouplingIsUndoneWithItsOvertones) {
  constexpr double kBend = 0.6;  // rad
  const Eigen::MatrixXd logged = values_as_logged();
  Eigen::MatrixXd truth = logged;
  for (double& q : truth.col(0)) {
    const double in_turn = std::remainder(q, 2.0 * std::numbers::pi);
    q += std::atan2(std::sin(q) * std::cos(kBend), std::cos(q)) - in_turn;
  }
  const double amplitude = std::pow(std::tan(0.5 * kBend), 2);
  expect_values(undo({fitted("eccentricity", "q1", {-amplitude, 0.0}, 2.0)}, log_of(logged)),
                truth);
}

TEST(CorrectedLog, AMapIsUndoneWithinItsRange) {
  const Eigen::MatrixXd logged = values_as_logged();
  FittedEffect map;
  map.id = {"joint_map", "q2"};
  map.table.value = Eigen::Vector3d(-0.5, 0.0, 0.5);
  map.table.error = Eigen::Vector3d(0.0, 0.01, 0.0);
  map.table.sigma = Eigen::Vector3d::Zero();
  Eigen::MatrixXd truth = logged;
  for (double& q : truth.col(1)) q += std::max(0.0, 0.01 * (1.0 - std::abs(q) / 0.5));
  expect_values(undo({map}, log_of(logged)), truth);
}

// What an encoder's ring adds depends on where the joint is, not on its channel alone.
TEST(CorrectedLog, AJointThatTwoChannelsMoveStandsWhereBothPutIt) {
  constexpr double kRatio = -1.0;
  KinematicTree coupled = robot();
  coupled.joints[1].couplings = {{"axis1", kRatio}};
  const Eigen::MatrixXd logged = values_as_logged();
  const Eigen::ArrayXd q = logged.col(1).array() + kRatio * kRadPerTick * logged.col(0).array();
  Eigen::MatrixXd truth = logged;
  truth.col(1).array() += 0.004 * q.sin();
  expect_values(corrected_log(log_of(logged), coupled,
                              {fitted("eccentricity", "q2", {0.004, 0.0}, 1.0)}, std::nullopt),
                truth);
}

// q2 is where q1's motor put it, whatever q1's encoder shows of that.
TEST(CorrectedLog, WhatAJointsEncoderLackedDoesNotMoveItsFollower) {
  constexpr double kRatio = -1.0;
  KinematicTree coupled = robot();
  coupled.joints[1].couplings = {{"axis1", kRatio}};
  const Eigen::MatrixXd logged = values_as_logged();
  const CorrectedLog corrected = corrected_log(
      log_of(logged), coupled, {fitted("eccentricity", "q1", {0.004, 0.0}, 1.0)}, std::nullopt);
  const auto follower = [&](const JointLog& log) -> Eigen::VectorXd {
    return log.values.col(0) + kRatio * log.values.col(1);
  };
  EXPECT_LT((follower(corrected.log) - follower(log_of(logged))).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_EQ(corrected.undone.size(), 1U);
}

TEST(CorrectedLog, AChannelOfTwoJointsIsLeft) {
  KinematicTree shared = robot();
  shared.joints[1].channel = "axis1";
  shared.joints[1].scale = 1.0;
  const CorrectedLog corrected =
      corrected_log(log_of(values_as_logged()), shared,
                    {fitted("eccentricity", "q1", {0.004, 0.0}, 1.0)}, std::nullopt);
  EXPECT_TRUE(corrected.undone.empty());
  EXPECT_EQ(corrected.left.size(), 1U);
  EXPECT_EQ(corrected.log.values, log_of(values_as_logged()).values);
}

// The link stands still while the gap is crossed, then follows half a gap behind.
TEST(CorrectedLog, BacklashIsUndone) {
  constexpr double kGap = 0.02;
  const Eigen::MatrixXd logged = values_as_logged();
  Eigen::MatrixXd truth = logged;
  double link = logged(0, 0) + (logged(1, 0) > logged(0, 0) ? -0.5 : 0.5) * kGap;
  for (Eigen::Index i = 0; i < logged.rows(); ++i) {
    link = std::max(std::min(link, logged(i, 0) + 0.5 * kGap), logged(i, 0) - 0.5 * kGap);
    truth(i, 0) = link;
  }
  expect_values(undo({fitted("backlash", "q1", {kGap}, kGap)}, log_of(logged)), truth);
}

TEST(CorrectedLog, ACouplingIsUndoneByTheOtherJointsValue) {
  const Eigen::MatrixXd logged = values_as_logged();
  Eigen::MatrixXd truth = logged;
  truth.col(0) += 0.02 * logged.col(1);
  expect_values(undo({fitted("coupling", "q1", {0.02}, 1.0)}, log_of(logged)), truth);
}

TEST(CorrectedLog, SeveralEffectsAddUpOnWhatWasLogged) {
  const Eigen::MatrixXd logged = values_as_logged();
  Eigen::MatrixXd truth = logged;
  const Eigen::ArrayXd q = logged.col(1).array();
  truth.col(1).array() += 0.01 * q + 0.004 * q.sin() + 0.001 * q.cos();
  const CorrectedLog corrected = undo(
      {fitted("encoder_scale", "q2", {0.01}), fitted("eccentricity", "q2", {0.004, 0.001}, 1.0)},
      log_of(logged));
  expect_values(corrected, truth);
  EXPECT_EQ(corrected.undone.size(), 2U);
}

TEST(CorrectedLog, StampsMoveToTheCamerasClock) {
  const JointLog log = log_of(values_as_logged());
  const CorrectedLog offset = undo({fitted("time_offset", "clock", {0.03})}, log);
  FittedEffect drift = fitted("clock_drift", "clock", {1e-3});
  drift.references[0] = 7.0;
  const CorrectedLog drifted = undo({drift}, log);
  for (std::size_t i = 0; i < log.size(); ++i) {
    EXPECT_NEAR(offset.log.times_s[i], log.times_s[i] - 0.03, kExact);
    const double camera_s = drifted.log.times_s[i];
    EXPECT_NEAR(camera_s + 1e-3 * (camera_s - 7.0), log.times_s[i], kExact);
  }
  EXPECT_EQ(offset.log.values, log.values);
  EXPECT_EQ(offset.undone.size(), 1U);
}

TEST(CorrectedLog, AJointThatIsReadLateIsReadInTime) {
  constexpr Eigen::Index kSamples = 2;  // by so many its reading is late
  const Eigen::MatrixXd logged = values_as_logged();
  Eigen::MatrixXd truth = logged;
  for (Eigen::Index i = 0; i < logged.rows(); ++i) {
    truth(i, 1) = logged(std::min(i + kSamples, logged.rows() - 1), 1);
  }
  const CorrectedLog corrected =
      undo({fitted("time_offset", "q2", {0.02 * kSamples})}, log_of(logged));
  EXPECT_LT((values_of(corrected.log) - truth).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_EQ(corrected.log.times_s, log_of(logged).times_s);
  EXPECT_EQ(corrected.undone.size(), 1U);
}

// A sag is told by the largest load of the recording, whatever the loads of this log.
TEST(CorrectedLog, ASagFollowsItsLoadIntoAnotherPosture) {
  KinematicTree tree = robot();
  tree.joints[0].T_parent_joint.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(-std::acos(0.0), Eigen::Vector3d::UnitX()));
  Marker marker;
  marker.link = LinkId{1};
  tree.markers = {marker};
  const Eigen::MatrixXd logged = 0.5 * values_as_logged();
  // Loads of q1: its own link along x and y, the next one along x and y.
  FittedEffect sag = fitted("compliance", "q1", {0.01, 0.0, 0.0, 0.0});
  sag.references[0] = 2.0;
  const Eigen::Vector3d down = -Eigen::Vector3d::UnitZ();
  const CorrectedLog corrected = corrected_log(log_of(logged), tree, {sag}, down);
  ASSERT_EQ(corrected.undone.size(), 1U);
  const Eigen::MatrixXd change = values_of(corrected.log) - logged;
  // The axis is level, x of the link at q = 0 too: a kilogram there pulls with cos q (kg m), of the
  // q that it has sagged to.
  for (Eigen::Index i = 0; i < change.rows(); ++i)
    EXPECT_NEAR(std::abs(change(i, 0)), 0.005 * std::cos(logged(i, 0) + change(i, 0)), kExact);
  EXPECT_LT(change.col(1).norm(), kExact);
}

// A joint that rests in the new log was wrong there all the same.
TEST(CorrectedLog, AJointThatRestsIsCorrectedWhereItRests) {
  Eigen::MatrixXd logged = values_as_logged();
  logged.col(0).setConstant(1.2);
  Eigen::MatrixXd truth = logged;
  truth.col(0).array() += 0.012 + 0.004 * std::sin(17.0 * 1.2);
  const CorrectedLog corrected =
      undo({fitted("encoder_scale", "q1", {0.01}), fitted("gear_error", "q1", {0.004, 0.0}, 17.0)},
           log_of(logged));
  expect_values(corrected, truth);
  EXPECT_TRUE(corrected.left.empty());
}

// A slow way of q1 through, and far out of, what was observed of it. q2 moves likewise.
Eigen::MatrixXd values_beyond(double low, double high) {
  Eigen::MatrixXd out(2001, 2);
  out.col(0) = Eigen::VectorXd::LinSpaced(out.rows(), low, high);
  out.col(1) = 0.5 * out.col(0);
  return out;
}

// All that a log shows of q1, and of a joint that follows q2.
std::vector<FittedEffect> effects_of_value() {
  FittedEffect map;
  map.id = {"joint_map", "q1"};
  map.table.value = Eigen::Vector4d(-1.5, -1.0, 1.0, 1.5);
  map.table.error = Eigen::Vector4d(0.0, 0.01, -0.02, 0.0);
  map.table.sigma = Eigen::Vector4d::Zero();
  return {fitted("encoder_scale", "q1", {0.01}),
          fitted("eccentricity", "q1", {0.01, 0.005}, 1.0),
          fitted("eccentricity", "q1", {0.01, 0.005}, 2.0),
          fitted("gear_error", "q1", {0.004, 0.003}, 17.0),
          fitted("backlash", "q1", {0.02}, 0.02),
          fitted("coupling", "q1", {0.05}, 1.0),
          map};
}

TEST(CorrectedLog, WithinTheRangeOfAnEffectNothingChanges) {
  constexpr JointLimits kRange{-1.0, 1.0};
  const JointLog log = log_of(values_beyond(-2.0, 2.0));
  const Eigen::MatrixXd logged = values_of(log);
  for (FittedEffect effect : effects_of_value()) {
    const CorrectedLog everywhere = undo({effect}, log);
    EXPECT_TRUE(everywhere.faded.empty());
    effect.range = kRange;
    const CorrectedLog ranged = undo({effect}, log);
    const Eigen::Index decides = effect.id.effect == "coupling" ? 1 : 0;
    for (Eigen::Index i = 0; i < logged.rows(); ++i) {
      const double value = logged(i, decides);
      if (value < kRange.lower || value > kRange.upper) continue;
      EXPECT_EQ(ranged.log.values.row(i), everywhere.log.values.row(i)) << effect.id.effect;
    }
  }
}

// Up to 4 rad no other turn of a ring comes near 1 rad.
TEST(CorrectedLog, BeyondItsRangeAnEffectFadesOutWithoutAStep) {
  constexpr JointLimits kRange{-1.0, 1.0};
  constexpr double kReach = kFadeShare * 2.0;
  const JointLog log = log_of(values_beyond(-4.0, 4.0));
  const Eigen::MatrixXd logged = values_of(log);
  for (FittedEffect effect : effects_of_value()) {
    SCOPED_TRACE(effect.id.effect);
    effect.range = kRange;
    const Eigen::ArrayXd change = (values_of(undo({effect}, log).log) - logged).col(0).array();
    const Eigen::ArrayXd value = logged.col(effect.id.effect == "coupling" ? 1 : 0).array();
    const Eigen::ArrayXd steps = (change.tail(change.size() - 1) - change.head(change.size() - 1));
    const auto within = value.abs() <= kRange.upper;
    const double size = within.select(change.abs(), 0.0).maxCoeff();
    const double steepest = within.tail(steps.size()).select(steps.abs(), 0.0).maxCoeff();
    EXPECT_LT((value.abs() > kRange.upper + kReach).select(change.abs(), 0.0).maxCoeff(), kExact);
    EXPECT_LE(change.abs().maxCoeff(), 1.5 * size);
    // The weight falls by at most 1.5 a reach, of what may have grown by a quarter of a turn.
    const double fall = 1.5 * (value[1] - value[0]) / kReach;
    EXPECT_LE(steps.abs().maxCoeff(), 1.5 * steepest + 1.5 * fall * size);
  }
}

// Loads are those of the posture, wherever it is.
TEST(CorrectedLog, ASagFadesOutBeyondTheRangeOfItsJoint) {
  KinematicTree tree = robot();
  tree.joints[0].T_parent_joint.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(-std::acos(0.0), Eigen::Vector3d::UnitX()));
  const JointLog log = log_of(values_beyond(-2.0, 2.0));
  FittedEffect sag = fitted("compliance", "q1", {0.01, 0.0, 0.0, 0.0});
  const Eigen::Vector3d down = -Eigen::Vector3d::UnitZ();
  const Eigen::MatrixXd everywhere = corrected_log(log, tree, {sag}, down).log.values;
  sag.range = JointLimits{-1.0, 1.0};
  const Eigen::MatrixXd ranged = corrected_log(log, tree, {sag}, down).log.values;
  for (Eigen::Index i = 0; i < ranged.rows(); ++i) {
    const double value = log.values(i, 1);
    if (std::abs(value) <= 1.0) {
      EXPECT_EQ(ranged(i, 1), everywhere(i, 1));
    } else if (std::abs(value) > 1.5) {
      EXPECT_EQ(ranged(i, 1), value);
    }
  }
}

TEST(CorrectedLog, NamesTheJointThatLeavesTheRangeOfAnEffect) {
  constexpr JointLimits kRange{-1.0, 1.0};
  FittedEffect coupling = fitted("coupling", "q1", {0.05}, 1.0);
  FittedEffect scale = fitted("encoder_scale", "q1", {0.01});
  coupling.range = scale.range = kRange;
  // q2 stays within; of q1 a hundredth of the range is no matter.
  EXPECT_TRUE(undo({coupling, scale}, log_of(values_beyond(-1.019, 1.0))).faded.empty());
  const CorrectedLog one = undo({coupling, scale}, log_of(values_beyond(-1.1, 1.0)));
  ASSERT_EQ(one.faded.size(), 1U);
  EXPECT_EQ(one.faded[0].id, scale.id);
  EXPECT_EQ(one.faded[0].joint, JointId{0});
  EXPECT_EQ(one.faded[0].range, kRange);
  EXPECT_NEAR(one.faded[0].reached.lower, -1.1, kExact);
  EXPECT_EQ(one.faded[0].reached.upper, kRange.upper);
  const CorrectedLog both = undo({coupling, scale}, log_of(values_beyond(-1.0, 2.4)));
  ASSERT_EQ(both.faded.size(), 2U);
  EXPECT_EQ(both.faded[0].joint, JointId{1});
  EXPECT_NEAR(both.faded[0].reached.upper, 1.2, kExact);
  // What no log shows is undone nowhere, and does not fade.
  FittedEffect thread = fitted("helical", "q1", {1e-4});
  thread.range = kRange;
  EXPECT_TRUE(undo({thread}, log_of(values_beyond(-2.0, 2.0))).faded.empty());
}

TEST(CorrectedLog, NamesWhatALogCannotShow) {
  const std::vector<FittedEffect> effects{
      fitted("helical", "q1", {1e-4}),
      fitted("axis_wobble", "q2", {1e-3, 0.0}, 1.0),
      fitted("tag_slip", "tag_12", {0, 0, 0, 1e-3, 0, 0}, 3.0),
      fitted("camera_bump", "camera", {1e-3, 0, 0, 0, 0, 0}, 3.0),
      fitted("camera_drift", "camera", {1e-3, 0, 0, 0, 0, 0}, 3.0),
      fitted("clock_jump", "clock", {1e-3}, 3.0),
      fitted("zero_jump", "q1", {1e-3}, 3.0),
      fitted("zero_drift", "q2", {1e-3}, 3.0),
      fitted("lens_distortion", "camera tangential", {1e-3, 0.0})};
  const JointLog log = log_of(values_as_logged());
  const CorrectedLog corrected = undo(effects, log);
  EXPECT_TRUE(corrected.undone.empty());
  ASSERT_EQ(corrected.left.size(), effects.size());
  for (std::size_t i = 0; i < effects.size(); ++i) EXPECT_EQ(corrected.left[i], effects[i].id);
  EXPECT_EQ(corrected.log.values, log.values);
  EXPECT_EQ(corrected.log.times_s, log.times_s);
}

void expect_bad_input(const std::vector<FittedEffect>& effects, const JointLog& log,
                      const std::string& part) {
  try {
    static_cast<void>(undo(effects, log));
    ADD_FAILURE() << "accepted: " << part;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    const std::string what = error.what();
    EXPECT_NE(what.find(part), std::string::npos) << what;
    EXPECT_NE(what.find("new_joints.csv"), std::string::npos) << what;
  }
}

TEST(CorrectedLog, AnotherLogOrRobotIsRefused) {
  JointLog log = log_of(values_as_logged());
  expect_bad_input({fitted("encoder_scale", "q9", {0.01})}, log, "q9");
  // Of another library, or of another gravity: numbers that nothing takes.
  expect_bad_input({fitted("eccentricity", "q1", {0.01}, 1.0)}, log, "eccentricity at q1");
  log.channels[0] = "another";
  expect_bad_input({fitted("encoder_scale", "q2", {0.01})}, log, "q2");
  expect_bad_input({fitted("coupling", "q1", {0.01}, 1.0)}, log,
                   "coupling at q1: no column 'axis2'");
  expect_bad_input({fitted("coupling", "q1", {0.01}, 7.0)}, log, "no column for what it follows");
  EXPECT_NO_THROW(static_cast<void>(undo({fitted("encoder_scale", "q1", {0.01})}, log)));
}

// A column that is not there is no joint at 0.
TEST(CorrectedLog, ALogThatDoesNotSayWhereAJointStandsIsRefused) {
  JointLog log = log_of(values_as_logged());
  log.channels[0] = "another";
  expect_bad_input({fitted("compliance", "q1", {0.01, 0.0, 0.0, 0.0})}, log, "'axis2'");
  KinematicTree coupled = robot();
  coupled.joints[0].couplings = {{"axis2", -1.0}};
  EXPECT_THROW(static_cast<void>(corrected_log(
                   log, coupled, {fitted("eccentricity", "q1", {0.004, 0.0}, 1.0)}, std::nullopt)),
               Error);
}

}  // namespace
}  // namespace kinescope
