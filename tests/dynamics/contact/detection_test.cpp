// SPDX-License-Identifier: Apache-2.0
//
// Simulated arms that are touched: what is found, when, where, and how hard.
#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/contact/contact.h"
#include "dynamics/contact/contact_score.h"
#include "dynamics/contact/momentum_observer.h"
#include "dynamics/experiments/contact_world.h"

namespace kinescope {
namespace {

using namespace experiments;

constexpr int kJoints = 4;

std::vector<BalanceSample> balance_of(const DynamicModel& model, const ContactWorld& world,
                                      double reversal_doubt = 0.0) {
  std::vector<DriveFriction> friction = friction_of(model);
  for (DriveFriction& own : friction) {
    own.reversal_doubt = reversal_doubt;
    if (reversal_doubt > 0.0) own.coulomb = 1e-9;
    own.sigma_unit = 1e-9;
  }
  return balance_samples(RigidBalance(make_rigid_model(model), friction), world.samples);
}

/// Calibrated on a log that holds contacts nobody declared.
struct Arm {
  DynamicModel model = contact_arm(kJoints);
  ContactWorld log;
  std::vector<BalanceSample> samples;
  ContactCalibration calibration;

  Arm() {
    Rng rng = Rng::from_name("contact.arm");
    log = contact_world(model, {.contacts = 6}, rng);
    samples = balance_of(model, log);
    calibration = calibrate_contacts(samples);
  }
};

const Arm& arm() {
  static const Arm instance;
  return instance;
}

TEST(Detection, CalibrationLeavesOutUndeclaredContacts) {
  const ContactCalibration& calibration = arm().calibration;
  EXPECT_EQ(calibration.status, ContactCalibrationStatus::kSettled);
  EXPECT_EQ(calibration.excluded.size(), arm().log.labels.size());
  Rng rng = Rng::from_name("contact.arm");
  const ContactWorld clean = contact_world(arm().model, {}, rng);
  const ContactCalibration reference =
      calibrate_contacts(balance_of(arm().model, clean), {.may_contain_contacts = false});
  // Both tails come from some hundred peaks.
  for (Eigen::Index o = 0; o < calibration.thresholds.size(); ++o) {
    EXPECT_NEAR(calibration.thresholds[o] / reference.thresholds[o], 1.0, 0.4) << o;
  }
  for (Eigen::Index j = 0; j < kJoints; ++j) {
    EXPECT_NEAR(calibration.noise.velocity_sigma[j], 1e-3, 1e-4);
  }
}

TEST(Detection, FindsEveryContactAndInventsNone) {
  Rng rng = Rng::from_name("contact.find");
  const ContactWorld world = contact_world(arm().model, {.duration_s = 40.0, .contacts = 24}, rng);
  const std::vector<BalanceSample> samples = balance_of(arm().model, world);
  const std::vector<ContactEvent> events = detect_contacts(arm().calibration, samples);
  const ContactScore score = score_contacts(world.labels, detections_of(events));
  EXPECT_EQ(score.missed, 0);
  EXPECT_EQ(score.invented, 0);
  EXPECT_EQ(score.repeated, 0);
  EXPECT_GE(score.link_right, static_cast<int>(world.labels.size()) - 1);
  EXPECT_LT(score.median_delay_s, 0.015);
  EXPECT_LT(score.median_end_error_s, 0.02);
  // Earlier than the observer with any gain, at the same declared rate.
  for (const double gain : {15.0, 25.0, 40.0, 60.0, 100.0}) {
    std::vector<char> use(arm().samples.size(), 1);
    for (std::size_t k = 0; k < use.size(); ++k) {
      for (const ContactLabel& label : arm().log.labels) {
        const double t = arm().samples[k].stamp_s;
        if (t > label.begin_s - 0.1 && t < label.end_s + 0.3) use[k] = 0;
      }
    }
    const ObserverCalibration observer =
        calibrate_observer(arm().samples, use, gain, 1.0, ObserverTest::kLargestJoint);
    const ContactScore other =
        score_contacts(world.labels, detections_of(observer_alarms(observer, samples)));
    EXPECT_TRUE(other.missed > 0 || other.median_delay_s > score.median_delay_s) << gain;
  }
}

TEST(Detection, TorqueIsRightWithinItsCovariance) {
  Rng rng = Rng::from_name("contact.torque");
  const ContactWorld world = contact_world(arm().model, {.duration_s = 60.0, .contacts = 40}, rng);
  const std::vector<ContactEvent> events =
      detect_contacts(arm().calibration, balance_of(arm().model, world));
  double squares = 0.0;
  for (const ContactEvent& event : events) {
    // True impulse between the estimated ends, by the trapezoidal rule of the log's own samples.
    Eigen::VectorXd impulse = Eigen::VectorXd::Zero(kJoints);
    for (Eigen::Index k = 1; k < world.samples.size(); ++k) {
      const double t = world.samples.t_s[k];
      if (t <= event.onset_s + 1e-9 || t > event.end_s + 1e-9) continue;
      impulse += 0.5 / 500.0 * (world.external.row(k) + world.external.row(k - 1)).transpose();
    }
    const Eigen::VectorXd miss = event.torque - impulse / (event.end_s - event.onset_s);
    squares += miss.dot(event.torque_covariance.llt().solve(miss)) / kJoints;
  }
  // Mean of some 150 squares of standard normal variables; the model's error is over-covered.
  EXPECT_GT(squares / static_cast<double>(events.size()), 0.3);
  EXPECT_LT(squares / static_cast<double>(events.size()), 1.5);
}

/// Impacts: 40 ms half-sines at 1 kHz.
TEST(Detection, HardContactsWithinTwelveMilliseconds) {
  Rng rng = Rng::from_name("contact.hard");
  const ContactWorldOptions hard{.duration_s = 20.0,
                                 .rate_hz = 1000.0,
                                 .contacts = 30,
                                 .contact_s = 0.04,
                                 .force_n = 100.0,
                                 .shape = ContactShape::kHalfSine};
  const ContactWorld free =
      contact_world(arm().model, {.duration_s = 15.0, .rate_hz = 1000.0}, rng);
  const ContactCalibration calibration = calibrate_contacts(balance_of(arm().model, free));
  const ContactWorld world = contact_world(arm().model, hard, rng);
  const ContactScore score = score_contacts(
      world.labels, detections_of(detect_contacts(calibration, balance_of(arm().model, world))));
  EXPECT_EQ(score.missed, 0);
  EXPECT_EQ(score.invented, 0);
  EXPECT_LE(score.mean_delay_s, 0.012);
  EXPECT_LE(score.worst_delay_s, 0.040);
}

/// Friction that the model does not know jumps at every reversal. Told of the doubt there, the
/// detector does not take reversals for contacts, and still finds contacts that begin at one.
TEST(Detection, ReversalsAreNotContacts) {
  Rng rng = Rng::from_name("contact.reversal");
  constexpr double kFriction_nm = 0.3;
  constexpr double kDoubt = 5.0;
  const ContactWorld log =
      contact_world(arm().model, {.duration_s = 40.0, .undeclared_coulomb_nm = kFriction_nm}, rng);
  const ContactCalibration calibration =
      calibrate_contacts(balance_of(arm().model, log, kDoubt), {.may_contain_contacts = false});
  const ContactWorld world = contact_world(arm().model,
                                           {.duration_s = 40.0,
                                            .contacts = 16,
                                            .force_n = 40.0,
                                            .at_reversal = true,
                                            .undeclared_coulomb_nm = kFriction_nm},
                                           rng);
  const ContactScore score = score_contacts(
      world.labels,
      detections_of(detect_contacts(calibration, balance_of(arm().model, world, kDoubt))));
  EXPECT_EQ(score.missed, 0);
  EXPECT_EQ(score.invented, 0);
  EXPECT_LT(score.median_delay_s, 0.04);
}

TEST(Detection, MissingSamplesArePassedOver) {
  Rng rng = Rng::from_name("contact.missing");
  const ContactWorld world =
      contact_world(arm().model, {.contacts = 8, .missing_share = 0.03}, rng);
  const ContactScore score = score_contacts(
      world.labels,
      detections_of(detect_contacts(arm().calibration, balance_of(arm().model, world))));
  EXPECT_EQ(score.missed, 0);
  EXPECT_EQ(score.invented, 0);
}

/// A predicted torque without a model of the masses: the same contacts, later or not.
TEST(Detection, WorksOnAPredictedTorque) {
  Rng rng = Rng::from_name("contact.predicted");
  const auto residual = [&](const ContactWorld& world) {
    Eigen::MatrixXd predicted = world.samples.torque + world.external;
    for (Eigen::Index k = 0; k < predicted.size(); ++k) predicted.data()[k] += rng.normal(0.02);
    return balance_samples(world.samples.t_s, world.samples.torque, predicted,
                           Eigen::MatrixXd::Constant(predicted.rows(), predicted.cols(), 0.02));
  };
  const ContactCalibration calibration =
      calibrate_contacts(residual(contact_world(arm().model, {.contacts = 4}, rng)));
  const ContactWorld world = contact_world(arm().model, {.contacts = 8}, rng);
  const std::vector<ContactEvent> events = detect_contacts(calibration, residual(world));
  const ContactScore score = score_contacts(world.labels, detections_of(events));
  EXPECT_EQ(score.missed, 0);
  EXPECT_EQ(score.invented, 0);
  EXPECT_GE(score.link_right, 7);
}

/// So weak that only long windows show it: held, it is one contact and not one each window.
TEST(Detection, AHeldContactIsReportedOnce) {
  Rng rng = Rng::from_name("contact.held");
  constexpr Eigen::Index kRows = 6000;
  const Eigen::VectorXd t_s = Eigen::VectorXd::LinSpaced(kRows, 0.0, 0.01 * (kRows - 1));
  Eigen::MatrixXd torque(kRows, 1);
  for (double& value : torque.reshaped()) value = rng.normal(0.1);
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(kRows, 1);
  const ContactCalibration calibration = calibrate_contacts(balance_samples(t_s, torque, none));
  torque.col(0).segment(3000, 500).array() += 0.2;
  const auto events = detect_contacts(calibration, balance_samples(t_s, torque, none));
  ASSERT_EQ(events.size(), 1U);
  EXPECT_NEAR(events[0].onset_s, 30.0, 0.1);
  EXPECT_NEAR(events[0].end_s, 35.0, 0.1);
  EXPECT_NEAR(events[0].torque[0], -0.2, 0.02);
}

/// The model's error at the onset is forgotten some thousand times over.
TEST(Detection, ALongContactHasATorqueThoughErrorsAreShort) {
  Rng rng = Rng::from_name("contact.long");
  constexpr Eigen::Index kRows = 8000;
  const Eigen::VectorXd t_s = Eigen::VectorXd::LinSpaced(kRows, 0.0, 0.01 * (kRows - 1));
  Eigen::MatrixXd torque(kRows, 1);
  for (double& value : torque.reshaped()) value = rng.normal(0.1);
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(kRows, 1);
  ContactCalibration calibration = calibrate_contacts(balance_samples(t_s, torque, none));
  calibration.noise.model_time_s.setConstant(0.02);
  torque.col(0).segment(3000, 3000).array() += 0.5;
  const auto events = detect_contacts(calibration, balance_samples(t_s, torque, none));
  ASSERT_EQ(events.size(), 1U);
  EXPECT_NEAR(events[0].torque[0], -0.5, 0.02);
}

/// A model's error with a correlation time of 0.5 s, and noise of the torque.
Eigen::MatrixXd residual_of(double error_nm, Eigen::Index rows, Rng& rng) {
  Eigen::MatrixXd out(rows, 1);
  const double kept = std::exp(-0.01 / 0.5);
  double error = 0.0;
  for (double& value : out.reshaped()) {
    error = kept * error + std::sqrt(1.0 - kept * kept) * rng.normal(error_nm);
    value = error + rng.normal(0.02);
  }
  return out;
}

/// The model errs more on the log that is looked at than on the one to learn from.
TEST(Detection, NoiseOfAnotherLogGivesWayToThisOnes) {
  Rng rng = Rng::from_name("contact.other_log");
  constexpr Eigen::Index kRows = 6000;
  const Eigen::VectorXd t_s = Eigen::VectorXd::LinSpaced(kRows, 0.0, 0.01 * (kRows - 1));
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(kRows, 1);
  const auto calm = balance_samples(t_s, residual_of(0.1, kRows, rng), none);
  Eigen::MatrixXd torque = residual_of(0.5, kRows, rng);
  torque.col(0).segment(3000, 40).array() += 3.0;
  const auto rough = balance_samples(t_s, torque, none);
  EXPECT_GT(detect_contacts(calibrate_contacts(calm), rough).size(), 5U)
      << "or the test says nothing";
  const auto events = detect_contacts(calibrate_contacts(calm, rough, {}), rough);
  ASSERT_EQ(events.size(), 1U);
  EXPECT_NEAR(events[0].onset_s, 30.0, 0.05);
}

}  // namespace
}  // namespace kinescope
