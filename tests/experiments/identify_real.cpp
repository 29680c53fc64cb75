// SPDX-License-Identifier: Apache-2.0
//
// Identification on measured joint logs of others: normalised mean squared error of the torque (%)
// on samples that the fit has not seen, beside a first fit (all ten parameters a link by an exact
// regressor, offset, viscous and Coulomb friction, motor inertia, ridge; same filter, same split).
// `identify_real [SET...]`; default: all. The sets stay where they are.
#include <chrono>

#include <fmt/format.h>

#include "dynamics/identify/consistent_model.h"
#include "dynamics/identify/identify.h"
#include "dynamics/identify/prediction.h"
#include "kinematics/core/error.h"
#include "tests/experiments/torque_sets.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

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

void run(const TorqueSet& set) {
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
  const std::vector<std::string> wanted(argv + 1, argv + argc);
  try {
    for (const auto& [name, folder, make] : kinescope::torque_sets()) {
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
