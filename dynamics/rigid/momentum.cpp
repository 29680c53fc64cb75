// SPDX-License-Identifier: Apache-2.0
#include "dynamics/rigid/momentum.h"

#include <cassert>
#include <utility>

namespace kinescope {

MomentumRecursion::MomentumRecursion(RigidModel model)
    : model_(std::move(model)), carried_(model_.bodies.size()) {
  const Eigen::Index n = model_.size();
  terms_ = {.mass = Eigen::MatrixXd::Zero(n, n),
            .momentum = Eigen::VectorXd::Zero(n),
            .velocity_torque = Eigen::VectorXd::Zero(n),
            .gravity_torque = Eigen::VectorXd::Zero(n)};
}

const MomentumTerms& MomentumRecursion::evaluate(const Eigen::Ref<const Eigen::VectorXd>& q,
                                                 const Eigen::Ref<const Eigen::VectorXd>& dq) {
  assert(q.size() == model_.size() && dq.size() == model_.size());
  for (std::size_t k = 0; k < carried_.size(); ++k) {
    place(k, q[static_cast<Eigen::Index>(k)], dq[static_cast<Eigen::Index>(k)]);
    weigh(k);
  }
  for (std::size_t k = carried_.size(); k-- > 0;) gather(k);
  for (std::size_t k = 0; k < carried_.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    terms_.momentum[i] += model_.bodies[k].motor_inertia * dq[i];
  }
  return terms_;
}

void MomentumRecursion::place(std::size_t body, double q, double dq) {
  const RigidBody& own = model_.bodies[body];
  Carried& c = carried_[body];
  Eigen::Matrix3d R_base_joint = own.R_parent_joint;
  Eigen::Vector3d p_base_joint = own.p_parent_joint;
  c.rotation.setZero();
  c.translation.setZero();
  if (own.parent >= 0) {
    const Carried& parent = carried_[static_cast<std::size_t>(own.parent)];
    R_base_joint = parent.R_base_body * own.R_parent_joint;
    p_base_joint = parent.p_base_body + parent.R_base_body * own.p_parent_joint;
    c.rotation = parent.rotation;
    c.translation = parent.translation;
  }
  const Eigen::Vector3d axis = R_base_joint * own.axis;
  if (own.type == JointType::kRevolute) {
    c.R_base_body = R_base_joint * Eigen::AngleAxisd(q, own.axis).toRotationMatrix();
    c.p_base_body = p_base_joint;
    c.axis_rotation = axis;
    c.axis_translation = p_base_joint.cross(axis);
  } else {
    c.R_base_body = R_base_joint;
    c.p_base_body = p_base_joint + q * axis;
    c.axis_rotation.setZero();
    c.axis_translation = axis;
  }
  c.rotation += dq * c.axis_rotation;
  c.translation += dq * c.axis_translation;
}

/// Mass, moments and momentum of the body alone.
void MomentumRecursion::weigh(std::size_t body) {
  const InertialParameters& own = model_.bodies[body].inertia;
  Carried& c = carried_[body];
  const Eigen::Vector3d h = c.R_base_body * own.first_moment_kgm;
  const Eigen::Matrix3d P = skew(c.p_base_body);
  const Eigen::Matrix3d H = skew(h);
  c.mass = own.mass_kg;
  c.first_moment = h + own.mass_kg * c.p_base_body;
  c.inertia.noalias() = c.R_base_body * own.inertia_kgm2 * c.R_base_body.transpose();
  c.inertia -= P * H + H * P + own.mass_kg * P * P;
  c.linear_momentum = c.mass * c.translation + c.rotation.cross(c.first_moment);
  c.angular_momentum = c.inertia * c.rotation + c.first_moment.cross(c.translation);
}

/// All that follows for the body's joint once what it carries is summed; then hands the sum on.
void MomentumRecursion::gather(std::size_t body) {
  const auto row = static_cast<Eigen::Index>(body);
  const Carried& c = carried_[body];
  const auto along = [](const Carried& joint, const Eigen::Vector3d& moment,
                        const Eigen::Vector3d& force) {
    return joint.axis_rotation.dot(moment) + joint.axis_translation.dot(force);
  };
  const Eigen::Vector3d force = c.mass * c.axis_translation + c.axis_rotation.cross(c.first_moment);
  const Eigen::Vector3d moment =
      c.inertia * c.axis_rotation + c.first_moment.cross(c.axis_translation);
  for (int j = static_cast<int>(body); j >= 0;
       j = model_.bodies[static_cast<std::size_t>(j)].parent) {
    terms_.mass(row, j) = terms_.mass(j, row) =
        along(carried_[static_cast<std::size_t>(j)], moment, force);
  }
  terms_.mass(row, row) += model_.bodies[body].motor_inertia;
  terms_.momentum[row] = along(c, c.angular_momentum, c.linear_momentum);
  const Eigen::Vector3d& gravity = model_.gravity_m_s2;
  terms_.gravity_torque[row] = -along(c, c.first_moment.cross(gravity), c.mass * gravity);
  // d(kinetic energy)/dq_j = -(momentum of what j carries) . (s_j x velocity of what carries j):
  // turning j turns all that it carries with their velocities relative to j.
  const int parent = model_.bodies[body].parent;
  if (parent < 0) {
    terms_.velocity_torque[row] = 0.0;
    return;
  }
  Carried& p = carried_[static_cast<std::size_t>(parent)];
  terms_.velocity_torque[row] = -c.angular_momentum.dot(c.axis_rotation.cross(p.rotation)) -
                                c.linear_momentum.dot(c.axis_translation.cross(p.rotation) +
                                                      c.axis_rotation.cross(p.translation));
  p.mass += c.mass;
  p.first_moment += c.first_moment;
  p.inertia += c.inertia;
  p.linear_momentum += c.linear_momentum;
  p.angular_momentum += c.angular_momentum;
}

}  // namespace kinescope
