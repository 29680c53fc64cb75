// SPDX-License-Identifier: Apache-2.0
//
// Takes   what a user may choose of an experiment, or a log of their own in place of its worlds.
// Gives   ExperimentSummary: findings, tables, drawings (app/report/experiment.h).
// Method  the worlds and learners of dynamics/experiments.
// Not here: the command line and the files (app/commands/experiment.cpp).
#pragma once

#include <string_view>
#include <vector>

#include "app/experiments/experiment_choice.h"
#include "app/report/experiment.h"
#include "kinematics/core/progress.h"

namespace kinescope {

struct Experiment {
  std::string_view name;
  std::string_view title;
  std::vector<std::string_view> options;  ///< that it takes beside --seed and --threads
  std::vector<std::string_view> tables;   ///< ids: each is written as a CSV
  ExperimentSummary (*run)(const ExperimentChoice&, const Progress&);
};

[[nodiscard]] const std::vector<Experiment>& all_experiments();

[[nodiscard]] ExperimentSummary scara_experiment(const ExperimentChoice& choice,
                                                 const Progress& progress);
[[nodiscard]] ExperimentSummary efficiency_experiment(const ExperimentChoice& choice,
                                                      const Progress& progress);

[[nodiscard]] ExperimentSummary panda_experiment(const ExperimentChoice& choice,
                                                 const Progress& progress);
[[nodiscard]] ExperimentSummary ur10_experiment(const ExperimentChoice& choice,
                                                const Progress& progress);
[[nodiscard]] ExperimentSummary barrett_experiment(const ExperimentChoice& choice,
                                                   const Progress& progress);
[[nodiscard]] ExperimentSummary contact_experiment(const ExperimentChoice& choice,
                                                   const Progress& progress);
[[nodiscard]] ExperimentSummary control_experiment(const ExperimentChoice& choice,
                                                   const Progress& progress);

}  // namespace kinescope
