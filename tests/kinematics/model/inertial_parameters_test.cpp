// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/inertial_parameters.h"

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"
#include "kinematics/model/dynamic_model.h"
#include "tests/kinematics/model/random_tree.h"

namespace kinescope {
namespace {

// A few operations on numbers of about 1.
constexpr double kRounding = 1e-13;

/// Particles, and what they amount to by the definitions.
struct Particles {
  std::vector<double> mass_kg;
  std::vector<Eigen::Vector3d> at_m;
};

Particles random_particles(Rng& rng, int count) {
  Particles out;
  for (int k = 0; k < count; ++k) {
    out.mass_kg.push_back(rng.uniform(0.1, 1.0));
    out.at_m.push_back(rng.normal3(0.4));
  }
  return out;
}

InertialParameters amount(const Particles& particles, const Pose& T_a_b) {
  InertialParameters out;
  for (std::size_t k = 0; k < particles.at_m.size(); ++k) {
    const Eigen::Vector3d r = T_a_b * particles.at_m[k];
    const double m = particles.mass_kg[k];
    out +=
        {.mass_kg = m,
         .first_moment_kgm = m * r,
         .inertia_kgm2 = m * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose())};
  }
  return out;
}

double distance(const InertialParameters& a, const InertialParameters& b) {
  return (a.vector() - b.vector()).norm();
}

TEST(InertialParameters, AnotherFrameSeesTheSameParticles) {
  Rng rng = Rng::from_name("InertialParameters.AnotherFrame");
  for (int k = 0; k < 50; ++k) {
    const Particles particles = random_particles(rng, 1 + rng.index(5));
    const Pose T_a_b = random_pose(rng);
    const InertialParameters in_b = amount(particles, {});
    const InertialParameters in_a = amount(particles, T_a_b);
    EXPECT_LT(distance(in_frame(T_a_b, in_b), in_a), kRounding * 10);
    EXPECT_LT((inertial_frame_change(T_a_b) * in_b.vector() - in_a.vector()).norm(),
              kRounding * 10);
  }
}

TEST(InertialParameters, RoundTrips) {
  Rng rng = Rng::from_name("InertialParameters.RoundTrips");
  for (int k = 0; k < 50; ++k) {
    const InertialParameters p = amount(random_particles(rng, 6), {});
    EXPECT_EQ(InertialParameters::from_vector(p.vector()), p);
    EXPECT_LT(distance(from_central(to_central(p)), p), kRounding);
    EXPECT_LT(distance(from_pseudo_inertia(pseudo_inertia(p)), p), kRounding);
  }
}

TEST(InertialParameters, CentralFormOfAPoint) {
  const CentralInertia point =
      to_central(from_central({.mass_kg = 2.0, .centre_m = {0.1, -0.2, 0.3}}));
  EXPECT_LT((point.centre_m - Eigen::Vector3d(0.1, -0.2, 0.3)).norm(), kRounding);
  EXPECT_LT(point.inertia_kgm2.norm(), kRounding);
  EXPECT_THROW(static_cast<void>(to_central({})), std::logic_error);
}

TEST(InertialParameters, PseudoInertiaIsTheSumOverParticles) {
  Rng rng = Rng::from_name("InertialParameters.PseudoInertia");
  const Particles particles = random_particles(rng, 5);
  Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
  for (std::size_t k = 0; k < 5; ++k) {
    const Eigen::Vector4d r = particles.at_m[k].homogeneous();
    sum += particles.mass_kg[k] * r * r.transpose();
  }
  EXPECT_LT((pseudo_inertia(amount(particles, {})) - sum).norm(), kRounding);
}

TEST(InertialParameters, SpatialInertiaGivesTheKineticEnergy) {
  Rng rng = Rng::from_name("InertialParameters.SpatialInertia");
  const Particles particles = random_particles(rng, 5);
  const Eigen::Vector3d omega = rng.normal3();
  const Eigen::Vector3d v = rng.normal3();
  double twice = 0.0;
  for (std::size_t k = 0; k < 5; ++k) {
    twice += particles.mass_kg[k] * (v + omega.cross(particles.at_m[k])).squaredNorm();
  }
  Vector6d twist;
  twist << omega, v;
  EXPECT_NEAR(twist.dot(spatial_inertia(amount(particles, {})) * twist), twice, 1e-12);
}

TEST(InertialParameters, ConsistencyIsThatOfMassDistributions) {
  Rng rng = Rng::from_name("InertialParameters.Consistency");
  EXPECT_TRUE(is_consistent({}));
  for (int k = 0; k < 20; ++k) {
    EXPECT_TRUE(is_consistent(amount(random_particles(rng, 1 + rng.index(6)), {})));
  }
  CentralInertia body{.mass_kg = 1.0, .inertia_kgm2 = Eigen::Vector3d(1, 1, 2).asDiagonal()};
  EXPECT_TRUE(is_consistent(from_central(body)));  // a flat plate: on the border
  body.inertia_kgm2(2, 2) = 2.01;                  // triangle inequality
  EXPECT_FALSE(is_consistent(from_central(body)));
  body.inertia_kgm2(2, 2) = 1.0;
  body.mass_kg = -1.0;
  EXPECT_FALSE(is_consistent(from_central(body)));
  body.mass_kg = std::nan("");
  EXPECT_FALSE(is_consistent(from_central(body)));
}

TEST(DynamicModel, ChecksItsSizesAndNumbers) {
  Rng rng = Rng::from_name("DynamicModel.ChecksItsSizesAndNumbers");
  const DynamicModel good = without_masses(random_tree(rng, 5, 0));
  EXPECT_NO_THROW(check_model(good));
  DynamicModel bad = good;
  bad.links.pop_back();
  EXPECT_THROW(check_model(bad), std::logic_error);
  bad = good;
  bad.joints.emplace_back();
  EXPECT_THROW(check_model(bad), std::logic_error);
  bad = good;
  bad.links[1].mass_kg = std::nan("");
  EXPECT_THROW(check_model(bad), std::logic_error);
  bad = good;
  bad.joints[0].coulomb = std::nan("");
  EXPECT_THROW(check_model(bad), std::logic_error);
  bad = good;
  bad.gravity_m_s2[0] = std::nan("");
  EXPECT_THROW(check_model(bad), std::logic_error);
}

TEST(DynamicModel, MovingJointsKeepTheirOrder) {
  Rng rng = Rng::from_name("DynamicModel.MovableJoints");
  const KinematicTree tree = random_tree(rng, 12, 0);
  int last = -1;
  std::size_t fixed = 0;
  for (const Joint& joint : tree.joints) fixed += joint.type == JointType::kFixed ? 1 : 0;
  const std::vector<JointId> joints = moving_joints(tree);
  EXPECT_EQ(joints.size() + fixed, tree.joints.size());
  for (const JointId id : joints) {
    EXPECT_GT(id.value, last);
    EXPECT_NE(tree.joints[id.index()].type, JointType::kFixed);
    last = id.value;
  }
}

}  // namespace
}  // namespace kinescope
