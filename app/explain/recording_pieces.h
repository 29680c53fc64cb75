// SPDX-License-Identifier: Apache-2.0
//
// Takes   what single recordings of one robot show.
// Gives   which of them may be pieces of one, and these as one; what a recording holds.
// Not here: whether they are (see_recordings.h).
#pragma once

#include <set>
#include <utility>
#include <vector>

#include "app/explain/see_cameras.h"

namespace kinescope {

/// Markers, bodies or points that were seen.
[[nodiscard]] std::set<TagId> ids_of(const LoneCamera& of);

/// In everything that was seen, and what is declared of it.
void rename_marker(TagId from, TagId to, LoneCamera& of);

/// First and last stamp, frames and log, s.
[[nodiscard]] std::pair<double, double> span_of(const LoneCamera& of);

/// Measured at rest: is_posture_log() of all channels, where it is not known which drive a joint.
[[nodiscard]] bool is_of_postures(const JointLog& log, const std::vector<double>& times_s);
[[nodiscard]] bool is_of_postures(const LoneCamera& of);

/// Throws bad_request where some are of postures and some of motion.
void require_one_kind(const std::vector<LoneCamera>& alone);

/// Both on one clock, the second behind the first, by cameras declared alike.
[[nodiscard]] bool may_go_on(const LoneCamera& first, const LoneCamera& second);

/// The two as one recording, as if it had never been cut.
[[nodiscard]] LoneCamera pieces_together(const LoneCamera& first, const LoneCamera& second);

}  // namespace kinescope
