// SPDX-License-Identifier: Apache-2.0
//
// Five hundred hard contacts and five hundred soft ones at 1 kHz on a seven-joint arm, half an hour
// of free motion, the momentum observer beside.
#include <algorithm>
#include <cstdio>
#include <string>

#include "dynamics/contact/contact.h"
#include "dynamics/contact/contact_score.h"
#include "dynamics/contact/momentum_observer.h"
#include "tests/experiments/contact_sets.h"
#include "tests/truth/contact_world.h"

namespace kinescope {
namespace {

constexpr int kJoints = 7;
constexpr int kWorlds = 10;

std::vector<BalanceSample> balance_of(const DynamicModel& model, const ContactWorld& world) {
  return balance_samples(RigidBalance(make_rigid_model(model), friction_of(model)), world.samples);
}

/// Labels and detections of several logs as of one.
struct Pooled {
  std::vector<ContactLabel> labels;
  std::vector<DetectedContact> detections;

  void add(double shift_s, std::vector<ContactLabel> more, std::vector<DetectedContact> found) {
    for (ContactLabel& label : more) {
      label.begin_s += shift_s;
      label.end_s += shift_s;
      labels.push_back(label);
    }
    for (DetectedContact& detection : found) {
      detection.alarm_s += shift_s;
      detection.end_s += shift_s;
      detection.onset_s += shift_s;
      detections.push_back(detection);
    }
  }
};

void print_score(const char* who, const ContactScore& score) {
  std::printf(
      "    %-30s found %d of %zu, invented %d, repeated %d; delay median %.1f mean %.1f worst %.1f "
      "ms\n",
      who, score.found, score.labels.size(), score.invented, score.repeated,
      1e3 * score.median_delay_s, 1e3 * score.mean_delay_s, 1e3 * score.worst_delay_s);
}

void judge(const char* name, const DynamicModel& model, const ContactCalibration& calibration,
           const std::vector<BalanceSample>& free, const ContactWorldOptions& options) {
  const std::vector<double> gains{15.0, 25.0, 40.0, 60.0, 90.0, 140.0};
  Pooled ours;
  std::vector<Pooled> theirs(gains.size());
  for (int w = 0; w < kWorlds; ++w) {
    Rng rng = Rng::from_name(name, static_cast<std::uint64_t>(w));
    const ContactWorld world = contact_world(model, options, rng);
    const std::vector<BalanceSample> samples = balance_of(model, world);
    const double shift_s = 1000.0 * w;
    ours.add(shift_s, world.labels, detections_of(detect_contacts(calibration, samples)));
    for (std::size_t g = 0; g < gains.size(); ++g) {
      const ObserverCalibration observer =
          calibrate_observer(free, {}, gains[g], 1.0, ObserverTest::kLargestJoint);
      theirs[g].add(shift_s, world.labels, detections_of(observer_alarms(observer, samples)));
    }
  }
  const ContactScore score = score_contacts(ours.labels, ours.detections);
  std::printf("  %s:\n", name);
  print_score("this room", score);
  std::printf("    link right %d\n", score.link_right);
  for (std::size_t g = 0; g < gains.size(); ++g) {
    print_score(
        ("momentum observer, " + std::to_string(static_cast<int>(gains[g])) + " /s").c_str(),
        score_contacts(theirs[g].labels, theirs[g].detections));
  }
}

}  // namespace

void contact_simulated() {
  const DynamicModel model = contact_arm(kJoints);
  Rng rng = Rng::from_name("contact_simulated");
  const ContactWorld log = contact_world(model, {.duration_s = 60.0, .rate_hz = 1000.0}, rng);
  const std::vector<BalanceSample> samples = balance_of(model, log);
  const ContactCalibration calibration = calibrate_contacts(samples);
  std::printf("simulated 7-joint arm, 1 kHz, calibrated on 60 s, 1 false alarm/h declared\n");
  judge("hard: 30 ms half-sines of 100 N", model, calibration, samples,
        {.duration_s = 25.0,
         .rate_hz = 1000.0,
         .contacts = 50,
         .contact_s = 0.03,
         .force_n = 100.0,
         .shape = ContactShape::kHalfSine});
  judge("soft: 200 ms trapezoids of 20 N", model, calibration, samples,
        {.duration_s = 50.0, .rate_hz = 1000.0, .contacts = 50, .contact_s = 0.2, .force_n = 20.0});
  double hours = 0.0;
  double tail = 0.0;
  int alarms = 0;
  for (int w = 0; w < kWorlds; ++w) {
    const ContactWorld free = contact_world(model, {.duration_s = 180.0, .rate_hz = 1000.0}, rng);
    const FalseAlarmCheck check = check_false_alarms(calibration, balance_of(model, free));
    alarms += check.alarms;
    hours += check.hours;
    tail += check.extrapolated_per_hour / kWorlds;
  }
  std::printf("  free motion: %d false alarms in %.2f h (declared 1 /h), by the tails %.2g /h\n",
              alarms, hours, tail);
}

}  // namespace kinescope
