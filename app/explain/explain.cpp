// SPDX-License-Identifier: Apache-2.0
#include "app/explain/explain.h"

#include <algorithm>
#include <functional>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "app/explain/compare_explanations.h"
#include "app/explain/explainer.h"
#include "app/explain/hypothesis_fit.h"
#include "app/explain/recording_pieces.h"
#include "calib/bundle/postures.h"
#include "calib/quality/lost_markers.h"
#include "calib/quality/odd_readings.h"
#include "calib/quality/partly_followed.h"
#include "calib/tracks/even_stamps.h"
#include "kinematics/core/mean_step.h"
#include "kinematics/log/exchanged_readings.h"
#include "kinematics/log/readings_apart.h"

namespace kinescope {
namespace {

// Evidence that owns what it changed.
struct ChangedEvidence {
  Recording recording;
  Observed observed;
  PoseTracks tracks;
};

// Without the sightings of which this is true, by marker and frame.
ChangedEvidence without_sightings(const Evidence& evidence, JointLog log,
                                  const std::function<bool(TagId, int)>& is_aside) {
  ChangedEvidence out{evidence.recording, evidence.observed, evidence.tracks};
  out.recording.log = std::move(log);
  Measurements& measured = out.observed.measurements;
  const auto is_seen_aside = [&](const auto& seen) { return is_aside(seen.id, seen.frame); };
  std::erase_if(measured.corners, is_seen_aside);
  std::erase_if(measured.points.observations, is_seen_aside);
  for (PoseTracks* tracks : {&measured.poses, &out.tracks}) {
    for (PoseTrack& track : tracks->tracks) {
      std::erase_if(track.samples,
                    [&](const PoseSample& sample) { return is_aside(track.id, sample.frame); });
    }
  }
  return out;
}

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
  const Evidence rest{changed.recording, changed.observed, changed.tracks, evidence.camera};
  std::vector<std::string> said;
  std::vector<std::string> said_with_them;
  Explanation without_them;
  try {
    without_them = explained(rest, options, said);
  } catch (const Error& error) {
    without_them.failure = error;
  }
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
  Recording mended = evidence.recording;
  mended.log = with_exchanged_back(log, exchanged);
  std::vector<std::string> said;
  Explanation back =
      with_odd_readings_apart({mended, evidence.observed, evidence.tracks, evidence.camera},
                              readings_apart(mended.log), options, said);
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

// A channel that is a joint's for a part of the recording.
Explanation with_parts_followed(Explanation now, const Evidence& evidence,
                                const ExplainOptions& options, std::vector<std::string>& warnings) {
  if (!now.fitted || !now.structure) return now;
  const Calibration& calibration = now.fitted->calibration;
  const std::vector<PartlyFollowed> followed =
      partly_followed(calibration, now.log, now.structure->idle_channels);
  std::vector<std::string> words;
  for (const PartlyFollowed& joint : followed)
    words.push_back(words_of(joint, calibration, now.log));
  if (const std::optional<JointLog> mended = with_readings_mended(now.log, followed)) {
    Recording other = evidence.recording;
    other.log = *mended;
    ExplainOptions alike = options;
    alike.calibrate.fold_of_frame = folds_of(calibration);
    std::vector<std::string> said;
    Explanation with =
        explained({other, evidence.observed, evidence.tracks, evidence.camera}, alike, said);
    if (is_better(with, now, evidence.observed.measurements)) {
      warnings.insert(warnings.end(), said.begin(), said.end());
      for (std::string& line : words) line += "; taken so";
      now = std::move(with);
    }
  }
  warnings.insert(warnings.end(), words.begin(), words.end());
  return now;
}

// Without what was seen while the log was wrong. It may have begun, and ended, within a frame's
// step.
ChangedEvidence without(const Evidence& evidence, const JointLog& log, double time_offset_s,
                        const std::vector<OddStretch>& stretches) {
  const std::vector<double>& times_s = evidence.observed.measurements.times_s;
  constexpr double kReach = 1.5;  // steps: one frame more
  const double step_s = median_step_s(times_s);
  return without_sightings(evidence, log, [&](TagId, int frame) {
    const double at_s = times_s[static_cast<std::size_t>(frame)] + time_offset_s;
    return std::ranges::any_of(stretches, [&](const OddStretch& stretch) {
      return at_s > stretch.from_s - kReach * step_s && at_s < stretch.to_s + kReach * step_s;
    });
  });
}

void add_unsaid(std::vector<std::string> said, std::vector<std::string>& warnings) {
  for (std::string& line : said)
    if (std::ranges::find(warnings, line) == warnings.end()) warnings.push_back(std::move(line));
}

// Readings that froze, came late or twice are no error of the robot.
Explanation with_stretches_apart(Explanation now, const Evidence& evidence,
                                 const ExplainOptions& options,
                                 std::vector<std::string>& warnings) {
  if (!now.fitted || now.log.empty()) return now;
  const Calibration& calibration = now.fitted->calibration;
  if (shows_postures(calibration.tree, now.log, calibration.times_s)) return now;
  const std::vector<OddStretch> stretches =
      odd_stretches(calibration, now.log, odd_readings(calibration, evidence.tracks, now.log));
  for (std::string& line : lines_of(stretches, now.log)) warnings.push_back(std::move(line));
  if (stretches.empty()) return now;
  const ChangedEvidence changed = without(evidence, now.log, calibration.time_offset_s, stretches);
  ExplainOptions alike = options;
  alike.calibrate.fold_of_frame = folds_of(calibration);
  std::vector<std::string> said;
  Explanation other = explained(
      {changed.recording, changed.observed, changed.tracks, evidence.camera}, alike, said);
  // What only the markers say may be an error of the robot that no effect explains.
  const bool is_of_log = std::ranges::all_of(stretches, &OddStretch::is_told_by_log);
  if (!(is_of_log && is_settled(other)) && !is_better(other, now, evidence.observed.measurements))
    return now;
  add_unsaid(std::move(said), warnings);
  return other;
}

// Markers that moved with no joint all the time may have done so for a half of it. Those that came
// off, by the robot that shows without their other half.
std::vector<LostMarker> lost_of_free_markers(const Explanation& now, const Evidence& evidence,
                                             const ExplainOptions& options) {
  const std::vector<TagId>& free = now.structure->free_markers;
  if (free.empty() || now.structure->idle_channels.empty()) return {};
  const std::vector<double>& times_s = evidence.observed.measurements.times_s;
  const double middle_s = 0.5 * (times_s.front() + times_s.back());
  for (const bool first : {true, false}) {
    const ChangedEvidence half = without_sightings(evidence, now.log, [&](TagId id, int frame) {
      const double at_s = times_s[static_cast<std::size_t>(frame)];
      return std::ranges::find(free, id) != free.end() && (at_s < middle_s) != first;
    });
    std::vector<std::string> said;
    const Explanation other =
        explained({half.recording, half.observed, half.tracks, evidence.camera}, options, said);
    if (!is_settled(other) || !other.structure ||
        other.structure->free_markers.size() >= free.size())
      continue;
    // The same robot beside all that was seen.
    const std::optional<Explanation> whole = HypothesisFit(evidence, options).carried_over(other);
    if (!whole || !whole->fitted) continue;
    std::vector<LostMarker> lost = lost_markers(whole->fitted->calibration);
    if (!lost.empty()) return lost;
  }
  return {};
}

// Markers that came off are no error of the robot.
Explanation with_lost_markers_apart(Explanation now, const Evidence& evidence,
                                    const ExplainOptions& options,
                                    std::vector<std::string>& warnings) {
  if (!now.fitted || !now.structure || evidence.recording.nominal) return now;
  const Calibration& calibration = now.fitted->calibration;
  if (now.log.empty() || shows_postures(calibration.tree, now.log, calibration.times_s) ||
      !evidence.observed.measurements.camera_of_frame.empty())
    return now;
  ExplainOptions alike = options;
  alike.calibrate.fold_of_frame = folds_of(calibration);
  std::vector<LostMarker> lost = lost_markers(calibration);
  if (lost.empty()) lost = lost_of_free_markers(now, evidence, alike);
  if (lost.empty()) return now;
  const std::vector<double>& times_s = evidence.observed.measurements.times_s;
  const ChangedEvidence changed = without_sightings(evidence, now.log, [&](TagId id, int frame) {
    const double at_s = times_s[static_cast<std::size_t>(frame)];
    return std::ranges::any_of(
        lost, [&](const LostMarker& marker) { return marker.id == id && marker.is_lost_at(at_s); });
  });
  std::vector<std::string> said;
  Explanation other = explained(
      {changed.recording, changed.observed, changed.tracks, evidence.camera}, alike, said);
  if (!is_settled(other) && !is_better(other, now, evidence.observed.measurements)) return now;
  add_unsaid(std::move(said), warnings);
  for (const LostMarker& marker : lost) warnings.push_back(words_of(marker));
  return other;
}

ChangedEvidence stamped_evenly(const Evidence& evidence, const std::vector<double>& times_s) {
  ChangedEvidence out{evidence.recording, evidence.observed, evidence.tracks};
  Measurements& measured = out.observed.measurements;
  for (std::vector<double>* stamps :
       {&measured.times_s, &measured.poses.times_s, &measured.points.times_s,
        &out.observed.tags.times_s, &out.tracks.times_s}) {
    if (stamps->size() == times_s.size()) *stamps = times_s;
  }
  return out;
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
  ChangedEvidence out = stamped_evenly(evidence, even->times_s);
  const Explanation as_stamped = HypothesisFit(evidence, options).plainly_explained();
  ExplainOptions alike = options;
  if (as_stamped.fitted) alike.calibrate.fold_of_frame = folds_of(as_stamped.fitted->calibration);
  const Explanation evenly =
      HypothesisFit({out.recording, out.observed, out.tracks, evidence.camera}, alike)
          .plainly_explained();
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
  Explanation out = with_exchanged_back(evidence, options, warnings);
  for (const auto& improve : {with_parts_followed, with_stretches_apart, with_lost_markers_apart})
    out = improve(std::move(out), evidence, options, warnings);
  return out;
}

}  // namespace

Explanation explain(const Evidence& evidence, const ExplainOptions& options,
                    std::vector<std::string>& warnings) {
  const std::optional<ChangedEvidence> even = with_even_stamps(evidence, options, warnings);
  if (!even) return explained_as_stamped(evidence, options, warnings);
  return explained_as_stamped({even->recording, even->observed, even->tracks, evidence.camera},
                              options, warnings);
}

}  // namespace kinescope
