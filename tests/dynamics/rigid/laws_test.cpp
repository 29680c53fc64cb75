// SPDX-License-Identifier: Apache-2.0
//
// What holds for every robot, checked on random ones.
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/mass_matrix.h"
#include "dynamics/rigid/regressor.h"
#include "kinematics/core/error.h"
#include "tests/kinematics/model/random_tree.h"
#include "tests/truth/random_dynamics.h"

namespace kinescope {
namespace {

// Sums of some hundred products of numbers up to a few hundred.
constexpr double kRounding = 1e-11;

struct Case {
  DynamicModel dynamic;
  RigidModel model;
  Eigen::VectorXd q;
  Eigen::VectorXd dq;
  Eigen::VectorXd ddq;
};

Case random_case(Rng& rng) {
  Case out;
  while (out.model.bodies.empty()) {
    out.dynamic = random_masses(random_tree(rng, 1 + rng.index(9), 0), {}, rng);
    out.model = make_rigid_model(out.dynamic);
  }
  const RandomStates states = random_states(out.dynamic.tree, 1, rng);
  out.q = states.q.row(0).transpose();
  out.dq = states.dq.row(0).transpose();
  out.ddq = states.ddq.row(0).transpose();
  return out;
}

double size_of(const Eigen::VectorXd& v) { return std::max(1.0, v.lpNorm<Eigen::Infinity>()); }

TEST(RigidLaws, TheTorqueIsTheSumOfItsParts) {
  Rng rng = Rng::from_name("RigidLaws.TheTorqueIsTheSumOfItsParts");
  for (int k = 0; k < 50; ++k) {
    const Case c = random_case(rng);
    const Eigen::VectorXd whole = inverse_dynamics(c.model, c.q, c.dq, c.ddq);
    const Eigen::VectorXd parts = mass_matrix(c.model, c.q) * c.ddq +
                                  coriolis_torque(c.model, c.q, c.dq) +
                                  gravity_torque(c.model, c.q);
    EXPECT_LT((whole - parts).lpNorm<Eigen::Infinity>(), kRounding * size_of(whole));
    EXPECT_LT((coriolis_matrix(c.model, c.q, c.dq) * c.dq - coriolis_torque(c.model, c.q, c.dq))
                  .lpNorm<Eigen::Infinity>(),
              kRounding * size_of(whole));
    const Eigen::VectorXd linear = gravity_jacobian(c.model, c.q) * c.model.gravity_m_s2;
    EXPECT_LT((linear - gravity_torque(c.model, c.q)).lpNorm<Eigen::Infinity>(),
              kRounding * size_of(linear));
  }
}

TEST(RigidLaws, MassMatrixIsSymmetricAndPositive) {
  Rng rng = Rng::from_name("RigidLaws.MassMatrixIsSymmetricAndPositive");
  for (int k = 0; k < 50; ++k) {
    const Case c = random_case(rng);
    const Eigen::MatrixXd M = mass_matrix(c.model, c.q);
    EXPECT_TRUE(M.isApprox(M.transpose(), 0.0));
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(M).eigenvalues()[0], 0.0);
  }
}

// Central differences of M over 1e-6 s leave about 1e-16 / 1e-6 x the size of M.
constexpr double kDifferences = 1e-7;

TEST(RigidLaws, MassRateMinusTwiceCoriolisIsSkew) {
  Rng rng = Rng::from_name("RigidLaws.MassRateMinusTwiceCoriolisIsSkew");
  constexpr double kStep = 1e-6;
  for (int k = 0; k < 50; ++k) {
    const Case c = random_case(rng);
    const Eigen::MatrixXd rate =
        (mass_matrix(c.model, c.q + kStep * c.dq) - mass_matrix(c.model, c.q - kStep * c.dq)) /
        (2.0 * kStep);
    const Eigen::MatrixXd N = rate - 2.0 * coriolis_matrix(c.model, c.q, c.dq);
    const double scale = std::max(1.0, mass_matrix(c.model, c.q).norm());
    EXPECT_LT((N + N.transpose()).norm(), kDifferences * scale);
  }
}

TEST(RigidLaws, ForwardDynamicsInvertsInverseDynamics) {
  Rng rng = Rng::from_name("RigidLaws.ForwardDynamicsInvertsInverseDynamics");
  for (int k = 0; k < 50; ++k) {
    const Case c = random_case(rng);
    const Eigen::VectorXd torque = inverse_dynamics(c.model, c.q, c.dq, c.ddq);
    const Eigen::VectorXd ddq = forward_dynamics(c.model, c.q, c.dq, torque);
    // Times the condition of M, some thousand.
    EXPECT_LT((ddq - c.ddq).lpNorm<Eigen::Infinity>(), 1e-8);
  }
}

TEST(RigidLaws, RegressorTimesParametersIsTheTorque) {
  Rng rng = Rng::from_name("RigidLaws.RegressorTimesParametersIsTheTorque");
  for (int k = 0; k < 50; ++k) {
    const Case c = random_case(rng);
    Eigen::VectorXd motors(c.q.size());
    for (Eigen::Index j = 0; j < motors.size(); ++j) {
      motors[j] = c.model.bodies[static_cast<std::size_t>(j)].motor_inertia * c.ddq[j];
    }
    const Eigen::VectorXd torque = inverse_dynamics(c.model, c.q, c.dq, c.ddq) - motors;
    const double tolerance = kRounding * size_of(torque);
    EXPECT_LT((regressor(c.model, c.q, c.dq, c.ddq) * body_parameters(c.model) - torque)
                  .lpNorm<Eigen::Infinity>(),
              tolerance);
    Eigen::VectorXd links(10 * static_cast<Eigen::Index>(c.dynamic.links.size()));
    for (std::size_t l = 0; l < c.dynamic.links.size(); ++l) {
      links.segment<10>(10 * static_cast<Eigen::Index>(l)) = c.dynamic.links[l].vector();
    }
    EXPECT_LT(
        (link_regressor(c.model, c.q, c.dq, c.ddq) * links - torque).lpNorm<Eigen::Infinity>(),
        tolerance);
  }
}

TEST(RigidLaws, SamplesAreTakenOneByOne) {
  Rng rng = Rng::from_name("RigidLaws.SamplesAreTakenOneByOne");
  const Case c = random_case(rng);
  const RandomStates states = random_states(c.dynamic.tree, 7, rng);
  const Eigen::MatrixXd torques =
      inverse_dynamics_of_samples(c.model, states.q, states.dq, states.ddq);
  const std::vector<Eigen::MatrixXd> Y =
      regressors_of_samples(c.model, states.q, states.dq, states.ddq);
  for (int t = 0; t < 7; ++t) {
    const Eigen::VectorXd q = states.q.row(t).transpose();
    const Eigen::VectorXd dq = states.dq.row(t).transpose();
    const Eigen::VectorXd ddq = states.ddq.row(t).transpose();
    EXPECT_TRUE(inverse_dynamics(c.model, q, dq, ddq).isApprox(torques.row(t).transpose(), 1e-14));
    const Eigen::MatrixXd one = regressor(c.model, q, dq, ddq);
    for (Eigen::Index j = 0; j < one.rows(); ++j) {
      EXPECT_TRUE(one.row(j).isApprox(Y[static_cast<std::size_t>(j)].row(t), 1e-14));
    }
  }
}

/// Energy of a fall without friction, by RK4 over half a second: constant but for the step's error.
TEST(RigidLaws, AFreeFallKeepsItsEnergy) {
  Rng rng = Rng::from_name("RigidLaws.AFreeFallKeepsItsEnergy");
  for (int k = 0; k < 10; ++k) {
    const Case c = random_case(rng);
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(c.q.size());
    const auto acceleration = [&](const Eigen::VectorXd& q, const Eigen::VectorXd& dq) {
      return forward_dynamics(c.model, q, dq, none);
    };
    const auto energy = [&](const Eigen::VectorXd& q, const Eigen::VectorXd& dq) {
      return kinetic_energy(c.model, q, dq) + potential_energy(c.model, q);
    };
    Eigen::VectorXd q = c.q;
    Eigen::VectorXd dq = c.dq;
    const double before = energy(q, dq);
    constexpr double kStep = 2e-4;
    double largest = 0.0;
    for (int s = 0; s < 500; ++s) {
      const Eigen::VectorXd a1 = acceleration(q, dq);
      const Eigen::VectorXd v2 = dq + 0.5 * kStep * a1;
      const Eigen::VectorXd a2 = acceleration(q + 0.5 * kStep * dq, v2);
      const Eigen::VectorXd v3 = dq + 0.5 * kStep * a2;
      const Eigen::VectorXd a3 = acceleration(q + 0.5 * kStep * v2, v3);
      const Eigen::VectorXd v4 = dq + kStep * a3;
      const Eigen::VectorXd a4 = acceleration(q + kStep * v3, v4);
      q += kStep / 6.0 * (dq + 2.0 * v2 + 2.0 * v3 + v4);
      dq += kStep / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
      largest = std::max(largest, kinetic_energy(c.model, q, dq));
    }
    EXPECT_NEAR(energy(q, dq), before, 1e-7 * std::max(1.0, largest));
  }
}

/// The power of the torque is the rate of the energy, along a given motion.
TEST(RigidLaws, PowerIsTheRateOfEnergy) {
  Rng rng = Rng::from_name("RigidLaws.PowerIsTheRateOfEnergy");
  constexpr double kStep = 1e-5;
  for (int k = 0; k < 30; ++k) {
    const Case c = random_case(rng);
    const auto energy = [&](double t) {
      const Eigen::VectorXd q = c.q + t * c.dq + 0.5 * t * t * c.ddq;
      return kinetic_energy(c.model, q, c.dq + t * c.ddq) + potential_energy(c.model, q);
    };
    const double rate = (energy(kStep) - energy(-kStep)) / (2.0 * kStep);
    const double power = c.dq.dot(inverse_dynamics(c.model, c.q, c.dq, c.ddq));
    EXPECT_NEAR(rate, power, 1e-6 * std::max(1.0, std::abs(energy(0.0)) + std::abs(power)));
  }
}

TEST(RigidLaws, MasslessJointsAreRefusedByForwardDynamics) {
  Rng rng = Rng::from_name("RigidLaws.MasslessJointsAreRefused");
  Case c = random_case(rng);
  for (InertialParameters& link : c.dynamic.links) link = {};
  for (JointDynamics& joint : c.dynamic.joints) joint = {};
  EXPECT_THROW(static_cast<void>(forward_dynamics(make_rigid_model(c.dynamic), c.q, c.dq, c.ddq)),
               Error);
}

}  // namespace
}  // namespace kinescope
