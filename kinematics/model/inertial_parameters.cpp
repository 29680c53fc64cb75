// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/inertial_parameters.h"

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

/// Inertia (about the origin) of a unit of second moments S = integral of r r' dm: tr(S) 1 - S. The
/// same formula leads back with half the trace.
Eigen::Matrix3d inertia_of_second_moments(const Eigen::Matrix3d& S) {
  return S.trace() * Eigen::Matrix3d::Identity() - S;
}

Eigen::Matrix3d second_moments(const Eigen::Matrix3d& inertia) {
  return 0.5 * inertia.trace() * Eigen::Matrix3d::Identity() - inertia;
}

}  // namespace

Vector10d InertialParameters::vector() const {
  const Eigen::Matrix3d& I = inertia_kgm2;
  Vector10d out;
  out << mass_kg, first_moment_kgm, I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2);
  return out;
}

InertialParameters InertialParameters::from_vector(const Vector10d& values) {
  InertialParameters out;
  out.mass_kg = values[0];
  out.first_moment_kgm = values.segment<3>(1);
  out.inertia_kgm2 << values[4], values[5], values[6],  //
      values[5], values[7], values[8],                  //
      values[6], values[8], values[9];
  return out;
}

InertialParameters& InertialParameters::operator+=(const InertialParameters& other) {
  mass_kg += other.mass_kg;
  first_moment_kgm += other.first_moment_kgm;
  inertia_kgm2 += other.inertia_kgm2;
  return *this;
}

InertialParameters from_central(const CentralInertia& central) {
  const Eigen::Matrix3d c = skew(central.centre_m);
  return {.mass_kg = central.mass_kg,
          .first_moment_kgm = central.mass_kg * central.centre_m,
          .inertia_kgm2 = central.inertia_kgm2 + central.mass_kg * c * c.transpose()};
}

CentralInertia to_central(const InertialParameters& parameters) {
  KINESCOPE_CHECK(parameters.mass_kg > 0.0, "a body without mass has no centre of mass");
  CentralInertia central{.mass_kg = parameters.mass_kg,
                         .centre_m = parameters.first_moment_kgm / parameters.mass_kg};
  const Eigen::Matrix3d c = skew(central.centre_m);
  central.inertia_kgm2 = parameters.inertia_kgm2 - central.mass_kg * c * c.transpose();
  return central;
}

InertialParameters in_frame(const Pose& T_a_b, const InertialParameters& in_b) {
  const Eigen::Matrix4d T = T_a_b.matrix4();
  return from_pseudo_inertia(T * pseudo_inertia(in_b) * T.transpose());
}

Matrix10d inertial_frame_change(const Pose& T_a_b) {
  Matrix10d out;
  for (int k = 0; k < 10; ++k) {
    out.col(k) = in_frame(T_a_b, InertialParameters::from_vector(Vector10d::Unit(k))).vector();
  }
  return out;
}

Matrix6d spatial_inertia(const InertialParameters& parameters) {
  const Eigen::Matrix3d h = skew(parameters.first_moment_kgm);
  Matrix6d out;
  out << parameters.inertia_kgm2, h, h.transpose(),
      parameters.mass_kg * Eigen::Matrix3d::Identity();
  return out;
}

Eigen::Matrix4d pseudo_inertia(const InertialParameters& parameters) {
  Eigen::Matrix4d out;
  out << second_moments(parameters.inertia_kgm2), parameters.first_moment_kgm,
      parameters.first_moment_kgm.transpose(), parameters.mass_kg;
  return out;
}

InertialParameters from_pseudo_inertia(const Eigen::Matrix4d& pseudo) {
  return {.mass_kg = pseudo(3, 3),
          .first_moment_kgm = pseudo.topRightCorner<3, 1>(),
          .inertia_kgm2 = inertia_of_second_moments(pseudo.topLeftCorner<3, 3>())};
}

bool is_consistent(const InertialParameters& parameters, double tolerance) {
  const Eigen::Vector4d values = symmetric_eigenvalues(pseudo_inertia(parameters));
  return values.allFinite() && values[0] >= -tolerance * std::abs(values[3]);
}

}  // namespace kinescope
