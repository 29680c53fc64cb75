// SPDX-License-Identifier: Apache-2.0
//
// Gaussian processes against bare BLAS and LAPACK of the same size, in one run:
//   cmake --preset test -DKINESCOPE_BUILD_BENCHMARKS=ON && ninja -C build/test bench_dynamics_gp
//   build/test/bench_dynamics_gp [--benchmark_filter=...]
// Ratios count, not seconds. The 16000-sample pair takes a minute and 4 GB.
#include <cmath>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "dynamics/gp/blas.h"
#include "dynamics/gp/gaussian_process.h"
#include "dynamics/gp/gram.h"
#include "dynamics/gp/likelihood.h"
#include "dynamics/gp/lip_kernel.h"
#include "dynamics/gp/robot_kernels.h"
#include "dynamics/gp/sparse.h"
#include "kinematics/core/rng.h"
#include "tests/truth/lapack.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

constexpr Index kColumns = 21;

// The context of every run names the kernels that OpenBLAS chose for this processor.
const bool kContext = [] {
  benchmark::AddCustomContext("OpenBLAS kernels", blas_core());
  return true;
}();

Eigen::MatrixXd random_inputs(Index samples, Index columns) {
  Rng rng = Rng::from_name("bench", static_cast<std::uint64_t>(samples));
  Eigen::MatrixXd out(samples, columns);
  for (Index i = 0; i < samples; ++i) {
    for (Index j = 0; j < columns; ++j) out(i, j) = rng.uniform(-1.5, 1.5);
  }
  return out;
}

Dataset make_data(Index samples, Index columns = kColumns, Index outputs = 1) {
  Dataset out{random_inputs(samples, columns), Eigen::MatrixXd(samples, outputs), {}, {}};
  Rng rng = Rng::from_name("bench targets");
  for (Index i = 0; i < samples; ++i) {
    for (Index o = 0; o < outputs; ++o) {
      out.targets(i, o) =
          std::sin(out.inputs(i, o)) + 0.3 * out.inputs.row(i).head(7).sum() + rng.normal(0.02);
    }
  }
  return out;
}

GpModel ard_model() {
  GpModel model = make_model(rbf(first_columns(static_cast<int>(kColumns))), 1e-3);
  Eigen::VectorXd values = model.kernel.log_values();
  values.tail(kColumns).setConstant(std::log(3.0));
  model.kernel = model.kernel.with_log_values(values);
  return model;
}

const JointKinds& seven() {
  static const JointKinds joints(7, JointKind::kRevolute);
  return joints;
}

void likelihood_and_gradient(benchmark::State& state) {
  const GpModel model = ard_model();
  const auto objective = make_objective(model, make_data(state.range(0)),
                                        {.threads = static_cast<int>(state.range(1))});
  const Eigen::VectorXd values = log_values_of(model);
  for (auto _ : state) benchmark::DoNotOptimize(objective->evaluate(values)->value);
}
BENCHMARK(likelihood_and_gradient)
    ->ArgsProduct({{1000, 2000, 4000}, {1, 2}})
    ->ArgNames({"N", "threads"})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

// The factor alone, by LAPACK, with as many threads as OpenBLAS wants.
void bare_dpotrf(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  Eigen::MatrixXd a(n, n);
  const Eigen::MatrixXd x = random_inputs(n, 8);
  for (auto _ : state) {
    state.PauseTiming();
    const int k = 8;
    const double one = 1.0;
    const double zero = 0.0;
    dgemm_("N", "T", &n, &n, &k, &one, x.data(), &n, x.data(), &n, &zero, a.data(), &n);
    a.diagonal().array() += n;
    state.ResumeTiming();
    int info = 0;
    dpotrf_("L", &n, a.data(), &n, &info);
    benchmark::DoNotOptimize(info);
  }
}
BENCHMARK(bare_dpotrf)
    ->Arg(2000)
    ->Arg(4000)
    ->Arg(16000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

// Kernel matrix, factor, both solves, likelihood.
void exact_fit(benchmark::State& state) {
  const GpModel model = ard_model();
  const Dataset data = make_data(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(fit(model, data).log_likelihood);
}
BENCHMARK(exact_fit)
    ->Arg(2000)
    ->Arg(4000)
    ->Arg(16000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

// Two products to stand beside: square ones, and one with as many inner columns as the kernel's
// largest factor has features (36).
void bare_dgemm(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const int k = static_cast<int>(state.range(1));
  const Eigen::MatrixXd a = random_inputs(n, k);
  Eigen::MatrixXd c = Eigen::MatrixXd::Zero(n, n);
  const double one = 1.0;
  const double zero = 0.0;
  for (auto _ : state) {
    dgemm_("N", "T", &n, &n, &k, &one, a.data(), &n, a.data(), &n, &zero, c.data(), &n);
    benchmark::DoNotOptimize(c.data());
  }
}
BENCHMARK(bare_dgemm)
    ->Args({4000, 4000})
    ->Args({4000, 36})
    ->ArgNames({"N", "inner"})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

void gip_covariance(benchmark::State& state) {
  const Kernel kernel = gip(seven());
  const Eigen::MatrixXd x = random_inputs(state.range(0), kColumns);
  Workers workers(static_cast<int>(state.range(1)));
  const Covariance function(kernel);
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(x.rows(), x.rows());
  for (auto _ : state) function.lower(workers, function.prepare(x), out);
}
BENCHMARK(gip_covariance)
    ->Args({4000, 1})
    ->Args({4000, 2})
    ->ArgNames({"N", "threads"})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

void gip_likelihood_and_gradient(benchmark::State& state) {
  const GpModel model = make_model(gip(seven()), 1e-2);
  const auto objective = make_objective(model, make_data(state.range(0)));
  const Eigen::VectorXd values = log_values_of(model);
  for (auto _ : state) benchmark::DoNotOptimize(objective->evaluate(values)->value);
}
BENCHMARK(gip_likelihood_and_gradient)
    ->Arg(500)
    ->Arg(2000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

// 40000 samples, 60 features: fit, then what one step of the search costs.
Kernel sixty_features() {
  return feature_kernel({std::vector<std::string>(60, "f"), 21,
                         [](const Inputs& inputs, Features features) {
                           for (Index k = 0; k < 60; ++k) {
                             features.col(k) = inputs.col(k % 21).array().cos() *
                                               inputs.col((k * 5 + 3) % 21).array();
                           }
                         }},
                        Eigen::MatrixXd::Identity(60, 60));
}

void model_based_fit(benchmark::State& state) {
  const GpModel model = make_model(sixty_features(), 1e-2);
  const Dataset data = make_data(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(fit(model, data).log_likelihood);
}
BENCHMARK(model_based_fit)->Arg(40000)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

void model_based_step(benchmark::State& state) {
  const GpModel model = make_model(sixty_features(), 1e-2);
  const auto objective = make_objective(model, make_data(state.range(0)));
  const Eigen::VectorXd values = log_values_of(model);
  for (auto _ : state) benchmark::DoNotOptimize(objective->evaluate(values)->value);
}
BENCHMARK(model_based_step)->Arg(40000)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

void sparse_fit(benchmark::State& state) {
  const GpModel model = ard_model();
  const Dataset data = make_data(state.range(0));
  const Eigen::MatrixXd inducing = choose_inducing(model, data, {.count = state.range(1)});
  for (auto _ : state) benchmark::DoNotOptimize(fit_sparse(model, data, inducing).log_likelihood);
}
BENCHMARK(sparse_fit)
    ->Args({40000, 300})
    ->ArgNames({"N", "m"})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

void one_sample(benchmark::State& state) {
  const bool variance = state.range(1) != 0;
  const FittedGp fitted = fit(ard_model(), make_data(state.range(0)));
  Predictor predictor(fitted);
  const Eigen::VectorXd x = Eigen::VectorXd::Constant(kColumns, 0.2);
  for (auto _ : state) {
    benchmark::DoNotOptimize(predictor.mean(x)[0]);
    if (variance) benchmark::DoNotOptimize(predictor.variance()[0]);
  }
}
BENCHMARK(one_sample)
    ->ArgsProduct({{1000, 2000, 4000}, {0, 1}})
    ->ArgNames({"N", "variance"})
    ->Unit(benchmark::kMicrosecond)
    ->MeasureProcessCPUTime();

// Seven torques together. 100 samples: one of the authors' mini-batches, five of which are an
// epoch.
void lip_likelihood_and_gradient(benchmark::State& state) {
  const GpModel model = make_model(lip(seven()), 1e-2, {}, true);
  const auto objective = make_objective(model, make_data(state.range(0), 21, 7),
                                        {.threads = static_cast<int>(state.range(1))});
  const Eigen::VectorXd values = log_values_of(model);
  for (auto _ : state) benchmark::DoNotOptimize(objective->evaluate(values)->value);
}
BENCHMARK(lip_likelihood_and_gradient)
    ->ArgsProduct({{100, 501}, {1, 2}})
    ->ArgNames({"N", "threads"})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

void lip_covariance(benchmark::State& state) {
  const Kernel kernel = lip(seven());
  const Eigen::MatrixXd x = random_inputs(state.range(0), 21);
  for (auto _ : state) benchmark::DoNotOptimize(covariance(kernel, x).sum());
}
BENCHMARK(lip_covariance)->Arg(501)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

}  // namespace
}  // namespace kinescope::gp
