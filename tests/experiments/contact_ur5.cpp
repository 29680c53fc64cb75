// SPDX-License-Identifier: Apache-2.0
//
// Every file is judged by a model and a calibration that have not seen it: its current is predicted
// by a model of the other files; the calibration's residuals are those of models that leave the
// file in question and the one to be judged out.
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "dynamics/contact/contact.h"
#include "dynamics/contact/contact_score.h"
#include "dynamics/contact/momentum_observer.h"
#include "kinematics/core/csv.h"
#include "tests/experiments/contact_sets.h"
#include "tests/experiments/ripple_model.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

constexpr std::array kFiles{"base_sweep_1degps_1", "base_sweep_1degps_2", "base_sweep_3degps_1",
                            "base_sweep_3degps_2", "base_sweep_5degps_1", "base_sweep_5degps_2",
                            "base_sweep_7degps_1", "base_sweep_7degps_2", "impact_4degps_1",
                            "impact_4degps_2",     "impact_4degps_3"};
constexpr double kFreeShare = 0.6;
constexpr double kBetweenFiles_s = 100.0;

struct Ur5Recording {
  std::string name;
  JointRun run;
  double stop_s = 0.0;
  double touch_s = std::nan("");  ///< soft sensor's first departure, impacts only
};

/// 6 sigma of the first 5 s away from their mean.
double first_departure(const Eigen::VectorXd& t, const Eigen::VectorXd& sensor) {
  Eigen::Index calm = 0;
  while (t[calm] < 5.0) ++calm;
  const double mean = sensor.head(calm).mean();
  const double sigma = std::sqrt((sensor.head(calm).array() - mean).square().mean());
  for (Eigen::Index k = calm; k < t.size(); ++k) {
    if (std::abs(sensor[k] - mean) > 6.0 * sigma) return t[k];
  }
  return std::nan("");
}

Ur5Recording read_recording(const std::filesystem::path& folder, const std::string& name) {
  const CsvTable table = read_csv(folder / (name + ".csv"));
  const auto column = [&](const char* header) {
    Eigen::VectorXd out(static_cast<Eigen::Index>(table.rows.size()));
    for (std::size_t r = 0; r < table.rows.size(); ++r) {
      out[static_cast<Eigen::Index>(r)] = table.number(r, table.require_column(header));
    }
    return out;
  };
  Ur5Recording out;
  out.name = name;
  out.run.t_s = 1e-3 * column("t_ms");
  out.run.q = column("q_deg1");
  out.run.current = column("i1");
  out.run.free = static_cast<Eigen::Index>(kFreeShare * static_cast<double>(out.run.q.size()));
  add_speeds(out.run, 0.08, 0.25);
  Eigen::Index last = out.run.q.size() - 1;
  const double cruise = out.run.speed.cwiseAbs().maxCoeff();
  while (last > 0 && std::abs(out.run.speed[last]) < 0.25 * cruise) --last;
  out.stop_s = out.run.t_s[last];
  if (table.column("soft_sensor_raw")) {
    out.touch_s = first_departure(out.run.t_s, column("soft_sensor_raw"));
  }
  return out;
}

std::vector<BalanceSample> residuals(const Ur5Recording& recording, const RippleModel& model,
                                     Eigen::Index rows, double shift_s) {
  const JointRun& run = recording.run;
  return balance_samples((run.t_s.array() + shift_s).matrix().head(rows), run.current.head(rows),
                         model.predict(run).head(rows), model.sigma(run).head(rows));
}

std::vector<const JointRun*> without(const std::vector<Ur5Recording>& all, std::size_t a,
                                     std::size_t b) {
  std::vector<const JointRun*> runs;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (k != a && k != b) runs.push_back(&all[k].run);
  }
  return runs;
}

std::vector<BalanceSample> calibration_samples(const std::vector<Ur5Recording>& all,
                                               std::size_t held_out,
                                               const std::vector<double>& frequencies) {
  std::vector<BalanceSample> out;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (k == held_out) continue;
    const std::vector<BalanceSample> part =
        residuals(all[k], learn_ripple(without(all, held_out, k), frequencies), all[k].run.free,
                  static_cast<double>(k) * kBetweenFiles_s);
    out.insert(out.end(), part.begin(), part.end());
  }
  return out;
}

/// First alarm after the free part, and how many there are in it.
struct Outcome {
  double first_s = std::nan("");
  int in_free_part = 0;
};

Outcome judge(const Ur5Recording& recording, const std::vector<DetectedContact>& detections) {
  Outcome out;
  const double free_s = recording.run.t_s[recording.run.free];
  for (const DetectedContact& detection : detections) {
    if (detection.alarm_s < free_s) {
      ++out.in_free_part;
    } else if (std::isnan(out.first_s)) {
      out.first_s = detection.alarm_s;
    }
  }
  return out;
}

void print_outcome(const Ur5Recording& recording, const Outcome& outcome) {
  const JointRun& run = recording.run;
  if (std::isnan(outcome.first_s)) {
    std::printf(" | none before the end, %d in free part", outcome.in_free_part);
    return;
  }
  Eigen::Index at = 0;
  while (run.t_s[at] < outcome.first_s) ++at;
  std::printf(" | %7.3f s, %6.0f ms before stop, at %.2f deg %.2f A", outcome.first_s,
              1e3 * (recording.stop_s - outcome.first_s), run.q[at], run.current[at]);
  if (!std::isnan(recording.touch_s)) {
    std::printf(" (touch %+.0f ms)", 1e3 * (outcome.first_s - recording.touch_s));
  }
  std::printf(", %d in free part", outcome.in_free_part);
}

/// The residual in units of its predictive sigma; plain, start-up would drown all the rest.
std::vector<BalanceSample> in_sigmas(std::vector<BalanceSample> samples) {
  for (BalanceSample& sample : samples) sample.drive = sample.drive.cwiseQuotient(sample.sigma);
  return samples;
}

std::vector<DetectedContact> lowpass_alarms(double gain, const std::vector<BalanceSample>& log,
                                            const std::vector<BalanceSample>& test) {
  const ObserverCalibration observer =
      calibrate_observer(in_sigmas(log), {}, gain, ContactOptions{}.false_alarms_per_hour,
                         ObserverTest::kLargestJoint);
  return detections_of(observer_alarms(observer, in_sigmas(test)));
}

/// The gain with the most files that are stopped in time without an alarm before, then the earliest
/// alarms: tuned on the very data it is judged on.
double best_gain(const std::vector<Ur5Recording>& all,
                 const std::vector<std::vector<BalanceSample>>& logs,
                 const std::vector<std::vector<BalanceSample>>& tests) {
  double best = -1e9;
  double out = 0.0;
  for (double gain = 1.0; gain < 130.0; gain *= 1.3) {
    double good = 0.0;
    for (std::size_t k = 0; k < all.size(); ++k) {
      const Outcome outcome = judge(all[k], lowpass_alarms(gain, logs[k], tests[k]));
      if (outcome.in_free_part > 0 || !(outcome.first_s < all[k].stop_s)) continue;
      good += 10.0 + std::min(1.0, all[k].stop_s - outcome.first_s);
    }
    if (good > best) {
      best = good;
      out = gain;
    }
  }
  return out;
}

}  // namespace

void contact_on_ur5() {
  const auto folder = shared_data("dynamics/ur5_contact");
  if (!folder) {
    std::printf("ur5_contact: not on this machine\n");
    return;
  }
  std::vector<Ur5Recording> all;
  for (const char* name : kFiles) all.push_back(read_recording(*folder, name));
  std::vector<ContactCalibration> calibrations;
  std::vector<std::vector<BalanceSample>> logs;
  std::vector<std::vector<BalanceSample>> tests;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const std::vector<double> frequencies = find_frequencies(without(all, k, k));
    logs.push_back(calibration_samples(all, k, frequencies));
    calibrations.push_back(calibrate_contacts(logs.back(), {.may_contain_contacts = false}));
    const RippleModel model = learn_ripple(without(all, k, k), frequencies);
    tests.push_back(residuals(all[k], model, all[k].run.q.size(), 0.0));
  }
  const double gain = best_gain(all, logs, tests);
  std::printf(
      "ur5_contact, %.0f false alarm/h declared: this room | low-passed residual in sigmas, gain "
      "%.0f /s (the best for these files)\n",
      calibrations[0].options.false_alarms_per_hour, gain);
  for (std::size_t k = 0; k < all.size(); ++k) {
    std::printf("  %-20s stop %7.3f s", all[k].name.c_str(), all[k].stop_s);
    print_outcome(all[k], judge(all[k], detections_of(detect_contacts(calibrations[k], tests[k]))));
    print_outcome(all[k], judge(all[k], lowpass_alarms(gain, logs[k], tests[k])));
    std::printf("\n");
  }
  const BalanceNoise& noise = calibrations[0].noise;
  std::printf("  first file: torque noise %.3f A, model %.2f x its sigma over %.2f s; thresholds",
              noise.torque_sigma[0], noise.model_sigma[0], noise.model_time_s[0]);
  for (const double t : calibrations[0].thresholds) std::printf(" %.0f", t);
  std::printf("\n");
}

}  // namespace kinescope
