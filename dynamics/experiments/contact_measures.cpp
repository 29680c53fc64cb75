// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/contact_measures.h"

#include <algorithm>
#include <span>
#include <utility>

namespace kinescope::experiments {
namespace {

constexpr std::size_t kGroups = 10;
constexpr std::size_t kFewestOfAGroup = 10;  // a share in steps of a tenth

using Trials = std::vector<const ContactTrial*>;

Trials trials_of(const ContactDetection& contacts, std::size_t kind) {
  Trials out;
  for (const ContactRun& run : contacts.runs) {
    if (run.kind != kind) continue;
    for (const ContactTrial& trial : run.trials) out.push_back(&trial);
  }
  return out;
}

const ContactOutcome& outcome(const ContactTrial& trial, std::optional<std::size_t> observer) {
  return observer ? trial.observers[*observer] : trial.detector;
}

DetectionMeasure measure(std::span<const ContactTrial* const> trials,
                         std::optional<std::size_t> observer) {
  DetectionMeasure out{.delay_s = {kNotMeasured, kNotMeasured, kNotMeasured}};
  std::vector<double> delays;
  for (const ContactTrial* trial : trials) {
    const ContactOutcome& one = outcome(*trial, observer);
    if (!one.found) continue;
    delays.push_back(one.delay_s);
    out.link_right += one.link_right ? 1 : 0;
  }
  out.found = static_cast<int>(delays.size());
  if (!delays.empty()) out.delay_s = quartiles(std::move(delays));
  return out;
}

}  // namespace

std::vector<TorqueGroup> groups_by_torque(const ContactDetection& contacts, std::size_t kind) {
  Trials trials = trials_of(contacts, kind);
  std::ranges::stable_sort(trials, {}, &ContactTrial::torque_nm);
  const std::size_t count = std::clamp<std::size_t>(trials.size() / kFewestOfAGroup, 1, kGroups);
  std::vector<TorqueGroup> out;
  for (std::size_t g = 0; g < count; ++g) {
    const std::size_t begin = g * trials.size() / count;
    const std::size_t end = (g + 1) * trials.size() / count;
    const std::span<const ContactTrial* const> group(trials.data() + begin, end - begin);
    if (group.empty()) continue;
    std::vector<double> torques;
    for (const ContactTrial* trial : group) torques.push_back(trial->torque_nm);
    out.push_back({.kind = kind,
                   .torque_nm = quartiles(std::move(torques)),
                   .contacts = static_cast<int>(group.size()),
                   .detector = measure(group, {}),
                   .observer = measure(group, contacts.chosen[kind])});
  }
  return out;
}

KindMeasure measure_kind(const ContactDetection& contacts, std::size_t kind,
                         std::optional<std::size_t> observer) {
  const Trials trials = trials_of(contacts, kind);
  KindMeasure out{.contacts = static_cast<int>(trials.size()), .found = measure(trials, observer)};
  for (const ContactRun& run : contacts.runs) {
    if (run.kind != kind) continue;
    out.hours += run.hours;
    out.invented += observer ? run.observers_invented[*observer] : run.detector_invented;
  }
  return out;
}

PairedDelay paired_delay(const ContactDetection& contacts, std::size_t kind) {
  std::vector<double> ours, theirs;
  for (const ContactTrial* trial : trials_of(contacts, kind)) {
    const ContactOutcome& observer = trial->observers[contacts.chosen[kind]];
    if (!trial->detector.found || !observer.found) continue;
    ours.push_back(trial->detector.delay_s);
    theirs.push_back(observer.delay_s);
  }
  const int count = static_cast<int>(ours.size());
  if (count == 0) return {.contacts = 0, .detector_s = kNotMeasured, .observer_s = kNotMeasured};
  return {.contacts = count,
          .detector_s = quartiles(std::move(ours)).median,
          .observer_s = quartiles(std::move(theirs)).median};
}

std::size_t best_observer(const ContactDetection& contacts, std::size_t kind) {
  std::size_t best = 0;
  std::pair<int, double> best_score{-1, 0.0};
  for (std::size_t o = 0; o < contacts.observers.size(); ++o) {
    const DetectionMeasure found = measure_kind(contacts, kind, o).found;
    const std::pair<int, double> score{found.found, found.found > 0 ? -found.delay_s.median : 0.0};
    if (score <= best_score) continue;
    best = o;
    best_score = score;
  }
  return best;
}

}  // namespace kinescope::experiments
