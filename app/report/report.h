// SPDX-License-Identifier: Apache-2.0
//
// Takes   a RunSummary.
// Gives   result.json and one self-contained report.html (inline SVG and CSS; complete with scripts
// off; the
//         script adds the 3-D view). Pure functions: the same summary gives the same bytes.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/run_summary.h"

namespace kinescope {

/// What the report opens with, and the program prints at the end.
struct Verdict {
  std::string found;  ///< "4 joints (R R P R), every one matched to a channel, probability > 0.999"
  std::string
      accurate;  ///< "markers predicted to 0.07 px held out; axes to 0.02 deg, 0.05 mm (k = 2)"
  std::string limits;  ///< what limits it
  std::string next;    ///< what to record next
};

[[nodiscard]] Verdict make_verdict(const RunSummary& run);

/// result.json: every number that the report shows, but the times of the stages, which stand in
/// run.json: the same recording gives the same bytes. SI units (rad, m, s, px), named in the key. A
/// number that is not known is null, never NaN. `expanded` is an expanded uncertainty,
/// coverage_factor (2) standard ones. Keys may be added under the same schema_version; a changed
/// meaning raises it.
///
///   schema, schema_version, coverage_factor
///   run            robot, recording, entry, kind (corners, poses, points), version,
///                  inputs [name, sha256], options [name, value]
///   verdict        answer (false: exit code 4), no_answer (what cannot be told; else null), found,
///                  accurate, limits, next: the sentences that the report opens with
///   data           frames, duration_s, independent_frames (residuals are alike over time),
///   image_coverage
///                  (share of an 8 x 6 grid; corners only), camera_declared,
///                  markers [id, link, size_m, frames_seen, share_seen, median_edge_px,
///                  median_sigma_px], rejected [reason, count], channels [name, samples, min, max,
///                  filmed_min, filmed_max (of the samples while frames were taken), joint, idle],
///                  second_columns [column, of, joint, unit, offset, rms, rms_left, effects, words]
///                  (of a channel that drives a joint, its command say: how it differs), warnings
///   structure      null for a nominal robot; else status (determined, ambiguous, undetermined),
///   probability, runner_up,
///                  runner_up_log_odds, links [name, markers], free_markers, idle_channels,
///                  copied_channels [channel, of], doubts [what, remedy, names],
///                  joints [type, parent, child, driven_by {channel, scale, scale_sigma},
///                  couplings, offset, travel, rotation_rms_rad, translation_rms_m,
///                  unexplained, unexplained_across (shares of its link's squared motion),
///                  log_odds, runner_up]
///   nominal_levels [words, effects, status, held_out_{px, m, rad}, log_odds, exported]: a nominal
///                  robot with more and more of it free, over the same sightings; empty without
///   calibration    status, reason, gauge, time_offset_s (joint-log time = frame time + offset) and
///                  time_offset_expanded_s, sightings_used, sightings_rejected, sigma_scale (noise
///                  found over declared), before_rms, training_rms, held_out_rms, final_rms (one
///                  coordinate: px for corners, m else), held_out_over_training, the same as
///                  *_rotation_rms_rad for poses, folds, correlation_time_s, iterations,
///                  initial_cost, final_cost, warnings, joints [name, type, parent, child, channel,
///                  unit, scale, scale_expanded, offset, offset_expanded, origin (pose), axis_base,
///                  point_base_m, direction_expanded_rad, position_expanded_m,
///                  among_direction_expanded_rad, among_position_expanded_m, range, travel,
///                  change_against_nominal {shift_m, turn_rad, offset}], markers [id, link, size_m,
///                  mount (pose), rotation_expanded_rad, translation_expanded_m, used, rejected],
///                  camera {pose_in_base, rotation_expanded_rad, translation_expanded_m,
///                  intrinsics {model, width, height, estimated, values [name, unit, value,
///                  expanded]}}, parameters [name, block, unit, value, sigma, sigma_white,
///                  expanded] (a pose: translation_m, quaternion_wxyz, rpy_rad as in URDF)
///   tip            null, or where the last link is: marker, link, joints (that move it),
///                  translation_expanded_m, rotation_expanded_rad in the base's frame, rms over the
///                  recorded postures, worst_translation_expanded_m of them; the first two as
///                  among_* with the base placed anew
///   errors         all, links [], markers []: name and {before, training, held_out}_{px, m, rad},
///   each
///                  count, rms, median, p95, max of the error's length (count 0: nothing else)
///   residuals      unit, components, component_rms, outside_two_sigma (share),
///                  dependence [on, share, half_range, half_range_unit, frames]
///   observability  condition_number, singular_values, weak [relative_singular_value, words,
///                  parameters [parameter, weight]], strong_correlations [a, b, correlation]
[[nodiscard]] nlohmann::json result_json(const RunSummary& run);

/// The page. `urdf` is shown in it where it is not empty. About 0.8 MB, most of it the viewer; the
/// 3-D view's data are thinned to 600 frames and 400 000 residual numbers, each plot to 2500 dots.
[[nodiscard]] std::string report_html(const RunSummary& run, std::string_view urdf);

}  // namespace kinescope
