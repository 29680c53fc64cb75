// SPDX-License-Identifier: Apache-2.0
//
// The torque laws of drives, of one sample or of many: the library of effects traces them, and
// dynamics/simulation moves a robot by them. What was traced is what is simulated.
// Armstrong-Helouvry, Dupont, Canudas de Wit 1994; pre-sliding: Dahl 1968.
#pragma once

#include <cmath>
#include <numbers>

#include <Eigen/Core>

namespace kinescope::effects {

/// Speed within which the friction of a coupled drive changes its direction, rad/s.
inline constexpr double kCoupledWidth_rad_s = 0.01;

[[nodiscard]] inline double sign_of(double x) { return static_cast<double>((x > 0.0) - (x < 0.0)); }
[[nodiscard]] inline Eigen::ArrayXd sign_of(const Eigen::ArrayXd& x) { return x.sign(); }

/// Direction of the speed, smooth within `width`, as Coulomb friction has it; 0: its sign.
template <typename Value>
[[nodiscard]] Value direction(const Value& dq, double width) {
  using std::tanh;
  if (width == 0.0) return sign_of(dq);
  const Value ratio = dq / width;
  return tanh(ratio);
}

/// How Stribeck's excess over Coulomb friction decays with the speed.
template <typename Value>
[[nodiscard]] Value stribeck_decay(const Value& dq, double speed) {
  using std::exp;
  const Value ratio = dq / speed;
  return exp(-(ratio * ratio));
}

/// sign(dq) |dq / high|^power.
template <typename Value>
[[nodiscard]] Value speed_power(const Value& dq, double high, double power) {
  using std::abs;
  using std::pow;
  const Value ratio = abs(dq) / high;
  return sign_of(dq) * pow(ratio, power);
}

/// Radians of a ripple's phase per rad or m, of periods a turn or a metre.
[[nodiscard]] inline double wave_number(bool turns, double periods) {
  return turns ? periods : 2.0 * std::numbers::pi * periods;
}

template <typename Value>
[[nodiscard]] Value wave_cosine(const Value& q, double number) {
  using std::cos;
  const Value phase = number * q;
  return cos(phase);
}

template <typename Value>
[[nodiscard]] Value wave_sine(const Value& q, double number) {
  using std::sin;
  const Value phase = number * q;
  return sin(phase);
}

/// Dahl's state after the joint `moved` one way: dz/dq = (1 - z sign(dq)) / length, solved exactly.
[[nodiscard]] inline double dahl_after(double state, double moved, double length) {
  if (moved == 0.0) return state;
  const double way = sign_of(moved);
  return way + (state - way) * std::exp(-std::abs(moved) / length);
}

/// From 0 at the start of a log to 1 at its end, settling with a time constant; long ones are
/// straight.
struct Settling {
  double begin_s = 0.0;
  double duration_s = 1.0;
  double constant_s = 1.0;

  [[nodiscard]] double end() const { return 1.0 - std::exp(-duration_s / constant_s); }
  [[nodiscard]] double at(double time_s) const {
    return (1.0 - std::exp(-(time_s - begin_s) / constant_s)) / end();
  }
  [[nodiscard]] Eigen::VectorXd at(const Eigen::VectorXd& time_s) const {
    return ((1.0 - (-(time_s.array() - begin_s) / constant_s).exp()) / end()).matrix();
  }
  [[nodiscard]] double mean() const { return 1.0 / end() - constant_s / duration_s; }
};

}  // namespace kinescope::effects
