// SPDX-License-Identifier: Apache-2.0
//
// What a user may choose of an experiment, or a log of their own in place of its worlds.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/experiments/learners.h"

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
  std::optional<double> seconds;  ///< of each simulated log
  std::optional<double> noise;    ///< share of the spread of each joint's torque
  std::optional<std::vector<double>> tilts_deg;
  std::optional<std::vector<double>> shifts_m;  ///< as many as tilts
  std::optional<std::vector<experiments::Learner>> learners;
  std::optional<std::vector<int>> joints;  ///< of the arm; several: one after another
  std::optional<int> starts;               ///< of every search of hyperparameters
  std::optional<int> search_samples;       ///< that the search sees
  std::optional<int> inducing;             ///< points, of the learners that take them
  std::uint64_t seed = 1;
  int threads = 0;  ///< 0: all of the machine; never changes a result
  std::optional<ExperimentLog> log;
};

}  // namespace kinescope
