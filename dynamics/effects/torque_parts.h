// SPDX-License-Identifier: Apache-2.0
//
// What a TorqueTracedModel keeps from one fit to the next. Internal to this room.
#pragma once

#include <memory>
#include <vector>

#include "dynamics/effects/base_choice.h"
#include "dynamics/effects/effect_library.h"
#include "dynamics/effects/traced_torque.h"

namespace kinescope {

struct TorqueTracedModel::Parts {
  DynamicModel model;
  TorqueModelOptions options;
  std::shared_ptr<EffectMotion> motion;
  EffectContext context;          ///< under the declared gravity
  TorqueBase base;
  std::vector<int> fold;          ///< of every sample
  Eigen::MatrixXd q, dq, ddq;     ///< at the instants
  Eigen::MatrixXd drives;         ///< friction that the model declares, instants x joints
  Eigen::MatrixXd widest;           ///< whitened, see widest_residual()

  /// All that follows from the instants that are kept.
  void refresh();
  void choose_base(const effects::BaseData& data, bool masses);
};

namespace effects {

/// Gauss-Newton over base parameters and effects.
class TorqueFitter {
 public:
  TorqueFitter(const TorqueTracedModel::Parts& parts, const std::vector<AddedEffect>& effects);

  [[nodiscard]] TracedFit run();
  [[nodiscard]] RigidModel rigid() const;

 private:
  enum class Kind { kLinear, kDelay, kGain, kCross, kGravity };
  struct Added {
    AddedEffect effect;
    Kind kind = Kind::kLinear;
    Eigen::Index joint = 0;  ///< of delay, gain, cross-talk
    Eigen::Index from = 0;   ///< of cross-talk
    Eigen::Index first = 0;  ///< of its parameters, among those of all effects
    Eigen::VectorXd values;
  };

  void read_widths(const std::vector<AddedEffect>& effects);
  void read(const std::vector<AddedEffect>& effects);
  [[nodiscard]] bool is_open(const EffectId& id) const;
  void set_gravity(const Eigen::Vector2d& tilt_deg);
  void choose_gravity_start(Added& gravity);
  [[nodiscard]] double step();
  [[nodiscard]] Eigen::VectorXd observed() const;
  [[nodiscard]] Eigen::MatrixXd sensor() const;
  [[nodiscard]] Eigen::MatrixXd effect_columns() const;
  [[nodiscard]] Eigen::VectorXd physical() const;
  [[nodiscard]] Eigen::VectorXd through_sensor(const Eigen::VectorXd& rows) const;
  [[nodiscard]] Eigen::VectorXd whitened(const Eigen::VectorXd& rows) const;
  void make_design();
  [[nodiscard]] TracedFit read_back(bool converged) const;

  const TorqueTracedModel::Parts& parts_;
  Eigen::Index joints_ = 0;
  Eigen::Index rows_ = 0;
  std::vector<Added> added_;
  Eigen::Index effect_parameters_ = 0;
  Eigen::VectorXd widths_;
  Eigen::Vector2d tilt_deg_ = Eigen::Vector2d::Zero();
  // Under the present gravity.
  RigidModel rigid_;             ///< declared bodies, or those of the reference
  EffectContext context_;
  EffectLibrary library_;
  Eigen::VectorXd fixed_;        ///< torque that is not free, rows
  Eigen::MatrixXd base_;         ///< torque a base parameter, rows x parameters
  Eigen::MatrixXd bodies_;       ///< the bodies' parameters from the base parameters
  Eigen::VectorXd base_values_;
  // Of the last step.
  RowMatrix design_;
  Eigen::VectorXd residual_;
};

}  // namespace effects
}  // namespace kinescope
