// SPDX-License-Identifier: Apache-2.0
//
// What the experiments that compare learners have in common: choices, and a user's own log.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "app/experiments/experiments.h"
#include "dynamics/experiments/comparison_runs.h"

namespace kinescope {

[[nodiscard]] std::vector<experiments::Learner> chosen_learners(const ExperimentChoice& choice);
[[nodiscard]] experiments::LearnOptions learn_options(const ExperimentChoice& choice);
/// Every run and setting with the same two parts.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> learn_settings(
    const ExperimentChoice& choice, const experiments::LearnOptions& learn);

/// Parts of the log that are left out one after another: whole trajectories, or blocks of one.
/// `runs` of them at most; each with at most `samples` of the rest to learn from, evenly chosen, or
/// all where it is 0. Throws undetermined for a log that is too short.
[[nodiscard]] std::vector<experiments::ComparisonCase> cases_of_log(const ExperimentLog& log,
                                                                    int runs, int samples);

}  // namespace kinescope
