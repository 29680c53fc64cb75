// SPDX-License-Identifier: Apache-2.0
//
// Our model as MuJoCo's. Only for programs that were built with MuJoCo.
#pragma once

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include <Eigen/Eigenvalues>
#include <mujoco/mujoco.h>

#include "kinematics/core/error.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {

struct MujocoDeleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using MujocoModel = std::unique_ptr<mjModel, MujocoDeleter>;
using MujocoData = std::unique_ptr<mjData, MujocoDeleter>;

// MuJoCo finds the principal axes of an inertia by an iteration that stops at about this, relative.
inline constexpr double kMujocoAxes = 1e-5;

/// The link's inertia as MuJoCo read it from the URDF, which must be ours; then with exact
/// principal axes.
inline void refine_inertia(const InertialParameters& ours, mjModel& model, int body) {
  const CentralInertia central = to_central(ours);
  const auto at = [body](int size) { return std::ptrdiff_t{size} * body; };
  mjtNum* diagonal = model.body_inertia + at(3);
  mjtNum* q = model.body_iquat + at(4);
  const Eigen::Matrix3d R = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  const Eigen::Matrix3d theirs =
      R * Eigen::Vector3d(diagonal[0], diagonal[1], diagonal[2]).asDiagonal() * R.transpose();
  KINESCOPE_CHECK(
      (theirs - central.inertia_kgm2).norm() < kMujocoAxes * central.inertia_kgm2.norm(),
      "MuJoCo reads our inertias");
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(central.inertia_kgm2);
  Eigen::Matrix3d axes = eigen.eigenvectors();
  if (axes.determinant() < 0.0) axes.col(0) *= -1.0;
  const Eigen::Quaterniond exact(axes);
  q[0] = exact.w();
  q[1] = exact.x();
  q[2] = exact.y();
  q[3] = exact.z();
  for (int k = 0; k < 3; ++k) diagonal[k] = eigen.eigenvalues()[k];
}

/// Through our URDF, with our gravity and motor inertias; without contacts, limits and friction.
inline MujocoModel to_mujoco(const DynamicModel& model) {
  const auto path = truth::temporary_path("mujoco_model.urdf");
  std::ofstream(path) << write_urdf(model);
  char error[1000] = "";
  MujocoModel loaded(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
  std::filesystem::remove(path);
  KINESCOPE_CHECK(loaded != nullptr, std::string("MuJoCo reads our URDF: ") + error);
  const Eigen::Vector3d& g = model.gravity_m_s2;
  for (int k = 0; k < 3; ++k) loaded->opt.gravity[k] = g[k];
  loaded->opt.disableflags |= mjDSBL_CONTACT | mjDSBL_CONSTRAINT | mjDSBL_PASSIVE;
  for (std::size_t l = 1; l < model.links.size(); ++l) {
    const int body = mj_name2id(loaded.get(), mjOBJ_BODY, model.tree.links[l].name.c_str());
    refine_inertia(model.links[l], *loaded, body);
  }
  for (const JointId id : moving_joints(model.tree)) {
    const Joint& joint = model.tree.joints[id.index()];
    const int theirs = mj_name2id(loaded.get(), mjOBJ_JOINT, joint.name.c_str());
    const double armature = model.joints[id.index()].motor_inertia;
    loaded->dof_armature[loaded->jnt_dofadr[theirs]] = armature;
  }
  return loaded;
}

}  // namespace kinescope
