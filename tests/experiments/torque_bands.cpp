// SPDX-License-Identifier: Apache-2.0
//
// What the 90 and 95 % bands of torque models hold on motion that no fit has seen: measured logs of
// others and simulated ones (white noise, noise with memory, friction that the model lacks). Beside
// the calibrated bands those of the normal distribution, from the sigma that the model claims; and
// the error (nMSE, %) of every model on the same samples.
//   build/test/torque_bands [--sets ur10e,..] [--models parametric,gip] [--samples 1000]
//   build/test/torque_bands --rotate 5 --samples 400 --search 250   # less scatter of one hold-out
#include <string>
#include <vector>

#include <fmt/format.h>

#include "dynamics/data/splits.h"
#include "dynamics/models/comparison.h"
#include "tests/experiments/command_line.h"
#include "tests/experiments/torque_sets.h"
#include "tests/truth/shared_data.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

struct Options {
  std::vector<std::string> sets = {"white", "coloured", "stribeck", "ur10e",
                                   "tx40",  "panda",    "rokae"};
  std::vector<std::string> models = {"parametric", "rbf", "gip", "semi_parametric"};
  int samples = 1000;
  int search = TorqueModelOptions{}.hyperparameter_samples;
  int rotate = 0;  ///< > 1: so many folds of the training part are held out in turn instead
  int folds = TorqueModelOptions{}.process_band_folds;
  int robots = 3;  ///< of each simulated set
};

// A random arm with 2 % noise; the last two of eight trajectories are held out.
TorqueSet simulated(const std::string& name, int number) {
  Rng rng = Rng::from_name("bands " + name, static_cast<std::uint64_t>(number));
  const RandomRobot robot = random_robot({.joints = 4, .prismatic_share = 0.0}, rng);
  TorqueSet set{};
  set.name = fmt::format("{} {}", name, number);
  set.split = "six trajectories -> two others";
  set.model = random_masses(robot.tree, {}, rng);
  TorqueSamples all = torque_log_of(set.model,
                                    {.samples = 4000,
                                     .noise = 0.02,
                                     .noise_memory = name == "white" ? 0.0 : 0.9,
                                     .trajectories = 8},
                                    rng);
  if (name == "stribeck") {
    const Eigen::ArrayXXd speed = all.dq.array();
    all.torque.array() += (speed / 0.01).tanh() * (-(speed / 0.2).square()).exp();
  }
  const Fold fold = split_last(all, 0.24);
  set.train = select_rows(all, fold.train);
  set.test = select_rows(all, fold.test);
  return set;
}

std::string per_cent(const Eigen::VectorXd& shares) {
  std::string out;
  for (const double share : shares) out += fmt::format("{:6.1f}", 100.0 * share);
  return out + fmt::format("   mean{:6.1f}", 100.0 * shares.mean());
}

struct Covered {
  TorqueScore calibrated;
  TorqueScore claimed;
  int folds = 0;
};

Covered covered(TorqueModelKind kind, const TorqueSet& set, const TorqueSamples& train,
                const TorqueSamples& test, TorqueModelOptions options) {
  const FittedTorqueModel fitted = fit_torque_model(kind, set.model, train, options);
  options.band_folds = 0;
  return {score_torque_model(fitted, test),
          score_torque_model(fit_torque_model(kind, set.model, train, options), test),
          fitted.bands.folds};
}

// Mean over folds that are held out one after the other.
Covered rotated(TorqueModelKind kind, const TorqueSet& set, int folds,
                const TorqueModelOptions& options) {
  Covered mean;
  const Folds outer = split_folds(set.train, {.folds = folds});
  const auto count = static_cast<double>(outer.folds.size());
  const auto add = [&](TorqueScore& sum, const TorqueScore& one) {
    const Eigen::Index joints = one.coverage_90.size();
    if (sum.coverage_90.size() == 0) {
      sum.coverage_90 = sum.coverage_95 = sum.extrapolated = sum.nmse_percent =
          Eigen::VectorXd::Zero(joints);
    }
    sum.coverage_90 += one.coverage_90 / count;
    sum.coverage_95 += one.coverage_95 / count;
    sum.extrapolated += one.extrapolated / count;
    sum.nmse_percent += one.nmse_percent / count;
  };
  for (const Fold& fold : outer.folds) {
    const Covered one = covered(kind, set, select_rows(set.train, fold.train),
                                select_rows(set.train, fold.test), options);
    add(mean.calibrated, one.calibrated);
    add(mean.claimed, one.claimed);
    mean.folds = one.folds;
  }
  return mean;
}

void judge(const TorqueSet& set, const Options& options) {
  TorqueModelOptions models;
  models.identify = set.options;
  models.samples = options.samples;
  models.hyperparameter_samples = options.search;
  models.starts = 1;
  models.process_band_folds = options.folds;
  fmt::print("\n{}: {}; {} training and {} test samples\n", set.name,
             options.rotate > 1 ? "folds of the training part" : set.split, set.train.size(),
             set.test.size());
  if (!set.first_fit.empty()) fmt::print("{:>16} nMSE {}\n", "first fit", set.first_fit);
  for (const std::string& name : options.models) {
    const TorqueModelKind kind = torque_model_kind(name).value();
    const Covered found = options.rotate > 1 ? rotated(kind, set, options.rotate, models)
                                             : covered(kind, set, set.train, set.test, models);
    fmt::print("{:<16} 90 % {}   claimed {}\n{:>16} 95 % {}   claimed {}\n", name,
               per_cent(found.calibrated.coverage_90), per_cent(found.claimed.coverage_90),
               fmt::format("{} folds", found.folds), per_cent(found.calibrated.coverage_95),
               per_cent(found.claimed.coverage_95));
    fmt::print("{:>16} extrapolated {}\n", "", per_cent(found.calibrated.extrapolated));
    fmt::print("{:>16} nMSE", "");
    for (const double error : found.calibrated.nmse_percent) fmt::print(" {:.3g}", error);
    fmt::print("\n");
    std::fflush(stdout);
  }
}

void run(const Options& options) {
  fmt::print("share (%) of unseen torques within the bands, a joint each, and their mean\n");
  for (const std::string& name : options.sets) {
    const auto measured = std::ranges::find(torque_sets(), name, &NamedTorqueSet::name);
    if (measured == torque_sets().end()) {
      for (int k = 1; k <= options.robots; ++k) judge(simulated(name, k), options);
      continue;
    }
    const auto folder = shared_data(measured->folder);
    folder ? judge(measured->make(*folder), options)
           : fmt::print("{}: not on this machine\n", name);
  }
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  kinescope::Options options;
  CLI::App app("Coverage of the torque models' bands");
  app.add_option("--sets", options.sets,
                 "white, coloured, stribeck, ur10e, tx40, panda, rokae, lwr4")
      ->delimiter(',');
  app.add_option("--models", options.models, "torque models")->delimiter(',');
  app.add_option("--samples", options.samples, "training samples of a Gaussian process");
  app.add_option("--search", options.search, "of them, for the search of hyperparameters");
  app.add_option("--rotate", options.rotate, "hold out so many folds of the training part in turn");
  app.add_option("--folds", options.folds, "that a Gaussian process's bands are made from");
  app.add_option("--robots", options.robots, "simulated robots a set");
  return kinescope::run_experiment(app, argc, argv, [&] { kinescope::run(options); });
}
