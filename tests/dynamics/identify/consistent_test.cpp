// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "dynamics/identify/consistent_model.h"
#include "dynamics/identify/log_cholesky.h"
#include "dynamics/identify/prediction.h"
#include "kinematics/core/error.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/dynamics/identify/random_arm.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

void expect_a_body_everywhere(const DynamicModel& model) {
  for (const InertialParameters& link : model.links) EXPECT_TRUE(is_consistent(link));
  for (const JointDynamics& joint : model.joints) {
    EXPECT_GE(joint.viscous, 0.0);
    EXPECT_GE(joint.coulomb, 0.0);
    EXPECT_GE(joint.motor_inertia, 0.0);
  }
}

TEST(LogCholesky, RoundTripsAndIsAlwaysABody) {
  Rng rng = Rng::from_name("LogCholesky.RoundTrips");
  for (int k = 0; k < 50; ++k) {
    const InertialParameters p = random_inertia({}, rng);
    const identify::LogCholesky theta = identify::log_cholesky(p);
    EXPECT_LT((identify::inertial_vector(theta.data()) - p.vector()).norm(),
              1e-12 * p.vector().norm());
    identify::LogCholesky any;
    for (Eigen::Index i = 0; i < 10; ++i) any[i] = rng.normal();
    EXPECT_TRUE(
        is_consistent(InertialParameters::from_vector(identify::inertial_vector(any.data()))));
  }
}

TEST(Consistent, AGoodFitKeepsItsTorquesAndItsPrior) {
  Rng rng = Rng::from_name("Consistent.AGoodFit");
  const DynamicModel model = random_arm(5, rng);
  const TorqueSamples log = torque_log_of(model, {.noise = 0.005}, rng);
  const Identification fit = identify_dynamics(model, log);
  const ConsistentModel consistent = consistent_model(fit);
  EXPECT_TRUE(consistent.converged);
  expect_a_body_everywhere(consistent.model);
  const Eigen::VectorXd base =
      normalised_error_percent(log.torque, predict_torque(fit, log.q, log.dq, log.ddq).mean);
  const Eigen::VectorXd full = normalised_error_percent(
      log.torque, predict_torque_mean(fit, consistent.parameters, log.q, log.dq, log.ddq));
  // The prior takes less than the noise's own floor of a twentieth.
  EXPECT_LT((full - base).maxCoeff(), 0.05 * base.maxCoeff());
  // The prior is the truth here: what torques do not tell must stay there.
  for (std::size_t l = 1; l < model.links.size(); ++l) {
    EXPECT_NEAR(consistent.model.links[l].mass_kg / model.links[l].mass_kg, 1.0, 0.1);
  }
}

TEST(Consistent, AWrongPriorIsOverruledWhereTorquesSpeak) {
  Rng rng = Rng::from_name("Consistent.AWrongPrior");
  const DynamicModel model = random_arm(4, rng);
  DynamicModel wrong = model;
  for (std::size_t l = 1; l < wrong.links.size(); ++l) {
    wrong.links[l] =
        InertialParameters::from_vector(rng.uniform(0.5, 2.0) * model.links[l].vector());
  }
  const TorqueSamples log = torque_log_of(model, {.samples = 4000, .noise = 0.003}, rng);
  const Identification fit = identify_dynamics(wrong, log);
  const ConsistentModel consistent = consistent_model(fit);
  expect_a_body_everywhere(consistent.model);
  const Eigen::MatrixXd torque =
      predict_torque_mean(fit, consistent.parameters, log.q, log.dq, log.ddq);
  EXPECT_LT(normalised_error_percent(log.torque, torque).maxCoeff(), 0.0015);
}

TEST(Consistent, NoiseThatMakesTheBaseFitImpossibleStillGivesBodies) {
  Rng rng = Rng::from_name("Consistent.Noise");
  for (int k = 0; k < 5; ++k) {
    const DynamicModel model = random_arm(5, rng);
    const TorqueSamples log = torque_log_of(model, {.samples = 400, .noise = 0.3}, rng);
    const Identification fit = identify_dynamics(model, log);
    const ConsistentModel consistent = consistent_model(fit);
    EXPECT_TRUE(consistent.converged);
    expect_a_body_everywhere(consistent.model);
  }
}

TEST(Consistent, WithoutAPriorLinksGetAPlainOne) {
  Rng rng = Rng::from_name("Consistent.WithoutAPrior");
  const DynamicModel model = random_arm(3, rng);
  DynamicModel bare = without_masses(model.tree);
  bare.gravity_m_s2 = model.gravity_m_s2;
  const TorqueSamples log = torque_log_of(model, {.noise = 0.002}, rng);
  const Identification fit = identify_dynamics(bare, log);
  const ConsistentModel consistent = consistent_model(fit);
  EXPECT_EQ(consistent.replaced_priors.size(), 3U);
  expect_a_body_everywhere(consistent.model);
  EXPECT_LT(normalised_error_percent(
                log.torque, predict_torque_mean(fit, consistent.parameters, log.q, log.dq, log.ddq))
                .maxCoeff(),
            0.001);
}

TEST(Consistent, ReadBackFromUrdfItPredictsTheSame) {
  Rng rng = Rng::from_name("Consistent.ReadBackFromUrdf");
  DynamicModel model = random_arm(4, rng);
  Joint tool;
  tool.name = "tool_joint";
  tool.parent = LinkId{4};
  tool.child = LinkId{5};
  tool.T_parent_joint.translation = {0.0, 0.0, 0.1};
  model.tree.joints.push_back(tool);
  model.tree.links.push_back({"tool"});
  model.links.push_back(random_inertia({.mass_kg = 0.2, .size_m = 0.03}, rng));
  model.joints.emplace_back();
  const TorqueSamples log = torque_log_of(model, {.noise = 0.005}, rng);
  const Identification fit = identify_dynamics(model, log);
  const ConsistentModel consistent = consistent_model(fit);
  expect_a_body_everywhere(consistent.model);
  DynamicModel back = parse_dynamic_urdf(write_urdf(consistent.model), "written");
  back.gravity_m_s2 = model.gravity_m_s2;
  Rng unused(1);
  TorqueWorldOptions quiet{.noise = 0.0};
  // Its own world's torques are the fit's predictions, but for the offsets.
  const RigidModel rigid = make_rigid_model(back);
  EXPECT_LT((body_parameters(rigid) - consistent.terms.head(10 * rigid.size())).norm(),
            1e-10 * body_parameters(rigid).norm());
  EXPECT_DOUBLE_EQ(back.joints[1].viscous, consistent.model.joints[1].viscous);
  EXPECT_DOUBLE_EQ(back.joints[1].motor_inertia, consistent.model.joints[1].motor_inertia);
}

// What the torques show of a body stays, what they do not show gives way.
TEST(Consistent, ABodyIsNearWhereItIsKnown) {
  Rng rng = Rng::from_name("Consistent.ABody");
  const InertialParameters prior = random_inertia({}, rng);
  const InertialParameters other = random_inertia({}, rng);
  constexpr double kKnown = 1e10;  // 1 / sigma^2
  EXPECT_LT(
      (consistent_body(other, kKnown * Matrix10d::Identity(), prior).vector() - other.vector())
          .norm(),
      1e-6 * other.vector().norm());
  EXPECT_LT((consistent_body(other, Matrix10d::Zero(), prior).vector() - prior.vector()).norm(),
            1e-3 * prior.vector().norm());
  InertialParameters none = other;
  none.inertia_kgm2 = -other.inertia_kgm2;
  ASSERT_FALSE(is_consistent(none));
  Matrix10d information = Matrix10d::Zero();
  information.diagonal().head<4>().setConstant(kKnown);
  const InertialParameters body = consistent_body(none, information, prior);
  EXPECT_TRUE(is_consistent(body));
  EXPECT_LT((body.vector() - none.vector()).head<4>().norm(),
            1e-4 * none.vector().head<4>().norm());
  // A prior that no body has is no reason to give up; one without a mass is.
  EXPECT_TRUE(is_consistent(consistent_body(none, information, none)));
  EXPECT_THROW(static_cast<void>(consistent_body(none, information, {})), Error);
}

TEST(Consistent, ASoftPriorIsRefusedOnlyWhenItIsNone) {
  Rng rng = Rng::from_name("Consistent.ASoftPrior");
  const DynamicModel model = random_arm(2, rng);
  const Identification fit = identify_dynamics(model, torque_log_of(model, {}, rng));
  EXPECT_THROW(static_cast<void>(consistent_model(fit, {.prior_relative_sigma = 0.0})), Error);
  EXPECT_THROW(static_cast<void>(consistent_model(Identification{})), std::logic_error);
}

}  // namespace
}  // namespace kinescope
