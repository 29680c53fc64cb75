// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/plot.h"
#include "app/report/sections.h"
#include "app/report/torque_sections.h"
#include "app/report/torque_unit.h"

namespace kinescope::report {
namespace {

constexpr Eigen::Index kMostTorquePoints = 600;  // of one curve

std::vector<std::string> joint_header(const TorqueSummary& summary, std::string_view first) {
  std::vector<std::string> names{std::string(first)};
  names.insert(names.end(), summary.joints.begin(), summary.joints.end());
  return names;
}

// One row a model, one column a joint.
std::string score_table(const TorqueFacts& facts, std::string_view id, std::string_view caption,
                        std::string_view key, Quantity quantity) {
  Table table(id, caption, facts.result);
  std::vector<std::string> head = joint_header(facts.summary, "Model");
  const bool inducing = std::ranges::any_of(
      facts.summary.scores, [](const TorqueScore& score) { return score.inducing_points > 0; });
  if (inducing) head.insert(head.begin() + 1, "Inducing points");
  head.insert(head.begin() + 1, "Samples");
  table.header(head);
  for (std::size_t m = 0; m < facts.summary.scores.size(); ++m) {
    const TorqueScore& score = facts.summary.scores[m];
    if (!score.failure.empty()) continue;
    table.begin_row();
    table.text(name_of(score));
    table.number(fmt::format("/models/{}/samples", m), Quantity::kCount);
    if (inducing) table.number(fmt::format("/models/{}/inducing_points", m), Quantity::kCount);
    for (std::size_t j = 0; j < facts.summary.joints.size(); ++j) {
      table.number(fmt::format("/models/{}/{}/{}", m, key, j), quantity);
    }
  }
  return table.str();
}

std::string learning_plot(const TorqueSummary& summary) {
  double low = 1e300;
  double high = -1e300;
  double least = 1e300;
  double most = 0.0;
  for (const LearningCurve& curve : summary.learning) {
    for (const LearningPoint& point : curve.points) {
      low = std::min(low, std::log10(std::max(1e-6, point.nmse_percent)));
      high = std::max(high, std::log10(std::max(1e-6, point.nmse_percent)));
      least = std::min(least, std::log10(static_cast<double>(point.samples)));
      most = std::max(most, std::log10(static_cast<double>(point.samples)));
    }
  }
  if (!(low <= high)) return "";
  pad_range(low, high);
  pad_range(least, most);
  Plot plot("nMSE against the number of training samples",
            {.label = "training samples", .lower = least, .upper = most, .log10 = true},
            {.label = "nMSE over all joints, %", .lower = low, .upper = high, .log10 = true});
  for (std::size_t k = 0; k < summary.learning.size(); ++k) {
    std::vector<Eigen::Vector2d> points;
    for (const LearningPoint& point : summary.learning[k].points) {
      points.emplace_back(std::log10(static_cast<double>(point.samples)),
                          std::log10(std::max(1e-6, point.nmse_percent)));
    }
    plot.line(points, series_class(k));
    plot.dots(points, series_class(k));
    plot.legend(to_string(summary.learning[k].kind), series_class(k));
  }
  return figure(plot.str(), "Learning curve: samples of the training part, evenly chosen.");
}

// Of the test samples; below, a band is as good as it says.
constexpr double kFewExtrapolated = 0.01;

std::string band_label(const TorqueScore& score, Eigen::Index joint) {
  const double share = joint < score.extrapolated.size() ? score.extrapolated[joint] : 0.0;
  if (!(share > kFewExtrapolated)) return "95 % band";
  return fmt::format("95 % band, extrapolated at {:.0f} % of the samples", 100.0 * share);
}

// What the model's bands do not promise; empty where they hold what they say.
std::string band_limits(const TorqueScore& score, const std::vector<std::string>& joints) {
  std::string out;
  Eigen::Index calibrated = 0;
  for (Eigen::Index j = 0; j < score.band_residuals.size(); ++j) {
    if (score.band_residuals[j] > 0) ++calibrated;
  }
  if (calibrated > 0 && calibrated < score.band_residuals.size()) {
    out +=
        " too few residuals with a finite sigma for some joints, whose bands are the normal "
        "distribution's;";
  }
  if (calibrated > 0 && !score.bands_by_trajectory) {
    out +=
        " calibrated on blocks of one path with motion learned from on both sides, which says "
        "less about what comes after it;";
  }
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const auto at = static_cast<Eigen::Index>(j);
    if (at >= score.extrapolated.size() || !(score.extrapolated[at] > kFewExtrapolated)) continue;
    out += fmt::format(" extrapolated at {:.0f} % of the samples of {};",
                       100.0 * score.extrapolated[at], joints[j]);
  }
  if (!out.empty()) out.back() = '.';
  return out;
}

std::string prediction_plot(const TorqueSummary& summary, Eigen::Index joint) {
  const Eigen::Index samples = summary.test.size();
  const Eigen::Index step =
      std::max<Eigen::Index>(1, (samples + kMostTorquePoints - 1) / kMostTorquePoints);
  const double band = summary.bands.width_95(joint);
  std::vector<double> time;
  std::vector<double> lower;
  std::vector<double> upper;
  std::vector<Eigen::Vector2d> measured;
  std::vector<Eigen::Vector2d> predicted;
  for (Eigen::Index i = 0; i < samples; i += step) {
    const double t = summary.test.t_s[i] - summary.test.t_s[0];
    const double mean = summary.prediction.mean(i, joint);
    const double sigma = summary.prediction.sigma(i, joint);
    time.push_back(t);
    lower.push_back(mean - band * sigma);
    upper.push_back(mean + band * sigma);
    measured.emplace_back(t, summary.test.torque(i, joint));
    predicted.emplace_back(t, mean);
  }
  double low = summary.test.torque.col(joint).minCoeff();
  double high = summary.test.torque.col(joint).maxCoeff();
  pad_range(low, high, 0.1);
  double begin = *std::ranges::min_element(time);
  double end = *std::ranges::max_element(time);
  pad_range(begin, end, 0.01);
  const std::string& name = summary.joints[static_cast<std::size_t>(joint)];
  const std::string unit =
      joint_unit(summary.test.torque_unit, summary.types[static_cast<std::size_t>(joint)]);
  Plot plot(fmt::format("Measured and predicted torque of {}", name),
            {.label = "time, s", .lower = begin, .upper = end},
            {.label = fmt::format("{}, {}", name, unit), .lower = low, .upper = high},
            {.width = 940.0, .height = 200.0});
  plot.band(time, lower, upper, series_class(0));
  plot.line(measured, series_class(7));
  plot.line(predicted, series_class(0));
  plot.legend("measured", series_class(7));
  const TorqueScore& score = summary.scores[static_cast<std::size_t>(summary.best)];
  plot.legend("predicted, " + band_label(score, joint), series_class(0));
  const double error = score.rms[joint];
  // A line on a line is no riddle to leave to the reader.
  const bool alike = error < 0.005 * (high - low);
  return figure(plot.str(),
                fmt::format("{}: samples that the model has not seen; rms error {:.2g} {}{}.", name,
                            error, unit, alike ? ", less than the lines are wide" : ""),
                "wide");
}

// Joints by what the model leaves of their torque's variance; those without variance last.
std::vector<Eigen::Index> worst_first(const TorqueSummary& summary) {
  std::vector<Eigen::Index> out(static_cast<std::size_t>(summary.test.joints()));
  std::iota(out.begin(), out.end(), Eigen::Index{0});
  const Eigen::VectorXd& nmse = summary.scores[static_cast<std::size_t>(summary.best)].nmse_percent;
  std::ranges::stable_sort(out, std::greater{}, [&](Eigen::Index j) {
    return j < nmse.size() && std::isfinite(nmse[j]) ? nmse[j] : -1.0;
  });
  return out;
}

std::string further_scores(const TorqueFacts& facts, const std::string& by_lot) {
  return score_table(facts, "left-out-table", "nMSE on motion left out of the training, %",
                     "left_out_nmse_percent", Quantity::kPlain) +
         score_table(
             facts, "rms-table",
             fmt::format("Rms error, {}{}",
                         common_unit(facts.summary.train.torque_unit, facts.summary.types), by_lot),
             "rms", Quantity::kPlain) +
         score_table(facts, "coverage90-table", "Coverage of the 90 % band, %" + by_lot,
                     "coverage_90", Quantity::kPercent) +
         score_table(facts, "coverage95-table", "Coverage of the 95 % band, %" + by_lot,
                     "coverage_95", Quantity::kPercent);
}

std::string notes(const TorqueSummary& summary) {
  std::string out;
  for (const std::string& note : model_notes(summary)) out += paragraph(note, "note");
  for (const TorqueScore& score : summary.scores) {
    const std::string limits = band_limits(score, summary.joints);
    if (limits.empty()) continue;
    out += paragraph(fmt::format("Bands of {}:{}", name_of(score), limits), "note");
  }
  return out;
}

// What the names of the table's models stand for, those that are in it.
std::string model_names_words(const TorqueSummary& summary) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 9> kWords = {
      {{"parametric", "rigid bodies with viscous and Coulomb friction"},
       {"rbf", "Gaussian process with a squared-exponential kernel, no physics"},
       {"gip", "Gaussian process whose kernel has the structure of rigid bodies, no masses"},
       {"model_based", "Gaussian process on the rigid bodies' regressor"},
       {"semi_parametric", "parametric, and a Gaussian process for what that leaves"},
       {"lip", "Gaussian processes for the energies, torques by the Lagrange equations"},
       {"svr", "support vectors, no physics"},
       {"network", "two-layer network, no physics"},
       {"traced", "parametric, with the effects that tracing found"}}};
  std::string out;
  for (const auto& [name, words] : kWords) {
    const bool fitted = std::ranges::any_of(summary.scores, [&](const TorqueScore& score) {
      return score.failure.empty() && name_of(score) == name;
    });
    if (fitted) out += fmt::format("{}{}: {}", out.empty() ? "" : "; ", name, words);
  }
  return out.empty() ? out : out + ".";
}

}  // namespace

std::string torque_models_section(const TorqueFacts& facts) {
  std::string out = section_head("models", "Models side by side");
  out += paragraph(
      "nMSE: mean squared error over the variance of the measured torque, on the held-out part; "
      "below it, on motion left out of the training, by which the model to rely on is chosen. "
      "Coverage: share of the held-out samples within the model's own 90 % and 95 % bands.");
  const std::string by_lot =
      facts.summary.split_at_random ? " (samples held out by lot, which flatters)" : "";
  out += score_table(facts, "nmse-table", "nMSE, %" + by_lot, "nmse_percent", Quantity::kPlain);
  out += paragraph(model_names_words(facts.summary), "note");
  out += folded_part("Motion left out of the training, rms errors and coverage",
                     further_scores(facts, by_lot));
  for (const TorqueScore& score : facts.summary.scores) {
    if (!score.failure.empty()) {
      out += paragraph(fmt::format("{} was not fitted: {}", name_of(score), score.failure), "note");
    }
  }
  out += folded_part("Notes on the models and their bands", notes(facts.summary));
  return out + learning_plot(facts.summary) + "</section>\n";
}

std::string torque_prediction_section(const TorqueFacts& facts) {
  std::string out = section_head("prediction", "Measured and predicted torque");
  if (facts.summary.test.size() == 0 || facts.summary.scores.empty()) return out + "</section>\n";
  out += paragraph(
      fmt::format("Predicted by the {} model.",
                  name_of(facts.summary.scores[static_cast<std::size_t>(facts.summary.best)])));
  constexpr std::size_t kOpen = 3;  // plots that a screen holds
  const std::vector<Eigen::Index> joints = worst_first(facts.summary);
  std::string rest;
  for (std::size_t k = 0; k < joints.size(); ++k)
    (k < kOpen ? out : rest) += prediction_plot(facts.summary, joints[k]);
  if (joints.size() > kOpen)
    out += folded_part(
        fmt::format("The other {} joints, which it explains better", joints.size() - kOpen), rest);
  return out + "</section>\n";
}

}  // namespace kinescope::report
