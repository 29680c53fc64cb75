// SPDX-License-Identifier: Apache-2.0
//
// Takes   GpModel with ranges and priors of its parameters, Dataset.
// Gives   the model with the parameters of the largest score, and how it was found.
// Method  L-BFGS (Ceres) on the logarithms with exact gradients, ranges kept by a smooth map;
// several
//         seeded starts, tried on a subset of the data where it is large.
// Not here: the score (likelihood.h), comparison of kernels on unseen data (leave_out.h).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dynamics/gp/likelihood.h"

namespace kinescope::gp {

struct EstimateOptions {
  FitOptions fit{};
  Score score = Score::kMarginalLikelihood;
  int starts = 3;                ///< the model's own values, and others drawn about them
  double start_log_sigma = 1.0;  ///< of the drawn ones
  std::uint64_t seed = 1;
  int max_iterations = 100;
  /// Stops where an iteration changes the score by less than this times the score.
  double relative_tolerance = 1e-5;
  int start_iterations = 20;  ///< of each start; then only the one that is ahead goes on
  /// Starts are compared on at most so many samples; only the best one sees all of them.
  Eigen::Index samples_for_starts = 500;
};

enum class EstimateStatus { kNotRun, kConverged, kIterationLimit, kFailed };

struct Start {
  double score = 0.0;  ///< reached on the samples for starts
  int evaluations = 0;
  bool usable = false;
};

struct Estimate {
  GpModel model;
  EstimateStatus status = EstimateStatus::kNotRun;
  std::string message;
  double score_before = 0.0;
  double score = 0.0;  ///< of all samples, priors left out
  Eigen::VectorXd gradient;
  int evaluations = 0;  ///< on all samples
  std::vector<Start> starts;
  std::vector<std::string> at_bound;  ///< parameters that ended at an end of their range
};

[[nodiscard]] Estimate estimate_hyperparameters(const GpModel& model, const Dataset& dataset,
                                                const EstimateOptions& options = {});
/// The same for another score of all samples.
[[nodiscard]] Estimate estimate_hyperparameters(const GpModel& model, const Dataset& dataset,
                                                Objective& objective,
                                                const EstimateOptions& options);

}  // namespace kinescope::gp
