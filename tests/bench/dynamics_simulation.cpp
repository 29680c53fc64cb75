// SPDX-License-Identifier: Apache-2.0
//
// Real-time factor (simulated over elapsed time, counter `real_time`) of the Panda with friction at
// every joint, steps of 1 ms, beside MuJoCo in the same run: its implicit integrator, friction as
// joint constraints, no collisions.
#include <benchmark/benchmark.h>

#include "dynamics/experiments/reference_arms.h"
#include "dynamics/simulation/simulation.h"
#ifdef KINESCOPE_HAVE_MUJOCO
#include "tests/truth/mujoco_model.h"
#endif

namespace kinescope {
namespace {

constexpr double kStep_s = 1e-3;
constexpr int kSteps = 1000;
constexpr double kViscous = 0.5;
constexpr double kCoulomb = 0.4;

DynamicModel arm(double coulomb) {
  DynamicModel out = panda_arm();
  for (const JointId id : moving_joints(out.tree)) {
    out.joints[id.index()] = {.viscous = kViscous, .coulomb = coulomb, .motor_inertia = 0.1};
  }
  return out;
}

void count_real_time(benchmark::State& state) {
  state.counters["real_time"] = benchmark::Counter(
      static_cast<double>(state.iterations()) * kSteps * kStep_s, benchmark::Counter::kIsRate);
}

void ours(benchmark::State& state, double coulomb) {
  const Plant plant = make_plant(with_effects(arm(coulomb)));
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(7);
  const PlantState start = PlantState::at(plant, Eigen::VectorXd::Constant(7, 0.3), still);
  Simulation simulation(plant, start);
  for (auto _ : state) {
    simulation.set_state(start);
    for (int k = 0; k < kSteps; ++k) benchmark::DoNotOptimize(simulation.step(still, kStep_s));
  }
  count_real_time(state);
}
BENCHMARK_CAPTURE(ours, bodies_and_viscous, 0.0);
BENCHMARK_CAPTURE(ours, with_coulomb, kCoulomb);

#ifdef KINESCOPE_HAVE_MUJOCO
void mujoco(benchmark::State& state, double coulomb) {
  const MujocoModel model = to_mujoco(arm(coulomb));
  model->opt.timestep = kStep_s;
  model->opt.disableflags = mjDSBL_CONTACT | mjDSBL_LIMIT;
  for (int d = 0; d < model->nv; ++d) {
    model->dof_damping[d] = kViscous;
    model->dof_frictionloss[d] = coulomb;
  }
  const MujocoData data(mj_makeData(model.get()));
  for (auto _ : state) {
    mj_resetData(model.get(), data.get());
    for (int d = 0; d < model->nq; ++d) data->qpos[d] = 0.3;
    for (int k = 0; k < kSteps; ++k) mj_step(model.get(), data.get());
  }
  count_real_time(state);
}
BENCHMARK_CAPTURE(mujoco, bodies_and_viscous, 0.0);
BENCHMARK_CAPTURE(mujoco, with_coulomb, kCoulomb);
#endif

}  // namespace
}  // namespace kinescope
