// SPDX-License-Identifier: Apache-2.0
//
// What recording.yaml declares against what the markers show.
#pragma once

#include <map>
#include <string>

#include "app/io/recording.h"
#include "kinematics/structure/structure.h"

namespace kinescope {

/// No gear is so wrong: a turning joint that moves by this share more or less than its unit says is
/// in another one.
inline constexpr double kHingeTolerance = 0.25;

/// True when the joint's channel is declared in rad, deg, m or mm, as suits the joint: its readings
/// are rad or m, and what the joint does beyond them is an effect.
[[nodiscard]] bool is_declared_in_si(const Recording& recording, const Joint& joint);

/// The units of the channels for the search, which weighs them.
[[nodiscard]] std::map<std::string, ChannelUnit> declared_units(const Recording& recording);

/// Throws undetermined when a channel that is declared in rad, deg, m or mm moves a joint of that
/// kind clearly (four standard deviations, and 5 % of a slide, 25 % of a turn) more or less far
/// than it says. A turning channel that slides a joint, or the other way round, has a scale of its
/// own; where that is 1, the declaration is refused as one of the wrong kind.
void require_declared_units(const Recording& recording, const Structure& structure);

/// Throws undetermined when one of the `fixed_tags` moves, and bad_input when one is not seen
/// (often enough).
void require_fixed_tags(const Recording& recording, const Structure& structure);
/// The same with the markers placed on a nominal robot.
void require_fixed_tags(const Recording& recording, const KinematicTree& tree);

}  // namespace kinescope
