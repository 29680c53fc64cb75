// SPDX-License-Identifier: Apache-2.0
//
// A mechanism's motion as a drawing: postures one over the other, and on a screen one more that
// moves, without a script.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "app/report/plot.h"
#include "dynamics/policy/systems/problem.h"

namespace kinescope::report {

/// A dot that follows a path in the plot and begins again, one point a step.
[[nodiscard]] std::string moving_dot(const Plot& plot, const std::vector<Eigen::Vector2d>& path,
                                     double seconds);

/// `states`: (steps + 1) x 2 P. Empty where the skeleton is.
[[nodiscard]] std::string motion_picture(std::string_view name, const policy::Skeleton& skeleton,
                                         const Eigen::MatrixXd& states, double step_s);

}  // namespace kinescope::report
