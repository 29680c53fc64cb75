// SPDX-License-Identifier: Apache-2.0
//
// One gradient step of policy search: 400 particles x 60 steps, 200 basis functions, two processes
// of N samples and six columns, dropout and all random numbers included, on one thread. Beside it
// the two products with the Cholesky factor that it cannot do without, alone, and as triangular
// solves of BLAS.
#include <benchmark/benchmark.h>

#include "dynamics/gp/blas.h"
#include "dynamics/policy/particle_objective.h"
#include "tests/dynamics/policy/policy_world.h"

namespace kinescope::policy {
namespace {

constexpr int kParticles = 400;
constexpr int kSteps = 60;
constexpr int kBasis = 200;

void policy_step(benchmark::State& state, VelocityKernel kernel) {
  const VelocityModel model = random_model(kernel, state.range(0));
  const PolicyTask task = random_task(kSteps);
  const RbfPolicy policy = random_policy(kBasis);
  ParticleObjective objective(model, task, kParticles, kBasis, static_cast<int>(state.range(1)));
  PolicyGradient gradient(policy);
  std::uint32_t step = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(objective.evaluate(policy, {1, step++, 0.25}, &gradient));
  }
}
BENCHMARK_CAPTURE(policy_step, se, VelocityKernel::kSquaredExponential)
    ->Args({60, 1})
    ->Args({120, 1})
    ->Args({300, 1})
    ->Args({120, 2})
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(policy_step, se_p2, VelocityKernel::kPolynomial2)
    ->Args({60, 1})
    ->Args({120, 1})
    ->Args({300, 1})
    ->Args({120, 2})
    ->Unit(benchmark::kMillisecond);

// Value and pullback of all particles, times and processes of such a step.
constexpr int kBlock = 40;
constexpr int kBlocks = kParticles / kBlock * kSteps * 2;

Eigen::MatrixXd factor(Eigen::Index size) {
  Rng rng(1);
  Eigen::MatrixXd out = random_matrix(rng, size, size, 0.01);
  out.triangularView<Eigen::StrictlyUpper>().setZero();
  out.diagonal().setOnes();
  return out;
}

void factor_products(benchmark::State& state) {
  const TriangleProduct product(factor(state.range(0)));
  const LaneMatrix rows(kBlock, state.range(0));
  LaneMatrix v = rows;
  LaneMatrix w = rows;
  for (auto _ : state) {
    for (int k = 0; k < kBlocks; ++k) {
      product.times_transposed(rows, v);
      product.times(v, w);
    }
    benchmark::DoNotOptimize(w.group(0));
  }
}
BENCHMARK(factor_products)->Arg(120)->Arg(300)->Unit(benchmark::kMillisecond);

void factor_solves(benchmark::State& state) {
  Rng rng(2);
  const SingleThreadedBlas one_thread;
  const Eigen::MatrixXd lower = factor(state.range(0));
  const Eigen::MatrixXd rows = random_matrix(rng, kBlock, state.range(0), 1.0);
  Eigen::MatrixXd w = rows;
  for (auto _ : state) {
    for (int k = 0; k < kBlocks; ++k) {
      w = rows;
      gp::solve_lower_transposed_right(lower, w);
      gp::solve_lower_right(lower, w);
    }
    benchmark::DoNotOptimize(w.data());
  }
}
BENCHMARK(factor_solves)->Arg(120)->Arg(300)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace kinescope::policy
