// SPDX-License-Identifier: Apache-2.0
//
// One sample of a running robot through a saved torque model:
//   build/test/bench_dynamics_models
// A process of one joint of seven (21 columns) that learned from N samples, with 256 points that
// carry its variance; and a whole saved robot, all joints.
#include <array>
#include <cmath>
#include <numeric>

#include <benchmark/benchmark.h>

#include "dynamics/control/torque_evaluator.h"
#include "dynamics/gp/compact.h"
#include "dynamics/models/torque_model.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

constexpr int kJoints = 7;
constexpr int kCarriers = 256;

Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns) {
  Rng rng = Rng::from_name("bench models", static_cast<std::uint64_t>(rows));
  Eigen::MatrixXd out(rows, columns);
  for (double& value : out.reshaped()) value = rng.uniform(-1.5, 1.5);
  return out;
}

gp::CompactGp process(bool polynomial, int points) {
  gp::CompactGp out;
  if (polynomial) {
    out.kernel.gip_joints.assign(kJoints, gp::JointKind::kRevolute);
    out.kernel.gip_offset = 1.0;
    out.kernel.gip_motion = Eigen::VectorXd::Constant(kJoints + kJoints * (kJoints + 1) / 2, 0.1);
    out.kernel.gip_first = Eigen::VectorXd::Constant(2L * kJoints, 0.5);
    out.kernel.gip_second = Eigen::VectorXd::Constant(2L * kJoints, 0.1);
  } else {
    out.kernel.rbf_variance = 1.0;
    out.kernel.rbf_rates = Eigen::VectorXd::Constant(3L * kJoints, 0.3);
  }
  out.points.resize(static_cast<std::size_t>(points));
  std::iota(out.points.begin(), out.points.end(), 0);
  out.weights = random_matrix(points, 1);
  out.root = 0.01 * random_matrix(kCarriers, kCarriers);
  return out;
}

void one_process(benchmark::State& state) {
  const auto points = static_cast<int>(state.range(1));
  gp::CompactPredictor predictor({process(state.range(0) != 0, points)},
                                 random_matrix(points, 3L * kJoints), {Eigen::MatrixXd(points, 0)});
  const Eigen::VectorXd x = Eigen::VectorXd::Constant(3L * kJoints, 0.2);
  const std::vector<Eigen::VectorXd> no_features(1);
  for (auto _ : state) {
    benchmark::DoNotOptimize(predictor.mean(x, no_features));
    if (state.range(2) != 0) benchmark::DoNotOptimize(predictor.variance(0));
  }
}
BENCHMARK(one_process)
    ->ArgsProduct({{0, 1}, {500, 2000}, {0, 1}})
    ->ArgNames({"gip", "N", "band"})
    ->Unit(benchmark::kMicrosecond);

// All joints, mean and bands.
void one_robot(benchmark::State& state) {
  Rng rng = Rng::from_name("bench robot");
  const RandomRobot robot = random_robot({.joints = kJoints, .prismatic_share = 0.0}, rng);
  const DynamicModel model = random_masses(robot.tree, {}, rng);
  const TorqueSamples log = torque_log_of(model, {.samples = 800, .trajectories = 4}, rng);
  TorqueModelOptions options = quick_options();
  options.hyperparameter_samples = 60;
  options.process_band_folds = 2;
  const auto kind = static_cast<TorqueModelKind>(state.range(0));
  const FittedTorqueModel fitted = fit_torque_model(kind, model, log, options);
  TorquePredictor predictor(*fitted.saved);
  const Eigen::VectorXd q = log.q.row(10);
  const Eigen::VectorXd dq = log.dq.row(10);
  const Eigen::VectorXd ddq = log.ddq.row(10);
  for (auto _ : state) {
    benchmark::DoNotOptimize(predictor.mean(q, dq, ddq)[0]);
    benchmark::DoNotOptimize(predictor.sigma()[0]);
  }
  state.SetLabel(std::string(to_string(kind)));
}
BENCHMARK(one_robot)
    ->Arg(static_cast<int>(TorqueModelKind::kParametric))
    ->Arg(static_cast<int>(TorqueModelKind::kGip))
    ->Arg(static_cast<int>(TorqueModelKind::kSemiParametric))
    ->ArgName("kind")
    ->Unit(benchmark::kMicrosecond);

// What a controller calls, every joint by a process of N samples: mean, or mean and band.
void controller(benchmark::State& state) {
  Rng rng = Rng::from_name("bench robot");
  const RandomRobot robot = random_robot({.joints = kJoints, .prismatic_share = 0.0}, rng);
  const auto points = static_cast<int>(state.range(1));
  SavedTorqueModel model;
  model.kind = state.range(0) != 0 ? TorqueModelKind::kGip : TorqueModelKind::kRbf;
  model.rigid = make_rigid_model(random_masses(robot.tree, {}, rng));
  model.motions = random_matrix(points, 3L * kJoints);
  SavedProcess one;
  one.gp = process(state.range(0) != 0, points);
  model.processes.assign(kJoints, one);
  model.parts = {Eigen::VectorXd::Ones(kJoints), Eigen::VectorXd::Ones(kJoints)};
  TorqueEvaluator evaluator(model);
  const std::array<double, kJoints> x{0.2, 0.3, -0.1, 0.5, 0.2, -0.7, 0.1};
  std::array<double, kJoints> torque{}, half_width{};
  for (auto _ : state) {
    const TorqueStatus status = state.range(2) != 0
                                    ? evaluator.mean_and_band(x, x, x, torque, half_width)
                                    : evaluator.mean(x, x, x, torque);
    if (status != TorqueStatus::kDone) state.SkipWithError("refused");
    benchmark::DoNotOptimize(torque);
  }
}
BENCHMARK(controller)
    ->ArgsProduct({{0, 1}, {2000}, {0, 1}})
    ->ArgNames({"gip", "N", "band"})
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace kinescope
