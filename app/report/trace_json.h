// SPDX-License-Identifier: Apache-2.0
//
// trace.json: what closing the loop found. Keys: `verdict` (effects, ambiguous, unknown, clean,
// nothing_to_say), `reason`, `accepted` (effect, place, size, unit, interval, explained, ..),
// `held_out_before`, `held_out_after` (value, interval, unit), `ambiguous`, `unexplained`,
// `candidates` (every one tested, by round), `not_found` (with the smallest size that would have
// been seen), `steps`. What is left and depends on a place in the image has a `field` (at, mean,
// sigma: pairs) in place of a curve.
#pragma once

#include <nlohmann/json.hpp>

#include "calib/trace/trace_result.h"

namespace kinescope {

[[nodiscard]] nlohmann::json trace_json(const Trace& trace);

}  // namespace kinescope
