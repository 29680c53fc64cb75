// SPDX-License-Identifier: Apache-2.0
//
// The same search from many seeds, a folder each: how often it succeeds by trial.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "app/report/experiment.h"

namespace kinescope {

/// Interval of a probability of which `successes` of `count` were seen, 95 % (Wilson 1927).
struct ShareInterval {
  double lower = 0.0;
  double upper = 1.0;
};
[[nodiscard]] ShareInterval share_interval(int successes, int count);

/// "seed_7".
[[nodiscard]] std::string seed_folder_name(std::uint64_t seed);

/// All searches in the folders seed_N of `folder`, whichever machine ran them. `request`: what each
/// must have asked for, but for its seed; throws bad_input where one did not.
[[nodiscard]] ExperimentSummary policy_seeds_summary(const std::filesystem::path& folder,
                                                     const nlohmann::json& request,
                                                     const std::string& system);

}  // namespace kinescope
