// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <limits>
#include <new>

#include <gtest/gtest.h>

#include "dynamics/contact/detector.h"
#include "dynamics/experiments/contact_world.h"
#include "kinematics/core/error.h"

namespace {
std::size_t allocations = 0;
}

// Counts what the program allocates.
void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace kinescope {
namespace {

using namespace experiments;

struct World {
  DynamicModel model = contact_arm(3);
  ContactWorld world;
  std::vector<BalanceSample> samples;
  ContactCalibration calibration;

  World() {
    Rng rng = Rng::from_name("contact.streaming");
    world = contact_world(model, {.duration_s = 15.0, .contacts = 4}, rng);
    samples =
        balance_samples(RigidBalance(make_rigid_model(model), friction_of(model)), world.samples);
    calibration = calibrate_contacts(samples);
  }
};

const World& world() {
  static const World instance;
  return instance;
}

TEST(Streaming, DecidesAsTheBatch) {
  const std::vector<ContactEvent> batch = detect_contacts(world().calibration, world().samples);
  ContactDetector detector(world().calibration);
  RigidBalance balance(make_rigid_model(world().model), friction_of(world().model));
  const TorqueSamples& log = world().world.samples;
  std::size_t ended = 0;
  std::size_t alarms = 0;
  for (Eigen::Index k = 0; k < log.size(); ++k) {
    const ContactDecision decision =
        detector.update(balance.evaluate(log.t_s[k], log.q.row(k).transpose(),
                                         log.dq.row(k).transpose(), log.torque.row(k).transpose()));
    if (decision.alarm) {
      ASSERT_LT(alarms, batch.size());
      EXPECT_EQ(detector.event().alarm_s, batch[alarms].alarm_s);
      EXPECT_TRUE(detector.event().open);
      ++alarms;
    }
    if (!decision.ended) continue;
    ASSERT_LT(ended, batch.size());
    EXPECT_EQ(detector.event().end_s, batch[ended].end_s);
    EXPECT_EQ(detector.event().onset_s, batch[ended].onset_s);
    EXPECT_EQ(detector.event().torque, batch[ended].torque);
    EXPECT_EQ(detector.event().link, batch[ended].link);
    ++ended;
  }
  EXPECT_EQ(alarms, 4U);
  EXPECT_EQ(ended, batch.size());
}

TEST(Streaming, TheSameAgain) {
  const ContactCalibration again = calibrate_contacts(world().samples);
  EXPECT_EQ(again.thresholds, world().calibration.thresholds);
  EXPECT_EQ(again.noise.model_sigma, world().calibration.noise.model_sigma);
}

TEST(Streaming, AFreeRobotAllocatesNothing) {
  ContactDetector detector(world().calibration);
  RigidBalance balance(make_rigid_model(world().model), friction_of(world().model));
  const TorqueSamples& log = world().world.samples;
  const Eigen::MatrixXd q = log.q.transpose();
  const Eigen::MatrixXd dq = log.dq.transpose();
  const Eigen::MatrixXd torque = log.torque.transpose();
  for (Eigen::Index k = 0; k < 500; ++k) {
    const std::size_t before = allocations;
    const ContactDecision decision =
        detector.update(balance.evaluate(log.t_s[k], q.col(k), dq.col(k), torque.col(k)));
    ASSERT_FALSE(decision.contact);
    ASSERT_EQ(allocations, before) << k;
  }
}

TEST(Streaming, SaysWhatIsWrongWithASample) {
  ContactDetector detector(world().calibration);
  for (std::size_t k = 0; k < 100; ++k) {
    EXPECT_EQ(detector.update(world().samples[k]).fault, SampleFault::kNone);
  }
  BalanceSample bad = world().samples[100];
  bad.drive[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(detector.update(bad).fault, SampleFault::kNotFinite);
  EXPECT_EQ(detector.update(world().samples[99]).fault, SampleFault::kNotLater);
  EXPECT_EQ(detector.update(world().samples[101]).fault, SampleFault::kNone);
  BalanceSample late = world().samples[102];
  late.stamp_s += 1.0;
  EXPECT_EQ(detector.update(late).fault, SampleFault::kAfterGap);
  BalanceSample other = world().samples[103];
  other.drive.conservativeResize(2);
  EXPECT_THROW(detector.update(other), Error);
}

/// A contact that is under way when the samples end, or stop for a while, is given as cut off.
TEST(Streaming, ContactsAreCutOffByTheEnd) {
  const ContactLabel& first = world().world.labels[0];
  std::vector<BalanceSample> samples;
  for (const BalanceSample& sample : world().samples) {
    if (sample.stamp_s < 0.5 * (first.begin_s + first.end_s)) samples.push_back(sample);
  }
  const std::vector<ContactEvent> events = detect_contacts(world().calibration, samples);
  ASSERT_EQ(events.size(), 1U);
  EXPECT_TRUE(events[0].cut_off);
  EXPECT_FALSE(events[0].open);
  EXPECT_EQ(events[0].end_s, samples.back().stamp_s);
}

TEST(Streaming, RefusesWhatCannotBeCalibrated) {
  EXPECT_THROW((void)calibrate_contacts({}), Error);
  EXPECT_THROW((void)calibrate_contacts({world().samples.begin(), world().samples.begin() + 100}),
               Error);
  EXPECT_THROW((void)calibrate_contacts(world().samples, {.false_alarms_per_hour = 0.0}), Error);
  EXPECT_THROW((void)calibrate_contacts(world().samples, {.longest_window_s = std::nan("")}),
               Error);
  EXPECT_NO_THROW(validate(ContactOptions{}));
  EXPECT_THROW(RigidBalance(make_rigid_model(world().model), {DriveFriction{}}), Error);
  EXPECT_THROW(
      (void)balance_samples(Eigen::VectorXd(3), Eigen::MatrixXd(3, 2), Eigen::MatrixXd(3, 1)),
      Error);
}

}  // namespace
}  // namespace kinescope
