// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/simulated_system.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope::policy {
namespace {

/// Of the integration, at most: halving it moves no cart-pole by more than 1e-7 in a trial of 3 s.
constexpr double kLongestStep_s = 2.5e-3;

Eigen::VectorXd normal(const Eigen::VectorXd& sigma, Rng& rng) {
  Eigen::VectorXd out(sigma.size());
  for (Eigen::Index k = 0; k < out.size(); ++k) out[k] = rng.normal(sigma[k]);
  return out;
}

}  // namespace

void check_start(const StartDistribution& start, const StateLayout& layout) {
  const Eigen::Index count = layout.state_count();
  const auto complete = [&](const Eigen::VectorXd& values) {
    return values.size() == count && values.allFinite();
  };
  bool good = !start.means.empty() && complete(start.sigma) && start.sigma.minCoeff() >= 0.0;
  for (const Eigen::VectorXd& mean : start.means) good = good && complete(mean);
  if (!good) {
    throw bad_request("start", fmt::format("is none of a state of {} numbers", count),
                      "give every position and every speed a mean and a deviation of 0 or more");
  }
}

Eigen::VectorXd limited_input(const Controller& controller, const Eigen::VectorXd& seen, int step,
                              const StateLayout& layout) {
  const Eigen::VectorXd input = controller(seen, step);
  KINESCOPE_CHECK(input.size() == layout.input_count(), "a controller of this system");
  if (!input.allFinite()) {
    throw undetermined("policy", fmt::format("its input at step {} is no number", step),
                       "begin again with another --seed");
  }
  return input.cwiseMax(-layout.input_limit).cwiseMin(layout.input_limit);
}

SimulatedSystem::SimulatedSystem(Mechanism mechanism, StartDistribution start,
                                 SimulatedSensors sensors)
    : mechanism_(std::move(mechanism)), start_(std::move(start)), sensors_(std::move(sensors)) {
  check_layout(mechanism_.layout);
  check_start(start_, mechanism_.layout);
  KINESCOPE_CHECK(sensors_.sigma.size() == mechanism_.layout.state_count(), "a sigma a state");
}

Trial SimulatedSystem::run(const Controller& controller, int steps, std::uint64_t seed,
                           int trial) const {
  const StateLayout& layout = mechanism_.layout;
  const Eigen::Index count = layout.position_count();
  const bool positions_only = sensors_.sensing == Sensing::kPositions;
  Rng rng = Rng::from_name(fmt::format("{}, trial {}", mechanism_.name, trial), seed);
  Eigen::VectorXd state =
      start_.means[static_cast<std::size_t>(rng.index(static_cast<int>(start_.means.size())))] +
      normal(start_.sigma, rng);
  const int substeps = static_cast<int>(std::ceil(layout.step_s / kLongestStep_s));
  SpeedEstimator estimator(layout.step_s, sensors_.filters.on_line);
  Trial out{.seen = Eigen::MatrixXd(steps + 1, 2 * count),
            .smoothed = {},
            .truth = Eigen::MatrixXd(steps + 1, 2 * count),
            .inputs = Eigen::MatrixXd(steps, layout.input_count())};
  for (int k = 0; k <= steps; ++k) {
    if (!state.allFinite()) {
      throw undetermined(mechanism_.name,
                         fmt::format("its state is no number at step {} of trial {}", k, trial),
                         "take a shorter horizon or another --seed");
    }
    const Eigen::VectorXd measured = state + normal(sensors_.sigma, rng);
    out.truth.row(k) = state;
    out.seen.row(k) = positions_only ? estimator.update(measured.head(count)) : measured;
    if (k == steps) break;
    const Eigen::VectorXd input = limited_input(controller, out.seen.row(k), k, layout);
    out.inputs.row(k) = input;
    state = move(mechanism_, state, input, layout.step_s, substeps);
  }
  out.smoothed = positions_only ? smoothed_states(out.seen.leftCols(count), layout.step_s,
                                                  sensors_.filters.off_line)
                                : out.seen;
  return out;
}

}  // namespace kinescope::policy
