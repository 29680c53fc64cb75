// SPDX-License-Identifier: Apache-2.0
//
// A mechanism that can be asked for trials: starts at random, noise on what is measured, inputs
// within their limits and held over a step.
#pragma once

#include "dynamics/policy/particles.h"
#include "dynamics/policy/systems/mechanism.h"

namespace kinescope::policy {

/// What is drawn and measured in a simulated trial.
struct SimulatedTrials {
  StartDistribution start;
  SensingOptions sensors;
  /// Afterwards, where only positions are measured; 0: none, the model learns from what was seen.
  double smoothing_cutoff_hz = 0.0;
};

class SimulatedSystem : public System {
 public:
  /// Throws bad_request for what contradicts itself or the layout.
  SimulatedSystem(Mechanism mechanism, SimulatedTrials trials);

  [[nodiscard]] const StateLayout& layout() const override { return mechanism_.layout; }
  [[nodiscard]] Trial run(const Controller& controller, int steps, std::uint64_t seed,
                          int trial) const override;

 private:
  Mechanism mechanism_;
  SimulatedTrials trials_;
};

/// The controller's input (U) within the limits of its layout. Throws undetermined where it is not
/// finite.
[[nodiscard]] Eigen::VectorXd limited_input(const Controller& controller,
                                            const Eigen::VectorXd& seen, int step,
                                            const StateLayout& layout);

/// What the model learns from: `seen`, or smoothed positions where only these are measured.
[[nodiscard]] Eigen::MatrixXd smoothed_signal(const Eigen::MatrixXd& seen,
                                              const Eigen::MatrixXd& measured_positions,
                                              const StateLayout& layout, Sensing sensing,
                                              double cutoff_hz);

}  // namespace kinescope::policy
