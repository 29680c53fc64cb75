// SPDX-License-Identifier: Apache-2.0
//
// From a Spec and a State to the best State: robust, then with outliers put aside and the noise
// level found.
#pragma once

#include <functional>
#include <vector>

#include "calib/bundle/problem.h"

namespace kinescope::bundle {

struct SolveSummary {
  bool converged = false;
  /// Or its last steps took next to nothing: along what the data hardly tell apart.
  bool settled = false;
  std::string message;
  int iterations = 0;  ///< 0: it cannot be evaluated at the start, where the state has been left
  double initial_cost = 0.0;
  double final_cost = 0.0;
};

/// Least squares over the given sightings; moves `state`. Single-threaded, so that the bits are the
/// same.
[[nodiscard]] SolveSummary solve(const Spec& spec, State& state, const std::vector<int>& sightings,
                                 const BuildOptions& options, int max_iterations);

/// Robust solve, noise level per marker (per rotation and translation for poses), and once more:
/// moves `state` to where no outlier pulls it. Rescales the sigmas in `spec`.
SolveSummary settle(Spec& spec, State& state, const std::vector<int>& sightings,
                    int max_iterations);

struct RobustSolution {
  SolveSummary summary;
  std::vector<int> used;  ///< indices into Spec::sightings
  std::vector<int> rejected;
  double sigma_scale = 1.0;  ///< noise found over noise declared, rms over all
};

/// settle(), then noise level, rejection and plain refit, twice. Where the larger part of a
/// marker's sightings stands out from a robot that describes its motion, none of them is rejected.
/// Rescales the sigmas in `spec`.
[[nodiscard]] RobustSolution solve_robustly(Spec& spec, State& state, std::vector<int> sightings,
                                            double reject_sigma, int max_iterations);

/// Sightings whose joints all have a reading at the state's time offset.
[[nodiscard]] std::vector<int> usable_sightings(const Spec& spec, const State& state);

}  // namespace kinescope::bundle
