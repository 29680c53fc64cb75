// SPDX-License-Identifier: Apache-2.0
#include "dynamics/simulation/plant.h"

#include <algorithm>
#include <array>
#include <functional>
#include <string_view>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

Error foreign(const TorqueEffect& effect, const std::string& what) {
  return bad_input("effects", fmt::format("{} at {} {}", effect.id.effect, effect.id.place, what),
                   "trace a log of this robot, or correct the list of effects");
}

/// Puts effects into a plant, one after another.
class Assembly {
 public:
  explicit Assembly(const CorrectedTorqueModel& model) : model_(model) {
    plant_.rigid = plant_.unloaded = model.base.rigid;
    const Eigen::Index n = plant_.rigid.size();
    plant_.coupled_inertia = Eigen::MatrixXd::Zero(n, n);
    plant_.viscous = model.base.viscous.asDiagonal();
    plant_.gain = Eigen::MatrixXd::Identity(n, n);
    plant_.delay_s = Eigen::VectorXd::Zero(n);
    plant_.lag_s = plant_.delay_s;
    plant_.drives.resize(static_cast<std::size_t>(n));
    for (Eigen::Index j = 0; j < n; ++j) {
      JointDrive& drive = plant_.drives[static_cast<std::size_t>(j)];
      drive.coulomb = model.base.coulomb[j];
      drive.width = model.base.widths[j];
    }
  }

  void add(const TorqueEffect& effect) {
    const auto law = std::ranges::find(kLaws, effect.id.effect, &Law::name);
    if (law == kLaws.end()) throw foreign(effect, "is no effect that can be simulated");
    (this->*law->add)(effect);
  }

  [[nodiscard]] Plant take() { return std::move(plant_); }

 private:
  struct Law {
    std::string_view name;
    void (Assembly::*add)(const TorqueEffect&);
  };
  static const std::array<Law, 20> kLaws;

  [[nodiscard]] std::size_t joint_named(const TorqueEffect& effect, std::string_view name) const {
    const auto& bodies = plant_.rigid.bodies;
    const auto found = std::ranges::find(bodies, name, &RigidBody::joint);
    if (found == bodies.end()) throw foreign(effect, "is at no joint of this robot");
    return static_cast<std::size_t>(found - bodies.begin());
  }
  [[nodiscard]] std::size_t joint(const TorqueEffect& effect) const {
    return joint_named(effect, effect.id.place);
  }
  static double value(const TorqueEffect& effect, Eigen::Index parameter, Eigen::Index count) {
    if (effect.values.size() != count) {
      throw foreign(effect, fmt::format("has {} parameters where the effect has {}",
                                        effect.values.size(), count));
    }
    return effect.values[parameter];
  }
  [[nodiscard]] JointDrive& drive(const TorqueEffect& effect) {
    return plant_.drives[joint(effect)];
  }
  [[nodiscard]] double high_speed(const TorqueEffect& effect, std::size_t joint) const {
    if (model_.travels[joint].high_speed > 0.0) {
      return model_.travels[joint].high_speed;
    }
    throw foreign(effect, "is relative to the joint's highest speed, which is not known");
  }
  [[nodiscard]] double positive_scan(const TorqueEffect& effect) const {
    if (effect.scan > 0.0) return effect.scan;
    throw foreign(effect, fmt::format("has 'at' {}, which is not above 0", effect.scan));
  }
  [[nodiscard]] JointDrive::Wave wave(const TorqueEffect& effect, double sine, double cosine) {
    const bool turns = plant_.rigid.bodies[joint(effect)].type == JointType::kRevolute;
    return {effects::wave_number(turns, positive_scan(effect)), sine, cosine};
  }

  void viscous(const TorqueEffect& e) {
    const auto j = static_cast<Eigen::Index>(joint(e));
    plant_.viscous(j, j) += value(e, 0, 1);
  }
  void coulomb(const TorqueEffect& e) { drive(e).coulomb += value(e, 0, 1); }
  void asymmetric(const TorqueEffect& e) { drive(e).asymmetric += value(e, 0, 1); }
  void stribeck(const TorqueEffect& e) {
    drive(e).stribecks.push_back({value(e, 0, 1), positive_scan(e)});
  }
  void cubic_viscous(const TorqueEffect& e) {
    drive(e).powers.push_back({value(e, 0, 1), high_speed(e, joint(e)), positive_scan(e)});
  }
  void load_friction(const TorqueEffect& e) { drive(e).share_of_load += value(e, 0, 1); }
  void position_friction(const TorqueEffect& e) {
    drive(e).position_friction.push_back(wave(e, value(e, 1, 2), value(e, 0, 2)));
  }
  void hysteresis(const TorqueEffect& e) {
    drive(e).presliding.push_back({value(e, 0, 1), positive_scan(e)});
  }
  void motor_inertia(const TorqueEffect& e) {
    plant_.rigid.bodies[joint(e)].motor_inertia += value(e, 0, 1);
  }
  void spring(const TorqueEffect& e) {
    drive(e).stiffness += value(e, 0, 2);
    drive(e).offset += value(e, 1, 2);
  }
  void ripple(const TorqueEffect& e) {
    drive(e).ripples.push_back(wave(e, value(e, 0, 2), value(e, 1, 2)));
  }
  void drift(const TorqueEffect& e) {
    if (e.id.place.ends_with(" with temperature")) {
      plant_.left_out.push_back(fmt::format("{} at {}", e.id.effect, e.id.place));
      return;
    }
    const std::size_t j = joint(e);
    plant_.drives[j].drifts.push_back(
        {{model_.log.begin_s, model_.log.duration_s, positive_scan(e)},
         value(e, 0, 3),
         value(e, 1, 3),
         value(e, 2, 3) / high_speed(e, j)});
  }
  void torque_offset(const TorqueEffect& e) { drive(e).offset += value(e, 0, 1); }
  void torque_gain(const TorqueEffect& e) {
    const auto j = static_cast<Eigen::Index>(joint(e));
    plant_.gain(j, j) += value(e, 0, 1);
  }
  void torque_delay(const TorqueEffect& e) {
    plant_.delay_s[static_cast<Eigen::Index>(joint(e))] += value(e, 0, 1);
  }
  void torque_lag(const TorqueEffect& e) {
    const double constant_s = value(e, 0, 1);
    if (constant_s < 0.0) throw foreign(e, "has a time constant below 0");
    plant_.lag_s[static_cast<Eigen::Index>(joint(e))] += constant_s;
  }

  /// "a from b": what the sensor shows of another's torque. "a + b", "a - b": a coupled drive.
  void cross_talk(const TorqueEffect& e) {
    for (const std::string_view between : {" from ", " + ", " - "}) {
      const std::size_t at = e.id.place.find(between);
      if (at == std::string::npos) continue;
      const auto first = static_cast<Eigen::Index>(joint_named(e, e.id.place.substr(0, at)));
      const auto second =
          static_cast<Eigen::Index>(joint_named(e, e.id.place.substr(at + between.size())));
      if (between == " from ") {
        plant_.gain(first, second) += value(e, 0, 1);
      } else {
        couple(e, first, second, between == " + " ? 1.0 : -1.0);
      }
      return;
    }
    throw foreign(e, "names no pair of joints ('a from b', 'a + b' or 'a - b')");
  }
  void couple(const TorqueEffect& e, Eigen::Index first, Eigen::Index second, double sign) {
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(plant_.size());
    weights[first] = 1.0;
    weights[second] = sign;
    const double high = high_speed(e, static_cast<std::size_t>(first));
    plant_.viscous += value(e, 1, 3) / high * weights * weights.transpose();
    plant_.coupled_inertia += value(e, 2, 3) * weights * weights.transpose();
    if (value(e, 0, 3) != 0.0) plant_.coupled.push_back({weights, value(e, 0, 3)});
  }

  void payload(const TorqueEffect& e) {
    auto& bodies = plant_.rigid.bodies;
    const auto body = std::ranges::find(bodies, e.id.place, &RigidBody::name);
    if (body == bodies.end()) throw foreign(e, "is at no moving link of this robot");
    (void)value(e, 0, 10);
    body->inertia += InertialParameters::from_vector(e.values);
  }
  /// A plant has one set of bodies: those that the log began with.
  void payload_change(const TorqueEffect& e) {
    plant_.left_out.push_back(fmt::format("{} at {}", e.id.effect, e.id.place));
  }
  void gravity_direction(const TorqueEffect&) {}  // with the bodies of the base

  const CorrectedTorqueModel& model_;
  Plant plant_;
};

const std::array<Assembly::Law, 20> Assembly::kLaws = {
    {{"viscous", &Assembly::viscous},
     {"coulomb", &Assembly::coulomb},
     {"asymmetric", &Assembly::asymmetric},
     {"stribeck", &Assembly::stribeck},
     {"cubic_viscous", &Assembly::cubic_viscous},
     {"load_friction", &Assembly::load_friction},
     {"position_friction", &Assembly::position_friction},
     {"hysteresis", &Assembly::hysteresis},
     {"motor_inertia", &Assembly::motor_inertia},
     {"spring", &Assembly::spring},
     {"ripple", &Assembly::ripple},
     {"drift", &Assembly::drift},
     {"torque_offset", &Assembly::torque_offset},
     {"torque_gain", &Assembly::torque_gain},
     {"torque_delay", &Assembly::torque_delay},
     {"torque_lag", &Assembly::torque_lag},
     {"cross_talk", &Assembly::cross_talk},
     {"payload", &Assembly::payload},
     {"payload_change", &Assembly::payload_change},
     {"gravity_direction", &Assembly::gravity_direction}}};

}  // namespace

Plant make_plant(const CorrectedTorqueModel& model) {
  Assembly assembly(model);
  for (const TorqueEffect& effect : model.effects) assembly.add(effect);
  return assembly.take();
}

CorrectedTorqueModel with_effects(const DynamicModel& model, std::vector<TorqueEffect> effects,
                                  std::vector<JointTravel> travels, const LogSpan& log) {
  CorrectedTorqueModel out;
  out.model = model;
  out.effects = std::move(effects);
  out.in_model.assign(out.effects.size(), 0);
  const std::vector<JointId> joints = moving_joints(model.tree);
  out.travels = std::move(travels);
  out.travels.resize(joints.size());
  out.log = log;
  out.base.rigid = make_rigid_model(model);
  out.base.widths = Eigen::VectorXd::Zero(std::ssize(joints));
  out.base.viscous = out.base.coulomb = out.base.widths;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const JointDynamics& drive = model.joints[joints[j].index()];
    out.base.viscous[static_cast<Eigen::Index>(j)] = drive.viscous;
    out.base.coulomb[static_cast<Eigen::Index>(j)] = drive.coulomb;
  }
  for (const TorqueEffect& effect : out.effects) {
    if (effect.id.effect != "gravity_direction") continue;
    if (effect.values.size() != 2) throw foreign(effect, "has no two tilts");
    out.base.rigid.gravity_m_s2 = tilted(out.base.rigid.gravity_m_s2, effect.values);
  }
  return out;
}

Plant sticking(Plant plant) {
  for (JointDrive& drive : plant.drives) drive.width = 0.0;
  for (CoupledDrive& drive : plant.coupled) drive.width = 0.0;
  return plant;
}

}  // namespace kinescope
