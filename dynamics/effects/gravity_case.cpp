// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "dynamics/effects/torque_parts.h"
#include "kinematics/core/dense_algebra.h"

namespace kinescope::effects {
namespace {

/// Combinations of the bodies' parameters that the log shows, each of unit effect on the whitened
/// torque: 10 bodies x base parameters. `normals`: Y' Y of each joint.
Eigen::MatrixXd shown_bodies(const std::vector<Eigen::MatrixXd>& normals,
                             const Eigen::VectorXd& sigma) {
  const Eigen::Index n = normals.front().cols();
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t j = 0; j < normals.size(); ++j) {
    H += normals[j] / std::pow(sigma[static_cast<Eigen::Index>(j)], 2);
  }
  const Eigen::VectorXd scale = unit_scale(H);
  const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * H * scale.asDiagonal());
  const Eigen::VectorXd& values = eigen.values;
  Eigen::Index first = 0;
  while (first < n && !(values[first] > kUnobservable * values[n - 1])) ++first;
  return scale.asDiagonal() * eigen.vectors.rightCols(n - first) *
         values.tail(n - first).cwiseSqrt().cwiseInverse().asDiagonal();
}

/// The base where all masses are free.
void free_bodies(const TorqueTracedModel::Parts& parts, const std::vector<Eigen::MatrixXd>& Y,
                 GravityCase& out) {
  std::vector<Eigen::MatrixXd> normals;
  for (std::size_t j = 0; j < Y.size(); ++j)
    normals.push_back(parts.regressors.normal(j, out.rigid.gravity_m_s2));
  out.bodies = shown_bodies(normals, parts.base.sigma);
  for (std::size_t j = 0; j < Y.size(); ++j) {
    // Bodies stand behind those that carry them: what stands before the joint's own does nothing.
    const Eigen::Index moved = Y[j].cols() - 10 * static_cast<Eigen::Index>(j);
    out.base.emplace_back(Y[j].rightCols(moved) * out.bodies.bottomRows(moved));
    out.base_squares.emplace_back(out.bodies.transpose() * normals[j] * out.bodies);
  }
}

/// The same where they are declared.
void fix_bodies(const TorqueTracedModel::Parts& parts, GravityCase& out) {
  const Eigen::Index joints = parts.q.cols();
  out.fixed = out.context.load + parts.dq * parts.viscous.asDiagonal();
  out.base.assign(static_cast<std::size_t>(joints), Eigen::MatrixXd(parts.q.rows(), 0));
  out.base_squares.assign(static_cast<std::size_t>(joints), Eigen::MatrixXd(0, 0));
}

}  // namespace

std::shared_ptr<const GravityCase> make_gravity_case(const TorqueTracedModel::Parts& parts,
                                                     const Eigen::Vector2d& tilt_deg,
                                                     const RigidModel& weighed) {
  auto out = std::make_shared<GravityCase>();
  out->tilt_deg = tilt_deg;
  out->rigid = parts.base.rigid;
  const Eigen::Vector3d& declared = parts.base.rigid.gravity_m_s2;
  const Eigen::Vector3d gravity = tilted(declared, tilt_deg);
  out->rigid.gravity_m_s2 = gravity;
  out->context = parts.context;
  out->context.rigid.gravity_m_s2 = gravity;
  out->context.gravity_moves = tilt_moves(gravity);
  if (!tilt_deg.isZero(0.0)) {
    const auto slopes = parts.regressors.slopes(out->context.rigid);
    out->context.load = parts.declared_load;
    for (std::size_t a = 0; a < slopes.size(); ++a) {
      const auto axis = static_cast<Eigen::Index>(a);
      out->context.load += (gravity[axis] - declared[axis]) * slopes[a];
    }
  }
  std::vector<Eigen::MatrixXd> Y;
  for (std::size_t j = 0; j < parts.regressors.declared.size(); ++j)
    Y.push_back(parts.regressors.regressor(j, gravity));
  out->fixed = Eigen::MatrixXd::Zero(parts.q.rows(), parts.q.cols());
  if (parts.base.kind == TorqueBaseKind::kDeclared) {
    fix_bodies(parts, *out);
  } else {
    free_bodies(parts, Y, *out);
  }
  out->carrier_torques = carrier_torques(out->context, parts.regressors.slopes(weighed), Y);
  return out;
}

}  // namespace kinescope::effects
