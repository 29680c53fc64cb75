// SPDX-License-Identifier: Apache-2.0
#include "dynamics/rigid/inverse_dynamics.h"

#include "dynamics/rigid/newton_euler.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using rigid::NewtonEuler;

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

std::array<Eigen::MatrixXd, 3> gravity_slopes_of_samples(const RigidModel& model,
                                                         const Eigen::MatrixXd& q) {
  const Eigen::MatrixXd still = Eigen::MatrixXd::Zero(q.rows(), q.cols());
  std::array<Eigen::MatrixXd, 3> out;
  for (std::size_t axis = 0; axis < out.size(); ++axis) {
    const auto unit = Eigen::Vector3d::Unit(static_cast<Eigen::Index>(axis));
    out[axis] = inverse_dynamics_of_samples(in_gravity(model, unit), q, still, still);
  }
  return out;
}

Eigen::VectorXd coriolis_torque(const RigidModel& model, const Eigen::VectorXd& q,
                                const Eigen::VectorXd& dq) {
  return inverse_dynamics(in_gravity(model, Eigen::Vector3d::Zero()), q, dq,
                          Eigen::VectorXd::Zero(q.size()));
}

}  // namespace kinescope
