// SPDX-License-Identifier: Apache-2.0
//
// The robot that MuJoCo reads from our MJCF moves as it does in our own simulation.
#include "kinematics/urdf/mjcf.h"

#include <cmath>
#include <fstream>

#include <gtest/gtest.h>

#include "dynamics/experiments/reference_arms.h"
#include "dynamics/simulation/simulation.h"
#include "kinematics/core/error.h"
#include "tests/truth/temporary_path.h"
#ifdef KINESCOPE_HAVE_MUJOCO
#include "tests/truth/mujoco_model.h"
#endif

namespace kinescope {
namespace {

DynamicModel arm(double coulomb) {
  DynamicModel out = panda_arm();
  for (const JointId id : moving_joints(out.tree)) {
    out.joints[id.index()] = {.viscous = 8.0, .coulomb = coulomb, .motor_inertia = 0.2};
    out.tree.joints[id.index()].limits = JointLimits{-10.0, 10.0};
  }
  out.gravity_m_s2 = {1.0, 2.0, -9.0};
  return out;
}

#ifdef KINESCOPE_HAVE_MUJOCO
constexpr double kStep_s = 2e-4;
constexpr double kLast_s = 1.0;

Eigen::VectorXd torque_at(double t_s) {
  Eigen::VectorXd out(7);
  for (int j = 0; j < 7; ++j) out[j] = (j < 4 ? 12.0 : 2.0) * std::sin((2.0 + j) * t_s + 0.3 * j);
  return out;
}

Eigen::VectorXd our_end(const DynamicModel& model, const std::vector<TorqueEffect>& effects) {
  const Plant plant = make_plant(with_effects(model, effects));
  Simulation simulation(
      plant, PlantState::at(plant, Eigen::VectorXd::Constant(7, 0.2), Eigen::VectorXd::Zero(7)));
  const auto steps = static_cast<int>(std::lround(kLast_s / kStep_s));
  for (int k = 0; k < steps; ++k) (void)simulation.step(torque_at((k + 0.5) * kStep_s), kStep_s);
  return simulation.state().q;
}

Eigen::VectorXd mujoco_end(const DynamicModel& model, const MjcfOptions& options) {
  const auto path = truth::temporary_path("arm.xml");
  std::ofstream(path) << write_mjcf(model, options);
  char error[1000] = "";
  const MujocoModel loaded(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
  EXPECT_NE(loaded, nullptr) << error;
  if (loaded == nullptr) return Eigen::VectorXd::Zero(7);
  EXPECT_EQ(loaded->nu, 7);
  EXPECT_EQ(loaded->opt.timestep, options.step_s);
  const MujocoData data(mj_makeData(loaded.get()));
  for (int d = 0; d < loaded->nq; ++d) data->qpos[d] = 0.2;
  const auto steps = static_cast<int>(std::lround(kLast_s / options.step_s));
  for (int k = 0; k < steps; ++k) {
    const Eigen::VectorXd torque = torque_at((k + 0.5) * options.step_s);
    for (int d = 0; d < 7; ++d) data->ctrl[d] = torque[d];
    mj_step(loaded.get(), data.get());
  }
  Eigen::VectorXd out(7);
  const std::vector<JointId> joints = moving_joints(model.tree);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const int theirs =
        mj_name2id(loaded.get(), mjOBJ_JOINT, model.tree.joints[joints[j].index()].name.c_str());
    out[static_cast<Eigen::Index>(j)] = data->qpos[loaded->jnt_qposadr[theirs]];
  }
  return out;
}

TEST(Mjcf, MovesInMujocoAsInOurSimulation) {
  const DynamicModel model = arm(0.0);
  const Eigen::VectorXd ours = our_end(model, {});
  const Eigen::VectorXd theirs = mujoco_end(model, {.step_s = kStep_s});
  std::printf("after %.0f s, without dry friction: %.1e rad apart\n", kLast_s,
              (ours - theirs).lpNorm<Eigen::Infinity>());
  // MuJoCo's semi-implicit Euler at 0.2 ms.
  EXPECT_LT((ours - theirs).lpNorm<Eigen::Infinity>(), 1e-3);
  // Half the step halves the difference: it is their integrator's, of order 1.
  const Eigen::VectorXd finer = mujoco_end(model, {.step_s = kStep_s / 4.0});
  EXPECT_LT((ours - finer).norm(), 0.4 * (ours - theirs).norm());
}

TEST(Mjcf, RubsInMujocoAsInOurSimulation) {
  const DynamicModel model = arm(1.5);
  const Eigen::VectorXd ours = our_end(model, {});
  const Eigen::VectorXd theirs = mujoco_end(model, {.step_s = kStep_s});
  const Eigen::VectorXd without = our_end(arm(0.0), {});
  std::printf("with dry friction: %.1e rad apart, of %.1e that it does\n",
              (ours - theirs).lpNorm<Eigen::Infinity>(),
              (ours - without).lpNorm<Eigen::Infinity>());
  // MuJoCo's friction is a soft constraint, which gives way a little.
  EXPECT_LT((ours - theirs).norm(), 0.05 * (ours - without).norm());
}

TEST(Mjcf, SpringsPullInMujocoAsInOurSimulation) {
  const DynamicModel model = arm(0.0);
  const std::string joint = model.tree.joints[moving_joints(model.tree)[1].index()].name;
  TorqueEffect spring;
  spring.id = {"spring", joint};
  spring.values = Eigen::Vector2d(30.0, -12.0);
  MjcfOptions options{.step_s = kStep_s};
  options.springs[joint] = {30.0, 0.4};
  EXPECT_LT((our_end(model, {spring}) - mujoco_end(model, options)).norm(), 1e-2);
  EXPECT_GT((our_end(model, {spring}) - our_end(model, {})).norm(), 0.1);
}
TEST(Mjcf, CarriesALoadInMujocoAsInOurSimulation) {
  const DynamicModel model = arm(0.0);
  const LinkId last = model.tree.joints[moving_joints(model.tree).back().index()].child;
  // A point mass, and one whose estimated inertia no body has.
  const InertialParameters point = from_central({1.5, {0.02, -0.05, 0.1}, Eigen::Matrix3d::Zero()});
  Eigen::VectorXd estimated = point.vector();
  estimated.tail(6) *= 0.1;
  DynamicModel loaded = model;
  loaded.links[last.index()] += point;
  const Eigen::VectorXd ours = our_end(loaded, {});
  EXPECT_GT((ours - our_end(model, {})).norm(), 0.05);
  for (const auto& load : {point, InertialParameters::from_vector(estimated)}) {
    MjcfOptions options{.step_s = kStep_s};
    options.carried = {{"load", model.tree.links[last.index()].name, load}};
    EXPECT_LT((mujoco_end(model, options) - ours).lpNorm<Eigen::Infinity>(), 1e-3);
  }
}

#else
TEST(Mjcf, MovesInMujocoAsInOurSimulation) {
  GTEST_SKIP() << "MuJoCo (package libmujoco-dev) was not installed when this was built";
}
#endif

TEST(Mjcf, RefusesBodiesThatMujocoRefuses) {
  DynamicModel weightless = arm(0.0);
  for (InertialParameters& link : weightless.links) link = {};
  EXPECT_THROW((void)write_mjcf(weightless), Error);
  DynamicModel impossible = arm(0.0);
  impossible.links[3].inertia_kgm2 *= -1.0;
  EXPECT_THROW((void)write_mjcf(impossible), Error);
}

TEST(Mjcf, TheSameModelGivesTheSameText) {
  EXPECT_EQ(write_mjcf(arm(1.0), {.notes = {"a -- b"}}),
            write_mjcf(arm(1.0), {.notes = {"a -- b"}}));
  EXPECT_EQ(write_mjcf(arm(1.0), {.notes = {"a -- b"}}).find("a -- b"), std::string::npos);
}

}  // namespace
}  // namespace kinescope
