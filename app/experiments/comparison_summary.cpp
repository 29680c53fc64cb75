// SPDX-License-Identifier: Apache-2.0
#include "app/experiments/comparison_summary.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "app/report/experiment_plots.h"
#include "dynamics/experiments/quartiles.h"

namespace kinescope {
namespace {

using experiments::Learner;
using experiments::Trial;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::string setting_text(const ComparisonFacts& facts, int setting) {
  return fmt::format("{:g}", facts.axis.values[static_cast<std::size_t>(setting)]);
}

int settings_of(const ComparisonFacts& facts) { return static_cast<int>(facts.axis.values.size()); }

// All joints together stand after the last one.
std::string joint_name(const ComparisonFacts& facts, int joint) {
  return joint < 0 ? "all joints" : facts.joints[static_cast<std::size_t>(joint)];
}

std::vector<int> joints_and_all(const ComparisonFacts& facts) {
  std::vector<int> out;
  for (int j = 0; std::cmp_less(j, facts.joints.size()); ++j) out.push_back(j);
  out.push_back(-1);
  return out;
}

std::vector<double> spread_values(const std::vector<double>& errors) {
  if (errors.empty()) return {0.0, kNone, kNone, kNone, kNone, kNone};
  const experiments::Quartiles q = experiments::quartiles(errors);
  const experiments::Interval i = experiments::median_interval(errors);
  return {static_cast<double>(errors.size()), q.median, i.lower, i.upper, q.lower, q.upper};
}

ExperimentTable medians(const ComparisonFacts& facts) {
  ExperimentTable out{
      "medians",
      fmt::format("nMSE, %: median of {} runs, on motion that was not learned from", facts.runs),
      {"Model"},
      {facts.axis.label},
      {}};
  for (const int joint : joints_and_all(facts)) out.values.push_back(joint_name(facts, joint));
  for (int s = 0; s < settings_of(facts); ++s) {
    for (const Learner learner : facts.learners) {
      ExperimentTable::Row row{{std::string(to_string(learner))},
                               {facts.axis.values[static_cast<std::size_t>(s)]}};
      for (const int joint : joints_and_all(facts)) {
        row.values.push_back(median_error(facts, s, learner, joint));
      }
      out.rows.push_back(std::move(row));
    }
  }
  return out;
}

ExperimentTable spread(const ComparisonFacts& facts) {
  ExperimentTable out{"spread",
                      "nMSE, %: runs, median, 95 % interval of the median, quartiles",
                      {"Model", "Joint"},
                      {facts.axis.label, "runs", "median", "median from", "median to",
                       "lower quartile", "upper quartile"},
                      {}};
  for (int s = 0; s < settings_of(facts); ++s) {
    for (const Learner learner : facts.learners) {
      for (const int joint : joints_and_all(facts)) {
        std::vector<double> values{facts.axis.values[static_cast<std::size_t>(s)]};
        const std::vector<double> more = spread_values(errors_of(facts, s, learner, joint));
        values.insert(values.end(), more.begin(), more.end());
        out.rows.push_back(
            {{std::string(to_string(learner)), joint_name(facts, joint)}, std::move(values)});
      }
    }
  }
  return out;
}

ExperimentTable runs(const ComparisonFacts& facts) {
  ExperimentTable out{"runs",
                      "nMSE, %, of every run",
                      {"Model"},
                      {facts.axis.label, "run", "test inside the ranges learned from (%)"},
                      {}};
  for (const int joint : joints_and_all(facts)) out.values.push_back(joint_name(facts, joint));
  for (const Trial& trial : facts.trials) {
    ExperimentTable::Row row{{std::string(to_string(trial.learner))},
                             {facts.axis.values[static_cast<std::size_t>(trial.setting)],
                              static_cast<double>(trial.run + 1), trial.inside_percent}};
    row.values.insert(row.values.end(), trial.nmse_percent.begin(), trial.nmse_percent.end());
    row.values.push_back(trial.global_nmse_percent);
    out.rows.push_back(std::move(row));
  }
  return out;
}

std::string best_two(const ComparisonFacts& facts, int setting, int joint) {
  std::vector<std::pair<double, Learner>> order;
  for (const Learner learner : facts.learners) {
    const double median = median_error(facts, setting, learner, joint);
    if (std::isfinite(median)) order.emplace_back(median, learner);
  }
  std::ranges::stable_sort(order, {}, &std::pair<double, Learner>::first);
  std::string out = joint_name(facts, joint) + ": ";
  for (std::size_t k = 0; k < std::min<std::size_t>(2, order.size()); ++k) {
    out += fmt::format("{}{} {:.3g} %", k > 0 ? ", then " : "", to_string(order[k].second),
                       order[k].first);
  }
  return out;
}

}  // namespace

std::vector<double> errors_of(const ComparisonFacts& facts, int setting, Learner learner,
                              int joint) {
  std::vector<double> out;
  for (const Trial& trial : facts.trials) {
    if (trial.setting != setting || trial.learner != learner) continue;
    const double error = joint < 0 ? trial.global_nmse_percent : trial.nmse_percent[joint];
    if (std::isfinite(error)) out.push_back(error);
  }
  return out;
}

double median_error(const ComparisonFacts& facts, int setting, Learner learner, int joint) {
  const std::vector<double> errors = errors_of(facts, setting, learner, joint);
  return errors.empty() ? kNone : experiments::quartiles(errors).median;
}

std::vector<ExperimentTable> comparison_tables(const ComparisonFacts& facts) {
  return {medians(facts), spread(facts), runs(facts)};
}

std::vector<ExperimentTable> comparison_tables(
    const std::vector<std::pair<std::string, ComparisonFacts>>& tests) {
  std::vector<ExperimentTable> out;
  for (const auto& [name, facts] : tests) {
    const std::vector<ExperimentTable> tables = comparison_tables(facts);
    for (std::size_t k = 0; k < tables.size(); ++k) {
      if (out.size() == k) {
        out.push_back(tables[k]);
        out[k].labels.emplace_back("Test");
        out[k].rows.clear();
      }
      for (ExperimentTable::Row row : tables[k].rows) {
        row.labels.push_back(name);
        out[k].rows.push_back(std::move(row));
      }
    }
  }
  return out;
}

std::vector<ExperimentSection::Figure> box_figures(const ComparisonFacts& facts, int setting) {
  std::vector<ExperimentSection::Figure> out;
  for (int j = 0; std::cmp_less(j, facts.joints.size()); ++j) {
    std::vector<report::BoxRow> rows;
    for (const Learner learner : facts.learners) {
      rows.push_back({std::string(to_string(learner)), errors_of(facts, setting, learner, j)});
    }
    const std::string& name = facts.joints[static_cast<std::size_t>(j)];
    out.push_back(
        {report::box_plot("Error of " + name, "nMSE of " + name + ", %", rows),
         fmt::format("{}: quartiles, median and every one of {} runs", name, facts.runs)});
  }
  return out;
}

ExperimentSection::Figure curve_figure(const ComparisonFacts& facts, int joint) {
  std::vector<report::Curve> curves;
  for (const Learner learner : facts.learners) {
    report::Curve curve{
        .name = std::string(to_string(learner)), .points = {}, .lower = {}, .upper = {}};
    for (int s = 0; s < settings_of(facts); ++s) {
      const std::vector<double> errors = errors_of(facts, s, learner, joint);
      if (errors.empty()) continue;
      const experiments::Quartiles q = experiments::quartiles(errors);
      curve.points.emplace_back(facts.axis.values[static_cast<std::size_t>(s)], q.median);
      curve.lower.push_back(q.lower);
      curve.upper.push_back(q.upper);
    }
    if (!curve.points.empty()) curves.push_back(std::move(curve));
  }
  const std::string name = joint_name(facts, joint);
  return {report::curve_plot("Error of " + name + " over " + facts.axis.label,
                             {.label = facts.axis.label, .log10 = true},
                             {.label = "nMSE of " + name + ", %", .log10 = true}, curves),
          fmt::format("{}: medians of {} runs, band: quartiles", name, facts.runs)};
}

std::vector<std::string> comparison_findings(const ComparisonFacts& facts, int setting) {
  std::string best;
  for (const int joint : joints_and_all(facts)) {
    best += (best.empty() ? "" : "; ") + best_two(facts, setting, joint);
  }
  std::vector<std::string> out{fmt::format("Least median nMSE, {} {}: {}.", facts.axis.label,
                                           setting_text(facts, setting), best)};
  for (const Learner learner : facts.learners) {
    const auto failed = [&](const Trial& trial) {
      return trial.learner == learner && !trial.failure.empty();
    };
    const auto count = std::ranges::count_if(facts.trials, failed);
    if (count == 0) continue;
    out.push_back(fmt::format("{} could not be learned {} times; the first: {}.",
                              to_string(learner), count,
                              std::ranges::find_if(facts.trials, failed)->failure));
  }
  return out;
}

}  // namespace kinescope
