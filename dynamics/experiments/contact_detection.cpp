// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/contact_detection.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <set>
#include <string>
#include <utility>

#include "dynamics/contact/contact.h"
#include "dynamics/experiments/contact_measures.h"
#include "kinematics/core/parallel_for.h"

namespace kinescope::experiments {
namespace {

constexpr double kSecondsPerHour = 3600.0;

std::vector<ObserverSetting> observer_settings() {
  std::vector<ObserverSetting> out;
  for (const ObserverTest test : {ObserverTest::kLargestJoint, ObserverTest::kAllJoints}) {
    for (const double gain : {5.0, 9.0, 15.0, 25.0, 40.0, 60.0, 90.0, 140.0})
      out.push_back({gain, test});
  }
  return out;
}

struct Arm {
  DynamicModel model;
  ContactWorldOptions world;  // noise
};

std::vector<BalanceSample> balance_of(const Arm& arm, const ContactWorld& world) {
  return balance_samples(RigidBalance(make_rigid_model(arm.model), friction_of(arm.model)),
                         world.samples);
}

ContactWorld world_of(const Arm& arm, ContactWorldOptions options, const std::string& name,
                      std::uint64_t seed) {
  options.rate_hz = kContactRate_hz;
  options.torque_sigmas_nm = arm.world.torque_sigmas_nm;
  Rng rng = Rng::from_name("contact " + name, seed);
  return contact_world(arm.model, options, rng);
}

ContactWorldOptions learned_from(const ContactDetectionOptions& options) {
  return {.duration_s = options.samples / kContactRate_hz};
}

Arm arm_of(const ContactDetectionOptions& options) {
  Arm out{.model = contact_arm(kContactJoints), .world = {}};
  if (!options.noise) return out;
  out.world.torque_sigmas_nm = Eigen::VectorXd::Zero(kContactJoints);
  const Eigen::MatrixXd torque =
      world_of(out, learned_from(options), "free", options.seed).samples.torque;
  const Eigen::RowVectorXd mean = torque.colwise().mean();
  out.world.torque_sigmas_nm = *options.noise *
                               (torque.rowwise() - mean).colwise().norm().transpose() /
                               std::sqrt(static_cast<double>(torque.rows()));
  return out;
}

struct Detectors {
  ContactCalibration detector;
  std::vector<ObserverCalibration> observers;
};

Detectors learn(const std::vector<BalanceSample>& free, double per_hour,
                const std::vector<ObserverSetting>& settings) {
  Detectors out{.detector = calibrate_contacts(
                    free, {.false_alarms_per_hour = per_hour, .may_contain_contacts = false}),
                .observers = {}};
  for (const ObserverSetting& setting : settings) {
    out.observers.push_back(
        calibrate_observer(free, {}, setting.gain_per_s, per_hour, setting.test));
  }
  return out;
}

ContactOutcome outcome_of(const LabelOutcome& label) {
  const bool found = label.detection >= 0;
  return {.found = found,
          .delay_s = found ? label.delay_s : std::numeric_limits<double>::quiet_NaN(),
          .link_right = found && label.link_right};
}

void judge(const Detectors& detectors, const std::vector<BalanceSample>& samples,
           const std::vector<ContactLabel>& labels, ContactRun& out) {
  const ContactScore score =
      score_contacts(labels, detections_of(detect_contacts(detectors.detector, samples)));
  out.detector_invented = score.invented;
  for (std::size_t k = 0; k < labels.size(); ++k) {
    out.trials[k].detector = outcome_of(score.labels[k]);
  }
  for (const ObserverCalibration& observer : detectors.observers) {
    const ContactScore theirs =
        score_contacts(labels, detections_of(observer_alarms(observer, samples)));
    out.observers_invented.push_back(theirs.invented);
    for (std::size_t k = 0; k < labels.size(); ++k) {
      out.trials[k].observers.push_back(outcome_of(theirs.labels[k]));
    }
  }
}

double peak_torque(const ContactWorld& world, const ContactLabel& label) {
  double peak = 0.0;
  for (Eigen::Index k = 0; k < world.external.rows(); ++k) {
    const double t = world.samples.t_s[k];
    if (t < label.begin_s || t > label.end_s) continue;
    peak = std::max(peak, world.external.row(k).norm());
  }
  return peak;
}

ContactRun run_of(const Arm& arm, const Detectors& detectors, std::size_t kind, double force_n,
                  int run, const ContactDetectionOptions& options) {
  const ContactKind& own = options.kinds[kind];
  const std::string name =
      std::string(own.name) + " " + std::to_string(force_n) + " " + std::to_string(run);
  const ContactWorld world = world_of(arm,
                                      {.duration_s = options.seconds,
                                       .contacts = static_cast<int>(options.seconds),
                                       .contact_s = own.contact_s,
                                       .force_n = force_n,
                                       .shape = own.shape},
                                      name, options.seed);
  ContactRun out{.kind = kind,
                 .force_n = force_n,
                 .run = run,
                 .hours = options.seconds / kSecondsPerHour,
                 .observers_invented = {},
                 .trials = {}};
  for (const ContactLabel& label : world.labels) {
    out.trials.push_back({.link = label.link,
                          .begin_s = label.begin_s,
                          .torque_nm = peak_torque(world, label),
                          .detector = {},
                          .observers = {}});
  }
  judge(detectors, balance_of(arm, world), world.labels, out);
  return out;
}

// Alarms of each rate's detectors in one free log, by rate.
std::vector<FalseAlarmPoint> alarms_in(const std::vector<Detectors>& by_rate,
                                       const std::vector<BalanceSample>& samples) {
  std::vector<FalseAlarmPoint> out;
  for (const Detectors& detectors : by_rate) {
    FalseAlarmPoint point;
    point.detector = static_cast<int>(detect_contacts(detectors.detector, samples).size());
    for (const ObserverCalibration& observer : detectors.observers) {
      point.observers.push_back(static_cast<int>(observer_alarms(observer, samples).size()));
    }
    out.push_back(std::move(point));
  }
  return out;
}

class Runner {
 public:
  Runner(const ContactDetectionOptions& options, int threads, const Progress& progress)
      : options_(options), threads_(threads), progress_(progress), arm_(arm_of(options)) {
    free_ = balance_of(arm_, world_of(arm_, learned_from(options), "free", options.seed));
    total_ = options.free_logs;
    for (const ContactKind& kind : options.kinds) total_ += static_cast<int>(kind.forces_n.size());
  }

  ContactDetection run() {
    ContactDetection out;
    out.kinds = options_.kinds;
    out.observers = observer_settings();
    const Detectors detectors = learn(free_, options_.declared_per_hour, out.observers);
    for (std::size_t kind = 0; kind < options_.kinds.size(); ++kind) {
      for (const double force_n : options_.kinds[kind].forces_n) {
        add_runs(detectors, kind, force_n, out.runs);
      }
    }
    for (std::size_t kind = 0; kind < options_.kinds.size(); ++kind) {
      out.chosen.push_back(best_observer(out, kind));
    }
    const std::set<std::size_t> each(out.chosen.begin(), out.chosen.end());
    out.free_observers.assign(each.begin(), each.end());
    out.free = free_motion(out);
    return out;
  }

 private:
  void done() { report_progress(progress_, "contacts", ++done_, total_); }

  void add_runs(const Detectors& detectors, std::size_t kind, double force_n,
                std::vector<ContactRun>& out) {
    std::vector<ContactRun> runs(static_cast<std::size_t>(options_.runs));
    parallel_for(
        runs.size(),
        [&](std::size_t k) {
          runs[k] = run_of(arm_, detectors, kind, force_n, static_cast<int>(k), options_);
        },
        threads_);
    std::ranges::move(runs, std::back_inserter(out));
    done();
  }

  std::vector<FalseAlarmPoint> free_motion(const ContactDetection& contacts) {
    std::vector<ObserverSetting> settings;
    for (const std::size_t k : contacts.free_observers) settings.push_back(contacts.observers[k]);
    const std::vector<double>& rates = options_.rates_per_hour;
    std::vector<Detectors> by_rate(rates.size());
    parallel_for(
        rates.size(), [&](std::size_t k) { by_rate[k] = learn(free_, rates[k], settings); },
        threads_);
    std::vector<FalseAlarmPoint> out;
    const int logs = options_.free_logs * options_.runs;
    for (const double rate : rates) {
      out.push_back({.declared_per_hour = rate,
                     .hours = logs * options_.seconds / kSecondsPerHour,
                     .observers = std::vector<int>(settings.size(), 0)});
    }
    for (int block = 0; block < options_.free_logs; ++block) add_free(by_rate, block, out);
    return out;
  }

  void add_free(const std::vector<Detectors>& by_rate, int block,
                std::vector<FalseAlarmPoint>& out) {
    std::vector<std::vector<FalseAlarmPoint>> logs(static_cast<std::size_t>(options_.runs));
    parallel_for(
        logs.size(),
        [&](std::size_t k) {
          const std::string name = "unseen " + std::to_string(block) + " " + std::to_string(k);
          logs[k] =
              alarms_in(by_rate, balance_of(arm_, world_of(arm_, {.duration_s = options_.seconds},
                                                           name, options_.seed)));
        },
        threads_);
    for (const std::vector<FalseAlarmPoint>& log : logs) {
      for (std::size_t r = 0; r < out.size(); ++r) {
        out[r].detector += log[r].detector;
        for (std::size_t o = 0; o < out[r].observers.size(); ++o) {
          out[r].observers[o] += log[r].observers[o];
        }
      }
    }
    done();
  }

  const ContactDetectionOptions& options_;
  int threads_;
  const Progress& progress_;
  Arm arm_;
  std::vector<BalanceSample> free_;
  int done_ = 0;
  int total_ = 0;
};

}  // namespace

std::vector<ContactKind> usual_contact_kinds() {
  return {{.name = "soft",
           .shape = ContactShape::kTrapezoid,
           .contact_s = 0.2,
           .forces_n = {1.25, 2.5, 5.0, 10.0, 20.0}},
          {.name = "hard",
           .shape = ContactShape::kHalfSine,
           .contact_s = 0.03,
           .forces_n = {6.25, 12.5, 25.0, 50.0, 100.0}}};
}

ContactDetection run_contact_detection(const ContactDetectionOptions& options, int threads,
                                       const Progress& progress) {
  return Runner(options, threads, progress).run();
}

}  // namespace kinescope::experiments
