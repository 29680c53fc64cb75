// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calib/bundle/problem.h"

namespace kinescope::bundle {

/// Gathers what is measured, held and free. Markers of the tree that were never seen stay, held.
/// Throws undetermined when nothing measured belongs to the tree.
[[nodiscard]] Spec make_spec(const Measurements& measurements, const MarkerSet& markers,
                             const JointLog& log, const CalibrationStart& start,
                             const CalibrateOptions& options);

/// Whatever one reading says: the joint moves by less than shows anything of its axis that the
/// prior of its frame leaves open (1 mrad, 0.1 mm). What it does in one posture alone nothing can
/// check.
[[nodiscard]] bool stands_still(const Spec& spec, std::size_t joint);

/// Puts every target where its points (of the sightings given) are on average. Needs marker mounts.
void guess_targets(const Spec& spec, const std::vector<int>& sightings, State& state);

[[nodiscard]] int count_frames(const Spec& spec, const std::vector<int>& sightings);

/// The marker that holds the base frame where it can be held: the first that was seen on the base.
[[nodiscard]] std::optional<std::size_t> first_seen_base_marker(const Spec& spec);

/// In words: what is held so that the answer is unique.
[[nodiscard]] std::string gauge_in_words(const Spec& spec);

}  // namespace kinescope::bundle
