// SPDX-License-Identifier: Apache-2.0
//
// The SCARA experiments of Dalla Libera's thesis talk: torque models learned from one trajectory
// (sums of 200 random sinusoids) and judged on another one.
//   build/test/scara_monte_carlo [--runs 20]       nMSE of every joint over runs; PA, MB and SP
//                                                  believe in a misplaced geometry
//   build/test/scara_monte_carlo --efficiency      global nMSE against the number of samples that
//                                                  the robot has moved for, true geometry
// The talk gives neither noise nor size of the perturbation: --noise (share of the spread of each
// joint's torque), --tilt (degrees) and --shift (m) do, about every axis of every joint.
#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/plot.h"
#include "dynamics/data/splits.h"
#include "dynamics/models/comparison.h"
#include "tests/experiments/command_line.h"
#include "tests/experiments/figure.h"
#include "tests/truth/reference_arms.h"

namespace kinescope {
namespace {

struct Options {
  int runs = 20;
  int first_run = 1;
  bool efficiency = false;
  int samples = 2000;
  int efficiency_samples = 4000;
  int starts = 1;
  double noise = 0.01;
  double tilt_deg = 2.0;
  double shift_m = 0.01;
  std::string figure;
  std::vector<std::string> models = {"gip",         "rbf",       "network", "semi_parametric",
                                     "model_based", "parametric"};
};

struct World {
  DynamicModel truth;
  DynamicModel believed;
  TorqueSamples train;
  TorqueSamples test;  ///< without noise
};

World make_world(const Options& options, int samples, bool misplace, int run) {
  Rng rng = Rng::from_name("scara monte carlo", static_cast<std::uint64_t>(run));
  World world{scara_arm(), scara_arm(), {}, {}};
  world.train = sinusoid_log(world.truth, {.samples = samples}, rng);
  world.test = sinusoid_log(world.truth, {.samples = samples}, rng);
  const Eigen::RowVectorXd mean = world.train.torque.colwise().mean();
  const Eigen::RowVectorXd spread =
      (world.train.torque.rowwise() - mean).colwise().norm() / std::sqrt(samples);
  add_white_noise(world.train, options.noise * spread, rng);
  if (misplace) {
    const double tilt = options.tilt_deg * std::numbers::pi / 180.0;
    world.believed = misplaced(world.believed, tilt, options.shift_m, rng);
  }
  return world;
}

std::vector<TorqueModelKind> kinds_of(const Options& options) {
  std::vector<TorqueModelKind> kinds;
  for (const std::string& name : options.models) {
    const auto kind = torque_model_kind(name);
    if (!kind) throw CLI::ValidationError("--models", name + " is no torque model");
    kinds.push_back(*kind);
  }
  return kinds;
}

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// nMSE (%) of each model, joint and run.
struct Errors {
  std::vector<std::vector<std::vector<double>>> of;  ///< model, joint, run
  std::vector<double> seconds;                       ///< a model, over all runs
};

void print_table(const std::vector<TorqueModelKind>& kinds, const Errors& errors, int runs) {
  fmt::print("\nnMSE (%) on another trajectory, without noise: median [quartiles] of {} runs\n",
             runs);
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    fmt::print("{:<16}", to_string(kinds[k]));
    for (const auto& joint : errors.of[k]) {
      const Quartiles q = quartiles(joint);
      fmt::print("  {:9.3g} [{:.2g} {:.2g}]", q.median, q.lower, q.upper);
    }
    fmt::print("   {:.1f} s a run\n", errors.seconds[k] / runs);
  }
}

// One plot a joint: the quartiles as a bar, the median in it, every run as a dot.
std::string joint_plot(const std::vector<TorqueModelKind>& kinds, const Errors& errors,
                       std::size_t joint) {
  double lower = 1e9;
  double upper = -1e9;
  for (const auto& model : errors.of) {
    for (const double value : model[joint]) {
      lower = std::min(lower, std::log10(value));
      upper = std::max(upper, std::log10(value));
    }
  }
  report::pad_range(lower, upper);
  const auto rows = static_cast<double>(kinds.size());
  report::Plot plot(fmt::format("joint {}", joint + 1),
                    {.label = fmt::format("nMSE of joint {}, %", joint + 1),
                     .lower = lower,
                     .upper = upper,
                     .log10 = true},
                    {.label = "", .lower = -0.6, .upper = rows - 0.4, .down = true},
                    {.width = 620.0, .height = 60.0 + 26.0 * rows});
  std::vector<std::string> names;
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    names.emplace_back(to_string(kinds[k]));
    const Quartiles q = quartiles(errors.of[k][joint]);
    const double y = static_cast<double>(k);
    const std::string colour = report::series_class(k);
    plot.bar(std::log10(q.lower), std::log10(q.upper), y - 0.3, y + 0.3, colour);
    plot.line({{std::log10(q.median), y - 0.4}, {std::log10(q.median), y + 0.4}}, "");
    std::vector<Eigen::Vector2d> runs;
    for (const double value : errors.of[k][joint]) runs.emplace_back(std::log10(value), y);
    plot.dots(runs, "");
  }
  plot.row_names(names);
  return plot.str();
}

void monte_carlo(const Options& options) {
  const std::vector<TorqueModelKind> kinds = kinds_of(options);
  TorqueModelOptions models;
  models.samples = options.samples;
  models.starts = options.starts;
  models.band_folds = 0;
  Errors errors;
  errors.seconds.assign(kinds.size(), 0.0);
  fmt::print(
      "SCARA, {} runs, {} training and {} test samples, noise {} %, tilt {} deg, shift {} "
      "m\n",
      options.runs, options.samples, options.samples, 100.0 * options.noise, options.tilt_deg,
      options.shift_m);
  errors.of.assign(kinds.size(), std::vector<std::vector<double>>(4));
  for (int run = options.first_run; run < options.first_run + options.runs; ++run) {
    const World world = make_world(options, options.samples, true, run);
    for (std::size_t k = 0; k < kinds.size(); ++k) {
      const auto begin = std::chrono::steady_clock::now();
      const FittedTorqueModel fitted =
          fit_torque_model(kinds[k], world.believed, world.train, models);
      const TorqueScore score = score_torque_model(fitted, world.test);
      errors.seconds[k] += seconds_since(begin);
      fmt::print("run {:2} {:<16}", run, to_string(kinds[k]));
      for (Eigen::Index j = 0; j < score.nmse_percent.size(); ++j) {
        errors.of[k][static_cast<std::size_t>(j)].push_back(score.nmse_percent[j]);
        fmt::print(" {:9.3g}", score.nmse_percent[j]);
      }
      fmt::print("\n");
      std::fflush(stdout);
    }
  }
  print_table(kinds, errors, options.runs);
  if (options.figure.empty()) return;
  std::vector<std::string> plots;
  for (std::size_t j = 0; j < 4; ++j) plots.push_back(joint_plot(kinds, errors, j));
  write_figure(options.figure, plots, 620.0, 70.0 + 26.0 * static_cast<double>(kinds.size()));
}

TorqueSamples first_samples(const TorqueSamples& samples, int count) {
  std::vector<Eigen::Index> rows(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<Eigen::Index>(i);
  return select_rows(samples, rows);
}

// Over all joints: sum of squared errors over sum of variances, per cent.
double global_nmse(const FittedTorqueModel& fitted, const TorqueSamples& test) {
  const Eigen::MatrixXd error = test.torque - fitted.predict(test.q, test.dq, test.ddq).mean;
  const Eigen::RowVectorXd mean = test.torque.colwise().mean();
  return 100.0 * error.squaredNorm() / (test.torque.rowwise() - mean).squaredNorm();
}

void efficiency(const Options& options) {
  const std::vector<int> sizes = {125, 250, 500, 1000, 2000, options.efficiency_samples};
  const World world = make_world(options, options.efficiency_samples, false, options.first_run);
  const Eigen::RowVectorXd mean = world.test.torque.colwise().mean();
  const double variance =
      (world.test.torque.rowwise() - mean).squaredNorm() / static_cast<double>(world.test.size());
  fmt::print(
      "SCARA, true geometry; global error on another trajectory of {} samples: nMSE (%), sum "
      "of squared errors over sum of variances ({:.4g} in N^2 and (N m)^2)\n{:<16}",
      world.test.size(), variance, "first samples");
  for (const int size : sizes) fmt::print(" {:>10}", size);
  fmt::print("\n");
  report::Plot plot("data efficiency",
                    {.label = "training samples", .lower = 2.0, .upper = 3.7, .log10 = true},
                    {.label = "global nMSE, %", .lower = -5.0, .upper = 2.2, .log10 = true},
                    {.width = 620.0, .height = 360.0});
  TorqueModelOptions models;
  models.starts = options.starts;
  models.band_folds = 0;
  std::size_t series = 0;
  for (const TorqueModelKind kind : kinds_of(options)) {
    fmt::print("{:<16}", to_string(kind));
    std::vector<Eigen::Vector2d> curve;
    for (const int size : sizes) {
      models.samples = size;
      const FittedTorqueModel fitted =
          fit_torque_model(kind, world.believed, first_samples(world.train, size), models);
      const double nmse = global_nmse(fitted, world.test);
      curve.emplace_back(std::log10(static_cast<double>(size)), std::log10(nmse));
      fmt::print(" {:>10.3g}", nmse);
      std::fflush(stdout);
    }
    fmt::print("\n");
    plot.line(curve, report::series_class(series));
    plot.legend(to_string(kind), report::series_class(series++));
  }
  if (!options.figure.empty()) write_figure(options.figure, {plot.str()}, 620.0, 420.0);
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  kinescope::Options options;
  CLI::App app("SCARA experiments");
  app.add_option("--runs", options.runs, "Monte Carlo runs")->check(CLI::PositiveNumber);
  app.add_option("--first", options.first_run, "number of the first run");
  app.add_flag("--efficiency", options.efficiency, "error against the number of samples");
  app.add_option("--noise", options.noise, "share of the spread of each joint's torque");
  app.add_option("--tilt", options.tilt_deg, "of the believed geometry, degrees");
  app.add_option("--shift", options.shift_m, "of the believed geometry, m");
  app.add_option("--starts", options.starts, "of every hyperparameter search");
  app.add_option("--models", options.models, "which ones, in this order");
  app.add_option("--figure", options.figure, "SVG file");
  return kinescope::run_experiment(app, argc, argv, [&] {
    options.efficiency ? kinescope::efficiency(options) : kinescope::monte_carlo(options);
  });
}
