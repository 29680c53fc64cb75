// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/torque_effects.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "dynamics/rigid/inverse_dynamics.h"
#include "tests/truth/random_dynamics.h"
#include "tests/truth/random_robot.h"

namespace kinescope {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kPrismaticMetrePerRad = 0.2;
constexpr double kSettling = 0.5;  // time constant of a drift, of the log
constexpr double kPickedUp = 0.4;  // when a load is picked up, of the log

struct State {
  Eigen::VectorXd q, dq, ddq;
};

/// A sum of sines for every joint, known at all times.
class Motion {
 public:
  Motion(const RigidModel& rigid, const EffectWorldOptions& options, Rng& rng) {
    for (const RigidBody& body : rigid.bodies) {
      Joint joint;
      const double size =
          (body.type == JointType::kRevolute ? 1.0 : kPrismaticMetrePerRad) * options.amplitude_rad;
      double sum = 0.0;
      for (Sine& sine : joint) {
        sine.omega = kTurn * rng.uniform(0.05, options.highest_hz);
        sine.amplitude = rng.uniform(0.3, 1.0);
        sine.phase = rng.uniform(0.0, kTurn);
        sum += sine.amplitude;
      }
      for (Sine& sine : joint) sine.amplitude *= 2.0 * size / sum;
      joints_.push_back(joint);
    }
  }

  [[nodiscard]] State at(double t_s) const {
    const auto n = static_cast<Eigen::Index>(joints_.size());
    State out{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n)};
    for (Eigen::Index j = 0; j < n; ++j) {
      for (const Sine& sine : joints_[static_cast<std::size_t>(j)]) {
        const double angle = sine.omega * t_s + sine.phase;
        out.q[j] += sine.amplitude * std::sin(angle);
        out.dq[j] += sine.amplitude * sine.omega * std::cos(angle);
        out.ddq[j] -= sine.amplitude * sine.omega * sine.omega * std::sin(angle);
      }
    }
    return out;
  }

 private:
  struct Sine {
    double amplitude = 0.0, omega = 0.0, phase = 0.0;
  };
  using Joint = std::array<Sine, 8>;
  std::vector<Joint> joints_;
};

/// What each joint does on average, for strengths that mean the same on all of them.
struct Scales {
  Eigen::VectorXd torque, speed, acceleration, range;
};

class World {
 public:
  World(const std::vector<TrueEffect>& effects, const EffectWorldOptions& options, Rng& rng)
      : effects_(effects), options_(options) {
    RandomRobotOptions robot;
    robot.joints = options.joints;
    robot.prismatic_share = options.prismatic_share;
    declared_ = random_masses(random_robot(robot, rng).tree,
                              {.every_direction = false, .motors = false}, rng);
    rigid_ = make_rigid_model(declared_);
    motion_.emplace_back(rigid_, options, rng);
    phase_ = rng.uniform(0.0, kTurn);
    measure();
    declare_friction();
    truth_ = loaded_ = declared_;
    apply_to_model();
    true_rigid_ = make_rigid_model(truth_);
    loaded_rigid_ = make_rigid_model(loaded_);
    start_states();
  }

  EffectWorld make(Rng& rng) {
    EffectWorld out;
    out.model = declared_;
    const auto rows = static_cast<Eigen::Index>(options_.duration_s * options_.rate_hz);
    const Eigen::Index n = rigid_.size();
    TorqueLog& log = out.log;
    log.sources = {"truth"};
    log.trajectory_names = {"truth"};
    log.trajectory = Eigen::VectorXi::Zero(rows);
    log.source.assign(static_cast<std::size_t>(rows), 0);
    log.lines.assign(static_cast<std::size_t>(rows), 0);
    for (const RigidBody& body : rigid_.bodies) {
      log.joints.push_back({body.joint, body.type == JointType::kPrismatic});
    }
    log.t_s.resize(rows);
    log.q.resize(rows, n);
    out.torque.resize(rows, n);
    for (Eigen::Index t = 0; t < rows; ++t) {
      log.t_s[t] = static_cast<double>(t) / options_.rate_hz;
      const State now = motion_[0].at(log.t_s[t]);
      log.q.row(t) = now.q.transpose();
      out.torque.row(t) = measured(log.t_s[t]).transpose();
    }
    log.torque = out.torque;
    add_noise(log, rng);
    out.effects = known_;
    return out;
  }

 private:
  void measure() {
    constexpr int kStates = 400;
    const Eigen::Index n = rigid_.size();
    Scales sum{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n),
               Eigen::VectorXd::Zero(n)};
    Eigen::VectorXd low = Eigen::VectorXd::Constant(n, 1e9);
    Eigen::VectorXd high = -low;
    for (int k = 0; k < kStates; ++k) {
      const State s = motion_[0].at(options_.duration_s * k / kStates);
      sum.torque += inverse_dynamics(rigid_, s.q, s.dq, s.ddq).cwiseAbs2() / kStates;
      sum.speed += s.dq.cwiseAbs2() / kStates;
      sum.acceleration += s.ddq.cwiseAbs2() / kStates;
      low = low.cwiseMin(s.q);
      high = high.cwiseMax(s.q);
    }
    scales_ = {sum.torque.cwiseSqrt(), sum.speed.cwiseSqrt(), sum.acceleration.cwiseSqrt(),
               high - low};
  }

  void declare_friction() {
    const std::vector<JointId> joints = moving_joints(declared_.tree);
    for (Eigen::Index j = 0; j < rigid_.size(); ++j) {
      JointDynamics& joint = declared_.joints[joints[static_cast<std::size_t>(j)].index()];
      joint.coulomb = options_.declared_coulomb * scales_.torque[j];
      joint.viscous = options_.declared_viscous * scales_.torque[j] / scales_.speed[j];
    }
  }

  [[nodiscard]] std::string name(int joint) const {
    return rigid_.bodies[static_cast<std::size_t>(joint)].joint;
  }

  void know(const TrueEffect& effect, double size) {
    known_.push_back({effect.effect, name(effect.joint), size});
  }

  /// Effects that are another robot, or the same robot standing elsewhere.
  void apply_to_model() {
    for (const TrueEffect& effect : effects_) {
      if (effect.effect == "payload" || effect.effect == "payload_change") {
        const LinkId link{static_cast<int>(truth_.links.size()) - 1};
        const double mass = effect.strength * truth_.links[link.index()].mass_kg;
        const Eigen::Vector3d centre(0.03, -0.02, 0.06);
        DynamicModel& carrier = effect.effect == "payload" ? truth_ : loaded_;
        carrier.links[link.index()] +=
            from_central({.mass_kg = mass,
                          .centre_m = centre,
                          .inertia_kgm2 = 4e-4 * mass * Eigen::Matrix3d::Identity()});
        known_.push_back({effect.effect, truth_.tree.links[link.index()].name, mass});
      }
      if (effect.effect == "gravity_direction") {
        const double angle = effect.strength * std::numbers::pi / 180.0;
        const Eigen::Vector3d axis(std::cos(phase_), std::sin(phase_), 0.0);
        truth_.gravity_m_s2 = Eigen::AngleAxisd(angle, axis) * truth_.gravity_m_s2;
        known_.push_back({"gravity_direction", "base", effect.strength});
      }
    }
  }

  void start_states() {
    dahl_.assign(effects_.size(), 0.0);
    dahl_time_.assign(effects_.size(), 0.0);
    for (const TrueEffect& e : effects_) {
      if (e.effect.starts_with("payload") || e.effect == "gravity_direction") continue;
      const double torque = e.strength * scales_.torque[e.joint];
      if (e.effect == "viscous") know(e, torque / scales_.speed[e.joint]);
      if (e.effect == "coulomb" || e.effect == "stribeck" || e.effect == "hysteresis" ||
          e.effect == "position_friction" || e.effect == "ripple" || e.effect == "torque_offset" ||
          e.effect == "contact" || e.effect == "snag") {
        know(e, torque);
      }
      if (e.effect == "drift") know(e, torque * (1.0 - std::exp(-1.0 / kSettling)));
      if (e.effect == "asymmetric") know(e, torque / scales_.speed[e.joint]);
      if (e.effect == "cubic_viscous") know(e, 0.0);
      if (e.effect == "load_friction" || e.effect == "torque_gain" || e.effect == "torque_delay" ||
          e.effect == "torque_lag") {
        know(e, e.strength);
      }
      if (e.effect == "motor_inertia") know(e, torque / scales_.acceleration[e.joint]);
      if (e.effect == "spring") know(e, torque / (0.3 * scales_.range[e.joint]));
      if (e.effect == "cross_talk") {
        known_.push_back(
            {e.effect, name(e.joint) + " from " + name(e.other), torque / scales_.torque[e.other]});
      }
    }
  }

  [[nodiscard]] double width(Eigen::Index joint) const {
    const bool turns = rigid_.bodies[static_cast<std::size_t>(joint)].type == JointType::kRevolute;
    return options_.width_rad_s * (turns ? 1.0 : kPrismaticMetrePerRad);
  }

  [[nodiscard]] double sign_of(double speed, Eigen::Index joint) const {
    return std::tanh(speed / width(joint));
  }

  /// dz/dt = (dq - |dq| z) / length, in small steps from the last time on.
  double dahl(std::size_t index, Eigen::Index joint, double t_s, double length) {
    constexpr double kStep_s = 2e-4;
    double& z = dahl_[index];
    double& t = dahl_time_[index];
    while (t < t_s) {
      const double step = std::min(kStep_s, t_s - t);
      const auto slope = [&](double at, double state) {
        const double v = motion_[0].at(at).dq[joint];
        return (v - std::abs(v) * state) / length;
      };
      const double middle = z + 0.5 * step * slope(t, z);
      z += step * slope(t + 0.5 * step, middle);
      t += step;
    }
    return z;
  }

  [[nodiscard]] double range_unit(Eigen::Index joint) const { return scales_.range[joint]; }

  /// Torque that the drives give at a time.
  [[nodiscard]] Eigen::VectorXd physical(double t_s) {
    const State s = motion_[0].at(t_s);
    Eigen::VectorXd rigid = inverse_dynamics(true_rigid_, s.q, s.dq, s.ddq);
    if (t_s >= kPickedUp * options_.duration_s) {
      rigid += inverse_dynamics(loaded_rigid_, s.q, s.dq, s.ddq) -
               inverse_dynamics(rigid_, s.q, s.dq, s.ddq);
    }
    Eigen::VectorXd out = rigid;
    const std::vector<JointId> joints = moving_joints(truth_.tree);
    for (Eigen::Index j = 0; j < out.size(); ++j) {
      const JointDynamics& joint = truth_.joints[joints[static_cast<std::size_t>(j)].index()];
      out[j] += joint.viscous * s.dq[j] + joint.coulomb * sign_of(s.dq[j], j);
    }
    for (std::size_t e = 0; e < effects_.size(); ++e) {
      const TrueEffect& effect = effects_[e];
      out[effect.joint] += torque_of(effect, e, s, rigid[effect.joint], t_s);
    }
    return out;
  }

  double torque_of(const TrueEffect& effect, std::size_t index, const State& s, double load,
                   double t_s) {
    const Eigen::Index j = effect.joint;
    const double v = s.dq[j];
    const double q = s.q[j];
    const double size = effect.strength * scales_.torque[j];
    const double speed = scales_.speed[j];
    const std::string& kind = effect.effect;
    const bool turns = rigid_.bodies[static_cast<std::size_t>(j)].type == JointType::kRevolute;
    const double angle = turns ? q : kTurn * q / scales_.range[j];
    if (kind == "viscous") return size * v / speed;
    if (kind == "coulomb") return size * sign_of(v, j);
    if (kind == "asymmetric") return v > 0.0 ? size * v / speed : -size * v / speed;
    if (kind == "stribeck") {
      return size * std::exp(-std::pow(v / (0.2 * speed), 2)) * sign_of(v, j);
    }
    if (kind == "cubic_viscous") return size * std::pow(v / speed, 3);
    if (kind == "load_friction") return effect.strength * std::abs(load) * sign_of(v, j);
    if (kind == "position_friction") return size * std::cos(angle + phase_) * sign_of(v, j);
    if (kind == "hysteresis") return size * dahl(index, j, t_s, 0.03 * scales_.range[j]);
    if (kind == "motor_inertia") return size * s.ddq[j] / scales_.acceleration[j];
    if (kind == "spring") return size * (q - 0.1 * scales_.range[j]) / (0.3 * scales_.range[j]);
    if (kind == "ripple") return size * std::sin(11.0 * angle + phase_);
    if (kind == "torque_offset") return size;
    if (kind == "drift") return size * (1.0 - std::exp(-t_s / (kSettling * options_.duration_s)));
    if (kind == "snag")
      return size * std::tanh(20.0 * (q - 0.1 * scales_.range[j]) / scales_.range[j]);
    if (kind == "contact") {
      const double since = t_s - 0.6 * options_.duration_s;
      constexpr double kSpan_s = 0.4;
      if (since < 0.0 || since > kSpan_s) return 0.0;
      return size * std::min({1.0, since / (0.2 * kSpan_s), (kSpan_s - since) / (0.2 * kSpan_s)});
    }
    return 0.0;
  }

  /// The mean of what was, weighted by e^(-age / constant): at the middles of equal weights.
  double lagged(const TrueEffect& effect, double t_s) {
    constexpr int kParts = 200;
    double sum = 0.0;
    for (int k = 0; k < kParts; ++k) {
      const double age = -effect.strength * std::log((k + 0.5) / kParts);
      sum += physical(t_s - age)[effect.joint];
    }
    return sum / kParts;
  }

  /// What the sensors say at a time.
  Eigen::VectorXd measured(double t_s) {
    const Eigen::VectorXd now = physical(t_s);
    Eigen::VectorXd out = now;
    // What is late is what the sensor's gain and cross-talk then bear on.
    for (const TrueEffect& effect : effects_) {
      if (effect.effect == "torque_delay")
        out[effect.joint] = physical(t_s - effect.strength)[effect.joint];
      if (effect.effect == "torque_lag") out[effect.joint] = lagged(effect, t_s);
    }
    for (const TrueEffect& effect : effects_) {
      const Eigen::Index j = effect.joint;
      if (effect.effect == "torque_gain") out[j] *= 1.0 + effect.strength;
      if (effect.effect == "cross_talk") {
        out[j] +=
            effect.strength * scales_.torque[j] / scales_.torque[effect.other] * now[effect.other];
      }
    }
    return out;
  }

  void add_noise(TorqueLog& log, Rng& rng) const {
    for (Eigen::Index j = 0; j < log.q.cols(); ++j) {
      const bool turns = rigid_.bodies[static_cast<std::size_t>(j)].type == JointType::kRevolute;
      const double position = options_.position_noise_rad * (turns ? 1.0 : kPrismaticMetrePerRad);
      const double memory = options_.noise_memory;
      double state = rng.normal();
      for (Eigen::Index t = 0; t < log.rows(); ++t) {
        log.q(t, j) += rng.normal(position);
        state = memory * state + std::sqrt(1.0 - memory * memory) * rng.normal();
        log.torque(t, j) += options_.noise * scales_.torque[j] * state;
      }
    }
  }

  std::vector<TrueEffect> effects_;
  EffectWorldOptions options_;
  DynamicModel declared_, truth_;
  DynamicModel loaded_;  ///< as declared, with what is picked up
  RigidModel rigid_, true_rigid_, loaded_rigid_;
  std::vector<Motion> motion_;
  Scales scales_;
  double phase_ = 0.0;
  std::vector<double> dahl_, dahl_time_;
  std::vector<KnownEffect> known_;
};

}  // namespace

std::vector<std::string> known_torque_effects() {
  return {"viscous",           "coulomb",       "asymmetric",
          "stribeck",          "cubic_viscous", "load_friction",
          "position_friction", "hysteresis",    "motor_inertia",
          "payload",           "spring",        "ripple",
          "torque_offset",     "torque_gain",   "cross_talk",
          "torque_delay",      "torque_lag",    "drift",
          "gravity_direction", "contact",       "payload_change"};
}

EffectWorld effect_world(const std::vector<TrueEffect>& effects, const EffectWorldOptions& options,
                         Rng& rng) {
  World world(effects, options, rng);
  return world.make(rng);
}

}  // namespace kinescope
