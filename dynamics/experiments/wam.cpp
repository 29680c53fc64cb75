// SPDX-License-Identifier: Apache-2.0
//
// The arm of the Barrett experiment, its motion and its log.
#include <array>
#include <cmath>
#include <numbers>

#include "dynamics/experiments/barrett.h"
#include "dynamics/experiments/reference_arms.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "kinematics/core/rng.h"

namespace kinescope::experiments {
namespace {

constexpr double kQuarter = 0.5 * std::numbers::pi;

struct Body {
  double mass_kg;
  Eigen::Vector3d centre_m;
  double radius_m;  // of gyration, alike about every axis
};

}  // namespace

Eigen::Vector3d wam_sensor_centre() { return {0.0, 0.0, 0.02}; }

DynamicModel wam_arm(double sensor_kg) {
  DynamicModel model = dh_arm({{0, 0, 0},
                               {0, -kQuarter, 0},
                               {0, kQuarter, 0.55},
                               {0.045, -kQuarter, 0},
                               {-0.045, kQuarter, 0.3},
                               {0, -kQuarter, 0},
                               {0, kQuarter, 0.06}});
  const std::array<Body, 7> bodies = {{{8.4, {0.0, 0.12, 0.0}, 0.10},
                                       {4.0, {0.0, 0.02, 0.03}, 0.08},
                                       {1.7, {-0.03, 0.0, -0.18}, 0.10},
                                       {2.4, {0.0, -0.13, 0.0}, 0.12},
                                       {0.12, {0.0, 0.0, 0.0}, 0.02},
                                       {0.40, {0.0, -0.02, 0.0}, 0.03},
                                       {0.07, {0.0, 0.0, 0.0}, 0.03}}};
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    const Body& body = bodies[k];
    model.links[k + 1] =
        from_central({body.mass_kg, body.centre_m,
                      body.mass_kg * body.radius_m * body.radius_m * Eigen::Matrix3d::Identity()});
  }
  if (sensor_kg > 0.0) {
    constexpr double kRadius = 0.02;
    model.links.back() +=
        from_central({sensor_kg, wam_sensor_centre(),
                      sensor_kg * kRadius * kRadius * Eigen::Matrix3d::Identity()});
  }
  return model;
}

const std::vector<WamMotion>& wam_motions() {
  static const std::vector<WamMotion> motions = {
      {1.3, 0.4, 0.8}, {1.3, 0.8, 0.8}, {1.3, 1.1, 0.8}, {1.3, 0.4, 2.0}, {1.3, 0.8, 1.2}};
  return motions;
}

double wam_friction(double dq, const BarrettOptions& options) {
  const double low = dq / options.stribeck_rad_s;
  constexpr double kSign_rad_s = 0.005;  // a sign that can be differentiated
  return options.viscous_nms * dq +
         (options.coulomb_nm + options.breakaway_nm * std::exp(-low * low)) *
             std::tanh(dq / kSign_rad_s);
}

Eigen::VectorXd wam_torque(const DynamicModel& arm, const Eigen::VectorXd& q,
                           const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq) {
  const RigidModel rigid = make_rigid_model(arm);
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(q.size(), rigid.size());
  all.col(1).setConstant(kWamShoulder_rad);
  Eigen::MatrixXd rate = Eigen::MatrixXd::Zero(q.size(), rigid.size());
  Eigen::MatrixXd acceleration = rate;
  all.col(kWamJoint) = q;
  rate.col(kWamJoint) = dq;
  acceleration.col(kWamJoint) = ddq;
  return inverse_dynamics_of_samples(rigid, all, rate, acceleration).col(kWamJoint);
}

BarrettLog barrett_log(const std::vector<WamMotion>& motions, int samples,
                       const BarrettOptions& options) {
  Rng rng = Rng::from_name("barrett", options.seed);
  const auto each = static_cast<Eigen::Index>(samples / static_cast<int>(motions.size()));
  const Eigen::Index rows = each * static_cast<Eigen::Index>(motions.size());
  BarrettLog out;
  TorqueSamples& log = out.measured;
  log.t_s = Eigen::VectorXd::Zero(rows);
  log.q = log.dq = log.ddq = Eigen::MatrixXd::Zero(rows, 1);
  log.trajectory = Eigen::VectorXi::Zero(rows);
  for (std::size_t m = 0; m < motions.size(); ++m) {
    const WamMotion& motion = motions[m];
    const double w = motion.rate_rad_s;
    for (Eigen::Index k = 0; k < each; ++k) {
      const Eigen::Index row = static_cast<Eigen::Index>(m) * each + k;
      const double angle =
          2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(each);
      log.t_s[row] = angle / w;
      log.q(row, 0) = motion.middle_rad + motion.amplitude_rad * std::sin(angle);
      log.dq(row, 0) = motion.amplitude_rad * w * std::cos(angle);
      log.ddq(row, 0) = -motion.amplitude_rad * w * w * std::sin(angle);
      log.trajectory[row] = static_cast<int>(m);
    }
  }
  out.clean = wam_torque(wam_arm(options.sensor_kg), log.q, log.dq, log.ddq);
  for (Eigen::Index i = 0; i < rows; ++i) out.clean[i] += wam_friction(log.dq(i, 0), options);
  log.torque = out.clean;
  for (Eigen::Index i = 0; i < rows; ++i) {
    log.torque(i, 0) += rng.normal(options.noise_nm);
    if (rng.uniform() >= options.outlier_share) continue;
    log.torque(i, 0) += rng.uniform(-options.outlier_nm, options.outlier_nm);
    out.wrong.push_back(static_cast<int>(i));
  }
  return out;
}

}  // namespace kinescope::experiments
