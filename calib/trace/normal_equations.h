// SPDX-License-Identifier: Apache-2.0
//
// Normal equations of the model's own parameters with an effect's beside them, by group of rows,
// and their solution when a group is left out.
#pragma once

#include <vector>

#include "calib/trace/normal_system.h"

namespace kinescope::trace {

struct NormalEquations {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  NormalEquations& operator+=(const NormalEquations& other);
};

/// Of [J, E] for every group; `effect` empty: of J.
[[nodiscard]] std::vector<NormalEquations> augmented(const std::vector<GroupSums>& own,
                                                     const std::vector<EffectSums>& effect);

/// Over all groups, with the priors.
[[nodiscard]] NormalEquations total_of(const NormalSystem& system,
                                       const std::vector<NormalEquations>& groups);

/// The step of all parameters that the rest of the rows ask for.
[[nodiscard]] Eigen::VectorXd solve_without(const NormalEquations& total,
                                            const NormalEquations& part);

}  // namespace kinescope::trace
