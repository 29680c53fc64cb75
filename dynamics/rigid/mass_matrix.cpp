// SPDX-License-Identifier: Apache-2.0
//
// All in the base frame: spatial vectors (rotation, translation) about the base origin, which makes
// sums over subtrees plain sums.
#include "dynamics/rigid/mass_matrix.h"

#include <vector>

#include <Eigen/Cholesky>

#include "dynamics/rigid/inverse_dynamics.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

/// A body in the base frame.
struct PlacedBody {
  Pose T_base_body;
  Vector6d axis;  ///< the joint's unit twist
  InertialParameters inertia;
};

void check_size(const RigidModel& model, const Eigen::VectorXd& values) {
  KINESCOPE_CHECK(values.size() == model.size(), "one value a movable joint");
}

std::vector<PlacedBody> place_bodies(const RigidModel& model, const Eigen::VectorXd& q) {
  check_size(model, q);
  std::vector<PlacedBody> placed(model.bodies.size());
  for (std::size_t k = 0; k < placed.size(); ++k) {
    const RigidBody& body = model.bodies[k];
    const Pose T_parent_joint{Eigen::Quaterniond(body.R_parent_joint), body.p_parent_joint};
    const Pose T_base_parent =
        body.parent < 0 ? Pose{} : placed[static_cast<std::size_t>(body.parent)].T_base_body;
    const Pose T = T_base_parent * T_parent_joint *
                   joint_motion(body.type, body.axis, q[static_cast<Eigen::Index>(k)]);
    Vector6d own = Vector6d::Zero();
    if (body.type == JointType::kRevolute) own.head<3>() = body.axis;
    if (body.type == JointType::kPrismatic) own.tail<3>() = body.axis;
    placed[k] = {.T_base_body = T, .axis = adjoint(T) * own, .inertia = in_frame(T, body.inertia)};
  }
  return placed;
}

/// [v x] on motions. Featherstone 2008, eq. 2.31.
Matrix6d motion_cross(const Vector6d& v) {
  const Eigen::Matrix3d w = skew(v.head<3>());
  Matrix6d out;
  out << w, Eigen::Matrix3d::Zero(), skew(v.tail<3>()), w;
  return out;
}

/// The matrix with (f bar) v = v x* f. Echeandia and Wensing 2021, eq. 7.
Matrix6d force_bar(const Vector6d& f) {
  const Eigen::Matrix3d force = -skew(f.tail<3>());
  Matrix6d out;
  out << -skew(f.head<3>()), force, force, Eigen::Matrix3d::Zero();
  return out;
}

}  // namespace

Eigen::MatrixXd mass_matrix(const RigidModel& model, const Eigen::VectorXd& q) {
  std::vector<PlacedBody> bodies = place_bodies(model, q);
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(model.size(), model.size());
  for (std::size_t k = bodies.size(); k-- > 0;) {
    const auto row = static_cast<Eigen::Index>(k);
    const int parent = model.bodies[k].parent;
    if (parent >= 0) bodies[static_cast<std::size_t>(parent)].inertia += bodies[k].inertia;
    const Vector6d momentum = spatial_inertia(bodies[k].inertia) * bodies[k].axis;
    for (int j = static_cast<int>(k); j >= 0;
         j = model.bodies[static_cast<std::size_t>(j)].parent) {
      M(row, j) = M(j, row) = bodies[static_cast<std::size_t>(j)].axis.dot(momentum);
    }
    M(row, row) += model.bodies[k].motor_inertia;
  }
  return M;
}

Eigen::VectorXd weight_scale(const RigidModel& model, const Eigen::VectorXd& q) {
  Eigen::VectorXd mass(model.size());
  for (std::size_t k = 0; k < model.bodies.size(); ++k) {
    mass[static_cast<Eigen::Index>(k)] = model.bodies[k].inertia.mass_kg;
  }
  for (std::size_t k = model.bodies.size(); k-- > 0;) {
    const int parent = model.bodies[k].parent;
    if (parent >= 0) mass[parent] += mass[static_cast<Eigen::Index>(k)];
  }
  // Radius of gyration: sqrt(inertia / mass).
  return kUsualGravity_m_s2 *
         mass.cwiseProduct(mass_matrix(model, q).diagonal()).cwiseMax(0.0).cwiseSqrt();
}

Eigen::MatrixXd coriolis_matrix(const RigidModel& model, const Eigen::VectorXd& q,
                                const Eigen::VectorXd& dq) {
  const std::vector<PlacedBody> bodies = place_bodies(model, q);
  check_size(model, dq);
  const std::size_t n = bodies.size();
  std::vector<Vector6d> velocity(n);
  std::vector<Vector6d> axis_rate(n);
  std::vector<Matrix6d> inertia(n);
  std::vector<Matrix6d> B(n);
  for (std::size_t k = 0; k < n; ++k) {
    const int parent = model.bodies[k].parent;
    velocity[k] = bodies[k].axis * dq[static_cast<Eigen::Index>(k)];
    if (parent >= 0) velocity[k] += velocity[static_cast<std::size_t>(parent)];
    const Matrix6d cross = motion_cross(velocity[k]);
    axis_rate[k] = cross * bodies[k].axis;
    inertia[k] = spatial_inertia(bodies[k].inertia);
    // v x* is minus the transpose of v x.
    B[k] = 0.5 * (-cross.transpose() * inertia[k] - inertia[k] * cross +
                  force_bar(inertia[k] * velocity[k]));
  }
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(model.size(), model.size());
  for (std::size_t k = n; k-- > 0;) {
    const auto kk = static_cast<Eigen::Index>(k);
    const int parent = model.bodies[k].parent;
    if (parent >= 0) {
      inertia[static_cast<std::size_t>(parent)] += inertia[k];
      B[static_cast<std::size_t>(parent)] += B[k];
    }
    for (int j = static_cast<int>(k); j >= 0;
         j = model.bodies[static_cast<std::size_t>(j)].parent) {
      const auto a = static_cast<std::size_t>(j);
      C(j, kk) = bodies[a].axis.dot(inertia[k] * axis_rate[k] + B[k] * bodies[k].axis);
      C(kk, j) = bodies[k].axis.dot(inertia[k] * axis_rate[a] + B[k] * bodies[a].axis);
    }
  }
  return C;
}

Eigen::VectorXd forward_dynamics(const RigidModel& model, const Eigen::VectorXd& q,
                                 const Eigen::VectorXd& dq, const Eigen::VectorXd& torque) {
  check_size(model, torque);
  const Eigen::LDLT<Eigen::MatrixXd> factor(mass_matrix(model, q));
  if (factor.info() != Eigen::Success || !(factor.vectorD().array() > 0.0).all()) {
    throw bad_request("forward dynamics", "the mass matrix is not positive definite",
                      "give every moving link an inertia or its joint a motor inertia");
  }
  const Eigen::VectorXd at_rest = Eigen::VectorXd::Zero(q.size());
  return factor.solve(torque - inverse_dynamics(model, q, dq, at_rest));
}

double kinetic_energy(const RigidModel& model, const Eigen::VectorXd& q,
                      const Eigen::VectorXd& dq) {
  check_size(model, dq);
  return 0.5 * dq.dot(mass_matrix(model, q) * dq);
}

double potential_energy(const RigidModel& model, const Eigen::VectorXd& q) {
  Eigen::Vector3d first_moment = Eigen::Vector3d::Zero();
  for (const PlacedBody& body : place_bodies(model, q)) {
    first_moment += body.inertia.first_moment_kgm;
  }
  return -model.gravity_m_s2.dot(first_moment);
}

}  // namespace kinescope
