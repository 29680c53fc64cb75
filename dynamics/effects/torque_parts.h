// SPDX-License-Identifier: Apache-2.0
//
// What a TorqueTracedModel keeps from one fit to the next. Internal to this room.
#pragma once

#include <memory>
#include <vector>

#include "dynamics/effects/base_choice.h"
#include "dynamics/effects/carrier_torques.h"
#include "dynamics/effects/effect_library.h"
#include "dynamics/effects/gravity_regressors.h"
#include "dynamics/effects/traced_torque.h"
#include "kinematics/core/memo.h"

namespace kinescope {

namespace effects {

/// The base under one direction of gravity.
struct GravityCase {
  Eigen::Vector2d tilt_deg;
  RigidModel rigid;  ///< bodies of the base; of the reference where they are free
  EffectContext context;
  std::vector<JointTorques> carrier_torques;  ///< by carrier
  Eigen::MatrixXd fixed;                      ///< torque that is not free, instants x joints
  std::vector<Eigen::MatrixXd> base;          ///< of each joint: torque a base parameter, instants
                                              ///< x parameters
  std::vector<Eigen::MatrixXd> base_squares;  ///< of each joint: base' base
  Eigen::MatrixXd bodies;                     ///< the bodies' parameters from the base parameters

  [[nodiscard]] Eigen::Index parameters() const { return base.front().cols(); }
};

/// `weighed`: the bodies by whose weight a tilt shows in the torque.
[[nodiscard]] std::shared_ptr<const GravityCase> make_gravity_case(
    const TorqueTracedModel::Parts& parts, const Eigen::Vector2d& tilt_deg,
    const RigidModel& weighed);

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
      coulomb;  ///< that the model declares, of each joint; 0 where masses are free
  /// Whitened residuals of the widest linear description (every joint alone, all that a joint may
  /// have), instants x joints: what is neither rigid bodies nor any common effect.
  Eigen::MatrixXd widest;

  effects::GravityRegressors regressors;  ///< of the geometry, at the instants
  Eigen::MatrixXd declared_load;  ///< of the bodies of context.rigid in the declared gravity
  std::shared_ptr<const effects::GravityCase> upright;  ///< gravity as declared
  /// From a base that stands as gravity_starts() says: every fit that seeks gravity begins there.
  Memo<int, std::shared_ptr<const effects::GravityCase>> starts;

  void leave_out(const std::vector<char>& wanted) const;
  /// All that follows from the instants that are kept.
  void refresh();
  void choose_base(const effects::BaseData& data, bool masses);
};

namespace effects {

/// The one of this name; there must be one.
[[nodiscard]] const Candidate& candidate_of(const std::vector<Candidate>& candidates,
                                            const EffectId& id);

/// Gauss-Newton over base parameters, widths of the turn of friction, and effects. All but sensors'
/// shares in each other acts on few joints: sums are made joint by joint.
class TorqueFitter {
 public:
  TorqueFitter(const TorqueTracedModel::Parts& parts, const std::vector<AddedEffect>& effects);

  [[nodiscard]] TracedFit run();
  [[nodiscard]] FittedTorque fitted() const;

 private:
  enum class Kind { kLinear, kDelay, kLag, kGain, kCross, kGravity };
  struct Added {
    AddedEffect effect;
    Kind kind = Kind::kLinear;
    Eigen::Index joint = 0;  ///< of delay, lag, gain, cross-talk, friction
    Eigen::Index from = 0;   ///< of cross-talk
    Eigen::Index first = 0;  ///< of its parameters, among those of all effects
    Eigen::VectorXd values;
    std::vector<JointTorques> torques;  ///< a unit of each parameter, before the sensors
  };
  /// One joint's rows: d measured / d parameter, whitened. Base parameters stand in `base`, times
  /// `base_gain`; of the others, those that act on the joint.
  struct JointDesign {
    const Eigen::MatrixXd* base = nullptr;
    const Eigen::MatrixXd* base_squares = nullptr;
    double base_gain = 1.0;
    Eigen::MatrixXd mixed, mixed_squares;  ///< base where the sensor lags or sees others, too
    Eigen::MatrixXd columns;
    std::vector<Eigen::Index> parameters;  ///< of the columns
    Eigen::VectorXd residual;
  };
  struct Normal {
    Eigen::MatrixXd H;  ///< without priors
    Eigen::VectorXd g;
    double squares = 0.0;  ///< of the residual
  };

  void read(const std::vector<AddedEffect>& effects);
  [[nodiscard]] bool is_open(const EffectId& id) const;
  void set_gravity(const Eigen::Vector2d& tilt_deg);
  void tilt_base(const Eigen::Vector2d& tilt_deg);
  void set_gravity(std::shared_ptr<const GravityCase> gravity);
  void set_gravity_start(int start);
  void set_widths(const Eigen::VectorXd& widths);
  void choose_gravity_start(Added& gravity);
  [[nodiscard]] double step();
  /// `move`: widths, too.
  [[nodiscard]] Eigen::VectorXd solve(const Normal& normal, bool move) const;
  void keep_best_widths(const Normal& equations);
  void settle_on_best_widths();
  void apply(const Eigen::VectorXd& change);
  void take_load_of_base();
  void move_widths(const Eigen::VectorXd& change);
  [[nodiscard]] bool at_a_bound(Eigen::Index turning, double change) const;
  [[nodiscard]] Eigen::MatrixXd observed() const;
  [[nodiscard]] Eigen::MatrixXd sensor() const;
  [[nodiscard]] double lag_s(Eigen::Index joint) const;
  [[nodiscard]] Eigen::MatrixXd lagged(Eigen::MatrixXd torque) const;
  [[nodiscard]] JointTorques seen(const JointTorques& torques, const Eigen::MatrixXd& sensor) const;
  [[nodiscard]] Eigen::VectorXd lag_column(const Eigen::VectorXd& torque, double constant_s) const;
  void make_torques();
  [[nodiscard]] std::vector<JointTorques> measured_columns(const Eigen::MatrixXd& physical) const;
  [[nodiscard]] Eigen::MatrixXd width_columns() const;
  [[nodiscard]] Eigen::MatrixXd turning_friction(double factor) const;
  [[nodiscard]] Eigen::VectorXd declared_coulomb(Eigen::Index joint,
                                                 const EffectContext& context) const;
  [[nodiscard]] Eigen::MatrixXd physical() const;
  [[nodiscard]] Eigen::Index own_parameters() const { return base_values_.size() + free_widths(); }
  [[nodiscard]] Eigen::Index free_widths() const { return std::ssize(turning_); }
  void make_design();
  void put_base(Eigen::Index joint, const Eigen::MatrixXd& sensor);
  [[nodiscard]] Normal normal() const;
  [[nodiscard]] Eigen::Matrix2d turn_of_tilt(const Eigen::Vector2d& tilt_deg) const;
  [[nodiscard]] TracedFit read_back(bool converged) const;
  [[nodiscard]] Eigen::MatrixXd residual() const;
  [[nodiscard]] double noise_memory(const Eigen::VectorXi& trajectory) const;
  [[nodiscard]] Eigen::MatrixXd own_prior() const;
  void name_covariates(TracedFit& out) const;

  const TorqueTracedModel::Parts& parts_;
  Eigen::Index joints_ = 0;
  Eigen::Index instants_ = 0;
  std::vector<Added> added_;
  std::vector<Eigen::Index> turning_;  ///< joints with Coulomb friction: their widths are free
  Eigen::Index effect_parameters_ = 0;
  std::shared_ptr<const GravityCase> case_;
  EffectContext context_;
  std::vector<Candidate> candidates_;  ///< of the added effects' kinds, at the present state
  Eigen::VectorXd base_values_;
  // Logarithms of the widths a step ago, and what that step asked for: for the secant.
  Eigen::VectorXd last_widths_, last_change_;
  Eigen::VectorXd best_widths_;  ///< so far; empty before the first step
  double least_left_ = 0.0;      ///< beside them, sum of squares
  // Of the last step, one a joint. Parameters: base, widths, effects.
  std::vector<JointDesign> design_;
};

}  // namespace effects
}  // namespace kinescope
