// SPDX-License-Identifier: Apache-2.0
#include "app/explain/contradictions.h"

#include <algorithm>
#include <utility>

#include "app/explain/compare_explanations.h"
#include "app/explain/explainer.h"
#include "app/explain/hypothesis_fit.h"
#include "calib/bundle/postures.h"
#include "calib/quality/lost_markers.h"
#include "calib/quality/odd_readings.h"
#include "calib/quality/partly_followed.h"
#include "kinematics/core/mean_step.h"

namespace kinescope {
namespace {

bool shows_film(const Explanation& now) {
  const Calibration& calibration = now.fitted->calibration;
  return !now.log.empty() && !shows_postures(calibration.tree, now.log, calibration.times_s);
}

bool is_in_any(const std::vector<OddStretch>& stretches, double at_s, double reach_s) {
  return std::ranges::any_of(stretches, [&](const OddStretch& stretch) {
    return at_s > stretch.from_s - reach_s && at_s < stretch.to_s + reach_s;
  });
}

// Over long ones the joints are then not known, over short ones the log is interpolated.
JointLog without_rows(const JointLog& log, const std::vector<OddStretch>& stretches,
                      double reach_s) {
  std::vector<Eigen::Index> kept;
  for (std::size_t row = 0; row < log.size(); ++row)
    if (!is_in_any(stretches, log.times_s[row], reach_s))
      kept.push_back(static_cast<Eigen::Index>(row));
  JointLog out = log;
  out.values = log.values(kept, Eigen::all);
  out.times_s.clear();
  for (const Eigen::Index row : kept)
    out.times_s.push_back(log.times_s[static_cast<std::size_t>(row)]);
  return out;
}

// Without what was seen and read while the log was wrong. It may have begun, and ended, within a
// frame's step.
ChangedEvidence without_stretches(const Evidence& evidence, const JointLog& log,
                                  double time_offset_s, const std::vector<OddStretch>& stretches) {
  const std::vector<double>& times_s = evidence.observed.measurements.times_s;
  constexpr double kReach = 1.5;  // steps: one frame more; chosen
  const double reach_s = kReach * median_step_s(times_s);
  return without_sightings(evidence, without_rows(log, stretches, reach_s), [&](TagId, int frame) {
    return is_in_any(stretches, times_s[static_cast<std::size_t>(frame)] + time_offset_s, reach_s);
  });
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
    const Explanation other = explained_part(half.view(), options, said);
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

bool may_have_lost_markers(const Explanation& now, const Evidence& evidence) {
  return now.fitted && now.structure && !evidence.recording.nominal && shows_film(now) &&
         evidence.observed.measurements.camera_of_frame.empty();
}

std::optional<Contradiction> without_lost(const std::vector<LostMarker>& lost,
                                          const Explanation& now, const Evidence& evidence) {
  if (lost.empty()) return {};
  Contradiction out;
  out.is_no_error_of_robot = true;
  for (const LostMarker& marker : lost) out.words_if_taken.push_back(words_of(marker));
  const std::vector<double>& times_s = evidence.observed.measurements.times_s;
  out.without_it = without_sightings(evidence, now.log, [&](TagId id, int frame) {
    const double at_s = times_s[static_cast<std::size_t>(frame)];
    return std::ranges::any_of(
        lost, [&](const LostMarker& marker) { return marker.id == id && marker.is_lost_at(at_s); });
  });
  return out;
}

}  // namespace

std::optional<Contradiction> joints_followed_in_parts(const Explanation& now,
                                                      const Evidence& evidence,
                                                      const ExplainOptions&) {
  if (!now.fitted || !now.structure) return {};
  const Calibration& calibration = now.fitted->calibration;
  const std::vector<PartlyFollowed> followed =
      partly_followed(calibration, now.log, now.structure->idle_channels);
  if (followed.empty()) return {};
  Contradiction out;
  for (const PartlyFollowed& joint : followed) {
    out.words_if_kept.push_back(words_of(joint, calibration, now.log));
    out.words_if_taken.push_back(out.words_if_kept.back() + "; taken so");
  }
  if (std::optional<JointLog> mended = with_readings_mended(now.log, followed))
    out.without_it = with_log(evidence, std::move(*mended));
  return out;
}

std::optional<Contradiction> stretches_of_a_wrong_log(const Explanation& now,
                                                      const Evidence& evidence,
                                                      const ExplainOptions&) {
  if (!now.fitted || !shows_film(now)) return {};
  const Calibration& calibration = now.fitted->calibration;
  const std::vector<OddStretch> stretches =
      odd_stretches(calibration, now.log, odd_readings(calibration, evidence.tracks, now.log));
  if (stretches.empty()) return {};
  Contradiction out;
  out.words_if_taken = out.words_if_kept = lines_of(stretches, now.log);
  out.is_no_error_of_robot = std::ranges::all_of(stretches, &OddStretch::is_told_by_log);
  out.without_it = without_stretches(evidence, now.log, calibration.time_offset_s, stretches);
  // Where most of the log is wrong, the robot is.
  if (2 * out.without_it->recording.log.size() < now.log.size()) out.without_it.reset();
  return out;
}

std::optional<Contradiction> markers_that_came_off(const Explanation& now, const Evidence& evidence,
                                                   const ExplainOptions&) {
  if (!may_have_lost_markers(now, evidence)) return {};
  return without_lost(lost_markers(now.fitted->calibration), now, evidence);
}

std::optional<Contradiction> free_markers_that_came_off(const Explanation& now,
                                                        const Evidence& evidence,
                                                        const ExplainOptions& options) {
  if (!may_have_lost_markers(now, evidence)) return {};
  return without_lost(lost_of_free_markers(now, evidence, options), now, evidence);
}

}  // namespace kinescope
