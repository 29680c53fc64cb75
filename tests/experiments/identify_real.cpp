// SPDX-License-Identifier: Apache-2.0
//
// Identification on measured joint logs of others: normalised mean squared error of the torque (%)
// on samples that the fit has not seen, beside a first fit (all ten parameters a link by an exact
// regressor, offset, viscous and Coulomb friction, motor inertia, ridge; same filter, same split).
// `identify_real [SET...]`; default: all. The sets stay where they are.
#include <chrono>
#include <functional>

#include <fmt/format.h>

#include "dynamics/data/motion.h"
#include "dynamics/data/splits.h"
#include "dynamics/identify/consistent_model.h"
#include "dynamics/identify/identify.h"
#include "dynamics/identify/prediction.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/experiments/torque_robots.h"
#include "tests/truth/reference_arms.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

struct RealSet {
  std::string name;
  std::string split;
  std::string first_fit;  ///< nMSE per joint, %
  DynamicModel model = {};
  TorqueSamples train = {};
  TorqueSamples test = {};
  IdentifyOptions options = {};
};

TorqueSamples samples_between(const TorqueSamples& samples, double from_s, double to_s) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index t = 0; t < samples.size(); ++t) {
    if (samples.t_s[t] >= from_s && samples.t_s[t] < to_s) rows.push_back(t);
  }
  return select_rows(samples, rows);
}

TorqueSamples filtered(const TorqueLog& log, double cutoff_hz) {
  MotionOptions options{.filter = LowPass::kButterworth, .source = MotionSource::kBest};
  options.cutoff_hz = cutoff_hz;
  return derive_motion(log, options).samples;
}

RealSet ur10e(const fs::path& folder) {
  const auto read = [&](const char* file) { return filtered(ur10e_log(folder, file), 7.0); };
  RealSet set{.name = "ur10e",
              .split = "12harm_50s -> 15harm_50s_unloaded, 7 Hz",
              .first_fit = "0.63 0.78 0.27 0.58 1.86 1.18"};
  set.model = read_dynamic_urdf(folder / "ur10e.urdf");
  // The authors' own cut of the start-up motion; of the other file, the same three seconds.
  set.train = samples_between(read("ident_12harm_50s.csv"), 3.8, 54.2);
  const TorqueSamples test = read("ident_15harm_50s_unloaded.csv");
  set.test = samples_between(test, 3.8, test.t_s[test.size() - 1] - 3.0);
  return set;
}

RealSet tx40(const fs::path& folder) {
  RealSet set{.name = "tx40",
              .split = "0.1 .. 5.5 s -> 5.5 .. 7.5 s, 50 Hz, with the wrist's coupled drive",
              .first_fit = "0.62 0.75 1.28 1.34 12.4 3.8"};
  set.model = read_dynamic_urdf(folder / "tx40_mdh_modified.urdf");
  const TorqueSamples all = filtered(tx40_log(folder), 50.0);
  set.train = samples_between(all, 0.1, 5.5);
  set.test = samples_between(all, 5.5, 7.5);
  Eigen::VectorXd wrist = Eigen::VectorXd::Zero(6);
  wrist.tail<2>().setOnes();
  set.options.drives.coupled_drives = {wrist};
  return set;
}

/// The first 65 % to learn from, the rest to be judged on.
void split(RealSet& set, const TorqueSamples& all) {
  const double cut = 0.65 * all.t_s[all.size() - 1];
  set.train = samples_between(all, 0.0, cut);
  set.test = samples_between(all, cut, 1e9);
}

RealSet panda(const fs::path& folder) {
  RealSet set{.name = "panda",
              .split = "first 65 % -> rest, 10 Hz",
              .first_fit =
                  "0.37 0.03 0.05 0.11 0.45 0.18 2.6 (with position harmonics 0.33 0.02 "
                  "0.04 0.08 0.37 0.10 2.3)"};
  set.options.drives.motor_inertia = false;  // the sensors sit behind the motors
  set.model = panda_kinematics();
  split(set, filtered(panda_log(folder), 10.0));
  return set;
}

RealSet rokae(const fs::path& folder) {
  RealSet set{.name = "rokae",
              .split = "first 65 % -> rest, 4 Hz, gravity along base x",
              .first_fit = "0.09 0.32 0.48 0.17 11 3.7 3.2"};
  set.options.drives.motor_inertia = false;  // the sensors sit behind the motors
  set.model = read_dynamic_urdf(folder / "AR5-5_07R-W4C4A2.urdf");
  set.model.gravity_m_s2 = {kUsualGravity_m_s2, 0.0, 0.0};
  split(set, filtered(rokae_log(folder), 4.0));
  return set;
}

RealSet lwr4(const fs::path& folder) {
  RealSet set{.name = "lwr4",
              .split = "measurements_1 -> measurements_2 (the same path), 8 Hz",
              .first_fit = "6.9 0.08 0.83 0.29 12 30 32"};
  set.options.drives.motor_inertia = false;  // the sensors sit behind the motors
  set.model = read_dynamic_urdf(folder / "kuka_lwr4.urdf");
  set.train = filtered(lwr4_log(folder, 1), 8.0);
  set.test = filtered(lwr4_log(folder, 2), 8.0);
  return set;
}

std::string row(const Eigen::VectorXd& values, const char* format = "{:8.3f}") {
  std::string out;
  for (const double value : values) out += fmt::format(fmt::runtime(format), value);
  return out;
}

/// Share of test samples within two predicted sigmas.
Eigen::VectorXd within_two_sigma(const TorqueSamples& test, const TorquePrediction& prediction) {
  return ((test.torque - prediction.mean).array().abs() <= 2.0 * prediction.sigma.array())
      .cast<double>()
      .matrix()
      .colwise()
      .mean()
      .transpose();
}

void print_drives(const Identification& fit) {
  for (std::size_t k = 0; k < fit.basis.kept.size(); ++k) {
    const TorqueTerm& term = fit.terms[static_cast<std::size_t>(fit.basis.kept[k])];
    if (term.kind == TermKind::kInertial || term.kind == TermKind::kOffset) continue;
    const auto at = static_cast<Eigen::Index>(k);
    fmt::print("    {:<40} {:9.4f} +- {:.4f}\n", fit.names[k], fit.parameters[at],
               fit.sigma_of(at));
  }
}

void run(const RealSet& set) {
  fmt::print("\n{}: {}; {} training and {} test samples, {} joints\n", set.name, set.split,
             set.train.size(), set.test.size(), set.train.q.cols());
  fmt::print("  first fit            {}\n", set.first_fit);
  for (const RobustLoss loss : {RobustLoss::kNone, RobustLoss::kHuber, RobustLoss::kStudent}) {
    IdentifyOptions options = set.options;
    options.loss = loss;
    const auto begin = std::chrono::steady_clock::now();
    const Identification fit = identify_dynamics(set.model, set.train, options);
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
    const TorquePrediction test = predict_torque(fit, set.test.q, set.test.dq, set.test.ddq);
    const char* name = loss == RobustLoss::kNone    ? "least squares  "
                       : loss == RobustLoss::kHuber ? "Huber          "
                                                    : "Student        ";
    fmt::print("  {} test  {}   ({:.2f} s)\n", name,
               row(normalised_error_percent(set.test.torque, test.mean)), time.count());
    if (loss != RobustLoss::kHuber) continue;
    fmt::print("                  train {}\n", row(fit.fit_error_percent));
    fmt::print("    noise sigma         {}\n", row(fit.sigma));
    fmt::print("    down-weighted share {}\n", row(fit.down_weighted));
    fmt::print("    within 2 sigma      {}\n", row(within_two_sigma(set.test, test)));
    fmt::print(
        "    {} base parameters, condition {:.0f}, residuals' correlation {:.0f} samples, "
        "{} blocks, {} iterations{}\n",
        fit.parameters.size(), fit.condition, fit.correlation_samples, fit.blocks, fit.iterations,
        fit.status == IdentifyStatus::kConverged ? "" : " (limit)");
    const ConsistentModel consistent = consistent_model(fit);
    const Eigen::MatrixXd torque =
        predict_torque_mean(fit, consistent.parameters, set.test.q, set.test.dq, set.test.ddq);
    fmt::print("  consistent      test  {}   misfit {:.1f}, {}\n",
               row(normalised_error_percent(set.test.torque, torque)), consistent.misfit,
               consistent.converged ? "converged" : "not converged");
    double mass = 0.0;
    for (const InertialParameters& link : consistent.model.links) mass += link.mass_kg;
    fmt::print("    total mass {:.2f} kg, priors replaced: {}\n", mass,
               consistent.replaced_priors.size());
    print_drives(fit);
  }
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  using Maker = std::function<kinescope::RealSet(const std::filesystem::path&)>;
  const std::vector<std::tuple<std::string, std::string, Maker>> sets = {
      {"ur10e", "dynamics/ur10e_innopolis", kinescope::ur10e},
      {"tx40", "dynamics/tx40_staubli", kinescope::tx40},
      {"panda", "dynamics/panda_gaz2019", kinescope::panda},
      {"rokae", "dynamics/rokae_ar5", kinescope::rokae},
      {"lwr4", "dynamics/kuka_lwr4", kinescope::lwr4}};
  const std::vector<std::string> wanted(argv + 1, argv + argc);
  try {
    for (const auto& [name, folder, make] : sets) {
      if (!wanted.empty() && std::ranges::find(wanted, name) == wanted.end()) continue;
      const auto path = kinescope::shared_data(folder);
      if (!path) {
        fmt::print("{}: not on this machine\n", name);
        continue;
      }
      kinescope::run(make(*path));
    }
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  return 0;
}
