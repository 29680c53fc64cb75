// SPDX-License-Identifier: Apache-2.0
//
// Commands beside measured values, by their names.
#pragma once

#include <string>

namespace kinescope {

/// True for the name of a channel or topic that holds what was asked for, not what was measured:
/// with command, cmd, desired, target, goal, setpoint or reference in it, in any case.
[[nodiscard]] bool is_commanded(std::string name);

}  // namespace kinescope
