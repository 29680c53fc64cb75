// SPDX-License-Identifier: Apache-2.0
//
// Hyperparameters of constant x squared exponential with 21 length scales + noise, from one start.
//   python3 tests/experiments/gp_against_sklearn.py build/test/gp_against_sklearn 2000
// writes the data, runs this program and scikit-learn on them, one thread each, and prints the
// ratio of CPU times beside both likelihoods.
//   gp_against_sklearn SAMPLES DATA.csv [THREADS]
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>

#include "dynamics/gp/blas.h"
#include "dynamics/gp/hyperparameters.h"
#include "kinematics/core/rng.h"

namespace kinescope::gp {
namespace {

// Something like a torque: positions, velocities and accelerations of seven joints.
Dataset make_data(int samples) {
  Rng rng = Rng::from_name("against sklearn", static_cast<std::uint64_t>(samples));
  Dataset out{Eigen::MatrixXd(samples, 21), Eigen::MatrixXd(samples, 1), {}, {}};
  for (int i = 0; i < samples; ++i) {
    for (int d = 0; d < 21; ++d) out.inputs(i, d) = rng.uniform(-1.7, 1.7);
    const auto x = out.inputs.row(i);
    const double gravity = 3.0 * std::sin(x[1]) + std::sin(x[1] + x[3]) + 0.3 * x[5];
    const double inertia = (1.0 + 0.4 * std::cos(x[3])) * x[15] + 0.3 * std::cos(x[3]) * x[17];
    const double coriolis = 0.5 * std::sin(x[3]) * x[8] * x[10];
    const double friction = 0.6 * std::tanh(3.0 * x[8]);
    out.targets(i, 0) = gravity + inertia - coriolis + friction + rng.normal(0.05);
  }
  const Normalisation n = standardise(out);
  out.inputs = n.normalised_inputs(out.inputs);
  out.targets = (out.targets.array() - n.target_shift[0]) / n.target_scale[0];
  return out;
}

void write_csv(const Dataset& data, const std::string& path) {
  std::ofstream file(path);
  file.precision(17);
  for (Eigen::Index i = 0; i < data.samples(); ++i) {
    for (Eigen::Index d = 0; d < data.inputs.cols(); ++d) file << data.inputs(i, d) << ',';
    file << data.targets(i, 0) << '\n';
  }
}

int run(int samples, const std::string& path, int threads) {
  const Dataset data = make_data(samples);
  write_csv(data, path);
  GpModel model = make_model(rbf(first_columns(21)), 0.1);
  // The start of both: variance and length scales of 1.
  model.kernel = model.kernel.with_log_values(Eigen::VectorXd::Zero(22));
  EstimateOptions options{.starts = 1};
  options.fit.threads = threads;
  const auto wall = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  const Estimate found = estimate_hyperparameters(model, data, options);
  const double cpu_s = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - wall).count();
  std::printf("kinescope %d %.6f %.3f %.3f %d %s\n", samples, found.score, cpu_s, wall_s,
              found.evaluations, blas_core().c_str());
  return found.status == EstimateStatus::kFailed ? 1 : 0;
}

}  // namespace
}  // namespace kinescope::gp

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "gp_against_sklearn SAMPLES DATA.csv [THREADS]\n");
    return 2;
  }
  return kinescope::gp::run(std::atoi(argv[1]), argv[2], argc > 3 ? std::atoi(argv[3]) : 1);
}
