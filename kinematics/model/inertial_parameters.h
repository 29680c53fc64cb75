// SPDX-License-Identifier: Apache-2.0
//
// The ten numbers of a rigid body in which torques are linear: mass, first moment and inertia about
// the origin of the link's frame, in its axes. SI units. Atkeson, An, Hollerbach 1986, section 2.
#pragma once

#include <array>
#include <string_view>

#include <Eigen/Core>

#include "kinematics/core/pose.h"

namespace kinescope {

using Vector10d = Eigen::Matrix<double, 10, 1>;
using Matrix10d = Eigen::Matrix<double, 10, 10>;

/// Names of the entries of InertialParameters::vector(), in its order.
inline constexpr std::array<std::string_view, 10> kInertialNames = {
    "m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"};

/// A body as seen from a frame that is fixed to it. Everything adds up: two bodies in one frame are
/// one body with the sum of their parameters.
struct InertialParameters {
  double mass_kg = 0.0;
  Eigen::Vector3d first_moment_kgm = Eigen::Vector3d::Zero();  ///< mass times centre of mass
  Eigen::Matrix3d inertia_kgm2 = Eigen::Matrix3d::Zero();      ///< about the frame's origin

  /// [m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz].
  [[nodiscard]] Vector10d vector() const;
  [[nodiscard]] static InertialParameters from_vector(const Vector10d& values);

  InertialParameters& operator+=(const InertialParameters& other);
  bool operator==(const InertialParameters&) const = default;
};

/// The same body about its centre of mass, in the axes of its frame (what URDF stores).
struct CentralInertia {
  double mass_kg = 0.0;
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Matrix3d inertia_kgm2 = Eigen::Matrix3d::Zero();  ///< about the centre of mass
};

[[nodiscard]] InertialParameters from_central(const CentralInertia& central);
/// Throws std::logic_error without a mass: the centre is then nowhere.
[[nodiscard]] CentralInertia to_central(const InertialParameters& parameters);

/// A body given in frame b, seen from frame a.
[[nodiscard]] InertialParameters in_frame(const Pose& T_a_b, const InertialParameters& in_b);
/// The same as a matrix on vector(): it is linear.
[[nodiscard]] Matrix10d inertial_frame_change(const Pose& T_a_b);

/// Spatial inertia, order rotation, translation: momentum = inertia * twist. Featherstone 2008, eq.
/// 2.63.
[[nodiscard]] Matrix6d spatial_inertia(const InertialParameters& parameters);

/// [S h; h' m] with S = integral of r r' dm and h the first moment. Positive semidefinite exactly
/// when some distribution of positive mass has these parameters. Wensing, Kim, Slotine 2018, eq. 9.
[[nodiscard]] Eigen::Matrix4d pseudo_inertia(const InertialParameters& parameters);
[[nodiscard]] InertialParameters from_pseudo_inertia(const Eigen::Matrix4d& pseudo);

/// True when the smallest eigenvalue of the pseudo-inertia is at least -tolerance times the
/// largest.
[[nodiscard]] bool is_consistent(const InertialParameters& parameters, double tolerance = 1e-12);

}  // namespace kinescope
