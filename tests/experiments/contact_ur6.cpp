// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>

#include "dynamics/contact/contact.h"
#include "dynamics/contact/contact_score.h"
#include "dynamics/contact/momentum_observer.h"
#include "dynamics/contact/statistic_log.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/experiments/contact_sets.h"
#include "tests/truth/gzip_table.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

constexpr int kJoints = 6;

struct LabelledLog {
  TorqueSamples samples;
  std::vector<ContactLabel> labels;
};

LabelledLog read_log(const std::filesystem::path& folder, const std::string& name,
                     const std::string& labels) {
  const CsvTable table = read_gzip_csv(folder / name);
  LabelledLog out;
  out.samples.t_s.resize(static_cast<Eigen::Index>(table.rows.size()));
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    out.samples.t_s[static_cast<Eigen::Index>(r)] = table.number(r, table.require_column("t"));
  }
  out.samples.q = numbered_columns(table, "q", kJoints);
  out.samples.dq = numbered_columns(table, "dq", kJoints);
  out.samples.torque = numbered_columns(table, "tau", kJoints);
  out.samples.trajectory = Eigen::VectorXi::Zero(out.samples.t_s.size());
  const CsvTable rows = read_csv(folder / labels);
  for (std::size_t r = 0; r < rows.rows.size(); ++r) {
    const std::string link = rows.rows[r][rows.require_column("link")];
    out.labels.push_back({.begin_s = rows.number(r, rows.require_column("start")),
                          .end_s = rows.number(r, rows.require_column("end")),
                          .link = std::stoi(link.substr(4)) - 1});
  }
  return out;
}

void print_score(const char* what, const ContactScore& score) {
  std::printf(
      "  %-34s found %d of %zu, invented %d, repeated %d; delay median %.1f mean %.1f worst %.1f "
      "ms",
      what, score.found, score.labels.size(), score.invented, score.repeated,
      1e3 * score.median_delay_s, 1e3 * score.mean_delay_s, 1e3 * score.worst_delay_s);
}

void print_events(const LabelledLog& log, const std::vector<ContactEvent>& events,
                  const ContactScore& score) {
  for (std::size_t k = 0; k < log.labels.size(); ++k) {
    const LabelOutcome& outcome = score.labels[k];
    std::printf("    %8.4f to %8.4f s, link%d: ", log.labels[k].begin_s, log.labels[k].end_s,
                log.labels[k].link + 1);
    if (outcome.detection < 0) {
      std::printf("missed\n");
      continue;
    }
    const ContactEvent& event = events[static_cast<std::size_t>(outcome.detection)];
    std::printf("delay %5.1f ms, onset %+6.1f ms, end %+6.1f ms, link%d (%.3f), torque",
                1e3 * outcome.delay_s, 1e3 * outcome.onset_error_s, 1e3 * outcome.end_error_s,
                event.link + 1, event.link_probability[event.link]);
    for (Eigen::Index j = 0; j < event.torque.size(); ++j) {
      std::printf(" %.3f(%.3f)", event.torque[j], std::sqrt(event.torque_covariance(j, j)));
    }
    std::printf("\n");
  }
}

std::vector<TimeSpan> spans_of(const std::vector<ContactLabel>& labels) {
  std::vector<TimeSpan> out;
  for (const ContactLabel& label : labels) {
    out.push_back({.begin_s = label.begin_s, .end_s = label.end_s});
  }
  return out;
}

/// The observer with the gain that does best on the very data it is judged on.
void print_observers(const LabelledLog& calibration_log,
                     const std::vector<BalanceSample>& calibration_samples, const LabelledLog& log,
                     const std::vector<BalanceSample>& samples, const ContactOptions& options) {
  // The observer is told where the contacts are.
  const std::vector<char> use =
      contact::outside(calibration_samples, spans_of(calibration_log.labels), options.guard_s);
  for (const ObserverTest test : {ObserverTest::kLargestJoint, ObserverTest::kAllJoints}) {
    double best_gain = 0.0;
    ContactScore best;
    for (double gain = 5.0; gain <= 400.0; gain *= 1.2) {
      const ObserverCalibration observer =
          calibrate_observer(calibration_samples, use, gain, options.false_alarms_per_hour, test);
      const ContactScore score =
          score_contacts(log.labels, detections_of(observer_alarms(observer, samples)));
      if (best_gain == 0.0 || score.found > best.found ||
          (score.found == best.found && score.median_delay_s < best.median_delay_s)) {
        best_gain = gain;
        best = score;
      }
    }
    const std::string name = std::string("momentum observer, ") +
                             (test == ObserverTest::kAllJoints ? "all joints" : "per joint");
    print_score(name.c_str(), best);
    std::printf(", gain %.0f /s\n", best_gain);
  }
}

void print_log(const char* name, const ContactCalibration& calibration, const LabelledLog& fit_log,
               const std::vector<BalanceSample>& fit_samples, const LabelledLog& log,
               const std::vector<BalanceSample>& samples) {
  const auto begin = std::chrono::steady_clock::now();
  const std::vector<ContactEvent> events = detect_contacts(calibration, samples);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const ContactScore score = score_contacts(log.labels, detections_of(events));
  std::printf("%s: %.1f us a sample\n", name, 1e6 * seconds / static_cast<double>(samples.size()));
  print_score("this room", score);
  std::printf(", link right %d, end %.1f ms\n", score.link_right, 1e3 * score.median_end_error_s);
  print_events(log, events, score);
  print_observers(fit_log, fit_samples, log, samples, calibration.options);
  const FalseAlarmCheck check = check_false_alarms(calibration, samples, spans_of(log.labels));
  std::printf(
      "  false alarms: declared %.1f /h, observed %d in %.1f s (95 %% up to %.0f /h), by the tail "
      "%.2g /h\n",
      check.declared_per_hour, check.alarms, 3600.0 * check.hours, check.upper_per_hour,
      check.extrapolated_per_hour);
}

}  // namespace

void contact_on_ur6() {
  const auto folder = shared_data("synthetic_dynamics/ur6_contact");
  if (!folder) {
    std::printf("ur6_contact: not on this machine\n");
    return;
  }
  const LabelledLog train = read_log(*folder, "log.csv.gz", "labels.csv");
  const LabelledLog test = read_log(*folder, "log_test.csv.gz", "labels_test.csv");
  const DynamicModel model = read_dynamic_urdf(*folder / "nominal.urdf");
  const RigidBalance balance(make_rigid_model(model), friction_of(model));
  const std::vector<BalanceSample> train_samples = balance_samples(balance, train.samples);
  const std::vector<BalanceSample> test_samples = balance_samples(balance, test.samples);
  const ContactCalibration calibration = calibrate_contacts(train_samples);
  std::printf(
      "ur6_contact: calibrated in %d rounds on %.1f s free of %zu spans taken for contacts\n",
      calibration.iterations, calibration.exposure_s, calibration.excluded.size());
  for (Eigen::Index j = 0; j < kJoints; ++j) {
    std::printf("  joint %ld: velocity %.2g, torque %.2g, model %.2g over %.2g s\n", long{j} + 1,
                calibration.noise.velocity_sigma[j], calibration.noise.torque_sigma[j],
                calibration.noise.model_sigma[j], calibration.noise.model_time_s[j]);
  }
  std::printf("  thresholds");
  for (const double t : calibration.thresholds) std::printf(" %.1f", t);
  std::printf("\n  tail: peaks %d, level %.2f, shape %.2f, scale %.3f\n",
              calibration.joint_tail.peaks, calibration.joint_tail.level,
              calibration.joint_tail.shape, calibration.joint_tail.scale);
  print_log("log_test", calibration, train, train_samples, test, test_samples);
  print_log("log", calibration, train, train_samples, train, train_samples);
}

}  // namespace kinescope
