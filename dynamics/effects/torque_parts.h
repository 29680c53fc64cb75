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

namespace effects {

/// The base under one direction of gravity.
struct GravityCase {
  Eigen::Vector2d tilt_deg;
  RigidModel rigid;  ///< bodies of the base; of the reference where they are free
  EffectContext context;
  Eigen::SparseMatrix<double> carriers;
  Eigen::VectorXd fixed;   ///< torque that is not free, rows
  Eigen::MatrixXd base;    ///< torque a base parameter, rows x parameters
  Eigen::MatrixXd bodies;  ///< the bodies' parameters from the base parameters
};

[[nodiscard]] std::shared_ptr<const GravityCase> make_gravity_case(
    const TorqueTracedModel::Parts& parts, const Eigen::Vector2d& tilt_deg);

}  // namespace effects

struct TorqueTracedModel::Parts {
  DynamicModel model;
  TracedTorqueOptions options;
  std::shared_ptr<EffectMotion> motion;
  EffectContext context;  ///< under the declared gravity
  TorqueBase base;
  std::vector<int> fold;       ///< of every sample
  Eigen::MatrixXd q, dq, ddq;  ///< at the instants
  Eigen::VectorXd viscous,
      coulomb;             ///< that the model declares, of each joint; 0 where masses are free
  Eigen::MatrixXd widest;  ///< whitened, see widest_residual()

  std::shared_ptr<const effects::GravityCase> upright;  ///< gravity as declared

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
  [[nodiscard]] FittedTorque fitted() const;

 private:
  enum class Kind { kLinear, kDelay, kGain, kCross, kGravity };
  struct Added {
    AddedEffect effect;
    Kind kind = Kind::kLinear;
    Eigen::Index joint = 0;  ///< of delay, gain, cross-talk, friction
    Eigen::Index from = 0;   ///< of cross-talk
    Eigen::Index first = 0;  ///< of its parameters, among those of all effects
    Eigen::VectorXd values;
  };

  void read(const std::vector<AddedEffect>& effects);
  [[nodiscard]] bool is_open(const EffectId& id) const;
  void set_gravity(const Eigen::Vector2d& tilt_deg);
  void set_widths(const Eigen::VectorXd& widths);
  void choose_gravity_start(Added& gravity);
  [[nodiscard]] double step();
  void apply(const Eigen::VectorXd& change);
  [[nodiscard]] Eigen::VectorXd observed() const;
  [[nodiscard]] Eigen::MatrixXd sensor() const;
  [[nodiscard]] Eigen::MatrixXd effect_columns() const;
  [[nodiscard]] Eigen::MatrixXd width_columns() const;
  [[nodiscard]] Eigen::VectorXd friction_of(Eigen::Index joint, double width) const;
  [[nodiscard]] Eigen::VectorXd declared_coulomb(Eigen::Index joint,
                                                 const EffectContext& context) const;
  [[nodiscard]] Eigen::VectorXd physical() const;
  [[nodiscard]] Eigen::VectorXd through_sensor(const Eigen::VectorXd& rows) const;
  [[nodiscard]] Eigen::VectorXd whitened(const Eigen::VectorXd& rows) const;
  [[nodiscard]] Eigen::Index own_parameters() const { return base_values_.size() + free_widths(); }
  [[nodiscard]] Eigen::Index free_widths() const { return std::ssize(turning_); }
  void make_design();
  [[nodiscard]] TracedFit read_back(bool converged) const;
  [[nodiscard]] Eigen::MatrixXd own_prior() const;
  void name_covariates(TracedFit& out) const;

  const TorqueTracedModel::Parts& parts_;
  Eigen::Index joints_ = 0;
  Eigen::Index rows_ = 0;
  std::vector<Added> added_;
  std::vector<Eigen::Index> turning_;  ///< joints with Coulomb friction: their widths are free
  Eigen::Index effect_parameters_ = 0;
  std::shared_ptr<const GravityCase> case_;
  EffectContext context_;
  std::vector<Candidate> candidates_;  ///< of the added effects' kinds, at the present state
  Eigen::VectorXd base_values_;
  // Of the last step. Columns: base, widths, effects.
  RowMatrix design_;
  Eigen::VectorXd residual_;
};

}  // namespace effects
}  // namespace kinescope
