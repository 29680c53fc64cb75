// SPDX-License-Identifier: Apache-2.0
//
// All candidates tested at once, each at the best value of its scan, with the number of tests
// counted in.
#pragma once

#include <cstddef>
#include <vector>

#include "calib/trace/score_test.h"

namespace kinescope::trace {

/// A p-value over the family, up to which an effect may be there and hidden.
inline constexpr double kHint = 0.2;
/// So many of those are tried: each costs fits.
inline constexpr std::size_t kMostHints = 3;

struct TestedMember {
  std::size_t index = 0;  ///< into the candidates
  double scan = 0.0;
  std::vector<EffectColumn> columns;  ///< at that value
  Score score;
  double tests = 1.0;    ///< by which the p-value of one test is multiplied
  double p_value = 1.0;  ///< over the family; Bonferroni over candidates and values of their scans
};

/// The value of the scan at which the effect explains most; 0 where there is none.
[[nodiscard]] double best_scan(const NormalSystem& system, const Candidate& candidate);

/// Candidates times the values of this one's scan: by which a single p-value is multiplied.
[[nodiscard]] double number_of_tests(const std::vector<Candidate>& candidates,
                                     const Candidate& candidate);

/// Scans are searched between their values where that can matter. Candidates that cannot make the
/// sum of squares fall by `least_gain` are left out, and curves.
[[nodiscard]] std::vector<TestedMember> test_family(const NormalSystem& system,
                                                    const std::vector<Candidate>& candidates,
                                                    double least_gain = 0.0);

/// Signed parameter where there is one, else the weighted length.
[[nodiscard]] double size_of(const Candidate& candidate, const Eigen::VectorXd& theta);
/// Standard uncertainty of it.
[[nodiscard]] double size_sigma(const Candidate& candidate, const Eigen::VectorXd& theta,
                                const Eigen::MatrixXd& covariance);
/// The size that is found in 95 of 100 recordings by a test at level `p_value` that passes over
/// what comes out smaller than `least_size`.
[[nodiscard]] double smallest_size(const Candidate& candidate, const Score& score, double p_value,
                                   double least_size);

}  // namespace kinescope::trace
