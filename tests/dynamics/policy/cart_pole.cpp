// SPDX-License-Identifier: Apache-2.0
#include "tests/dynamics/policy/cart_pole.h"

#include <cmath>
#include <numbers>

#include "kinematics/core/rng.h"

namespace kinescope::policy {
namespace {

constexpr double kGravity = 9.81;
constexpr int kSubsteps = 10;

// Lagrange's equations of a cart and a rod of uniform mass; state x, angle, x', angle'.
Eigen::Vector4d derivative(const CartPoleNumbers& n, const Eigen::Vector4d& x, double force) {
  const double s = std::sin(x[1]);
  const double c = std::cos(x[1]);
  const double rate = x[3];
  const double total = n.cart_kg + n.pole_kg;
  const double denominator = 4.0 * total - 3.0 * n.pole_kg * c * c;
  const double pull = force - n.friction * x[2];
  const double cart = (2.0 * n.pole_kg * n.length_m * rate * rate * s +
                       3.0 * n.pole_kg * kGravity * s * c + 4.0 * pull) /
                      denominator;
  const double pole = (-3.0 * n.pole_kg * n.length_m * rate * rate * s * c -
                       6.0 * total * kGravity * s - 6.0 * pull * c) /
                      (n.length_m * denominator);
  return {x[2], x[3], cart, pole};
}

Eigen::Vector4d advance(const CartPoleNumbers& n, Eigen::Vector4d x, double force, double step) {
  const double h = step / kSubsteps;
  for (int i = 0; i < kSubsteps; ++i) {
    const Eigen::Vector4d a = derivative(n, x, force);
    const Eigen::Vector4d b = derivative(n, x + 0.5 * h * a, force);
    const Eigen::Vector4d c = derivative(n, x + 0.5 * h * b, force);
    const Eigen::Vector4d d = derivative(n, x + h * c, force);
    x += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
  }
  return x;
}

}  // namespace

CartPole::CartPole(const CartPoleNumbers& numbers)
    : numbers_(numbers),
      layout_{{"cart", "pole"},
              {false, true},
              {"force"},
              Eigen::VectorXd::Constant(1, numbers.force_n),
              0.05} {}

Trial CartPole::run(const Controller& controller, int steps, std::uint64_t seed, int trial) const {
  Rng rng = Rng::from_name("cart pole", seed * 1000 + static_cast<std::uint64_t>(trial));
  Trial out{
      Eigen::MatrixXd(steps + 1, 4), {}, Eigen::MatrixXd(steps + 1, 4), Eigen::MatrixXd(steps, 1)};
  Eigen::Vector4d x;
  for (double& value : x) value = rng.normal(numbers_.start_sigma);
  for (int k = 0; k <= steps; ++k) {
    out.truth.row(k) = x.transpose();
    for (int i = 0; i < 4; ++i) out.seen(k, i) = x[i] + rng.normal(numbers_.noise);
    if (k == steps) break;
    out.inputs.row(k) = controller(out.seen.row(k).transpose(), k).transpose();
    x = advance(numbers_, x, out.inputs(k, 0), layout_.step_s);
  }
  out.smoothed = out.seen;
  return out;
}

PolicyTask cart_pole_task(const CartPoleNumbers& numbers) {
  PolicyTask out;
  out.cost.terms = {{0, 0.0, 1.0, CostError::kDifference},
                    {1, std::numbers::pi, 3.0, CostError::kAbsolute}};
  out.start.means = Eigen::MatrixXd::Zero(1, 4);
  out.start.sigma = Eigen::VectorXd::Constant(4, numbers.start_sigma);
  out.steps = 60;
  return out;
}

bool upright(const Trial& trial) {
  constexpr double kReach_m = 0.1;
  const double lean_rad = std::numbers::pi / 18.0;
  for (Eigen::Index k = trial.truth.rows() - 20; k < trial.truth.rows(); ++k) {
    const double angle = std::abs(std::abs(trial.truth(k, 1)) - std::numbers::pi);
    if (std::abs(trial.truth(k, 0)) >= kReach_m || angle > lean_rad) return false;
  }
  return true;
}

}  // namespace kinescope::policy
