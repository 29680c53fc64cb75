// SPDX-License-Identifier: Apache-2.0
#include "app/report/recordings_json.h"

#include <algorithm>
#include <cmath>

#include "app/report/result_values.h"

namespace kinescope {
namespace {

using nlohmann::json;
using report::expanded;
using report::number;
using report::text;

json or_null(const std::optional<double>& value) { return value ? number(*value) : json(nullptr); }

json anew_json(const MarkerAnew& anew) {
  return {{"tag", anew.id.value},
          {"named", anew.renamed.value},
          {"shift_m", or_null(anew.shift_m)},
          {"shift_expanded_m", expanded(anew.shift_sigma_m)},
          {"turn_rad", or_null(anew.turn_rad)},
          {"turn_expanded_rad", expanded(anew.turn_sigma_rad)}};
}

json recording_json(const RecordingSummary& recording) {
  json anew = json::array();
  for (const MarkerAnew& marker : recording.anew) anew.push_back(anew_json(marker));
  return {{"name", text(recording.name)},
          {"time_offset_s", number(recording.time_offset_s)},
          {"time_offset_expanded_s", expanded(recording.time_offset_sigma_s)},
          {"sightings_used", recording.used},
          {"held_out_rms", number(recording.held_out_rms)},
          {"by_others_rms", or_null(recording.by_others_rms)},
          {"markers_anew", std::move(anew)}};
}

}  // namespace

std::optional<RecordingScatter> recording_scatter(const RunSummary& run) {
  double count = 0.0;
  double within = 0.0;
  double unseen = 0.0;
  for (const RecordingSummary& recording : run.recordings) {
    if (!recording.by_others_rms) continue;
    count += recording.used;
    within += recording.used * std::pow(recording.held_out_rms, 2);
    unseen += recording.used * std::pow(*recording.by_others_rms, 2);
  }
  if (!(count > 0.0)) return std::nullopt;
  return RecordingScatter{std::sqrt(within / count), std::sqrt(unseen / count),
                          std::sqrt(std::max(0.0, unseen - within) / count)};
}

json recordings_json(const RunSummary& run) {
  json each = json::array();
  for (const RecordingSummary& recording : run.recordings)
    each.push_back(recording_json(recording));
  json out{{"each", std::move(each)},
           {"rms_unit", run.calibration.kind == MeasurementKind::kCorners ? "px" : "m"},
           {"scatter", nullptr}};
  if (const auto scatter = recording_scatter(run))
    out["scatter"] = {{"within_rms", number(scatter->within_rms)},
                      {"unseen_rms", number(scatter->unseen_rms)},
                      {"between_rms", number(scatter->between_rms)}};
  return out;
}

}  // namespace kinescope
