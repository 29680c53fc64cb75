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

/// The filter on a block of particles, one row each, with its pullback. Memory: measured position
/// of the step before, filtered position, filtered speed.
class ParticleFilter {
 public:
  ParticleFilter(const StateLayout& layout, const SensingOptions& options, Eigen::Index rows);
  [[nodiscard]] bool noisy() const { return options_.noise_sigma.size() > 0; }

  /// Forgets everything: the next step is the first.
  void start();
  /// `normals`: rows x 2 P, read where the measurement has noise. At the first step filters start
  /// at what is measured; speeds that are not measured start at zero.
  void step(const TrueStates& states, const Eigen::MatrixXd& normals, SeenStates& seen);

  /// Before the pullback of the last step.
  void start_pullback();
  /// From the last step to the first: d_states += the pullback of d_seen (rows x 2 P each).
  void pullback(const ConstBlock& d_seen, bool first_step, Block d_states);

 private:
  StateLayout layout_;
  SensingOptions options_;
  double position_memory_ = 0.0;
  double speed_memory_ = 0.0;
  bool started_ = false;
  Eigen::MatrixXd last_;  // rows x P each
  Eigen::MatrixXd position_;
  Eigen::MatrixXd speed_;
};

/// The same filter on one run of the real system, whose measurements have noise of their own.
class OnlineFilter {
 public:
  OnlineFilter(const StateLayout& layout, SensingOptions options);
  /// The seen state (2 P) from the measured one (2 P; speeds are not read where only positions are
  /// measured).
  [[nodiscard]] Eigen::VectorXd step(const Eigen::VectorXd& measured);

 private:
  ParticleFilter filter_;
  TrueStates measured_;
  SeenStates seen_;
};

}  // namespace kinescope::policy
