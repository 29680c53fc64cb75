// SPDX-License-Identifier: Apache-2.0
//
// Mechanisms of textbooks, by their formulas.
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/mass_matrix.h"

namespace kinescope {
namespace {

constexpr double kExact = 1e-12;
constexpr double kG = kUsualGravity_m_s2;

struct JointAt {
  JointType type;
  Eigen::Vector3d place;
  Eigen::Vector3d axis;
};

/// A chain whose frames are all parallel in the zero posture.
DynamicModel chain(const std::vector<JointAt>& joints) {
  KinematicTree tree;
  tree.links.push_back({"base"});
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const auto index = static_cast<int>(j);
    Joint joint;
    joint.name = "joint" + std::to_string(j + 1);
    joint.type = joints[j].type;
    joint.parent = LinkId{index};
    joint.child = LinkId{index + 1};
    joint.T_parent_joint.translation = joints[j].place;
    joint.axis = joints[j].axis;
    tree.joints.push_back(joint);
    tree.links.push_back({"link" + std::to_string(j + 1)});
  }
  return without_masses(tree);
}

InertialParameters body(double mass, const Eigen::Vector3d& centre, double inertia) {
  return from_central(
      {.mass_kg = mass, .centre_m = centre, .inertia_kgm2 = inertia * Eigen::Matrix3d::Identity()});
}

TEST(ClosedForm, Pendulum) {
  // About y, the mass hangs along -z: torque = (I + m l^2) ddq + m g l sin q.
  DynamicModel model = chain({{JointType::kRevolute, {0, 0, 0}, Eigen::Vector3d::UnitY()}});
  const double m = 1.3;
  const double l = 0.7;
  const double I = 0.02;
  model.links[1] = body(m, {0, 0, -l}, I);
  const RigidModel rigid = make_rigid_model(model);
  for (double q = -3.0; q < 3.0; q += 0.7) {
    const Eigen::VectorXd at = Eigen::VectorXd::Constant(1, q);
    const Eigen::VectorXd torque = inverse_dynamics(rigid, at, Eigen::VectorXd::Constant(1, 0.3),
                                                    Eigen::VectorXd::Constant(1, 2.0));
    EXPECT_NEAR(torque[0], (I + m * l * l) * 2.0 + m * kG * l * std::sin(q), kExact * 20);
    EXPECT_NEAR(potential_energy(rigid, at), -m * kG * l * std::cos(q), kExact * 20);
  }
}

TEST(ClosedForm, WeightScale) {
  // A slide carries a pendulum: the weight of both, and the pendulum's at its radius of gyration.
  DynamicModel model = chain({{JointType::kPrismatic, {0, 0, 0}, Eigen::Vector3d::UnitX()},
                              {JointType::kRevolute, {0, 0, 0.2}, Eigen::Vector3d::UnitY()}});
  const double m = 1.3;
  const double l = 0.7;
  const double I = 0.02;
  model.links[1] = body(2.0, {0.1, 0, 0}, 0.05);
  model.links[2] = body(m, {0, 0, -l}, I);
  const Eigen::VectorXd scale = weight_scale(make_rigid_model(model), Eigen::Vector2d(0.3, -1.0));
  EXPECT_NEAR(scale[0], (2.0 + m) * kG, kExact * 100);
  EXPECT_NEAR(scale[1], kG * std::sqrt(m * (I + m * l * l)), kExact * 100);
}

TEST(ClosedForm, CartPole) {
  // Cart along x, pole about y hanging along -z at q = 0: force  = (M + m) a - m l cos(q) ddq + m l
  // sin(q) dq^2   (pole's centre at x - l sin q), torque = m l^2 ddq - m l cos(q) a + m g l sin q.
  DynamicModel model = chain({{JointType::kPrismatic, {0, 0, 0}, Eigen::Vector3d::UnitX()},
                              {JointType::kRevolute, {0, 0, 0}, Eigen::Vector3d::UnitY()}});
  const double M = 0.5;
  const double m = 0.4;
  const double l = 0.6;
  model.links[1] = body(M, {0, 0, 0}, 0.01);
  model.links[2] = body(m, {0, 0, -l}, 0.0);
  const RigidModel rigid = make_rigid_model(model);
  const double a = 1.7;
  const double w = -2.1;
  const double dw = 3.3;
  for (double q = -3.0; q < 3.0; q += 0.7) {
    const Eigen::VectorXd torque = inverse_dynamics(
        rigid, Eigen::Vector2d(0.2, q), Eigen::Vector2d(0.4, w), Eigen::Vector2d(a, dw));
    EXPECT_NEAR(torque[0], (M + m) * a - m * l * std::cos(q) * dw + m * l * std::sin(q) * w * w,
                kExact * 20);
    EXPECT_NEAR(torque[1], m * l * l * dw - m * l * std::cos(q) * a + m * kG * l * std::sin(q),
                kExact * 20);
  }
}

TEST(ClosedForm, PlanarTwoJoints) {
  // Spong, Hutchinson, Vidyasagar 2006, section 7.3.2: both about z, gravity along -y.
  DynamicModel model = chain({{JointType::kRevolute, {0, 0, 0}, Eigen::Vector3d::UnitZ()},
                              {JointType::kRevolute, {0.5, 0, 0}, Eigen::Vector3d::UnitZ()}});
  model.gravity_m_s2 = {0.0, -kG, 0.0};
  const double m1 = 2.0;
  const double m2 = 1.1;
  const double l1 = 0.5;
  const double c1 = 0.2;
  const double c2 = 0.33;
  const double I1 = 0.05;
  const double I2 = 0.03;
  model.links[1] = body(m1, {c1, 0, 0}, I1);
  model.links[2] = body(m2, {c2, 0, 0}, I2);
  const RigidModel rigid = make_rigid_model(model);
  const Eigen::Vector2d dq(0.7, -1.9);
  for (double q2 = -3.0; q2 < 3.0; q2 += 0.7) {
    const double q1 = 0.4 - q2;
    const Eigen::VectorXd q = Eigen::Vector2d(q1, q2);
    Eigen::Matrix2d M;
    M(0, 0) = m1 * c1 * c1 + m2 * (l1 * l1 + c2 * c2 + 2 * l1 * c2 * std::cos(q2)) + I1 + I2;
    M(0, 1) = M(1, 0) = m2 * (c2 * c2 + l1 * c2 * std::cos(q2)) + I2;
    M(1, 1) = m2 * c2 * c2 + I2;
    EXPECT_LT((mass_matrix(rigid, q) - M).norm(), kExact * 10);
    const double h = -m2 * l1 * c2 * std::sin(q2);
    Eigen::Matrix2d C;
    C << h * dq[1], h * (dq[0] + dq[1]), -h * dq[0], 0.0;
    EXPECT_LT((coriolis_matrix(rigid, q, dq) - C).norm(), kExact * 10);
    const Eigen::Vector2d g(
        (m1 * c1 + m2 * l1) * kG * std::cos(q1) + m2 * c2 * kG * std::cos(q1 + q2),
        m2 * c2 * kG * std::cos(q1 + q2));
    EXPECT_LT((gravity_torque(rigid, q) - g).norm(), kExact * 50);
  }
}

TEST(ClosedForm, MotorInertiaAddsToItsJointOnly) {
  DynamicModel model = chain({{JointType::kRevolute, {0, 0, 0}, Eigen::Vector3d::UnitZ()},
                              {JointType::kPrismatic, {0, 0, 0}, Eigen::Vector3d::UnitX()}});
  model.links[2] = body(1.0, {0, 0, 0}, 0.1);
  const RigidModel without = make_rigid_model(model);
  model.joints[1].motor_inertia = 0.8;
  const RigidModel with = make_rigid_model(model);
  const Eigen::Vector2d q(0.3, 0.2);
  const Eigen::Vector2d dq(0.5, 0.1);
  const Eigen::Vector2d ddq(-1.0, 2.0);
  const Eigen::VectorXd added =
      inverse_dynamics(with, q, dq, ddq) - inverse_dynamics(without, q, dq, ddq);
  EXPECT_NEAR(added[0], 0.0, kExact);
  EXPECT_NEAR(added[1], 1.6, kExact);
  EXPECT_NEAR(kinetic_energy(with, q, dq) - kinetic_energy(without, q, dq), 0.5 * 0.8 * 0.01,
              kExact);
}

}  // namespace
}  // namespace kinescope
