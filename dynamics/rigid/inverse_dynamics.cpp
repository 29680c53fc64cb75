// SPDX-License-Identifier: Apache-2.0
#include "dynamics/rigid/inverse_dynamics.h"

#include "dynamics/rigid/body_motions.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using rigid::BodyMotion;
using rigid::BodyMotions;
using rigid::BodyWrench;

/// Newton and Euler for one body, about its frame's origin.
BodyWrench required_wrench(const InertialParameters& inertia, const BodyMotion& motion) {
  const Eigen::Vector3d& h = inertia.first_moment_kgm;
  const Eigen::Vector3d& w = motion.omega;
  return {
      .moment = inertia.inertia_kgm2 * motion.alpha + w.cross(inertia.inertia_kgm2 * w) +
                h.cross(motion.acceleration),
      .force = inertia.mass_kg * motion.acceleration + motion.alpha.cross(h) + w.cross(w.cross(h))};
}

/// Newton-Euler with its memory, for many samples.
class NewtonEuler {
 public:
  explicit NewtonEuler(const RigidModel& model)
      : model_(model), motions_(model), wrenches_(model.bodies.size()) {}

  template <typename In, typename Out>
  void torque(const In& q, const In& dq, const In& ddq, Out&& out) {
    motions_.move(q, dq, ddq);
    const std::size_t n = motions_.size();
    for (std::size_t k = 0; k < n; ++k) {
      wrenches_[k] = required_wrench(model_.bodies[k].inertia, motions_[k]);
    }
    for (std::size_t k = n; k-- > 0;) {
      const auto i = static_cast<Eigen::Index>(k);
      const BodyWrench& wrench = wrenches_[k];
      const double along = motions_.axis(k).dot(motions_.turns(k) ? wrench.moment : wrench.force);
      out[i] = along + model_.bodies[k].motor_inertia * ddq[i];
      if (motions_.parent(k) >= 0) hand_down(motions_[k], wrench, motions_.parent(k));
    }
  }

 private:
  void hand_down(const BodyMotion& motion, const BodyWrench& wrench, int parent) {
    BodyWrench& below = wrenches_[static_cast<std::size_t>(parent)];
    const Eigen::Vector3d force = motion.R_parent_body * wrench.force;
    below.force += force;
    below.moment += motion.R_parent_body * wrench.moment + motion.p_parent_body.cross(force);
  }

  const RigidModel& model_;
  BodyMotions motions_;
  std::vector<BodyWrench> wrenches_;
};

RigidModel in_gravity(const RigidModel& model, const Eigen::Vector3d& gravity_m_s2) {
  RigidModel out = model;
  out.gravity_m_s2 = gravity_m_s2;
  return out;
}

}  // namespace

Eigen::VectorXd inverse_dynamics(const RigidModel& model, const Eigen::VectorXd& q,
                                 const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq) {
  KINESCOPE_CHECK(q.size() == model.size() && dq.size() == q.size() && ddq.size() == q.size(),
                  "one position, rate and acceleration a movable joint");
  Eigen::VectorXd out(q.size());
  NewtonEuler(model).torque(q, dq, ddq, out);
  return out;
}

Eigen::MatrixXd inverse_dynamics_of_samples(const RigidModel& model, const Eigen::MatrixXd& q,
                                            const Eigen::MatrixXd& dq, const Eigen::MatrixXd& ddq) {
  KINESCOPE_CHECK(q.cols() == model.size(), "one column a movable joint");
  KINESCOPE_CHECK(dq.rows() == q.rows() && dq.cols() == q.cols() && ddq.rows() == q.rows() &&
                      ddq.cols() == q.cols(),
                  "positions, rates and accelerations of the same samples");
  Eigen::MatrixXd out(q.rows(), q.cols());
  NewtonEuler recursion(model);
  for (Eigen::Index t = 0; t < q.rows(); ++t) {
    recursion.torque(q.row(t), dq.row(t), ddq.row(t), out.row(t));
  }
  return out;
}

Eigen::VectorXd gravity_torque(const RigidModel& model, const Eigen::VectorXd& q) {
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(q.size());
  return inverse_dynamics(model, q, still, still);
}

Eigen::Matrix<double, Eigen::Dynamic, 3> gravity_jacobian(const RigidModel& model,
                                                          const Eigen::VectorXd& q) {
  Eigen::Matrix<double, Eigen::Dynamic, 3> out(q.size(), 3);
  for (int axis = 0; axis < 3; ++axis) {
    out.col(axis) = gravity_torque(in_gravity(model, Eigen::Vector3d::Unit(axis)), q);
  }
  return out;
}

Eigen::VectorXd coriolis_torque(const RigidModel& model, const Eigen::VectorXd& q,
                                const Eigen::VectorXd& dq) {
  return inverse_dynamics(in_gravity(model, Eigen::Vector3d::Zero()), q, dq,
                          Eigen::VectorXd::Zero(q.size()));
}

}  // namespace kinescope
