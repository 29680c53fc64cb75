// SPDX-License-Identifier: Apache-2.0
//
// measured(t + delay) = lag (sensor * (rigid bodies + effects))(t), forwards and backwards.
#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "dynamics/effects/candidates.h"
#include "dynamics/effects/trace_torque.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

/// An effect's part in the equation above.
enum class Part { kPhysical, kDelay, kLag, kGain, kCross, kGravity };

Part part_of(const TorqueEffect& effect) {
  if (effect.id.effect == "torque_delay") return Part::kDelay;
  if (effect.id.effect == "torque_lag") return Part::kLag;
  if (effect.id.effect == "torque_gain") return Part::kGain;
  if (effect.id.effect == "gravity_direction") return Part::kGravity;
  if (effect.id.effect == "cross_talk" && effect.values.size() == 1) return Part::kCross;
  return Part::kPhysical;
}

/// Effects come from files, too.
Error foreign(const TorqueEffect& effect) {
  return bad_input("traced effects",
                   effect.id.effect + " at " + effect.id.place + " is none of this robot",
                   "trace a log of the robot again");
}

/// A log at all of its samples, and its library.
struct Applied {
  const CorrectedTorqueModel& corrected;
  EffectContext context;
  EffectLibrary library;

  Applied(const CorrectedTorqueModel& model, const TorqueSamples& samples,
          const TorqueFilter& filter)
      : corrected(model) {
    context.motion = std::make_shared<const EffectMotion>(
        samples, EffectMotionOptions{.filter = filter, .every_sample = true});
    context.cache = std::make_shared<ColumnCache>();
    context.torque_unit = samples.torque_unit;
    context.rigid = model.base.rigid;
    for (const RigidBody& body : model.base.rigid.bodies) {
      context.joints.push_back(body.joint);
      context.turns.push_back(body.type == JointType::kRevolute ? 1 : 0);
    }
    context.widths = model.base.widths;
    context.gravity_moves = tilt_moves(context.rigid.gravity_m_s2);
    context.load =
        inverse_dynamics_of_samples(model.base.rigid, samples.q, samples.dq, samples.ddq);
    context.torque = context.load;
    context.measured_rate = Eigen::MatrixXd::Zero(samples.size(), samples.joints());
    context.travels = model.travels;
    context.log = model.log;
    library = {make_candidates(context), make_carriers(context)};
  }

  [[nodiscard]] Eigen::Index joint_of(const TorqueEffect& effect) const {
    const auto& names = context.joints;
    const auto found = std::ranges::find_if(names, [&](const std::string& name) {
      return effect.id.place == name || effect.id.place.starts_with(name + " ");
    });
    if (found == names.end()) throw foreign(effect);
    return found - names.begin();
  }

  /// Torque of the bodies with the friction that was declared.
  [[nodiscard]] Eigen::MatrixXd base() const {
    Eigen::MatrixXd out = context.load;
    for (Eigen::Index j = 0; j < out.cols(); ++j) {
      out.col(j) += corrected.base.viscous[j] * context.motion->samples().dq.col(j);
      if (corrected.base.coulomb[j] == 0.0) continue;
      out.col(j) += corrected.base.coulomb[j] *
                    effects::direction_column(context, static_cast<std::size_t>(j));
    }
    return out;
  }

  /// Torque of the effects that are no matter of the sensors.
  [[nodiscard]] Eigen::MatrixXd effects() const {
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(context.load.rows(), context.load.cols());
    for (const TorqueEffect& effect : corrected.effects) {
      if (part_of(effect) != Part::kPhysical) continue;
      const Candidate* candidate = library.find(effect.id);
      if (candidate == nullptr) continue;  // a temperature that this log does not have
      if (effect.values.size() != std::ssize(candidate->parameters)) throw foreign(effect);
      out += effect_torque(library.carriers, *candidate, effect.scan, effect.values, out.cols());
    }
    return out;
  }

  [[nodiscard]] Eigen::MatrixXd sensor() const {
    Eigen::MatrixXd out = Eigen::MatrixXd::Identity(context.load.cols(), context.load.cols());
    for (const TorqueEffect& effect : corrected.effects) {
      const Eigen::Index j =
          part_of(effect) == Part::kGain || part_of(effect) == Part::kCross ? joint_of(effect) : 0;
      if (part_of(effect) == Part::kGain) out(j, j) += effect.values[0];
      if (part_of(effect) != Part::kCross) continue;
      for (std::size_t from = 0; from < context.joints.size(); ++from) {
        if (effect.id.place.ends_with(" from " + context.joints[from])) {
          out(j, static_cast<Eigen::Index>(from)) += effect.values[0];
        }
      }
    }
    return out;
  }

  /// What the sensors make of torques in time: behind each joint's low-pass, and late.
  [[nodiscard]] Eigen::MatrixXd late(Eigen::MatrixXd torque) const {
    const EffectMotion& motion = *context.motion;
    for (const Part part : {Part::kLag, Part::kDelay}) {
      for (const TorqueEffect& effect : corrected.effects) {
        if (part_of(effect) != part) continue;
        auto column = torque.col(joint_of(effect));
        column = part == Part::kLag ? motion.lagged(column, effect.values[0])
                                    : motion.shifted(column, -effect.values[0]);
      }
    }
    return torque;
  }

  /// The other way round.
  [[nodiscard]] Eigen::MatrixXd in_time(Eigen::MatrixXd torque) const {
    const EffectMotion& motion = *context.motion;
    for (const Part part : {Part::kDelay, Part::kLag}) {
      for (const TorqueEffect& effect : corrected.effects) {
        if (part_of(effect) != part) continue;
        auto column = torque.col(joint_of(effect));
        column = part == Part::kLag ? motion.before_lag(column, effect.values[0])
                                    : motion.shifted(column, effect.values[0]);
      }
    }
    return torque;
  }
};

}  // namespace

Eigen::MatrixXd predict_torque(const CorrectedTorqueModel& corrected, const TorqueSamples& samples,
                               const TorqueFilter& filter) {
  const Applied applied(corrected, samples, filter);
  const Eigen::MatrixXd physical = applied.base() + applied.effects();
  return applied.late(physical * applied.sensor().transpose());
}

TorqueSamples compensate(const CorrectedTorqueModel& corrected, const TorqueSamples& samples,
                         const TorqueFilter& filter) {
  const Applied applied(corrected, samples, filter);
  TorqueSamples out = samples;
  const Eigen::MatrixXd in_time = applied.in_time(samples.torque);
  out.torque =
      applied.sensor().fullPivLu().solve(in_time.transpose()).transpose() - applied.effects();
  return out;
}

}  // namespace kinescope
