// SPDX-License-Identifier: Apache-2.0
//
// Detector and momentum observers on simulated contacts, in small; what their runs come to.
#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/contact/contact.h"
#include "dynamics/experiments/contact_measures.h"

namespace kinescope::experiments {
namespace {

ContactDetectionOptions small(double force_n) {
  return {.kinds = {{.name = "soft",
                     .shape = ContactShape::kTrapezoid,
                     .contact_s = 0.2,
                     .forces_n = {force_n}}},
          .runs = 2,
          .seconds = 5.0,
          .samples = 8000,
          .noise = {},
          .rates_per_hour = {100.0},
          .free_logs = 1};
}

const ContactDetection& firm() {
  static const ContactDetection contacts = run_contact_detection(small(20.0), 1);
  return contacts;
}

TEST(ContactDetection, FindsFirmContactsBeforeTheObserver) {
  const ContactDetection& contacts = firm();
  const KindMeasure ours = measure_kind(contacts, 0, {});
  EXPECT_EQ(ours.contacts, 10);
  EXPECT_EQ(ours.found.found, 10);
  EXPECT_NEAR(ours.hours, 10.0 / 3600.0, 1e-12);
  const PairedDelay delay = paired_delay(contacts, 0);
  ASSERT_GE(delay.contacts, 5);
  EXPECT_LT(delay.detector_s, delay.observer_s);
  EXPECT_LT(delay.observer_s, 0.2);
  EXPECT_NEAR(contacts.free.front().hours, 10.0 / 3600.0, 1e-12);
}

TEST(ContactDetection, ForcesBelowTheNoiseAreNotFound) {
  ContactDetectionOptions options = small(20.0);
  options.noise = 1.0;  // as much as the motion's own torque
  options.kinds.front().forces_n = {0.01};
  options.rates_per_hour.clear();
  const ContactDetection contacts = run_contact_detection(options, 2);
  EXPECT_EQ(measure_kind(contacts, 0, {}).found.found, 0);
  EXPECT_EQ(measure_kind(contacts, 0, contacts.chosen[0]).found.found, 0);
  EXPECT_EQ(paired_delay(contacts, 0).contacts, 0);
  EXPECT_TRUE(std::isnan(paired_delay(contacts, 0).detector_s));
}

TEST(ContactDetection, ThreadsChangeNothing) {
  const ContactDetection& one = firm();
  const ContactDetection two = run_contact_detection(small(20.0), 2);
  ASSERT_EQ(one.runs.size(), two.runs.size());
  EXPECT_EQ(one.chosen, two.chosen);
  EXPECT_EQ(one.free.front().detector, two.free.front().detector);
  EXPECT_EQ(one.free.front().observers, two.free.front().observers);
  for (std::size_t r = 0; r < one.runs.size(); ++r) {
    ASSERT_EQ(one.runs[r].trials.size(), two.runs[r].trials.size());
    for (std::size_t k = 0; k < one.runs[r].trials.size(); ++k) {
      const ContactTrial& a = one.runs[r].trials[k];
      const ContactTrial& b = two.runs[r].trials[k];
      EXPECT_EQ(a.torque_nm, b.torque_nm);
      EXPECT_EQ(a.detector.found, b.detector.found);
      if (a.detector.found) {
        EXPECT_EQ(a.detector.delay_s, b.detector.delay_s);
      }
    }
  }
}

// Twenty contacts of 1 to 20 N m: the detector finds those from 6, the first observer those from
// 11, the second the same ones sooner.
ContactDetection made_up() {
  ContactDetection out;
  out.kinds = {{.name = "soft", .forces_n = {1.0}}};
  out.observers = {{.gain_per_s = 15.0}, {.gain_per_s = 25.0}};
  ContactRun run{.hours = 0.5, .detector_invented = 1, .observers_invented = {2, 3}, .trials = {}};
  for (int k = 20; k >= 1; --k) {
    const auto by = [&](int fewest, double delay_s) {
      return ContactOutcome{.found = k >= fewest, .delay_s = delay_s, .link_right = k > 10};
    };
    run.trials.push_back({.link = 0,
                          .torque_nm = static_cast<double>(k),
                          .detector = by(6, 0.01),
                          .observers = {by(11, 0.03), by(11, 0.02)}});
  }
  out.runs.push_back(run);
  out.chosen = {best_observer(out, 0)};
  return out;
}

TEST(ContactMeasures, OfKnownOutcomes) {
  const ContactDetection contacts = made_up();
  EXPECT_EQ(contacts.chosen.front(), 1U);
  const std::vector<TorqueGroup> groups = groups_by_torque(contacts, 0);
  ASSERT_EQ(groups.size(), 2U);
  EXPECT_EQ(groups[0].torque_nm.median, 5.5);
  EXPECT_EQ(groups[0].detector.found, 5);
  EXPECT_EQ(groups[0].observer.found, 0);
  EXPECT_TRUE(std::isnan(groups[0].observer.delay_s.median));
  EXPECT_EQ(groups[1].detector.link_right, 10);
  EXPECT_EQ(groups[1].observer.delay_s.median, 0.02);
  EXPECT_EQ(measure_kind(contacts, 0, 0).invented, 2);
  EXPECT_EQ(measure_kind(contacts, 0, {}).invented, 1);
  EXPECT_EQ(paired_delay(contacts, 0).contacts, 10);
  EXPECT_EQ(paired_delay(contacts, 0).detector_s, 0.01);
}

// Garwood 1936, by quantiles of chi-square; also where exp(-mean) is no double any more.
TEST(ContactMeasures, IntervalOfARate) {
  EXPECT_EQ(alarm_rate(0, 1.0).lower_per_hour, 0.0);
  EXPECT_NEAR(alarm_rate(0, 1.0).upper_per_hour, 3.6889, 1e-4);
  EXPECT_NEAR(alarm_rate(10, 2.0).lower_per_hour, 4.7954 / 2.0, 1e-4);
  EXPECT_NEAR(alarm_rate(10, 2.0).upper_per_hour, 18.3904 / 2.0, 1e-4);
  EXPECT_NEAR(alarm_rate(1000, 1.0).lower_per_hour, 938.97, 0.01);
  EXPECT_NEAR(alarm_rate(1000, 1.0).upper_per_hour, 1063.95, 0.01);
}

}  // namespace
}  // namespace kinescope::experiments
