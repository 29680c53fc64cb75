// SPDX-License-Identifier: Apache-2.0
//
// Rigid-body dynamics per sample of a seven-joint arm, beside KDL in the same run. Items are
// samples.
#include <benchmark/benchmark.h>

#include "dynamics/rigid/base_parameters.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/mass_matrix.h"
#include "dynamics/rigid/regressor.h"
#include "tests/truth/random_dynamics.h"

#ifdef KINESCOPE_HAVE_KDL
#include <kdl/chainidsolver_recursive_newton_euler.hpp>

#include "tests/truth/kdl_tree.h"
#endif

namespace kinescope {
namespace {

constexpr int kSamples = 1000;

struct Arm {
  DynamicModel dynamic;
  RigidModel model;
  RandomStates states;
};

const Arm& arm() {
  static const Arm instance = [] {
    Rng rng = Rng::from_name("bench.arm");
    Arm out;
    out.dynamic = random_masses(random_robot({.joints = 7, .prismatic_share = 0.0}, rng).tree,
                                {.motors = false}, rng);
    out.model = make_rigid_model(out.dynamic);
    out.states = random_states(out.dynamic.tree, kSamples, rng);
    return out;
  }();
  return instance;
}

void newton_euler_of_a_log(benchmark::State& state) {
  const Arm& a = arm();
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        inverse_dynamics_of_samples(a.model, a.states.q, a.states.dq, a.states.ddq));
  }
  state.SetItemsProcessed(state.iterations() * kSamples);
}
BENCHMARK(newton_euler_of_a_log);

void newton_euler_one_by_one(benchmark::State& state) {
  const Arm& a = arm();
  const Eigen::VectorXd q = a.states.q.row(0).transpose();
  const Eigen::VectorXd dq = a.states.dq.row(0).transpose();
  const Eigen::VectorXd ddq = a.states.ddq.row(0).transpose();
  for (auto _ : state) benchmark::DoNotOptimize(inverse_dynamics(a.model, q, dq, ddq));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(newton_euler_one_by_one);

#ifdef KINESCOPE_HAVE_KDL
void newton_euler_of_kdl(benchmark::State& state) {
  const Arm& a = arm();
  KDL::Chain chain;
  const KDL::Tree tree = to_kdl(a.dynamic);
  tree.getChain(a.dynamic.tree.links.front().name, a.dynamic.tree.links.back().name, chain);
  KDL::ChainIdSolver_RNE solver(chain, to_kdl(a.model.gravity_m_s2));
  KDL::JntArray q(7);
  KDL::JntArray dq(7);
  KDL::JntArray ddq(7);
  KDL::JntArray torque(7);
  const KDL::Wrenches none(chain.getNrOfSegments(), KDL::Wrench::Zero());
  for (auto _ : state) {
    for (Eigen::Index t = 0; t < kSamples; ++t) {
      q.data = a.states.q.row(t).transpose();
      dq.data = a.states.dq.row(t).transpose();
      ddq.data = a.states.ddq.row(t).transpose();
      solver.CartToJnt(q, dq, ddq, none, torque);
      benchmark::DoNotOptimize(torque.data.data());
    }
  }
  state.SetItemsProcessed(state.iterations() * kSamples);
}
BENCHMARK(newton_euler_of_kdl);
#endif

void regressors_of_a_log(benchmark::State& state) {
  const Arm& a = arm();
  for (auto _ : state) {
    benchmark::DoNotOptimize(regressors_of_samples(a.model, a.states.q, a.states.dq, a.states.ddq));
  }
  state.SetItemsProcessed(state.iterations() * kSamples);
}
BENCHMARK(regressors_of_a_log);

/// The slow road to the same regressor: one Newton-Euler pass for each of the 70 parameters.
void regressors_by_unit_parameters(benchmark::State& state) {
  const Arm& a = arm();
  std::vector<RigidModel> units;
  for (Eigen::Index k = 0; k < 70; ++k) {
    units.push_back(with_body_parameters(a.model, Eigen::VectorXd::Unit(70, k)));
  }
  for (auto _ : state) {
    for (const RigidModel& unit : units) {
      benchmark::DoNotOptimize(
          inverse_dynamics_of_samples(unit, a.states.q, a.states.dq, a.states.ddq));
    }
  }
  state.SetItemsProcessed(state.iterations() * kSamples);
}
BENCHMARK(regressors_by_unit_parameters);

void forward_dynamics_of_a_state(benchmark::State& state) {
  const Arm& a = arm();
  const Eigen::VectorXd q = a.states.q.row(0).transpose();
  const Eigen::VectorXd dq = a.states.dq.row(0).transpose();
  const Eigen::VectorXd torque = a.states.ddq.row(0).transpose();
  for (auto _ : state) benchmark::DoNotOptimize(forward_dynamics(a.model, q, dq, torque));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(forward_dynamics_of_a_state);

void base_parameters_of_an_arm(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(base_parameters(arm().model));
}
BENCHMARK(base_parameters_of_an_arm)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace kinescope
