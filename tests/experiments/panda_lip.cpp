// SPDX-License-Identifier: Apache-2.0
//
// The 7-joint simulated Panda of the LIP paper (Giacomuzzo, Carli, Romeres, Dalla Libera 2024,
// section VI-A): 500 training and 500 test samples, noise 0.01 N m, nMSE (%) of every joint on
// another trajectory, over pairs of trajectories; beside it the figures of the authors' own code on
// a pair of theirs (other coefficients by the same rule).
//   build/test/panda_lip [--pairs 50] [--first 1] [--figure FILE.svg]
#include <chrono>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/plot.h"
#include "dynamics/experiments/reference_arms.h"
#include "dynamics/gp/hyperparameters.h"
#include "dynamics/gp/lip_kernel.h"
#include "dynamics/gp/robot_kernels.h"
#include "dynamics/models/torque_model.h"
#include "tests/experiments/command_line.h"
#include "tests/experiments/figure.h"

namespace kinescope {
namespace {

constexpr Eigen::Index kJoints = 7;
constexpr double kNoise_nm = 0.01;

struct Options {
  int pairs = 50;
  int first = 1;
  int lip_search_samples = 250;
  std::string figure;
};

Eigen::MatrixXd inputs_of(const TorqueSamples& samples) {
  Eigen::MatrixXd out(samples.size(), 3 * samples.joints());
  out << samples.q, samples.dq, samples.ddq;
  return out;
}

struct Pair {
  TorqueSamples train;
  TorqueSamples test;
  Eigen::MatrixXd clean;  ///< torques of the test without noise
};

Pair make_pair_of_logs(const DynamicModel& panda, int number) {
  const auto log = [&](int seed, Eigen::MatrixXd* clean) {
    Rng rng = Rng::from_name("panda trajectory", static_cast<std::uint64_t>(seed));
    TorqueSamples samples = panda_log(panda, rng);
    if (clean != nullptr) *clean = samples.torque;
    add_white_noise(samples, Eigen::RowVectorXd::Constant(kJoints, kNoise_nm), rng);
    return samples;
  };
  Pair out;
  out.train = log(number, nullptr);
  out.test = log(100 + number, &out.clean);
  return out;
}

using Learner = std::function<Eigen::MatrixXd(const Pair&)>;
using gp::Dataset;

Eigen::MatrixXd independent(const Pair& pair,
                            const std::function<gp::GpModel(const Dataset&)>& model) {
  Eigen::MatrixXd out(pair.test.size(), kJoints);
  for (Eigen::Index j = 0; j < kJoints; ++j) {
    const Dataset data{inputs_of(pair.train), pair.train.torque.col(j), {}, {}};
    const gp::Estimate found = gp::estimate_hyperparameters(model(data), data, {.starts = 1});
    out.col(j) =
        gp::predict(gp::fit(found.model, data), inputs_of(pair.test), {.variance = false}).mean;
  }
  return out;
}

Eigen::MatrixXd lip(const Pair& pair, int search_samples) {
  const gp::JointKinds kinds(kJoints, gp::JointKind::kRevolute);
  const Dataset data{inputs_of(pair.train), pair.train.torque, {}, {}};
  gp::Normalisation scale;
  scale.target_shift = Eigen::RowVectorXd::Zero(kJoints);
  scale.target_scale = Eigen::RowVectorXd::Constant(
      kJoints, std::sqrt(data.targets.squaredNorm() / static_cast<double>(data.targets.size())));
  const gp::GpModel model = gp::make_model(gp::lip(kinds), 1e-4, scale, true);
  const Dataset few = gp::subset(data, evenly_chosen(data.samples(), search_samples));
  const gp::Estimate found = gp::estimate_hyperparameters(
      model, few,
      {.starts = 1, .max_iterations = 80, .relative_tolerance = 1e-6, .samples_for_starts = 120});
  return gp::predict(gp::fit(found.model, data), inputs_of(pair.test), {.variance = false}).mean;
}

Eigen::MatrixXd rigid(const Pair& pair) {
  const FittedTorqueModel fitted =
      fit_torque_model(TorqueModelKind::kParametric, panda_kinematics(), pair.train);
  return fitted.predict(pair.test.q, pair.test.dq, pair.test.ddq).mean;
}

struct Row {
  std::string name;
  std::string anchor;
  Learner learn;
  std::vector<std::vector<double>> measured;  ///< joint, pair
  std::vector<std::vector<double>> clean;
  double seconds = 0.0;
};

std::vector<Row> make_rows(const Options& options) {
  const gp::JointKinds kinds(kJoints, gp::JointKind::kRevolute);
  const std::vector<std::vector<double>> empty(kJoints);
  return {{"GIP", "1.34 0.71 0.37 9.3 3.2 13.9 11.8, 1501 epochs",
           [kinds](const Pair& pair) {
             return independent(pair, [&](const Dataset& data) {
               return gp::make_model(gp::gip(kinds, data.inputs), 1e-3,
                                     gp::standardise_targets(data));
             });
           },
           empty, empty},
          {"RBF", "8.3 1.7 2.7 13.8 6.2 24.7 10.6, 1501 epochs",
           [](const Pair& pair) {
             return independent(pair, [](const Dataset& data) {
               return gp::make_model(gp::rbf(gp::first_columns(3 * kJoints)), 1e-3,
                                     gp::standardise(data));
             });
           },
           empty, empty},
          {"LIP", "published medians below 10 at 7 joints; 5 to 9 s an epoch, 1001 epochs",
           [&options](const Pair& pair) { return lip(pair, options.lip_search_samples); }, empty,
           empty},
          {"parametric", "none; knows the kinematics: the floor", rigid, empty, empty}};
}

void run(const Options& options) {
  const DynamicModel panda = panda_arm();
  std::vector<Row> rows = make_rows(options);
  fmt::print("7-joint Panda, 500 training and 500 test samples, noise {} N m, {} pairs; nMSE (%)\n",
             kNoise_nm, options.pairs);
  for (int number = options.first; number < options.first + options.pairs; ++number) {
    const Pair pair = make_pair_of_logs(panda, number);
    for (Row& row : rows) {
      const auto begin = std::chrono::steady_clock::now();
      const Eigen::MatrixXd got = row.learn(pair);
      row.seconds +=
          std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      const Eigen::VectorXd measured = normalised_error_percent(pair.test.torque, got);
      const Eigen::VectorXd clean = normalised_error_percent(pair.clean, got);
      fmt::print("pair {:2} {:<10}", number, row.name);
      for (std::size_t j = 0; j < row.clean.size(); ++j) {
        row.measured[j].push_back(measured[static_cast<Eigen::Index>(j)]);
        row.clean[j].push_back(clean[static_cast<Eigen::Index>(j)]);
        fmt::print(" {:8.3g}", row.measured[j].back());
      }
      fmt::print("\n");
      std::fflush(stdout);
    }
  }
  fmt::print("\nmedian over pairs [quartiles]; against measured torques, below it without noise\n");
  for (const Row& row : rows) {
    for (const auto* errors : {&row.measured, &row.clean}) {
      fmt::print("{:<12}", errors == &row.measured ? row.name : "");
      for (const auto& joint : *errors) {
        const Quartiles q = quartiles(joint);
        fmt::print(" {:7.3g} [{:.2g} {:.2g}]", q.median, q.lower, q.upper);
      }
      fmt::print("\n");
    }
    fmt::print("{:<12} {:.1f} s a pair; authors' code: {}\n", "", row.seconds / options.pairs,
               row.anchor);
  }
  if (options.figure.empty()) return;
  report::Plot plot("nMSE", {.label = "joint", .lower = 0.5, .upper = kJoints + 0.5, .ticks = 7},
                    {.label = "nMSE, %", .lower = -3.0, .upper = 2.5, .log10 = true},
                    {.width = 620.0, .height = 360.0});
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t j = 0; j < rows[r].measured.size(); ++j) {
      const Quartiles q = quartiles(rows[r].measured[j]);
      const double x = static_cast<double>(j) + 0.7 + 0.15 * static_cast<double>(r);
      plot.bar(x, x + 0.12, std::log10(q.lower), std::log10(q.upper), report::series_class(r));
      plot.line({{x - 0.01, std::log10(q.median)}, {x + 0.13, std::log10(q.median)}}, "");
    }
    plot.legend(rows[r].name, report::series_class(r));
  }
  write_figure(options.figure, {plot.str()}, 620.0, 420.0);
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  kinescope::Options options;
  CLI::App app("The Panda of the LIP paper");
  app.add_option("--pairs", options.pairs, "of trajectories")->check(CLI::PositiveNumber);
  app.add_option("--first", options.first, "number of the first pair");
  app.add_option("--lip-search", options.lip_search_samples, "samples of LIP's search");
  app.add_option("--figure", options.figure, "SVG file");
  return kinescope::run_experiment(app, argc, argv, [&] { kinescope::run(options); });
}
