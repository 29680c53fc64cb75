// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/model_data.h"

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

void check_trial(const StateLayout& layout, const Trial& trial, std::size_t number) {
  const std::string where = fmt::format("trial {}", number);
  const Index steps = trial.inputs.rows();
  if (steps < 1 || trial.inputs.cols() != layout.input_count() ||
      trial.smoothed.rows() != steps + 1 || trial.smoothed.cols() != layout.state_count()) {
    throw bad_request(where,
                      fmt::format("{} x {} inputs with {} x {} states", steps, trial.inputs.cols(),
                                  trial.smoothed.rows(), trial.smoothed.cols()),
                      fmt::format("give K x {} inputs and K + 1 x {} states", layout.input_count(),
                                  layout.state_count()));
  }
  if (!trial.smoothed.allFinite() || !trial.inputs.allFinite()) {
    throw bad_request(where, "a state or input is not finite", "leave the trial out");
  }
}

}  // namespace

IncrementData increments_of(const StateLayout& layout, const std::vector<Trial>& trials) {
  check_layout(layout);
  Index samples = 0;
  for (std::size_t k = 0; k < trials.size(); ++k) {
    check_trial(layout, trials[k], k);
    samples += trials[k].inputs.rows();
  }
  const Index features = feature_count(layout);
  const Index positions = layout.position_count();
  const Index columns = features + layout.input_count();
  if (samples < columns) {
    throw undetermined("model", fmt::format("{} samples of {} numbers each", samples, columns),
                       "explore for longer");
  }
  IncrementData out{Eigen::MatrixXd(samples, columns), Eigen::MatrixXd(samples, positions)};
  Index row = 0;
  for (const Trial& trial : trials) {
    const Index steps = trial.inputs.rows();
    state_features(layout, trial.smoothed.topRows(steps),
                   out.inputs.block(row, 0, steps, features));
    out.inputs.block(row, features, steps, layout.input_count()) = trial.inputs;
    const auto speeds = trial.smoothed.rightCols(positions);
    out.increments.middleRows(row, steps) = speeds.bottomRows(steps) - speeds.topRows(steps);
    row += steps;
  }
  for (Index p = 0; p < positions; ++p) {
    if (out.increments.col(p).cwiseAbs().maxCoeff() > 0.0) continue;
    throw undetermined("model",
                       fmt::format("the speed of '{}' never changes",
                                   layout.positions[static_cast<std::size_t>(p)]),
                       "explore with inputs that move it, or read the right column");
  }
  return out;
}

}  // namespace kinescope::policy
