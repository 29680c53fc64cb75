// SPDX-License-Identifier: Apache-2.0
//
// Takes   the masses that a controller believes in, what was learned of its robot, what it carries.
// Gives   Compensation: the torque that a motion asks for.
// Units   SI; vectors have one entry a moving joint; N m or N.
// Method  nominal + weight (learned - nominal) + payload. The weight e^2 / (e^2 + s^2) makes the
//         linear estimate of least mean square error from both: s is the model's doubt about the
//         function (its band without the noise), e what the nominal torque lacks of the learned
//         one where the model was learned, rms. Where the model knows nothing the weight is 0.
// Not here: feedback (controller.h), how models are learned (dynamics/models, dynamics/effects).
#pragma once

#include <memory>
#include <optional>

#include "dynamics/control/online_torque.h"
#include "dynamics/effects/trace_torque.h"
#include "dynamics/models/torque_model.h"

namespace kinescope {

/// A learned robot; at least one of both. With effects, these give the torque and the model its
/// doubt: it is the one that they were traced beside.
struct LearnedTorque {
  std::optional<SavedTorqueModel> model = {};
  std::optional<CorrectedTorqueModel> traced = {};
};

/// What a controller knows of its robot.
struct KnownRobot {
  RigidModel nominal;                                 ///< masses of the data sheet
  std::shared_ptr<const LearnedTorque> learned = {};  ///< null: nothing
  /// What the last link carries beyond what was learned from, in its body's frame.
  std::optional<InertialParameters> payload = {};
};

/// One run of one controller: friction with a memory is in it.
class Compensation {
 public:
  /// Throws bad_request for a learned model of other joints than the robot's, or of currents.
  explicit Compensation(const KnownRobot& robot);
  ~Compensation();
  Compensation(Compensation&&) noexcept;
  Compensation& operator=(Compensation&&) noexcept;

  const Eigen::VectorXd& at(const MotionPoint& motion);
  /// What holds the robot there; memories stay as they are.
  const Eigen::VectorXd& at_rest(const Eigen::VectorXd& q, double t_s);
  /// Of the learned part at the last call, 0 to 1, one a joint; 0 where nothing was learned.
  [[nodiscard]] const Eigen::VectorXd& weight() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// e^2 / (e^2 + s^2) of the above; 0 for a doubt that is not finite.
[[nodiscard]] double weight_of_doubt(double doubt, double nominal_error);

/// What the nominal torque lacks of the model's where it was learned, rms, one a joint: at the
/// points of its processes; a parametric model's at random motion within what was learned. Joints
/// of which the model knows nothing there have 0.
[[nodiscard]] Eigen::VectorXd nominal_errors(const SavedTorqueModel& model,
                                             const RigidModel& nominal);

/// The last body that the others carry: where a payload hangs.
[[nodiscard]] std::size_t last_body(const RigidModel& rigid);

/// Massless but for a payload at the last body: the torque is linear in the masses.
[[nodiscard]] RigidModel payload_alone(const RigidModel& rigid, const InertialParameters& payload);

}  // namespace kinescope
