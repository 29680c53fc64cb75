// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/hyperparameters.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include <ceres/gradient_problem.h>
#include <ceres/gradient_problem_solver.h>
#include <fmt/format.h>

#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"
#include "kinematics/core/silence_glog.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

// A free parameter's logarithm lies between its ends: a + (b - a) / (1 + exp(-4 u / (b - a))), with
// slope 1 in the middle.
struct LogRange {
  double low;
  double high;

  [[nodiscard]] double width() const { return high - low; }
  [[nodiscard]] double value(double u) const {
    return low + width() / (1.0 + std::exp(-4.0 * u / width()));
  }
  [[nodiscard]] double slope(double u) const {
    const double share = (value(u) - low) / width();
    return 4.0 * share * (1.0 - share);
  }
  [[nodiscard]] double inverse(double log_value) const {
    constexpr double kEdge = 1e-3;
    const double share = std::clamp((log_value - low) / width(), kEdge, 1.0 - kEdge);
    return 0.25 * width() * std::log(share / (1.0 - share));
  }
};

struct Free {
  Index index;
  LogRange range;
  double prior_mean;
  double prior_sigma;  // 0: none
};

std::vector<Free> free_parameters(const std::vector<Parameter>& parameters) {
  std::vector<Free> out;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Parameter& p = parameters[i];
    if (!(p.value > 0.0) || !std::isfinite(p.value)) {
      throw bad_request(p.name, fmt::format("the value is {}", p.value), "give a positive number");
    }
    if (p.fixed) continue;
    if (!(p.lower > 0.0) || !(p.upper > p.lower)) {
      throw bad_request(p.name, fmt::format("the range is {} to {}", p.lower, p.upper),
                        "give 0 < lower < upper, or fix the parameter");
    }
    out.push_back({static_cast<Index>(i),
                   {std::log(p.lower), std::log(p.upper)},
                   std::log(p.prior_value),
                   p.prior_log_sigma});
  }
  return out;
}

// Minus (score + log prior) of the free parameters, for Ceres.
class Cost : public ceres::FirstOrderFunction {
 public:
  Cost(Objective& objective, const std::vector<Free>& free, Eigen::VectorXd log_values)
      : objective_(objective), free_(free), log_values_(std::move(log_values)) {}

  bool Evaluate(const double* u, double* cost, double* gradient) const override {
    ++evaluations_;
    Eigen::VectorXd values = log_values_;
    for (std::size_t k = 0; k < free_.size(); ++k) {
      values[free_[k].index] = free_[k].range.value(u[k]);
    }
    const std::optional<Likelihood> score = objective_.evaluate(values);
    if (!score || !std::isfinite(score->value) || !score->gradient.allFinite()) return false;
    *cost = -score->value;
    for (std::size_t k = 0; k < free_.size(); ++k) {
      double slope = -score->gradient[free_[k].index];
      if (free_[k].prior_sigma > 0.0) {
        const double z = (values[free_[k].index] - free_[k].prior_mean) / free_[k].prior_sigma;
        *cost += 0.5 * z * z;
        slope += z / free_[k].prior_sigma;
      }
      if (gradient != nullptr) gradient[k] = slope * free_[k].range.slope(u[k]);
    }
    return true;
  }

  [[nodiscard]] int NumParameters() const override { return static_cast<int>(free_.size()); }
  [[nodiscard]] int evaluations() const { return evaluations_; }

 private:
  Objective& objective_;
  const std::vector<Free>& free_;
  Eigen::VectorXd log_values_;
  mutable int evaluations_ = 0;
};

struct Climb {
  Eigen::VectorXd u;
  double cost = 0.0;
  int evaluations = 0;
  bool usable = false;
  bool converged = false;
  std::string message;
};

Climb climb(Objective& objective, const std::vector<Free>& free, const Eigen::VectorXd& log_values,
            Eigen::VectorXd u, const EstimateOptions& options) {
  // Owned by the problem.
  auto* cost = new Cost(objective, free, log_values);
  const ceres::GradientProblem problem(cost);
  ceres::GradientProblemSolver::Options solver;
  solver.line_search_direction_type = ceres::LBFGS;
  solver.max_num_iterations = options.max_iterations;
  solver.function_tolerance = options.relative_tolerance;
  solver.gradient_tolerance = 1e-6;
  solver.parameter_tolerance = 1e-9;
  solver.logging_type = ceres::SILENT;
  ceres::GradientProblemSolver::Summary summary;
  Climb out;
  out.u = std::move(u);
  ceres::Solve(solver, problem, out.u.data(), &summary);
  out.cost = summary.final_cost;
  out.evaluations = cost->evaluations();
  out.usable = summary.IsSolutionUsable() && std::isfinite(out.cost);
  out.converged = summary.termination_type == ceres::CONVERGENCE;
  out.message = summary.message;
  return out;
}

Eigen::VectorXd to_u(const std::vector<Free>& free, const Eigen::VectorXd& log_values) {
  Eigen::VectorXd u(static_cast<Index>(free.size()));
  for (std::size_t k = 0; k < free.size(); ++k) {
    u[static_cast<Index>(k)] = free[k].range.inverse(log_values[free[k].index]);
  }
  return u;
}

// Evenly spaced, so that every stretch of a trajectory is seen.
Dataset thinned(const Dataset& dataset, Index limit) {
  const Index samples = dataset.samples();
  if (samples <= limit) return dataset;
  std::vector<Index> indices;
  indices.reserve(static_cast<std::size_t>(limit));
  for (Index k = 0; k < limit; ++k) indices.push_back(k * samples / limit);
  return subset(dataset, indices);
}

// The start that is ahead after a short climb each.
Climb leader_of(Objective& objective, const std::vector<Free>& free,
                const Eigen::VectorXd& log_values, const Eigen::VectorXd& own,
                EstimateOptions options, std::vector<Start>& starts) {
  options.max_iterations = std::min(options.max_iterations, options.start_iterations);
  Climb best{.u = own, .cost = std::numeric_limits<double>::infinity(), .message = ""};
  for (int s = 0; s < options.starts; ++s) {
    Eigen::VectorXd u = own;
    if (s > 0) {
      Rng rng = Rng::from_name("gp start " + std::to_string(s), options.seed);
      for (double& value : u) value += rng.normal(options.start_log_sigma);
    }
    Climb climbed = climb(objective, free, log_values, u, options);
    starts.push_back({-climbed.cost, climbed.evaluations, climbed.usable});
    if (climbed.usable && climbed.cost < best.cost) best = std::move(climbed);
  }
  return best;
}

// From several starts, on few samples as long as there is a choice. `same`: `objective` is the
// dense one of these samples.
Climb best_climb(const GpModel& model, const Dataset& dataset, const std::vector<Free>& free,
                 Objective& objective, bool same, const EstimateOptions& options,
                 std::vector<Start>& starts) {
  const Eigen::VectorXd log_values = log_values_of(model);
  Climb leader{.u = to_u(free, log_values), .message = ""};
  const bool few = dataset.samples() <= options.samples_for_starts;
  if (options.starts > 1 || !few) {
    const auto part = few && same
                          ? nullptr
                          : make_objective(model, thinned(dataset, options.samples_for_starts),
                                           options.fit, options.score);
    Objective& tried = part ? *part : objective;
    if (options.starts > 1) {
      leader = leader_of(tried, free, log_values, leader.u, options, starts);
    }
    if (!part && leader.converged) return leader;
    if (part) {
      const Climb on = climb(tried, free, log_values, leader.u, options);
      if (options.starts <= 1) starts.push_back({-on.cost, on.evaluations, on.usable});
      if (on.usable) leader = on;
    }
  }
  return climb(objective, free, log_values, leader.u, options);
}

Estimate estimate(const GpModel& model, const Dataset& dataset, Objective& objective, bool same,
                  const EstimateOptions& options) {
  silence_glog();
  const std::vector<Parameter> parameters = parameters_of(model);
  const std::vector<Free> free = free_parameters(parameters);
  const Eigen::VectorXd before = log_values_of(model);
  Estimate out{model, EstimateStatus::kFailed, "", 0.0, 0.0, {}, 0, {}, {}};
  std::optional<Likelihood> score = objective.evaluate(before);
  out.score_before = score ? score->value : -std::numeric_limits<double>::infinity();
  Eigen::VectorXd values = before;
  if (!free.empty()) {
    const Climb climbed = best_climb(model, dataset, free, objective, same, options, out.starts);
    out.evaluations = climbed.evaluations;
    out.message = climbed.message;
    if (climbed.usable) {
      for (std::size_t k = 0; k < free.size(); ++k) {
        values[free[k].index] = free[k].range.value(climbed.u[static_cast<Index>(k)]);
      }
      out.status = climbed.converged ? EstimateStatus::kConverged : EstimateStatus::kIterationLimit;
      score = objective.evaluate(values);
    }
  } else {
    out.status = score ? EstimateStatus::kConverged : EstimateStatus::kFailed;
    out.message = "nothing is free";
  }
  if (score) {
    out.score = score->value;
    out.gradient = score->gradient;
  }
  out.model = with_log_values(model, values);
  for (const Free& f : free) {
    constexpr double kNear = 0.02;
    const double share = (values[f.index] - f.range.low) / f.range.width();
    if (share < kNear || share > 1.0 - kNear) {
      out.at_bound.push_back(parameters[static_cast<std::size_t>(f.index)].name);
    }
  }
  return out;
}

}  // namespace

Estimate estimate_hyperparameters(const GpModel& model, const Dataset& dataset,
                                  const EstimateOptions& options) {
  const auto objective = make_objective(model, dataset, options.fit, options.score);
  return estimate(model, dataset, *objective, true, options);
}

Estimate estimate_hyperparameters(const GpModel& model, const Dataset& dataset,
                                  Objective& objective, const EstimateOptions& options) {
  return estimate(model, dataset, objective, false, options);
}

}  // namespace kinescope::gp
