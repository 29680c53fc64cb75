// SPDX-License-Identifier: Apache-2.0
//
// The robust regressions of a torque log and what the robot carries.
#pragma once

#include <optional>
#include <string>

#include "app/report/torque_summary.h"
#include "app/torque/torque_options.h"

namespace kinescope {

/// Three regressions beside each other, judged on the summary's test samples; the best of the
/// robust ones in friction, gravity and inertia parts. What cannot be done is a warning.
void add_robust_regressions(const DynamicModel& model, const TorqueModelOptions& options,
                            TorqueSummary& summary);

/// A payload is asked for.
[[nodiscard]] bool asks_for_payload(const DynamicsOptions& options);

/// Throws where no log of this unit could answer: before any work.
void require_payload_question(const DynamicsOptions& options, const DynamicModel& model,
                              const std::string& torque_unit);

/// By all of the log's motion, beside the one without load where it is named: quick. Gives that
/// log. Throws what estimate_payload() throws.
std::optional<TorqueSamples> add_payload(const DynamicsOptions& options, const DynamicModel& model,
                                         TorqueSummary& summary);

/// The same load at rest, from the learned torque: slow. What cannot be done is a warning.
void add_payload_at_rest(const DynamicsOptions& options, const DynamicModel& model,
                         const std::optional<TorqueSamples>& unloaded, TorqueSummary& summary);

}  // namespace kinescope
