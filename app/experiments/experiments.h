// SPDX-License-Identifier: Apache-2.0
//
// Takes   what a user may choose of an experiment, or a log of their own in place of its worlds.
// Gives   ExperimentSummary: findings, tables, drawings (app/report/experiment.h).
// Method  the worlds and learners of dynamics/experiments.
// Not here: the command line and the files (app/commands/experiment.cpp).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/report/experiment.h"
#include "dynamics/experiments/learners.h"
#include "kinematics/core/progress.h"

namespace kinescope {

/// A robot and its log, judged in place of an experiment's own worlds.
struct ExperimentLog {
  DynamicModel robot;
  TorqueSamples samples;
  std::vector<std::string> joints;
};

/// What was chosen; nothing: the experiment's own.
struct ExperimentChoice {
  std::optional<int> runs;
  std::optional<int> samples;
  std::optional<double> noise;  ///< share of the spread of each joint's torque
  std::optional<std::vector<double>> tilts_deg;
  std::optional<std::vector<double>> shifts_m;  ///< as many as tilts
  std::optional<std::vector<experiments::Learner>> learners;
  std::optional<int> starts;          ///< of every search of hyperparameters
  std::optional<int> search_samples;  ///< that the search sees
  std::uint64_t seed = 1;
  int threads = 0;  ///< 0: all of the machine; never changes a result
  std::optional<ExperimentLog> log;
};

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

}  // namespace kinescope
