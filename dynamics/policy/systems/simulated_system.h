// SPDX-License-Identifier: Apache-2.0
//
// A mechanism that can be asked for trials: starts at random, noise on what is measured, inputs
// within their limits and held over a step.
#pragma once

#include <vector>

#include "dynamics/policy/system.h"
#include "dynamics/policy/systems/mechanism.h"
#include "dynamics/policy/systems/sensing.h"

namespace kinescope::policy {

struct SimulatedSensors {
  Sensing sensing = Sensing::kFull;
  Eigen::VectorXd sigma;  ///< of the measured state (2 P); with kPositions its first P count
  SpeedFilters filters;
};

struct StartDistribution {
  std::vector<Eigen::VectorXd> means;  ///< 2 P each; one of them, each as probable
  Eigen::VectorXd sigma;               ///< 2 P, about it
};

/// Throws bad_request for sizes that are not the layout's, deviations below zero, no mean.
void check_start(const StartDistribution& start, const StateLayout& layout);

class SimulatedSystem : public System {
 public:
  /// Throws bad_request as check_layout() and check_start().
  SimulatedSystem(Mechanism mechanism, StartDistribution start, SimulatedSensors sensors);

  [[nodiscard]] const StateLayout& layout() const override { return mechanism_.layout; }
  [[nodiscard]] Trial run(const Controller& controller, int steps, std::uint64_t seed,
                          int trial) const override;

 private:
  Mechanism mechanism_;
  StartDistribution start_;
  SimulatedSensors sensors_;
};

/// An input within the limits of its layout. Throws undetermined where the controller gives one
/// that is not finite.
[[nodiscard]] Eigen::VectorXd limited_input(const Controller& controller,
                                            const Eigen::VectorXd& seen, int step,
                                            const StateLayout& layout);

}  // namespace kinescope::policy
