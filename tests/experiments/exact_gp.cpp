// SPDX-License-Identifier: Apache-2.0
//
// All samples in one exact Gaussian process: time and memory, in one process beside LAPACK's bare
// factor of the same size, and over the processes of mpirun.
//   build/test/exact_gp --samples 40000      # 13 GB; 21 inputs, one output, all threads
//   mpirun --oversubscribe --bind-to none -n 2 build/test/exact_gp --threads 1 --no-dpotrf
//   mpirun --oversubscribe -n 4 build/test/exact_gp --samples 1500 --no-dpotrf --against-one
// The last one compares with one process's answers: exit code 1 where they differ by more than
// 1e-8, relative.
#include <chrono>
#include <cmath>
#include <ctime>
#include <fstream>
#include <string>

#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <fmt/format.h>

#include "dynamics/gp/gaussian_process.h"
#include "dynamics/gp/process_group.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"
#include "tests/truth/lapack.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

constexpr int kColumns = 21;

struct Options {
  int samples = 10000;
  int test_samples = 256;
  int threads = 0;
  double most_mb = 0.0;
  bool without_dpotrf = false;
  bool against_one = false;
};

// Of a machine that others use, the time of all its processors tells more.
struct Times {
  double wall_s = 0.0, processor_s = 0.0;
};

class Stopwatch {
 public:
  [[nodiscard]] Times times() const {
    return {std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count(),
            static_cast<double>(std::clock() - processor_) / CLOCKS_PER_SEC};
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  std::clock_t processor_ = std::clock();
};

Dataset make_data(int samples, std::string_view name) {
  Rng rng = Rng::from_name(name, static_cast<std::uint64_t>(samples));
  Dataset out{Eigen::MatrixXd(samples, kColumns), Eigen::MatrixXd(samples, 1), {}, {}};
  for (Index i = 0; i < samples; ++i) {
    for (Index j = 0; j < kColumns; ++j) out.inputs(i, j) = rng.uniform(-1.5, 1.5);
    out.targets(i, 0) =
        std::sin(out.inputs(i, 0)) + 0.3 * out.inputs.row(i).head(7).sum() + rng.normal(0.02);
  }
  return out;
}

GpModel ard_model() {
  GpModel model = make_model(rbf(first_columns(kColumns)), 1e-3);
  Eigen::VectorXd values = model.kernel.log_values();
  values.tail(kColumns).setConstant(std::log(3.0));
  model.kernel = model.kernel.with_log_values(values);
  return model;
}

// The most that this process has held so far.
double peak_gb() {
  std::ifstream file("/proc/self/status");
  std::string line;
  while (std::getline(file, line)) {
    if (line.starts_with("VmHWM:")) return std::stod(line.substr(6)) * 1024.0 / 1e9;
  }
  return std::nan("");
}

Times times_of_dpotrf(int n) {
  Eigen::MatrixXd a(n, n);
  const Eigen::MatrixXd x = make_data(n, "dpotrf").inputs;
  const int k = 8;
  const double one = 1.0;
  const double zero = 0.0;
  dgemm_("N", "T", &n, &n, &k, &one, x.data(), &n, x.data(), &n, &zero, a.data(), &n);
  a.diagonal().array() += n;
  const Stopwatch watch;
  int info = 0;
  dpotrf_("L", &n, a.data(), &n, &info);
  return watch.times();
}

struct Answers {
  double log_likelihood = 0.0;
  Prediction prediction;
  Times fit, predict;
};

Answers answers_of(const Options& options) {
  Answers out;
  const Stopwatch fit_watch;
  const FittedGp fitted =
      fit(ard_model(), make_data(options.samples, "train"),
          {.threads = options.threads,
           .memory_limit_bytes = static_cast<std::size_t>(1e6 * options.most_mb)});
  out.fit = fit_watch.times();
  out.log_likelihood = fitted.log_likelihood;
  const Stopwatch predict_watch;
  out.prediction =
      predict(fitted, make_data(options.test_samples, "test").inputs, {.threads = options.threads});
  out.predict = predict_watch.times();
  return out;
}

double furthest(const Answers& a, const Answers& b) {
  const auto apart = [](const Eigen::MatrixXd& x, const Eigen::MatrixXd& y) {
    return (x - y).cwiseAbs().maxCoeff() / y.cwiseAbs().maxCoeff();
  };
  return std::max({std::abs(a.log_likelihood / b.log_likelihood - 1.0),
                   apart(a.prediction.mean, b.prediction.mean),
                   apart(a.prediction.variance, b.prediction.variance)});
}

int run(const Options& options) {
  Answers one;
  if (options.against_one) one = answers_of(options);
  const ProcessGroup group;
  const Answers all = answers_of(options);
  const double peak = peak_gb();
  if (process_rank() == 0) {
    fmt::print("samples {}  processes {}  fit {:.2f} s ({:.2f} s of processors)", options.samples,
               process_count(), all.fit.wall_s, all.fit.processor_s);
    fmt::print("  predict {} with bands {:.2f} s  peak {:.2f} GB", options.test_samples,
               all.predict.wall_s, peak);
    if (!options.without_dpotrf) {
      const Times bare = times_of_dpotrf(options.samples);
      fmt::print("  dpotrf {:.2f} s ({:.2f})  ratio {:.2f} ({:.2f})", bare.wall_s, bare.processor_s,
                 all.fit.wall_s / bare.wall_s, all.fit.processor_s / bare.processor_s);
    }
    if (options.against_one) fmt::print("  apart {:.1e}", furthest(all, one));
    fmt::print("\n");
  }
  constexpr double kTolerance = 1e-8;
  return options.against_one && !(furthest(all, one) < kTolerance) ? 1 : 0;
}

}  // namespace
}  // namespace kinescope::gp

int main(int argc, char** argv) {
  CLI::App app("Exact Gaussian processes of many samples");
  kinescope::gp::Options options;
  app.add_option("--samples", options.samples)->check(CLI::Range(10, 100000));
  app.add_option("--test-samples", options.test_samples)->check(CLI::Range(1, 100000));
  app.add_option("--threads", options.threads, "0: all of the machine")->check(CLI::Range(0, 256));
  app.add_option("--most-mb", options.most_mb, "memory that the matrix may take; 0: what there is");
  app.add_flag("--no-dpotrf", options.without_dpotrf);
  app.add_flag("--against-one", options.against_one, "compare with one process's answers");
  CLI11_PARSE(app, argc, argv);
  try {
    return kinescope::gp::run(options);
  } catch (const kinescope::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
}
