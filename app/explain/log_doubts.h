// SPDX-License-Identifier: Apache-2.0
//
// What is odd about a joint log beside the markers, in words, before anything is fitted: the fit
// puts what contradicts it aside and would not say why.
#pragma once

#include <string>
#include <vector>

#include "app/explain/pipeline.h"
#include "kinematics/log/joint_log.h"

namespace kinescope {

/// A clock that jumps while the joints do not; one sentence a jump.
[[nodiscard]] std::vector<std::string> clock_jump_words(const JointLog& log);

/// The log repeats one row for longer than two seconds while a marker moves. The clocks may differ
/// by up to half a second: that much at either end is not looked at.
[[nodiscard]] std::vector<std::string> frozen_log_words(const JointLog& log,
                                                        const Observed& observed);

}  // namespace kinescope
