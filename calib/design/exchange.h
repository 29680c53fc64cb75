// SPDX-License-Identifier: Apache-2.0
//
// Takes   what each candidate measurement would say (its information matrix), what is known, and a
//         criterion of an information matrix.
// Gives   the candidates to measure.
// Method  greedy augmentation, then exchange: each chosen candidate in turn makes way for whichever
//         one is best in its place, until none does (Fedorov 1972, as modified by Cook and
//         Nachtsheim 1980).
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

namespace kinescope::design {

struct DesignProblem {
  Eigen::MatrixXd known;                    ///< information before, P x P
  std::vector<Eigen::MatrixXd> candidates;  ///< information of each, P x P
  /// Lower is better; threads call it at the same time.
  std::function<double(const Eigen::MatrixXd& information)> criterion;
};

/// Indices of `count` candidates in the order of choice; the same one may be chosen again. `held`:
/// chosen before, which stay. O(candidates x count) criteria a pass; deterministic, whatever the
/// number of threads.
[[nodiscard]] std::vector<std::size_t> choose_candidates(const DesignProblem& problem,
                                                         std::size_t count,
                                                         const std::vector<std::size_t>& held = {});

}  // namespace kinescope::design
