// SPDX-License-Identifier: Apache-2.0
//
// Sections of the page of a policy search.
#pragma once

#include <string>

#include "app/report/policy_report.h"

namespace kinescope::report {

[[nodiscard]] const policy::StateLayout& layout_of(const PolicySummary& summary);
[[nodiscard]] double trial_seconds(const PolicySummary& summary, const policy::Trial& trial);
/// Some position has a tolerance.
[[nodiscard]] bool judges(const PolicySummary& summary);
/// What was paid is within two standard deviations of what one rollout may come to.
[[nodiscard]] bool as_promised(const policy::TrialRecord& record);

[[nodiscard]] std::string policy_trial_id(std::size_t number);
/// Particles beside the system, and the inputs.
[[nodiscard]] std::string policy_trial_section(const PolicySummary& summary, std::size_t number);
/// Empty where the system has no drawing.
[[nodiscard]] std::string policy_motion_section(const PolicySummary& summary);

}  // namespace kinescope::report
