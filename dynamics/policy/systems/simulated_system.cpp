// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/simulated_system.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "dynamics/policy/systems/smoothing.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope::policy {
namespace {

/// Of the integration, at most: halving it moves no plant of the literature by more than 1e-5 in a
/// trial (SimulatedSystem.IntegratesFinelyEnough).
constexpr double kLongestStep_s = 1.25e-3;

Eigen::VectorXd normal(const Eigen::VectorXd& sigma, Rng& rng) {
  Eigen::VectorXd out(sigma.size());
  for (Eigen::Index k = 0; k < out.size(); ++k) out[k] = rng.normal(sigma[k]);
  return out;
}

Eigen::VectorXd draw_start(const StartDistribution& start, Rng& rng) {
  const int mode = rng.index(static_cast<int>(start.means.rows()));
  return start.means.row(mode).transpose() + normal(start.sigma, rng);
}

}  // namespace

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

Eigen::MatrixXd smoothed_signal(const Eigen::MatrixXd& seen,
                                const Eigen::MatrixXd& measured_positions,
                                const StateLayout& layout, Sensing sensing, double cutoff_hz) {
  if (sensing == Sensing::kFullState || cutoff_hz <= 0.0) return seen;
  return smoothed_states(measured_positions, layout.step_s, cutoff_hz);
}

SimulatedSystem::SimulatedSystem(Mechanism mechanism, SimulatedTrials trials)
    : mechanism_(std::move(mechanism)), trials_(std::move(trials)) {
  check_layout(layout());
  check_sensing(trials_.sensors, layout());
  const StartDistribution& start = trials_.start;
  if (start.means.rows() < 1 || start.means.cols() != layout().state_count() ||
      start.sigma.size() != layout().state_count()) {
    throw bad_request("start", "is none of this system",
                      "give every position and every speed a mean and a deviation");
  }
}

Trial SimulatedSystem::run(const Controller& controller, int steps, std::uint64_t seed,
                           int trial) const {
  const Eigen::Index count = layout().position_count();
  Rng rng = Rng::from_name(fmt::format("{}, trial {}", mechanism_.name, trial), seed);
  Eigen::VectorXd state = draw_start(trials_.start, rng);
  const Eigen::VectorXd& sigma = trials_.sensors.noise_sigma;
  const Eigen::VectorXd noise = sigma.size() > 0 ? sigma : Eigen::VectorXd::Zero(2 * count);
  const int substeps = static_cast<int>(std::ceil(layout().step_s / kLongestStep_s));
  OnlineFilter filter(layout(), trials_.sensors);
  Eigen::MatrixXd positions(steps + 1, count);
  Trial out{.seen = Eigen::MatrixXd(steps + 1, 2 * count),
            .smoothed = {},
            .truth = Eigen::MatrixXd(steps + 1, 2 * count),
            .inputs = Eigen::MatrixXd(steps, layout().input_count())};
  for (int k = 0; k <= steps; ++k) {
    if (!state.allFinite()) {
      throw undetermined(mechanism_.name,
                         fmt::format("its state is no number at step {} of trial {}", k, trial),
                         "take a shorter horizon or another --seed");
    }
    const Eigen::VectorXd measured = state + normal(noise, rng);
    positions.row(k) = measured.head(count);
    out.truth.row(k) = state;
    out.seen.row(k) = filter.step(measured);
    if (k == steps) break;
    const Eigen::VectorXd input = limited_input(controller, out.seen.row(k), k, layout());
    out.inputs.row(k) = input;
    state = move(mechanism_, state, input, layout().step_s, substeps);
  }
  out.smoothed = smoothed_signal(out.seen, positions, layout(), trials_.sensors.sensing,
                                 trials_.smoothing_cutoff_hz);
  return out;
}

}  // namespace kinescope::policy
