// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "app/report/torque_summary.h"

namespace kinescope {
namespace {

// A joint whose best model leaves more than this share of the torque unexplained is spoken of, per
// cent.
constexpr double kPoor = 5.0;
// A 95 % band that holds fewer of the unseen samples than this is too narrow.
constexpr double kLeastCoverage = 0.90;

std::string percent(double value) {
  return value < 10.0 ? fmt::format("{:.2g} %", value) : fmt::format("{:.0f} %", value);
}

std::string name_of(TorqueModelKind kind) {
  std::string name(to_string(kind));
  std::ranges::replace(name, '_', '-');
  return name;
}

const TorqueScore* score_of(const TorqueSummary& summary, TorqueModelKind kind) {
  for (const TorqueScore& score : summary.scores) {
    if (score.kind == kind && score.failure.empty()) return &score;
  }
  return nullptr;
}

Eigen::Index worst_joint(const TorqueScore& score) {
  Eigen::Index worst = 0;
  score.nmse_percent.maxCoeff(&worst);
  return worst;
}

}  // namespace

TorqueVerdict torque_verdict(const TorqueSummary& summary) {
  TorqueVerdict out;
  const Identification& found = summary.identification;
  out.found = fmt::format(
      "{} joints; {} base and drive parameters from {} samples; noise cut at {:.3g} Hz.",
      summary.joints.size(), found.parameters.size(), summary.train.size(),
      summary.data.cutoff.cutoff_hz);
  if (summary.scores.empty()) return out;
  const TorqueScore& best = summary.scores[static_cast<std::size_t>(summary.best)];
  if (!best.failure.empty()) {
    out.accurate = "No model could be fitted: " + best.failure;
    return out;
  }
  const Eigen::Index worst = worst_joint(best);
  out.accurate = fmt::format(
      "On {} the {} model leaves {} of the torque's variance unexplained (mean over the joints; "
      "worst {} with {}).",
      summary.split, name_of(best.kind), percent(best.nmse_percent.mean()),
      summary.joints[static_cast<std::size_t>(worst)], percent(best.nmse_percent[worst]));
  const TorqueScore* parametric = score_of(summary, TorqueModelKind::kParametric);
  if (parametric != nullptr && best.kind != TorqueModelKind::kParametric) {
    out.accurate +=
        fmt::format(" The parametric model leaves {}.", percent(parametric->nmse_percent.mean()));
  }
  if (best.nmse_percent[worst] > kPoor) {
    out.limits = fmt::format(
        "The torque of {} is explained worst: its noise is {:.3g} {}, its "
        "error {:.3g} {}. ",
        summary.joints[static_cast<std::size_t>(worst)], found.sigma[worst],
        summary.train.torque_unit, best.rms[worst], summary.train.torque_unit);
  }
  Eigen::Index narrow = 0;
  if (best.coverage_95.minCoeff(&narrow) < kLeastCoverage) {
    out.limits += fmt::format(
        "The 95 % band of {} holds only {:.0f} % of the unseen samples: the model lacks something "
        "there. ",
        summary.joints[static_cast<std::size_t>(narrow)], 100.0 * best.coverage_95[narrow]);
  }
  if (!found.undetermined.empty()) {
    out.limits += fmt::format(
        "{} parameters are not moved by this motion ({}, ..): record a richer one. ",
        found.undetermined.size(), found.names[static_cast<std::size_t>(found.undetermined[0])]);
  }
  if (out.limits.empty()) out.limits = "No joint stands out; the noise limits the accuracy.";
  return out;
}

}  // namespace kinescope
