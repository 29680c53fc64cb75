// SPDX-License-Identifier: Apache-2.0
//
// The system that a policy moves, as the learner sees it: which states there are, and trials.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace kinescope::policy {

/// A state is positions, then their speeds in the same order: x = (p, dp), 2 P entries. States that
/// integrate from speeds are all that the speed-integration model knows (Amadio et al.,
/// "Model-Based Policy Search Using Monte Carlo Gradient Estimation with Real Systems Application",
/// T-RO 2022, section IV).
struct StateLayout {
  std::vector<std::string> positions;  ///< names: "cart", "pole"
  std::vector<bool> is_angle;          ///< one a position, rad: seen through sine and cosine
  std::vector<std::string> inputs;     ///< names: "force"
  Eigen::VectorXd input_limit;         ///< one an input: |u| stays below
  double step_s = 0.0;                 ///< the input is held over it

  [[nodiscard]] Eigen::Index position_count() const {
    return static_cast<Eigen::Index>(positions.size());
  }
  [[nodiscard]] Eigen::Index state_count() const { return 2 * position_count(); }
  [[nodiscard]] Eigen::Index input_count() const {
    return static_cast<Eigen::Index>(inputs.size());
  }
};

/// Throws bad_request for a layout that contradicts itself.
void check_layout(const StateLayout& layout);

/// One rollout of the system, K steps. The three signals of MC-PILCO4PMS (Amadio et al. 2021) are
/// kept apart: what the policy saw while it ran, what the model learns from, and, where the system
/// is simulated, what was true.
struct Trial {
  Eigen::MatrixXd seen;      ///< (K + 1) x 2 P: after the filters that ran with the policy
  Eigen::MatrixXd smoothed;  ///< (K + 1) x 2 P: after filters that know the future; `seen` if none
  Eigen::MatrixXd truth;     ///< (K + 1) x 2 P, or empty: nobody knows
  Eigen::MatrixXd inputs;    ///< K x U, as applied
};

/// u (U) from the seen state (2 P) at step k.
using Controller = std::function<Eigen::VectorXd(const Eigen::VectorXd& seen, int step)>;

/// What can be asked for rollouts.
class System {
 public:
  virtual ~System() = default;
  [[nodiscard]] virtual const StateLayout& layout() const = 0;
  /// From a start drawn by the trial's number, the same for the same seed. Throws undetermined, one
  /// line, where the system fails (a state that is not finite, a program that dies).
  [[nodiscard]] virtual Trial run(const Controller& controller, int steps, std::uint64_t seed,
                                  int trial) const = 0;

 protected:
  System() = default;
  System(const System&) = default;
  System& operator=(const System&) = default;
};

}  // namespace kinescope::policy
