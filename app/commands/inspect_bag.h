// SPDX-License-Identifier: Apache-2.0
//
// Takes   a bag.
// Gives   its topics as `inspect` prints them, and which kind of log it is.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "kinematics/bags/bag_contents.h"

namespace kinescope {

/// True where it shows markers or images; false: joint states alone, for `dynamics`. Throws
/// bad_input where it holds neither, with its topics.
[[nodiscard]] bool shows_robot(const bags::Contents& contents);

/// "topic /joint_states ..", one line each.
void print_topics(const bags::Contents& contents);
[[nodiscard]] nlohmann::json topics_json(const bags::Contents& contents);

}  // namespace kinescope
