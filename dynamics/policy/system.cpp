// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/system.h"

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope::policy {

void check_layout(const StateLayout& layout) {
  if (layout.positions.empty() || layout.inputs.empty()) {
    throw bad_request("system", "it has no position or no input", "name one of each at least");
  }
  if (layout.is_angle.size() != layout.positions.size()) {
    throw bad_request("system",
                      fmt::format("{} of {} positions say whether they are angles",
                                  layout.is_angle.size(), layout.positions.size()),
                      "say it of each");
  }
  if (layout.input_limit.size() != layout.input_count() ||
      !(layout.input_limit.array() > 0.0).all() || !layout.input_limit.allFinite()) {
    throw bad_request("system", "an input has no limit above zero", "give one limit an input");
  }
  if (!(layout.step_s > 0.0) || layout.step_s > 10.0) {
    throw bad_request("system", fmt::format("a step of {} s", layout.step_s),
                      "give one above 0 and up to 10 s");
  }
}

}  // namespace kinescope::policy
