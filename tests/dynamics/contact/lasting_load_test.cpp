// SPDX-License-Identifier: Apache-2.0
//
// Loads that last: simulated arms that pick something up, that are leaned on, and that are free.
#include "dynamics/contact/lasting_load.h"

#include <gtest/gtest.h>

#include "dynamics/experiments/contact_world.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

using namespace experiments;

constexpr double kRate_hz = 50.0;
constexpr double kLength_s = 40.0;

/// A free arm with Coulomb and viscous friction, exact but for the noise of its torque.
TorqueSamples free_motion(const DynamicModel& model, Rng& rng) {
  const RigidModel rigid = make_rigid_model(model);
  const auto rows = static_cast<Eigen::Index>(kLength_s * kRate_hz);
  TorqueSamples out;
  out.t_s = Eigen::VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / kRate_hz);
  out.trajectory = Eigen::VectorXi::Zero(rows);
  out.q = out.dq = out.ddq = Eigen::MatrixXd::Zero(rows, rigid.size());
  for (Eigen::Index j = 0; j < rigid.size(); ++j) {
    for (int wave = 0; wave < 4; ++wave) {
      const double omega = rng.uniform(0.5, 3.0);
      const Eigen::ArrayXd angle = omega * out.t_s.array() + rng.uniform(0.0, 6.0);
      out.q.col(j).array() += 0.4 * angle.sin();
      out.dq.col(j).array() += 0.4 * omega * angle.cos();
      out.ddq.col(j).array() -= 0.4 * omega * omega * angle.sin();
    }
  }
  out.torque = inverse_dynamics_of_samples(rigid, out.q, out.dq, out.ddq);
  for (double& value : out.torque.reshaped()) value += rng.normal(0.05);
  out.torque.array() += 0.3 * out.dq.array() + 0.5 * out.dq.array().sign();
  return out;
}

/// What `kg` more at the last link make of the torque from one instant to another.
void load_with(const DynamicModel& model, double kg, double from_s, double to_s,
               TorqueSamples& samples) {
  DynamicModel loaded = model;
  loaded.links.back() += from_central({.mass_kg = kg,
                                       .centre_m = {0.02, 0.03, 0.1},
                                       .inertia_kgm2 = 1e-3 * Eigen::Matrix3d::Identity()});
  const Eigen::MatrixXd more =
      inverse_dynamics_of_samples(make_rigid_model(loaded), samples.q, samples.dq, samples.ddq) -
      inverse_dynamics_of_samples(make_rigid_model(model), samples.q, samples.dq, samples.ddq);
  for (Eigen::Index k = 0; k < samples.size(); ++k) {
    if (samples.t_s[k] >= from_s && samples.t_s[k] < to_s) samples.torque.row(k) += more.row(k);
  }
}

void expect_span(const std::vector<LastingLoad>& loads, const TorqueSamples& samples, double from_s,
                 double to_s) {
  constexpr double kEnd_s = 0.15;
  ASSERT_EQ(loads.size(), 1U);
  EXPECT_NEAR(samples.t_s[loads[0].first], from_s, kEnd_s);
  EXPECT_NEAR(samples.t_s[loads[0].last], to_s, kEnd_s);
}

TEST(LastingLoad, APayloadIsKnownFromWhenItWasPickedUp) {
  const DynamicModel model = contact_arm(4);
  Rng rng = Rng::from_name("lasting.payload");
  TorqueSamples samples = free_motion(model, rng);
  load_with(model, 0.5, 21.3, kLength_s, samples);
  const auto loads = lasting_loads(make_rigid_model(model), samples);
  expect_span(loads, samples, 21.3, kLength_s);
  EXPECT_EQ(loads[0].body, 3);
  EXPECT_TRUE(loads[0].is_payload);
}

TEST(LastingLoad, PickedUpAndPutDown) {
  const DynamicModel model = contact_arm(4);
  Rng rng = Rng::from_name("lasting.put_down");
  TorqueSamples samples = free_motion(model, rng);
  load_with(model, 0.5, 12.0, 24.5, samples);
  expect_span(lasting_loads(make_rigid_model(model), samples), samples, 12.0, 24.5);
}

/// Masses say whether the log begins with the load; free ones do not.
TEST(LastingLoad, ALogThatBeginsWithTheLoad) {
  const DynamicModel model = contact_arm(4);
  Rng rng = Rng::from_name("lasting.begins");
  TorqueSamples samples = free_motion(model, rng);
  load_with(model, 0.5, 0.0, 18.0, samples);
  expect_span(lasting_loads(make_rigid_model(model), samples), samples, 0.0, 18.0);
  expect_span(lasting_loads(make_rigid_model(model), samples, {.masses_known = false}), samples,
              18.0, kLength_s);
}

/// Masses that are declared wrongly are no load, nor is friction that fades.
TEST(LastingLoad, AFreeRobotHasNone) {
  const DynamicModel model = contact_arm(4);
  DynamicModel wrong = model;
  for (InertialParameters& link : wrong.links)
    link = InertialParameters::from_vector(1.2 * link.vector());
  Rng rng = Rng::from_name("lasting.free");
  for (int log = 0; log < 4; ++log) {
    TorqueSamples samples = free_motion(model, rng);
    EXPECT_TRUE(lasting_loads(make_rigid_model(wrong), samples).empty()) << log;
    const Eigen::ArrayXd cold = (-samples.t_s.array() / 10.0).exp();
    samples.torque.array() += 0.3 * (samples.dq.array().sign().colwise() * cold);
    EXPECT_TRUE(lasting_loads(make_rigid_model(wrong), samples).empty()) << log;
  }
}

}  // namespace
}  // namespace kinescope
