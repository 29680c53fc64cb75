// SPDX-License-Identifier: Apache-2.0
//
// Takes   a DynamicModel (kinematics, gravity, masses if known) and TorqueSamples.
// Gives   TorqueTracedModel: the log as calib/trace looks at it, rigid bodies as the base model and
//         the torque library of effects as what it may lack.
// Units   N m (N for joints that slide) or A; rows are joints within instants.
// Method  base parameters or declared masses (identify); columns low-passed as the torque is
//         (Gautier 1997); Gauss-Newton for delay, gain and gravity, all else is linear.
// Not here: which effect it is (calib/trace), contact spans (contact_spans.h), driver
// (trace_torque.h).
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "calib/trace/traced_model.h"
#include "dynamics/data/torque_samples.h"
#include "dynamics/effects/effect_library.h"
#include "dynamics/effects/effect_motion.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

enum class TorqueBaseKind {
  kAuto,
  kDeclared,   ///< masses, motor inertia and friction as the model has them; nothing is free
  kIdentified  ///< the rigid bodies' base parameters are free; effects come on top
};

/// "auto", "declared", "identified".
[[nodiscard]] std::string_view to_string(TorqueBaseKind kind);

struct TracedTorqueOptions {
  TorqueBaseKind base = TorqueBaseKind::kAuto;
  /// Declared masses are trusted while their held-out error is not above that of identified ones by
  /// more than this factor, all other terms being free for both, or that is not clear.
  double trust_factor = 1.05;
  TorqueFilter filter = {};  ///< that the samples went through
  int most_instants = 2500;
  int folds = 8;  ///< trajectories where there are at least five paths, else stretches of time
  FrictionWidths widths = {};
  Eigen::VectorXd temperature_c = {};  ///< of every sample; empty: not logged
};

/// What the effects come on top of, and how that was chosen.
struct TorqueBase {
  TorqueBaseKind kind = TorqueBaseKind::kIdentified;
  std::string reason;           ///< in one sentence
  double declared_error = 0.0;  ///< held-out, whitened; NaN where it was not looked at
  double identified_error = 0.0;
  Eigen::VectorXd sigma;  ///< noise of each joint's torque, on what no linear term explains
  RigidModel rigid;       ///< bodies that give the base's torque
};

/// What a fit found beside the effects.
struct FittedTorque {
  RigidModel rigid;                  ///< bodies identified, or as declared; gravity as found
  Eigen::VectorXd widths;            ///< of each joint: speed within which its friction turns round
  Eigen::VectorXd viscous, coulomb;  ///< friction of the base, as declared
};

class TorqueTracedModel : public TracedModel {
 public:
  /// One flag a sample: those of 0 do not count.
  using Kept = std::function<std::vector<char>(const EffectMotion& motion)>;

  /// Throws bad_request for arrays or options that do not fit; undetermined for logs too short.
  TorqueTracedModel(const DynamicModel& model, const TorqueSamples& samples,
                    const TracedTorqueOptions& options = {}, const Kept& kept = {});
  ~TorqueTracedModel() override;

  [[nodiscard]] TracedFit fit(const std::vector<AddedEffect>& effects) const override;

  [[nodiscard]] const TorqueBase& base() const;
  [[nodiscard]] const EffectMotion& motion() const;
  [[nodiscard]] const EffectContext& context() const;

  /// Samples for which `wanted` is 0 count no more. Throws undetermined where too few are left.
  void leave_out(const std::vector<char>& wanted);

  /// What every instant's torque lacks after a fit, in the unit of the torque: instants x joints.
  [[nodiscard]] Eigen::MatrixXd residual_torque(const TracedFit& fit) const;
  [[nodiscard]] FittedTorque fitted(const std::vector<AddedEffect>& effects) const;

  struct Parts;  ///< internal

 private:
  std::unique_ptr<Parts> parts_;
};

}  // namespace kinescope
