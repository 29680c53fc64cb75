// SPDX-License-Identifier: Apache-2.0
#include "app/report/policy_sections.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/motion_picture.h"
#include "app/report/numbers.h"
#include "app/report/sections.h"

namespace kinescope::report {
namespace {

using Eigen::Index;
using Eigen::Vector2d;
using policy::StateLayout;

const Eigen::MatrixXd& best_known(const policy::Trial& trial) {
  return trial.truth.size() > 0 ? trial.truth : trial.smoothed;
}

/// An angle is drawn in degrees.
struct Signal {
  std::string label;
  double factor = 1.0;
};

Signal position_signal(const StateLayout& layout, std::size_t p) {
  return layout.is_angle[p] ? Signal{layout.positions[p] + ", deg", kDegreesPerRadian}
                            : Signal{layout.positions[p], 1.0};
}

std::vector<Vector2d> over_time(const Eigen::VectorXd& values, double step_s, double factor) {
  std::vector<Vector2d> out;
  for (Index k = 0; k < values.size(); ++k) {
    out.emplace_back(static_cast<double>(k) * step_s, factor * values[k]);
  }
  return out;
}

void hold(const Eigen::VectorXd& values, double factor, PlotAxis& axis) {
  axis.lower = std::min(axis.lower, factor * values.minCoeff());
  axis.upper = std::max(axis.upper, factor * values.maxCoeff());
}

std::string position_plot(const PolicySummary& summary, const PolicyTrialSummary& one,
                          std::size_t p, int number, bool moving) {
  const StateLayout& layout = layout_of(summary);
  const Signal signal = position_signal(layout, p);
  const auto column = static_cast<Index>(p);
  const Eigen::VectorXd real = best_known(one.trial).col(column);
  const double seconds = trial_seconds(summary, one.trial);
  PlotAxis y{.label = signal.label,
             .lower = signal.factor * real.minCoeff(),
             .upper = signal.factor * real.maxCoeff()};
  const bool banded = one.particles && one.particles->lower.rows() == real.size();
  if (banded) {
    hold(one.particles->lower.col(column), signal.factor, y);
    hold(one.particles->upper.col(column), signal.factor, y);
  }
  pad_range(y.lower, y.upper);
  Plot plot(fmt::format("{} in trial {}", layout.positions[p], number),
            {.label = "time, s", .lower = 0.0, .upper = seconds}, y);
  if (banded) {
    std::vector<double> x, lower, upper;
    for (Index k = 0; k < real.size(); ++k) {
      x.push_back(static_cast<double>(k) * layout.step_s);
      lower.push_back(signal.factor * one.particles->lower(k, column));
      upper.push_back(signal.factor * one.particles->upper(k, column));
    }
    plot.band(x, lower, upper, series_class(0));
    plot.line(over_time(one.particles->median.col(column), layout.step_s, signal.factor),
              series_class(0));
    plot.legend("particles, median and 90 %", series_class(0));
  }
  const std::vector<Vector2d> path = over_time(real, layout.step_s, signal.factor);
  plot.line(path, "ink");
  plot.legend("the system", "ink");
  if (moving) plot.add(moving_dot(plot, path, seconds));
  return figure(plot.str(), layout.positions[p], "half");
}

// Inputs are held over a step.
std::string input_plot(const PolicySummary& summary, const PolicyTrialSummary& one, int number) {
  const StateLayout& layout = layout_of(summary);
  const double limit = layout.input_limit.maxCoeff();
  Plot plot(fmt::format("inputs in trial {}", number),
            {.label = "time, s", .lower = 0.0, .upper = trial_seconds(summary, one.trial)},
            {.label = "input", .lower = -1.1 * limit, .upper = 1.1 * limit});
  for (Index u = 0; u < layout.input_count(); ++u) {
    std::vector<Vector2d> steps;
    for (Index k = 0; k < one.trial.inputs.rows(); ++k) {
      const auto at = static_cast<double>(k);
      steps.emplace_back(at * layout.step_s, one.trial.inputs(k, u));
      steps.emplace_back((at + 1.0) * layout.step_s, one.trial.inputs(k, u));
    }
    const std::string colour = series_class(static_cast<std::size_t>(u) + 1);
    plot.line(steps, colour);
    plot.legend(layout.inputs[static_cast<std::size_t>(u)], colour);
  }
  return figure(plot.str(), "Inputs as applied", "half");
}

std::string trial_words(const PolicySummary& summary, const PolicyTrialSummary& one) {
  if (!one.record) return "Random inputs, to learn from.";
  std::string out =
      fmt::format("Promised {:.3g} (standard deviation {:.2g}), paid {:.3g}", one.record->promised,
                  one.record->promised_sigma, cost_paid(*one.record));
  out += as_promised(*one.record) ? ", as promised" : ", which is not what was promised";
  if (!judges(summary)) return out + ".";
  return out + (one.success ? "; within tolerance over the last second."
                            : "; not within tolerance over the last second.");
}

}  // namespace

const StateLayout& layout_of(const PolicySummary& summary) {
  return summary.problem.system->layout();
}

double trial_seconds(const PolicySummary& summary, const policy::Trial& trial) {
  return static_cast<double>(trial.inputs.rows()) * layout_of(summary).step_s;
}

bool judges(const PolicySummary& summary) {
  return summary.problem.tolerance.array().isFinite().any();
}

bool as_promised(const policy::TrialRecord& record) {
  return std::abs(cost_paid(record) - record.promised) <= 2.0 * record.promised_sigma;
}

std::string policy_trial_id(std::size_t number) { return fmt::format("trial-{}", number); }

std::string policy_trial_section(const PolicySummary& summary, std::size_t number) {
  const PolicyTrialSummary& one = summary.trials[number];
  const bool last = number + 1 == summary.trials.size();
  std::string out = section_head(policy_trial_id(number), fmt::format("Trial {}", number));
  out += paragraph(trial_words(summary, one)) + "<div class=\"figures\">";
  for (std::size_t p = 0; p < layout_of(summary).positions.size(); ++p) {
    out += position_plot(summary, one, p, static_cast<int>(number), last);
  }
  return out + input_plot(summary, one, static_cast<int>(number)) + "</div>\n</section>\n";
}

std::string policy_motion_section(const PolicySummary& summary) {
  const PolicyTrialSummary& last = summary.trials.back();
  const std::string picture = motion_picture("Motion in the last trial", summary.problem.skeleton,
                                             best_known(last.trial), layout_of(summary).step_s);
  if (picture.empty()) return {};
  return section_head("motion", "Motion in the last trial") +
         figure(picture,
                "Postures at even times; on a screen one more goes through them in real "
                "time",
                "half") +
         "</section>\n";
}

}  // namespace kinescope::report
