// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/library.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "dynamics/policy/systems/ball_plate.h"
#include "dynamics/policy/systems/cart_pole.h"
#include "dynamics/policy/systems/double_pendulum.h"
#include "dynamics/policy/systems/furuta.h"
#include "dynamics/policy/systems/monomials.h"
#include "dynamics/policy/systems/simulated_system.h"
#include "dynamics/policy/systems/smoothing.h"
#include "kinematics/core/error.h"

namespace kinescope::policy {
namespace {

using Eigen::Matrix2Xd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using std::numbers::pi;

constexpr double kAnyValue = std::numeric_limits<double>::infinity();
constexpr double kDegree = pi / 180.0;

/// What a problem is, before its sensors.
struct Description {
  Mechanism mechanism;
  SaturatingCost cost = {};
  double horizon_s = 3.0;
  StartDistribution start = {};
  VectorXd noise = {};          ///< of measured states (2 P)
  double position_noise = 0.0;  ///< of positions, where these alone are measured
  VectorXd tolerance = {};      ///< P
  int trials = 5;
  std::vector<std::string> physics = {};  ///< monomials; empty: no semi-parametric kernel
  Skeleton skeleton = {};
};

StartDistribution at_rest(Eigen::Index positions, double sigma) {
  return {Eigen::MatrixXd::Zero(1, 2 * positions), VectorXd::Constant(2 * positions, sigma)};
}

VectorXd list(std::initializer_list<double> values) {
  return Eigen::Map<const VectorXd>(values.begin(), std::ssize(values));
}

Matrix2Xd polyline(std::initializer_list<Vector2d> points) {
  Matrix2Xd out(2, std::ssize(points));
  Eigen::Index column = 0;
  for (const Vector2d& point : points) out.col(column++) = point;
  return out;
}

// The benchmark of PILCO and MC-PILCO (Amadio et al., T-RO 2022): cost, noise, start and success.
Description cart_pole_problem(Sensing sensing) {
  CartPole values;
  // As seen by a camera that takes 30 images a second.
  if (sensing == Sensing::kPositionsOnly) values.step_s = 1.0 / 30.0;
  Description out{.mechanism = cart_pole(values)};
  out.cost.terms = {{0, 0.0, 1.0, CostError::kDifference}, {1, pi, 3.0, CostError::kAbsolute}};
  out.start = at_rest(2, 0.01);
  out.noise = VectorXd::Constant(4, 0.01);
  out.position_noise = 3e-3;
  out.tolerance = list({0.1, 10.0 * kDegree});
  out.physics = {"cart speed",
                 "force",
                 "pole speed^2*sin pole",
                 "force*cos pole",
                 "sin pole",
                 "sin pole*cos pole",
                 "pole speed^2*sin pole*cos pole",
                 "cart speed*cos pole"};
  const double length = values.length_m;
  out.skeleton.moving = [length](const VectorXd& p) {
    const Vector2d cart(p[0], 0.0);
    return polyline({cart, cart + length * Vector2d(std::sin(p[1]), -std::cos(p[1]))});
  };
  out.skeleton.fixed = polyline({{-1.0, 0.0}, {1.0, 0.0}});
  return out;
}

// Seen from above at a slant: lengths along the line of sight are halved.
Vector2d slanted(double x, double y, double z) { return {x - 0.35 * y, z - 0.35 * y}; }

Description furuta_problem(Sensing) {
  const Furuta values;
  Description out{.mechanism = furuta(values)};
  out.cost.terms = {{0, 0.0, 2.0, CostError::kDifference}, {1, pi, 2.0, CostError::kAbsolute}};
  out.start = at_rest(2, 0.01);
  out.noise = list({3e-3, 3e-3, 3e-2, 3e-2});
  out.position_noise = 3e-3;
  out.tolerance = list({30.0 * kDegree, 10.0 * kDegree});
  out.trials = 6;
  out.physics = {"arm speed",
                 "pole speed",
                 "voltage",
                 "sin pole",
                 "sin pole*cos pole",
                 "voltage*cos pole",
                 "arm speed*cos pole",
                 "pole speed^2*sin pole",
                 "arm speed^2*sin pole*cos pole",
                 "arm speed*pole speed*sin pole*cos pole"};
  out.skeleton.moving = [values](const VectorXd& p) {
    const double c = std::cos(p[0]);
    const double s = std::sin(p[0]);
    const double side = values.pole_m * std::sin(p[1]);
    return polyline({slanted(0, 0, 0), slanted(values.arm_m * c, values.arm_m * s, 0.0),
                     slanted(values.arm_m * c - side * s, values.arm_m * s + side * c,
                             -values.pole_m * std::cos(p[1]))});
  };
  out.skeleton.fixed = polyline({slanted(0, 0, 0), slanted(0, 0, -0.16)});
  return out;
}

// From a place away from the middle, to the middle.
Description ball_plate_problem(Sensing) {
  Description out{.mechanism = ball_plate()};
  out.cost.terms = {{0, 0.0, 0.1, CostError::kDifference}, {1, 0.0, 0.1, CostError::kDifference}};
  out.start = {Eigen::MatrixXd::Zero(1, 8), list({0.06, 0.06, 1e-3, 1e-3, 0.02, 0.02, 1e-3, 1e-3})};
  out.noise = list({1e-3, 1e-3, 1e-3, 1e-3, 5e-3, 5e-3, 5e-3, 5e-3});
  out.position_noise = 1e-3;
  out.tolerance = list({0.01, 0.01, kAnyValue, kAnyValue});
  // From above; the plate's edge is drawn where the real one has it.
  out.skeleton.moving = [](const VectorXd& p) { return polyline({{p[0], p[1]}}); };
  constexpr double kHalf_m = 0.15;
  out.skeleton.fixed = polyline({{-kHalf_m, -kHalf_m},
                                 {kHalf_m, -kHalf_m},
                                 {kHalf_m, kHalf_m},
                                 {-kHalf_m, kHalf_m},
                                 {-kHalf_m, -kHalf_m}});
  return out;
}

Description double_pendulum_problem(MotorAt motor) {
  const DoublePendulum values;
  Description out{.mechanism = double_pendulum(motor, values)};
  out.cost.terms = {{0, pi, 3.0, CostError::kAbsolute}, {1, 0.0, 3.0, CostError::kDifference}};
  out.start = at_rest(2, 0.01);
  out.noise = VectorXd::Constant(4, 0.01);
  out.position_noise = 3e-3;
  out.tolerance = list({10.0 * kDegree, 10.0 * kDegree});
  out.skeleton.moving = [values](const VectorXd& p) {
    const Vector2d elbow = values.upper_m * Vector2d(std::sin(p[0]), -std::cos(p[0]));
    // The lower link is drawn as long as its centre of mass says of a rod, 0.3 m at most.
    const double angle = p[0] + p[1];
    return polyline({{0.0, 0.0}, elbow, elbow + 0.3 * Vector2d(std::sin(angle), -std::cos(angle))});
  };
  out.skeleton.fixed = polyline({{-0.05, 0.0}, {0.05, 0.0}});
  return out;
}

Description describe(std::string_view name, Sensing sensing) {
  if (name == "cartpole") return cart_pole_problem(sensing);
  if (name == "furuta") return furuta_problem(sensing);
  if (name == "ball_plate") return ball_plate_problem(sensing);
  if (name == "pendubot") return double_pendulum_problem(MotorAt::kShoulder);
  if (name == "acrobot") return double_pendulum_problem(MotorAt::kElbow);
  throw bad_request(std::string(name), "is no problem of the literature",
                    fmt::format("take {}", fmt::join(problem_names(), ", ")));
}

SensingOptions sensors_of(const Description& description, Sensing sensing) {
  SensingOptions out{.sensing = sensing, .noise_sigma = description.noise};
  if (sensing == Sensing::kFullState) return out;
  out.noise_sigma.setConstant(description.position_noise);
  out.speed_cutoff_hz = kSpeedCutoffShare / description.mechanism.layout.step_s;
  return out;
}

}  // namespace

std::vector<std::string> problem_names() {
  return {"cartpole", "furuta", "ball_plate", "pendubot", "acrobot"};
}

PolicyProblem problem_named(std::string_view name, Sensing sensing, bool plain) {
  const Description known = describe(name, sensing);
  const StateLayout& layout = known.mechanism.layout;
  PolicyProblem out;
  out.name = known.mechanism.name;
  out.task.cost = known.cost;
  out.task.start = known.start;
  const SensingOptions sensors = sensors_of(known, sensing);
  // As in the benchmark: particles of a measured state are seen as they are, the model's noise
  // holds the sensors'; where only positions are measured, the particles have the sensors, too.
  if (sensing == Sensing::kPositionsOnly && !plain) out.task.sensing = sensors;
  out.task.steps = static_cast<int>(std::lround(known.horizon_s / layout.step_s));
  out.learner.trials = known.trials;
  out.tolerance = known.tolerance;
  if (!known.physics.empty()) {
    out.physics = std::make_shared<const Monomials>(layout, known.physics);
  }
  out.skeleton = known.skeleton;
  out.system = std::make_shared<const SimulatedSystem>(
      known.mechanism,
      SimulatedTrials{.start = known.start,
                      .sensors = sensors,
                      .smoothing_cutoff_hz = plain ? 0.0 : kSpeedCutoffShare / layout.step_s});
  return out;
}

}  // namespace kinescope::policy
