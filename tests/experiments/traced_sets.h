// SPDX-License-Identifier: Apache-2.0
//
// Torque logs that are traced, measured ones of others and simulated ones with known truth, read
// where they lie.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynamics/effects/trace_torque.h"

namespace kinescope {

struct TracedSet {
  std::string name;
  std::string reference;  ///< what a first look found, or the truth
  DynamicModel model = {};
  TorqueSamples samples = {};
  TorqueTraceOptions options = {};
};

[[nodiscard]] std::vector<std::string> traced_set_names();

/// Nothing where the set is not on this machine. Throws as its readers do.
[[nodiscard]] std::optional<TracedSet> traced_set(const std::string& name);

}  // namespace kinescope
