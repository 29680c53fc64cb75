// SPDX-License-Identifier: Apache-2.0
#include "app/torque/torque_plausibility.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "dynamics/models/comparison.h"
#include "dynamics/models/exchanged_torques.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// Of the variance on motion that the fit has not seen. White and coloured noise of 6 s at 4 joints
// leaves 95 to 102 % at the best joint (25 logs), of 1.5 s 100 % and more (25); five logs of robots
// leave at most 2 %.
constexpr double kUnexplainedPercent = 90.0;
constexpr double kFollows = 0.7;  // correlation with the robot's own masses; chance comes not near

std::string names_of(const std::vector<std::string>& files) {
  return fmt::format("{}", fmt::join(files, ", "));
}

void refuse_exchanged(const TorqueSummary& summary, const TorqueLog& log,
                      const ExchangedTorques& found) {
  const auto first = static_cast<std::size_t>(found.first);
  const auto second = static_cast<std::size_t>(found.second);
  std::vector<std::string> columns = log.torque_columns;
  const std::string words = fmt::format(
      "the torques of the joints '{}' and '{}' ('{}' and '{}') stand in each other's place: "
      "exchanged, the model leaves {:.3g} and {:.3g} % of their variance unexplained, as logged "
      "{:.3g} and {:.3g} %",
      summary.joints[first], summary.joints[second], columns[first], columns[second],
      found.exchanged_percent[found.first], found.exchanged_percent[found.second],
      found.as_logged_percent[found.first], found.as_logged_percent[found.second]);
  std::swap(columns[first], columns[second]);
  throw bad_input(names_of(log.sources), words,
                  fmt::format("exchange the columns, or say so in recording.yaml, dynamics: "
                              "{{torque: [{}]}}",
                              fmt::join(columns, ", ")));
}

// On motion left out of the training; of a log too short for that, on the test.
Eigen::VectorXd unseen_percent(const FittedTorqueModel& parametric, const TorqueSummary& summary) {
  if (parametric.left_out_nmse_percent.size() > 0) return parametric.left_out_nmse_percent;
  return score_torque_model(parametric, summary.test).nmse_percent;
}

bool follows_masses(const TorqueScales& scales) {
  return std::ranges::any_of(scales.joints, [](const TorqueScale& scale) {
    return std::abs(scale.correlation) > kFollows;
  });
}

}  // namespace

void require_torques_of_motion(const DynamicModel& model, const TorqueSummary& summary,
                               const TorqueLog& log, const TorqueScales& scales,
                               const FittedTorqueModel& parametric,
                               const TorqueModelOptions& options) {
  const Eigen::VectorXd left = unseen_percent(parametric, summary);
  if (const auto found = find_exchanged_torques(model, summary.train, left, options.identify,
                                                options.band_folds)) {
    refuse_exchanged(summary, log, *found);
  }
  // A torque that does not vary has no share, and is named as constant.
  const bool explained =
      (left.array() < kUnexplainedPercent).any() || !left.array().isFinite().any();
  if (explained || follows_masses(scales)) return;
  Eigen::Index best = 0;
  const double least = left.array().isFinite().select(left, HUGE_VAL).minCoeff(&best);
  throw undetermined(
      names_of(log.sources),
      fmt::format("the robot's motion explains the torques no better than noise: at '{}', the best "
                  "joint, it leaves {:.0f} % of the variance on motion that the fit has not seen",
                  summary.joints[static_cast<std::size_t>(best)], least),
      "check that the columns of positions and torques are of one motion of this robot "
      "(kinescope inspect LOG --robot names them), and record longer, every joint at changing "
      "speeds");
}

}  // namespace kinescope
