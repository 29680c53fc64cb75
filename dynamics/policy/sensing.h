// SPDX-License-Identifier: Apache-2.0
//
// What the policy sees of the true state: everything, with noise or without, or positions alone,
// whose speeds come from a backward difference and a first-order low-pass that run with the policy
// (MC-PILCO4PMS, Amadio et al. 2021, arXiv 2101.08740). The same filter runs on the real system
// (`OnlineFilter`) and inside the particles, where it is a linear state with a pullback.
#pragma once

#include <vector>

#include "dynamics/policy/state_features.h"

namespace kinescope::policy {

/// States by what is known of them: types that do not convert into each other. Particles x 2 P.
struct TrueStates {
  Eigen::MatrixXd values;
};
struct SeenStates {
  Eigen::MatrixXd values;
};

enum class Sensing {
  kFullState,      ///< positions and speeds are measured
  kPositionsOnly,  ///< speeds are estimated from positions
};

struct SensingOptions {
  Sensing sensing = Sensing::kFullState;
  /// Standard deviation of what is measured: 2 P entries (speeds are ignored where only positions
  /// are measured). Empty: none.
  Eigen::VectorXd noise_sigma;
  /// Cut-off of the low-pass of positions and of estimated speeds, Hz; 0: none.
  double position_cutoff_hz = 0.0;
  double speed_cutoff_hz = 0.0;
};

/// Throws bad_request for cut-offs or sigmas below zero, or a number of sigmas that does not fit.
void check_sensing(const SensingOptions& options, const StateLayout& layout);

/// exp(-2 pi cutoff step): the share of the last value that a first-order low-pass keeps; 0 where
/// the cut-off is 0.
[[nodiscard]] double low_pass_memory(double cutoff_hz, double step_s);

/// The filter on one run of the system. Memory of the filter: measured position of the step before,
/// filtered position, filtered speed.
class OnlineFilter {
 public:
  OnlineFilter(const StateLayout& layout, const SensingOptions& options);
  /// The seen state (2 P) from the measured one (2 P; speeds are not read where only positions are
  /// measured). The first call starts the filter: speeds zero where they are not measured.
  [[nodiscard]] Eigen::VectorXd step(const Eigen::VectorXd& measured);

 private:
  StateLayout layout_;
  SensingOptions options_;
  bool started_ = false;
  Eigen::VectorXd last_position_;
  Eigen::VectorXd position_;
  Eigen::VectorXd speed_;
};

}  // namespace kinescope::policy
