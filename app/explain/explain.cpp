// SPDX-License-Identifier: Apache-2.0
#include "app/explain/explain.h"

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "app/explain/changed_evidence.h"
#include "app/explain/compare_explanations.h"
#include "app/explain/contradictions.h"
#include "app/explain/explainer.h"
#include "app/explain/hypothesis_fit.h"
#include "app/explain/recording_pieces.h"
#include "calib/quality/odd_readings.h"
#include "calib/tracks/even_stamps.h"
#include "kinematics/log/exchanged_readings.h"
#include "kinematics/log/readings_apart.h"

namespace kinescope {
namespace {

// Without these readings. What was measured at the very instant of one has no reading then.
ChangedEvidence without(const Evidence& evidence, const std::vector<ReadingApart>& apart) {
  const JointLog& log = evidence.recording.log;
  const std::vector<double>& times_s = evidence.observed.measurements.times_s;
  std::set<double> stamps;
  for (const ReadingApart& reading : apart) stamps.insert(log.times_s[reading.row]);
  return without_sightings(evidence, without_readings(log, apart), [&](TagId, int frame) {
    return stamps.contains(times_s[static_cast<std::size_t>(frame)]);
  });
}

std::string words_of(const std::vector<ReadingApart>& readings, const Explanation& of,
                     const Evidence& evidence) {
  const JointLog& log = evidence.recording.log;
  std::string out = words_of(log, readings) + ": put aside";
  if (readings.size() > 1 || !of.fitted) return out;
  const double time_s = log.times_s[readings.front().row];
  const std::string& channel = log.channels[static_cast<std::size_t>(readings.front().channel)];
  const std::vector<double>& times_s = evidence.observed.measurements.times_s;
  const auto frame = std::ranges::find(times_s, time_s);
  if (frame == times_s.end()) return out;
  const auto shown = reading_shown(of.fitted->calibration, evidence.tracks,
                                   static_cast<int>(frame - times_s.begin()), channel);
  return shown ? fmt::format("{}; the markers say {:.6g}", out, *shown) : out;
}

// Without the readings that nothing leads to, unless the markers speak for them.
Explanation with_odd_readings_apart(const Evidence& evidence,
                                    const std::vector<ReadingApart>& apart,
                                    const ExplainOptions& options,
                                    std::vector<std::string>& warnings) {
  if (apart.empty()) return explained(evidence, options, warnings);
  const ChangedEvidence changed = without(evidence, apart);
  std::vector<std::string> said;
  std::vector<std::string> said_with_them;
  Explanation without_them = explained_part(changed.view(), options, said);
  // What needed no sighting to be given up has nothing against it.
  const bool cost_nothing =
      sightings_in(changed.observed.measurements) == sightings_in(evidence.observed.measurements);
  if (!cost_nothing || !is_settled(without_them)) {
    ExplainOptions alike = options;
    if (without_them.fitted)
      alike.calibrate.fold_of_frame = folds_of(without_them.fitted->calibration);
    const auto is_right = [&](const Explanation& with_them) {
      return !is_better(without_them, with_them, evidence.observed.measurements);
    };
    // A robot that the readings contradict is not looked for with them.
    const std::optional<Explanation> same_robot =
        HypothesisFit(evidence, alike).carried_over(without_them);
    if (!same_robot || is_right(*same_robot)) {
      Explanation with_them = explained(evidence, alike, said_with_them);
      if (is_right(with_them)) {
        warnings.insert(warnings.end(), said_with_them.begin(), said_with_them.end());
        return with_them;
      }
    }
  }
  warnings.insert(warnings.end(), said.begin(), said.end());
  for (const std::vector<ReadingApart>& readings : told_together(apart))
    warnings.push_back(words_of(readings, without_them, evidence));
  return without_them;
}

// With columns back in their places, unless the markers speak for the log as it is.
Explanation with_exchanged_back(const Evidence& evidence, const ExplainOptions& options,
                                std::vector<std::string>& warnings) {
  const JointLog& log = evidence.recording.log;
  const std::vector<ReadingApart> apart = readings_apart(log);
  const std::vector<ExchangedReadings> exchanged = exchanged_readings(log, apart);
  if (exchanged.empty()) return with_odd_readings_apart(evidence, apart, options, warnings);
  const ChangedEvidence mended = with_log(evidence, with_exchanged_back(log, exchanged));
  std::vector<std::string> said;
  Explanation back =
      with_odd_readings_apart(mended.view(), readings_apart(mended.recording.log), options, said);
  if (!is_settled(back)) {
    ExplainOptions alike = options;
    if (back.fitted) alike.calibrate.fold_of_frame = folds_of(back.fitted->calibration);
    std::vector<std::string> said_as_logged;
    Explanation as_logged = with_odd_readings_apart(evidence, apart, alike, said_as_logged);
    if (!is_better(back, as_logged, evidence.observed.measurements)) {
      warnings.insert(warnings.end(), said_as_logged.begin(), said_as_logged.end());
      return as_logged;
    }
  }
  warnings.insert(warnings.end(), said.begin(), said.end());
  for (const ExchangedReadings& one : exchanged)
    warnings.push_back(words_of(log, one) + "; taken so");
  return back;
}

void add_unsaid(std::vector<std::string> said, std::vector<std::string>& warnings) {
  for (std::string& line : said)
    if (std::ranges::find(warnings, line) == warnings.end()) warnings.push_back(std::move(line));
}

// Evidence that an explanation contradicts is left out where the rest of it speaks for that, until
// nothing more is.
Explanation with_contradictions_apart(Explanation now, const Evidence& evidence,
                                      const ExplainOptions& options,
                                      std::vector<std::string>& warnings) {
  // Which readings are wrong, the markers tell: those that came off are asked for before. What
  // takes long is asked at last.
  static constexpr std::array kFinders{&joints_followed_in_parts, &markers_that_came_off,
                                       &stretches_of_a_wrong_log, &free_markers_that_came_off};
  std::optional<ChangedEvidence> changed;
  std::array<std::vector<std::string>, kFinders.size()> kept;  // what each said last
  ExplainOptions alike = options;
  std::size_t asked_since_change = 0;
  for (std::size_t i = 0; asked_since_change < kFinders.size(); i = (i + 1) % kFinders.size()) {
    ++asked_since_change;
    kept[i].clear();
    if (now.fitted) alike.calibrate.fold_of_frame = folds_of(now.fitted->calibration);
    const Evidence in_force = changed ? changed->view() : evidence;
    std::optional<Contradiction> found = kFinders[i](now, in_force, alike);
    if (!found) continue;
    kept[i] = std::move(found->words_if_kept);
    if (!found->without_it) continue;
    std::vector<std::string> said;
    Explanation other = explained_part(found->without_it->view(), alike, said);
    const bool is_enough = found->is_no_error_of_robot && is_settled(other);
    if (!is_enough && !is_better(other, now, evidence.observed.measurements)) continue;
    now = std::move(other);
    changed = std::move(found->without_it);
    add_unsaid(std::move(said), warnings);
    add_unsaid(std::move(found->words_if_taken), warnings);
    kept[i].clear();
    asked_since_change = 0;
  }
  for (std::vector<std::string>& words : kept) add_unsaid(std::move(words), warnings);
  return now;
}

// Frames of a camera that runs evenly, stamped as they arrived, where the markers' motion says so.
std::optional<ChangedEvidence> with_even_stamps(const Evidence& evidence,
                                                const ExplainOptions& options,
                                                std::vector<std::string>& warnings) {
  const Measurements& measured = evidence.observed.measurements;
  const JointLog& log = evidence.recording.log;
  if (!measured.camera_of_frame.empty() || evidence.recording.nominal || log.empty() ||
      is_of_postures(log, measured.times_s))
    return std::nullopt;
  const std::optional<EvenStamps> even = even_stamps(measured.times_s);
  if (!even) return std::nullopt;
  ChangedEvidence out = with_stamps(evidence, even->times_s);
  const Explanation as_stamped = HypothesisFit(evidence, options).plainly_explained();
  ExplainOptions alike = options;
  if (as_stamped.fitted) alike.calibrate.fold_of_frame = folds_of(as_stamped.fitted->calibration);
  const Explanation evenly = HypothesisFit(out.view(), alike).plainly_explained();
  if (!evenly.fitted || !is_better(evenly, as_stamped, measured)) return std::nullopt;
  warnings.push_back(fmt::format(
      "the frames' stamps scatter by {:.3g} ms (standard deviation) about a camera that "
      "runs at {:.5g} Hz, and the markers move as if they did not: taken as even; use "
      "stamps of the camera's own clock",
      1e3 * even->scatter_s, even->rate_hz));
  return out;
}

Explanation explained_as_stamped(const Evidence& evidence, const ExplainOptions& options,
                                 std::vector<std::string>& warnings) {
  return with_contradictions_apart(with_exchanged_back(evidence, options, warnings), evidence,
                                   options, warnings);
}

}  // namespace

Explanation explain(const Evidence& evidence, const ExplainOptions& options,
                    std::vector<std::string>& warnings) {
  const std::optional<ChangedEvidence> even = with_even_stamps(evidence, options, warnings);
  if (!even) return explained_as_stamped(evidence, options, warnings);
  return explained_as_stamped(even->view(), options, warnings);
}

}  // namespace kinescope
