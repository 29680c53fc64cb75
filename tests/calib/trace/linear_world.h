// SPDX-License-Identifier: Apache-2.0
//
// A linear model with two "joints" that move smoothly, known noise, and effects that the base model
// lacks: what the tracing engine is tested on without a robot.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/trace/traced_model.h"

namespace kinescope::truth {

struct LinearWorldOptions {
  std::uint64_t seed = 1;
  std::optional<std::uint64_t> noise_seed;  ///< of the same motion; none: goes on from `seed`
  int instants = 400;
  double noise = 1.0;         ///< of a row
  double noise_memory = 0.0;  ///< AR(1) from instant to instant
  int folds = 5;
  bool together = false;     ///< the second joint moves as the first one does
  bool scale_grows = false;  ///< a scale below zero cannot be
  bool scale_turns = false;  ///< fitted, a scale has the other sign than the residual asks for
  /// Candidate "bend" at joint1: at nothing it does what the joint's zero does, in the fit it is
  /// "tanh_other" (as friction frees the width of its turn).
  bool bends = false;
  /// Candidate "imitation" at joint1: nearly what "tanh_other" does, and some of its own.
  bool imitates = false;
  /// Candidate "tanh_other" at joint1, below a floor that nothing reaches.
  bool other_is_small = false;
  /// Candidates "first_half" and "second_half" at joint1: far larger each than the "weave" that
  /// they are together, which candidate "weave" tells alone, below a floor that nothing reaches.
  bool stands_in = false;
  /// Candidate "drift" at joint1: what a time constant of 2 to 200 s leaves of it after the start.
  bool drifts = false;
  /// The noise is what neighbours differ by: what is left may be seen to last, as the residual's
  /// own correlation time says, s.
  std::optional<double> lasts_s;
  std::string converges_with;  ///< the fit converges only with this effect in it; empty: always
};

/// What is in the data and not in the model: one term of `LinearWorld::share`.
struct Injected {
  int joint = 0;
  std::string shape;  ///< "scale", "coupling", "sine", "gear", "direction", "step", "tanh_other",
                      ///< "wave_other", "weave", "drift", "field"
  double size = 0.0;
  double detail = 0.0;  ///< periods of the gear, time (constant) of the step (the drift) in s
};

class LinearWorld final : public TracedModel {
 public:
  LinearWorld(const LinearWorldOptions& options, const std::vector<Injected>& injected);
  [[nodiscard]] TracedFit fit(const std::vector<AddedEffect>& effects) const override;
  /// Of the effect "field", size 1: the shift at a place.
  [[nodiscard]] static Eigen::Vector2d shape_of_field(const Eigen::Vector2d& place);

 private:
  [[nodiscard]] Eigen::VectorXd share(const Injected& effect) const;
  [[nodiscard]] std::vector<Candidate> candidates() const;

  LinearWorldOptions options_;
  Eigen::VectorXd time_s_;
  Eigen::MatrixXd q_;       // instants x joints
  Eigen::MatrixXd gains_;   // rows x carriers: the joints, then a shift along either coordinate
  Eigen::MatrixX2d place_;  // of rows
  Eigen::VectorXd observed_;
};

}  // namespace kinescope::truth
