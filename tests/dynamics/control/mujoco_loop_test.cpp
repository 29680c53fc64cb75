// SPDX-License-Identifier: Apache-2.0
//
// The same controllers around MuJoCo's arm and around ours: the same tracking errors.
#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/control/controller.h"
#include "dynamics/experiments/reference_arms.h"
#include "dynamics/rigid/mass_matrix.h"
#include "dynamics/simulation/simulation.h"
#ifdef KINESCOPE_HAVE_MUJOCO
#include "tests/truth/mujoco_model.h"
#endif

namespace kinescope {
namespace {

#ifdef KINESCOPE_HAVE_MUJOCO
constexpr double kStep_s = 2e-4;
constexpr int kSteps = 4000;
constexpr int kJoints = 7;

DynamicModel arm_with_rotors() {
  DynamicModel out = panda_arm();
  for (const JointId id : moving_joints(out.tree)) out.joints[id.index()].motor_inertia = 0.2;
  return out;
}

/// What the controller believes: masses a fifth too small, so that there is an error to compare.
RigidModel believed() {
  DynamicModel out = arm_with_rotors();
  for (InertialParameters& link : out.links) {
    link = InertialParameters::from_vector(0.8 * link.vector());
  }
  return make_rigid_model(out);
}

Eigen::VectorXd middle() {
  return (Eigen::VectorXd(kJoints) << 0.1, 0.4, -0.3, -1.6, 0.2, 1.7, 0.5).finished();
}

MotionPoint reference_at(double t_s) {
  MotionPoint out{t_s, middle(), Eigen::VectorXd(kJoints), Eigen::VectorXd(kJoints)};
  for (int j = 0; j < kJoints; ++j) {
    const double w = 2.0 + 0.7 * j;
    out.q[j] += 0.3 * (1.0 - std::cos(w * t_s));
    out.dq[j] = 0.3 * w * std::sin(w * t_s);
    out.ddq[j] = 0.3 * w * w * std::cos(w * t_s);
  }
  return out;
}

Controller controller(ControlLaw law) {
  constexpr double kBandwidth_hz = 3.0;
  const RigidModel nominal = believed();
  return Controller({.nominal = nominal},
                    {.law = law,
                     .gains = servo_gains(mass_matrix(nominal, middle()), kBandwidth_hz),
                     .bandwidth_hz = kBandwidth_hz,
                     .rate_hz = 1.0 / kStep_s});
}

Eigen::VectorXd our_end(ControlLaw law) {
  Controller control = controller(law);
  const Plant plant = make_plant(with_effects(arm_with_rotors()));
  Simulation simulation(plant, PlantState::at(plant, middle(), Eigen::VectorXd::Zero(kJoints)));
  for (int k = 0; k < kSteps; ++k) {
    const MotionPoint now = reference_at(k * kStep_s);
    const PlantState& state = simulation.state();
    (void)simulation.step(control.command(now, {state.q, state.dq, now.q, now.dq}), kStep_s);
  }
  return simulation.state().q;
}

Eigen::VectorXd mujoco_end(ControlLaw law) {
  Controller control = controller(law);
  const MujocoModel model = to_mujoco(arm_with_rotors());
  model->opt.timestep = kStep_s;
  model->opt.integrator = mjINT_RK4;
  const MujocoData data(mj_makeData(model.get()));
  Eigen::Map<Eigen::VectorXd> q(data->qpos, kJoints);
  const Eigen::Map<Eigen::VectorXd> dq(data->qvel, kJoints);
  Eigen::Map<Eigen::VectorXd> torque(data->qfrc_applied, kJoints);
  q = middle();
  for (int k = 0; k < kSteps; ++k) {
    const MotionPoint now = reference_at(k * kStep_s);
    torque = control.command(now, {q, dq, now.q, now.dq});
    mj_step(model.get(), data.get());
  }
  return q;
}

TEST(Mujoco, ItsArmFollowsAsOursDoes) {
  // Two integrators at 0.2 ms, of order 2 and 4; the errors themselves are hundreds of times that.
  constexpr double kIntegrators_rad = 1e-5;
  for (const ControlLaw law : all_control_laws()) {
    const Eigen::VectorXd ours = our_end(law);
    EXPECT_GT((ours - reference_at(kSteps * kStep_s).q).lpNorm<Eigen::Infinity>(),
              200.0 * kIntegrators_rad)
        << to_string(law);
    EXPECT_LT((ours - mujoco_end(law)).lpNorm<Eigen::Infinity>(), kIntegrators_rad)
        << to_string(law);
  }
}
#else
TEST(Mujoco, ItsArmFollowsAsOursDoes) { GTEST_SKIP() << "MuJoCo is not installed"; }
#endif

}  // namespace
}  // namespace kinescope
