// SPDX-License-Identifier: Apache-2.0
//
// The step of a search, and when it is smaller or enough; internal.
#pragma once

#include "dynamics/policy/improve.h"

namespace kinescope::policy {

/// One step of Adam (Kingma and Ba 2015, algorithm 1) with the search's step size.
void adam_step(const Eigen::VectorXd& gradient, SearchState& search);

/// The gradient shortened to `limit` times the running average of its length, which it enters.
void limit_gradient(double limit, Eigen::VectorXd& gradient, SearchState& search);

/// Enters a cost into the averages of its change; where there was no progress for long, halves the
/// step size, lowers the dropout and starts the averages anew (Amadio et al., T-RO 2022). True: no
/// progress at the smallest step size.
[[nodiscard]] bool note_cost(double cost, const ImproveOptions& options, SearchState& search);

}  // namespace kinescope::policy
