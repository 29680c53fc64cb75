// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/ball_plate.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace kinescope::policy {
namespace {

using Eigen::Vector3d;
using Eigen::Vector4d;
using PartialVelocities = Eigen::Matrix<double, 3, 4>;

// Velocity of the ball in the plate's frame from (dx, dy, droll, dpitch), and its derivative.
struct BallVelocity {
  PartialVelocities jacobian, rate;
};

BallVelocity ball_velocity(const Vector4d& p, const Vector4d& dp) {
  const double sine = std::sin(p[3]);
  const double cosine = std::cos(p[3]);
  BallVelocity out;
  out.jacobian << 1, 0, -sine * p[1], 0,  //
      0, 1, sine * p[0], 0,               //
      0, 0, cosine * p[1], -p[0];
  out.rate << 0, 0, -cosine * dp[3] * p[1] - sine * dp[1], 0,  //
      0, 0, cosine * dp[3] * p[0] + sine * dp[0], 0,           //
      0, 0, -sine * dp[3] * p[1] + cosine * dp[1], -dp[0];
  return out;
}

// Height of the ball by the positions.
Vector4d height_slope(const Vector4d& p) {
  const double sr = std::sin(p[2]);
  const double cr = std::cos(p[2]);
  const double sp = std::sin(p[3]);
  const double cp = std::cos(p[3]);
  return {-cr * sp, sr, p[1] * cr + p[0] * sr * sp, -p[0] * cr * cp};
}

}  // namespace

Mechanism ball_plate(const BallPlate& values) {
  Mechanism out{.name = "ball and plate", .layout = {}, .terms = {}};
  out.layout = {.positions = {"x", "y", "roll", "pitch"},
                // The plate turns far less than once: its angles enter as they are.
                .is_angle = {false, false, false, false},
                .inputs = {"roll_reference", "pitch_reference"},
                .input_limit = Eigen::VectorXd::Constant(2, values.angle_limit_rad),
                .step_s = values.step_s};
  out.terms = [values](const Eigen::VectorXd& positions, const Eigen::VectorXd& speeds,
                       const Eigen::VectorXd& u) {
    const Vector4d p = positions;
    const Vector4d dp = speeds;
    const double m = values.ball_kg;
    const double rolling = values.rolling_share * m;
    const double inertia = values.plate_kgm2;  // 2 I about the normal
    const double w = 2.0 * std::numbers::pi * values.servo_hz;
    const double sine = std::sin(p[3]);
    const double cosine = std::cos(p[3]);
    const BallVelocity velocity = ball_velocity(p, dp);
    const Vector3d turn(dp[2] * cosine, dp[3], dp[2] * sine);  // of the plate, in its frame
    const Vector3d bias = velocity.rate * dp + turn.cross(Vector3d(velocity.jacobian * dp));
    MotionTerms terms = MotionTerms::zero(4);
    terms.mass = m * velocity.jacobian.transpose() * velocity.jacobian;
    terms.mass.diagonal() += Vector4d(rolling, rolling, inertia * (1.0 + sine * sine), inertia);
    const Vector4d plate(0, 0, -2.0 * inertia * sine * cosine * dp[2] * dp[3],
                         inertia * sine * cosine * dp[2] * dp[2]);
    const Vector4d actuators(-values.rolling_damping_ns_m * dp[0],
                             -values.rolling_damping_ns_m * dp[1],
                             inertia * w * (w * (u[0] - p[2]) - 2.0 * dp[2]),
                             inertia * w * (w * (u[1] - p[3]) - 2.0 * dp[3]));
    terms.force = actuators + plate - m * velocity.jacobian.transpose() * bias -
                  m * kPlantGravity_m_s2 * height_slope(p);
    terms.potential_j =
        m * kPlantGravity_m_s2 * (p[1] * std::sin(p[2]) - p[0] * std::cos(p[2]) * sine);
    return terms;
  };
  return out;
}

}  // namespace kinescope::policy
