// SPDX-License-Identifier: Apache-2.0
//
// Contacts of a simulated arm: found, how soon, at which link, and false alarms; the momentum
// observer beside.
#include "dynamics/contact/contact.h"

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "app/experiments/experiments.h"
#include "app/report/experiment_plots.h"
#include "dynamics/experiments/contact_measures.h"

namespace kinescope::experiments {
namespace {

using report::Curve;
using Figure = ExperimentSection::Figure;

constexpr const char* kDetector = "detector";
constexpr const char* kObserver = "momentum observer";

std::string titled(const ContactKind& kind) {
  return fmt::format("{} contacts", kind.shape == ContactShape::kHalfSine ? "Hard" : "Soft");
}

double milliseconds(double seconds) { return 1e3 * seconds; }
double percent(int part, int of) { return 100.0 * part / of; }

std::string observer_name(const ObserverSetting& setting) {
  return fmt::format(
      "{}, {:g} /s, {}", kObserver, setting.gain_per_s,
      setting.test == ObserverTest::kAllJoints ? "all joints" : "a threshold a joint");
}

std::vector<TorqueGroup> all_groups(const ContactDetection& contacts) {
  std::vector<TorqueGroup> out;
  for (std::size_t kind = 0; kind < contacts.kinds.size(); ++kind) {
    for (const TorqueGroup& group : groups_by_torque(contacts, kind)) out.push_back(group);
  }
  return out;
}

std::string name_of(const ContactDetection& contacts, std::size_t kind) {
  return std::string(contacts.kinds[kind].name);
}

ExperimentTable detection_table(const ContactDetection& contacts,
                                const std::vector<TorqueGroup>& groups) {
  ExperimentTable out{
      "detection",
      "Contacts in groups of ascending torque (peak of the norm of the external joint torque): "
      "found, and after how long (median of those found)",
      {"Contact"},
      {"torque (N m)", "contacts", "found (%)", "found by the observer (%)", "delay (ms)",
       "delay of the observer (ms)", "link right of those found (%)"},
      {}};
  for (const TorqueGroup& group : groups) {
    out.rows.push_back(
        {{name_of(contacts, group.kind)},
         {group.torque_nm.median, static_cast<double>(group.contacts),
          percent(group.detector.found, group.contacts),
          percent(group.observer.found, group.contacts),
          milliseconds(group.detector.delay_s.median), milliseconds(group.observer.delay_s.median),
          percent(group.detector.link_right, group.detector.found)}});
  }
  return out;
}

ExperimentTable::Row detector_row(const ContactDetection& contacts, std::size_t kind,
                                  std::optional<std::size_t> observer) {
  const KindMeasure measure = measure_kind(contacts, kind, observer);
  const AlarmRate rate = alarm_rate(measure.invented, measure.hours);
  std::string name = observer ? observer_name(contacts.observers[*observer]) : kDetector;
  if (observer == contacts.chosen[kind]) name += " (chosen)";
  return {{name_of(contacts, kind), std::move(name)},
          {static_cast<double>(measure.contacts), percent(measure.found.found, measure.contacts),
           milliseconds(measure.found.delay_s.median), static_cast<double>(measure.invented),
           rate.per_hour, rate.lower_per_hour, rate.upper_per_hour}};
}

ExperimentTable detectors_table(const ContactDetection& contacts) {
  ExperimentTable out{"detectors",
                      "All contacts of a kind, with 95 % interval of the rate of invented contacts",
                      {"Contact", "Detector"},
                      {"contacts", "found (%)", "delay (ms)", "invented", "an hour", "from", "to"},
                      {}};
  for (std::size_t kind = 0; kind < contacts.kinds.size(); ++kind) {
    out.rows.push_back(detector_row(contacts, kind, {}));
    for (std::size_t o = 0; o < contacts.observers.size(); ++o) {
      out.rows.push_back(detector_row(contacts, kind, o));
    }
  }
  return out;
}

ExperimentTable runs_table(const ContactDetection& contacts) {
  ExperimentTable out{"runs",
                      "Each log, by the detector and by the observer that was chosen",
                      {"Contact"},
                      {"run", "force (N)", "contacts", "found", "found by the observer",
                       "link right", "invented an hour", "by the observer an hour"},
                      {}};
  for (const ContactRun& run : contacts.runs) {
    const std::size_t chosen = contacts.chosen[run.kind];
    int found = 0;
    int theirs = 0;
    int link_right = 0;
    for (const ContactTrial& trial : run.trials) {
      found += trial.detector.found ? 1 : 0;
      theirs += trial.observers[chosen].found ? 1 : 0;
      link_right += trial.detector.link_right ? 1 : 0;
    }
    out.rows.push_back(
        {{name_of(contacts, run.kind)},
         {static_cast<double>(run.run), run.force_n, static_cast<double>(run.trials.size()),
          static_cast<double>(found), static_cast<double>(theirs), static_cast<double>(link_right),
          run.detector_invented / run.hours, run.observers_invented[chosen] / run.hours}});
  }
  return out;
}

ExperimentTable contacts_table(const ContactDetection& contacts) {
  ExperimentTable out{"contacts",
                      "Each contact; 1: yes, 0: no",
                      {"Contact", "Link"},
                      {"run", "force (N)", "begin (s)", "torque (N m)", "found", "delay (ms)",
                       "link right", "found by the observer", "delay of the observer (ms)"},
                      {}};
  for (const ContactRun& run : contacts.runs) {
    for (const ContactTrial& trial : run.trials) {
      const ContactOutcome& observer = trial.observers[contacts.chosen[run.kind]];
      out.rows.push_back(
          {{name_of(contacts, run.kind), fmt::format("link{}", trial.link + 1)},
           {static_cast<double>(run.run), run.force_n, trial.begin_s, trial.torque_nm,
            trial.detector.found ? 1.0 : 0.0, milliseconds(trial.detector.delay_s),
            trial.detector.link_right ? 1.0 : 0.0, observer.found ? 1.0 : 0.0,
            milliseconds(observer.delay_s)}});
    }
  }
  return out;
}

void add_alarms(ExperimentTable& table, const FalseAlarmPoint& point, std::string who, int alarms) {
  const AlarmRate rate = alarm_rate(alarms, point.hours);
  table.rows.push_back({{std::move(who)},
                        {point.declared_per_hour, point.hours, static_cast<double>(alarms),
                         rate.per_hour, rate.lower_per_hour, rate.upper_per_hour}});
}

ExperimentTable false_alarms_table(const ContactDetection& contacts) {
  ExperimentTable out{"false_alarms",
                      "Alarms in motion without contact, with 95 % interval of their rate",
                      {"Detector"},
                      {"declared an hour", "hours", "alarms", "an hour", "from", "to"},
                      {}};
  for (const FalseAlarmPoint& point : contacts.free) {
    add_alarms(out, point, kDetector, point.detector);
    for (std::size_t o = 0; o < point.observers.size(); ++o) {
      add_alarms(out, point, observer_name(contacts.observers[contacts.free_observers[o]]),
                 point.observers[o]);
    }
  }
  return out;
}

Curve share_curve(const std::vector<TorqueGroup>& groups, std::size_t kind,
                  DetectionMeasure TorqueGroup::* by, std::string name) {
  Curve out{.name = std::move(name), .points = {}, .lower = {}, .upper = {}};
  for (const TorqueGroup& group : groups) {
    if (group.kind != kind) continue;
    out.points.emplace_back(group.torque_nm.median, percent((group.*by).found, group.contacts));
  }
  return out;
}

// Where one was found.
Curve delay_curve(const std::vector<TorqueGroup>& groups, std::size_t kind,
                  DetectionMeasure TorqueGroup::* by, std::string name) {
  Curve out{.name = std::move(name), .points = {}, .lower = {}, .upper = {}};
  for (const TorqueGroup& group : groups) {
    const DetectionMeasure& measure = group.*by;
    if (group.kind != kind || measure.found == 0) continue;
    out.points.emplace_back(group.torque_nm.median, milliseconds(measure.delay_s.median));
    out.lower.push_back(milliseconds(measure.delay_s.lower));
    out.upper.push_back(milliseconds(measure.delay_s.upper));
  }
  return out;
}

ExperimentSection kind_section(const ContactKind& own, const std::vector<TorqueGroup>& groups,
                               std::size_t kind) {
  const report::CurveAxis torque{.label = "external joint torque, N m", .log10 = true};
  const char* shape = own.shape == ContactShape::kHalfSine ? "half-sines" : "trapezoids";
  ExperimentSection out{
      std::string(own.name),
      titled(own),
      {fmt::format("Forces of {:g} to {:g} N in random directions, {} of {:g} ms, on the links in "
                   "turn.",
                   own.forces_n.front(), own.forces_n.back(), shape, milliseconds(own.contact_s))},
      {},
      {}};
  out.figures.push_back(
      {report::curve_plot(fmt::format("Share found of {} contacts", own.name), torque,
                          {.label = "found, %"},
                          {share_curve(groups, kind, &TorqueGroup::detector, kDetector),
                           share_curve(groups, kind, &TorqueGroup::observer, kObserver)}),
       "Share of the contacts that was found, in groups of ascending torque"});
  out.figures.push_back(
      {report::curve_plot(fmt::format("Delay of {} contacts", own.name), torque,
                          {.label = "delay, ms", .log10 = true},
                          {delay_curve(groups, kind, &TorqueGroup::detector, kDetector),
                           delay_curve(groups, kind, &TorqueGroup::observer, kObserver)}),
       "Delay of those found: median and quartiles. Where an observer finds few, these are its "
       "easiest"});
  return out;
}

// A rate of zero has no place on this axis.
Curve alarm_curve(const ContactDetection& contacts, std::string name,
                  const std::function<int(const FalseAlarmPoint&)>& alarms) {
  Curve out{.name = std::move(name), .points = {}, .lower = {}, .upper = {}};
  for (const FalseAlarmPoint& point : contacts.free) {
    const AlarmRate rate = alarm_rate(alarms(point), point.hours);
    if (!(rate.lower_per_hour > 0.0)) continue;
    out.points.emplace_back(point.declared_per_hour, rate.per_hour);
    out.lower.push_back(rate.lower_per_hour);
    out.upper.push_back(rate.upper_per_hour);
  }
  return out;
}

ExperimentSection alarms_section(const ContactDetection& contacts) {
  Curve declared{.name = "declared", .points = {}, .lower = {}, .upper = {}};
  for (const FalseAlarmPoint& point : contacts.free) {
    declared.points.emplace_back(point.declared_per_hour, point.declared_per_hour);
  }
  std::vector<Curve> curves{
      alarm_curve(contacts, kDetector, [](const FalseAlarmPoint& p) { return p.detector; })};
  for (std::size_t o = 0; o < contacts.free_observers.size(); ++o) {
    curves.push_back(alarm_curve(contacts,
                                 observer_name(contacts.observers[contacts.free_observers[o]]),
                                 [o](const FalseAlarmPoint& p) { return p.observers[o]; }));
  }
  curves.push_back(std::move(declared));
  return {
      "alarms",
      "False alarms",
      {"Motion without contact that no detector has learned from. Every detector takes its "
       "threshold from the tail of its own statistic, in the same motion."},
      {"false_alarms"},
      {{report::curve_plot("False alarms over the declared rate",
                           {.label = "declared, an hour", .log10 = true},
                           {.label = "observed, an hour", .log10 = true}, curves),
        "Observed rate and its 95 % interval; a rate without any alarm is in the table alone"}}};
}

std::string kind_finding(const ContactDetection& contacts, std::size_t kind) {
  const std::size_t chosen = contacts.chosen[kind];
  const KindMeasure detector = measure_kind(contacts, kind, {});
  const KindMeasure observer = measure_kind(contacts, kind, chosen);
  const PairedDelay both = paired_delay(contacts, kind);
  std::string out = fmt::format(
      "{}: {} of {} found, {} of them at the right link, {} invented in {:.2f} h; {} at "
      "its best: {} found, {} invented.",
      titled(contacts.kinds[kind]), detector.found.found, detector.contacts,
      detector.found.link_right, detector.invented, detector.hours,
      observer_name(contacts.observers[chosen]), observer.found.found, observer.invented);
  if (both.contacts == 0) return out;
  return out + fmt::format(" Median delay of the {} that both found: {:.1f} ms, {:.1f} ms.",
                           both.contacts, milliseconds(both.detector_s),
                           milliseconds(both.observer_s));
}

std::string alarms_finding(const ContactDetection& contacts) {
  std::string out;
  for (const FalseAlarmPoint& point : contacts.free) {
    const AlarmRate rate = alarm_rate(point.detector, point.hours);
    out += fmt::format("{}{:g} an hour declared: {:.3g} ({:.3g} to {:.3g})",
                       out.empty() ? "" : "; ", point.declared_per_hour, rate.per_hour,
                       rate.lower_per_hour, rate.upper_per_hour);
  }
  return fmt::format("False alarms in {:.2f} h without contact: {}.", contacts.free.front().hours,
                     out);
}

}  // namespace
}  // namespace kinescope::experiments

namespace kinescope {

ExperimentSummary contact_experiment(const ExperimentChoice& choice, const Progress& progress) {
  using namespace experiments;
  ContactDetectionOptions options{.noise = choice.noise, .seed = choice.seed};
  options.runs = choice.runs.value_or(options.runs);
  options.seconds = choice.seconds.value_or(options.seconds);
  options.samples = choice.samples.value_or(options.samples);
  const ContactDetection contacts = run_contact_detection(options, choice.threads, progress);
  const std::vector<TorqueGroup> groups = all_groups(contacts);
  ExperimentSummary out;
  out.settings = {
      {"Seed", fmt::format("{}", options.seed)},
      {"Logs", fmt::format("{} a force, {:g} s each", options.runs, options.seconds)},
      {"Learned from", fmt::format("{:g} s without contact, {:g} Hz",
                                   options.samples / kContactRate_hz, kContactRate_hz)},
      {"Noise of the torques", options.noise
                                   ? fmt::format("{:g} of their spread", *options.noise)
                                   : fmt::format("{:g} N m at joint 1, 0.6 of it at each next one",
                                                 ContactWorldOptions{}.torque_sigma_nm)},
      {"Declared false alarms", fmt::format("{:g} an hour", options.declared_per_hour)}};
  for (std::size_t kind = 0; kind < contacts.kinds.size(); ++kind) {
    out.findings.push_back(kind_finding(contacts, kind));
    out.sections.push_back(kind_section(contacts.kinds[kind], groups, kind));
  }
  out.findings.push_back(alarms_finding(contacts));
  out.sections.push_back(alarms_section(contacts));
  out.sections.push_back(
      {"detectors",
       "Tables",
       {fmt::format("A {}-joint arm whose masses, geometry and friction the detectors know. "
                    "Observers of several gains (De Luca and Mattone 2005; Haddadin, De Luca, "
                    "Albu-Schaeffer 2017), with thresholds for the same declared rate; for each "
                    "kind of contact the one that found most, the fastest of these, was chosen on "
                    "these very contacts, which is in its favour.",
                    kContactJoints)},
       {"detection", "detectors"},
       {}});
  out.tables = {detection_table(contacts, groups), detectors_table(contacts), runs_table(contacts),
                contacts_table(contacts), false_alarms_table(contacts)};
  return out;
}

}  // namespace kinescope
