// SPDX-License-Identifier: Apache-2.0
#include "app/report/policy_report.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "app/report/experiment_plots.h"
#include "app/report/html.h"
#include "app/report/motion_picture.h"
#include "app/report/page.h"
#include "app/report/result_values.h"
#include "app/report/sections.h"

namespace kinescope {
namespace {

using namespace report;
using Eigen::Index;
using Eigen::Vector2d;
using policy::StateLayout;

constexpr int kSchemaVersion = 1;
constexpr double kDegrees = 180.0 / std::numbers::pi;

const StateLayout& layout_of(const PolicySummary& summary) {
  return summary.problem.system->layout();
}

const Eigen::MatrixXd& best_known(const policy::Trial& trial) {
  return trial.truth.size() > 0 ? trial.truth : trial.smoothed;
}

double rollout_seconds(const PolicySummary& summary, const policy::Trial& trial) {
  return static_cast<double>(trial.inputs.rows()) * layout_of(summary).step_s;
}

bool has_tolerance(const PolicySummary& summary) {
  return summary.problem.tolerance.array().isFinite().any();
}

// Within two standard deviations of what one rollout may come to.
bool as_promised(const policy::TrialRecord& record) {
  return std::abs(cost_paid(record) - record.promised) <= 2.0 * record.promised_sigma;
}

nlohmann::json trial_json(const PolicySummary& summary, const PolicyTrialSummary& one, int index,
                          double seconds) {
  nlohmann::json out{{"trial", index},
                     {"explored", !one.record.has_value()},
                     {"data_s", seconds},
                     {"promised", nullptr},
                     {"promised_sigma", nullptr},
                     {"paid", nullptr},
                     {"as_promised", nullptr},
                     {"success", nullptr},
                     {"search_steps", nullptr},
                     {"search_converged", nullptr},
                     {"samples", nlohmann::json::array()}};
  if (!one.record) return out;
  out["promised"] = number(one.record->promised);
  out["promised_sigma"] = number(one.record->promised_sigma);
  out["paid"] = number(cost_paid(*one.record));
  out["as_promised"] = as_promised(*one.record);
  if (has_tolerance(summary)) out["success"] = one.success;
  out["search_steps"] = one.record->search_steps;
  out["search_converged"] = one.record->search == policy::SearchStatus::kConverged;
  for (const Index count : one.record->samples) out["samples"].push_back(count);
  return out;
}

std::string trials_table(const PolicySummary& summary, const nlohmann::json& document) {
  Table table("trials-table", "Trials: what the model's particles promised and what was paid",
              document);
  table.header({"Trial", "learned from, s", "promised", "standard deviation", "paid",
                "within tolerance", "gradient steps", "samples kept"});
  for (std::size_t k = 0; k < summary.trials.size(); ++k) {
    const std::optional<policy::TrialRecord>& record = summary.trials[k].record;
    const auto place = [k](const char* key) { return fmt::format("/trials/{}/{}", k, key); };
    table.begin_row();
    table.text(record ? fmt::format("{}", k) : fmt::format("{} (explored)", k));
    table.number(place("data_s"), Quantity::kPlain);
    for (const char* key : {"promised", "promised_sigma", "paid"}) {
      table.number(place(key), Quantity::kPlain);
    }
    const bool known = record && has_tolerance(summary);
    table.text(!known ? "" : summary.trials[k].success ? "yes" : "no");
    table.number(place("search_steps"), Quantity::kCount);
    std::string samples;
    if (record) {
      for (const Index count : record->samples) {
        samples += fmt::format("{}{}", samples.empty() ? "" : ", ", count);
      }
    }
    table.text(samples);
  }
  return table.str();
}

std::string cost_section(const PolicySummary& summary, const nlohmann::json& document) {
  Curve promised{
      .name = "promised, and two standard deviations", .points = {}, .lower = {}, .upper = {}};
  Curve paid{.name = "paid", .points = {}, .lower = {}, .upper = {}};
  for (std::size_t k = 0; k < summary.trials.size(); ++k) {
    const std::optional<policy::TrialRecord>& record = summary.trials[k].record;
    if (!record) continue;
    const auto x = static_cast<double>(k);
    promised.points.emplace_back(x, record->promised);
    promised.lower.push_back(record->promised - 2.0 * record->promised_sigma);
    promised.upper.push_back(record->promised + 2.0 * record->promised_sigma);
    paid.points.emplace_back(x, cost_paid(*record));
  }
  std::string out = section_head("cost", "Cost promised and paid");
  out += paragraph(fmt::format(
      "A trial has {} steps of {:g} s; each state costs between 0 and 1, so that a trial costs at "
      "most {}.",
      summary.problem.task.steps, layout_of(summary).step_s, summary.problem.task.steps + 1));
  if (!paid.points.empty()) {
    out += figure(curve_plot("Cost over trials", {.label = "trial"}, {.label = "cost of a trial"},
                             {promised, paid}),
                  "What the particles promised before each trial, and what the system then cost",
                  "half");
  }
  return out + trials_table(summary, document) + "</section>\n";
}

/// An angle is drawn in degrees.
struct Signal {
  std::string label;
  double factor = 1.0;
};

Signal position_signal(const StateLayout& layout, std::size_t p) {
  return layout.is_angle[p] ? Signal{layout.positions[p] + ", deg", kDegrees}
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
  const double seconds = rollout_seconds(summary, one.trial);
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
            {.label = "time, s", .lower = 0.0, .upper = rollout_seconds(summary, one.trial)},
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
  if (!has_tolerance(summary)) return out + ".";
  return out + (one.success ? "; within tolerance over the last second."
                            : "; not within tolerance over the last second.");
}

std::string trial_id(std::size_t number) { return fmt::format("trial-{}", number); }

std::string trial_section(const PolicySummary& summary, std::size_t number) {
  const PolicyTrialSummary& one = summary.trials[number];
  const bool last = number + 1 == summary.trials.size();
  std::string out = section_head(trial_id(number), fmt::format("Trial {}", number));
  out += paragraph(trial_words(summary, one)) + "<div class=\"figures\">";
  for (std::size_t p = 0; p < layout_of(summary).positions.size(); ++p) {
    out += position_plot(summary, one, p, static_cast<int>(number), last);
  }
  return out + input_plot(summary, one, static_cast<int>(number)) + "</div>\n</section>\n";
}

std::string motion_section(const PolicySummary& summary) {
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

std::string reproduce_section(const PolicySummary& summary) {
  std::string out = section_head("reproduce", "How to reproduce");
  out += "<pre id=\"command\">" + escaped(summary.command) + "</pre>\n<dl class=\"verdict\">";
  for (const auto& [name, value] : summary.settings) {
    out += fmt::format("<dt>{}</dt><dd>{}</dd>", escaped(name), escaped(value));
  }
  out += "</dl>\n<ul>";
  for (const InputFile& input : summary.inputs) {
    out += "<li>" + escaped(input.name) + " <code class=\"hash\">" + escaped(input.sha256) +
           "</code></li>";
  }
  return out + "</ul></section>\n";
}

std::vector<double> data_seconds(const PolicySummary& summary) {
  std::vector<double> out;
  double seconds = 0.0;
  for (const PolicyTrialSummary& one : summary.trials) {
    out.push_back(seconds);
    seconds += rollout_seconds(summary, one.trial);
  }
  return out;
}

}  // namespace

double cost_paid(const policy::TrialRecord& record) {
  return record.paid_truth.value_or(record.paid);
}

std::optional<std::size_t> first_success(const PolicySummary& summary) {
  const auto found = std::ranges::find_if(summary.trials, [](const PolicyTrialSummary& one) {
    return one.record.has_value() && one.success;
  });
  if (found == summary.trials.end()) return std::nullopt;
  return static_cast<std::size_t>(found - summary.trials.begin());
}

std::vector<std::string> policy_findings(const PolicySummary& summary) {
  std::vector<std::string> out;
  const std::vector<double> seconds = data_seconds(summary);
  int policies = 0;
  int kept = 0;
  for (const PolicyTrialSummary& one : summary.trials) {
    if (!one.record) continue;
    ++policies;
    if (as_promised(*one.record)) ++kept;
  }
  if (policies == 0) {
    out.push_back(fmt::format("{}: no trial with a policy yet.", summary.problem.name));
    return out;
  }
  if (const std::optional<std::size_t> first = first_success(summary)) {
    out.push_back(fmt::format(
        "{}: within tolerance over the last second first in trial {}, learned from {:.3g} s.",
        summary.problem.name, *first, seconds[*first]));
  } else if (has_tolerance(summary)) {
    out.push_back(fmt::format(
        "{}: within tolerance over the last second in none of {} trials; more --trials may help.",
        summary.problem.name, policies));
  }
  const policy::TrialRecord& last = *summary.trials.back().record;
  out.push_back(
      fmt::format("Last trial: promised {:.3g} with standard deviation {:.2g}, paid {:.3g}.",
                  last.promised, last.promised_sigma, cost_paid(last)));
  out.push_back(
      fmt::format("{} of {} trials cost what was promised within two standard "
                  "deviations.",
                  kept, policies));
  return out;
}

nlohmann::json policy_search_json(const PolicySummary& summary) {
  const std::vector<double> seconds = data_seconds(summary);
  nlohmann::json settings = nlohmann::json::array();
  for (const auto& [name, value] : summary.settings) {
    settings.push_back({{"name", text(name)}, {"value", text(value)}});
  }
  nlohmann::json trials = nlohmann::json::array();
  for (std::size_t k = 0; k < summary.trials.size(); ++k) {
    trials.push_back(trial_json(summary, summary.trials[k], static_cast<int>(k), seconds[k]));
  }
  const std::optional<std::size_t> first = first_success(summary);
  return {{"schema", "kinescope.policy_search"},
          {"schema_version", kSchemaVersion},
          {"version", summary.version},
          {"system", text(summary.problem.name)},
          {"command", text(summary.command)},
          {"inputs", inputs_json(summary.inputs)},
          {"settings", std::move(settings)},
          {"findings", texts(policy_findings(summary))},
          {"step_s", layout_of(summary).step_s},
          {"steps", summary.problem.task.steps},
          {"first_success", first ? nlohmann::json(*first) : nlohmann::json()},
          {"trials", std::move(trials)}};
}

std::string policy_html(const PolicySummary& summary) {
  const nlohmann::json document = policy_search_json(summary);
  std::vector<std::pair<std::string, std::string>> ids{{"verdict", "Findings"}};
  const std::string motion = summary.trials.empty() ? "" : motion_section(summary);
  if (!motion.empty()) ids.emplace_back("motion", "Motion");
  ids.emplace_back("cost", "Cost");
  for (std::size_t k = 0; k < summary.trials.size(); ++k) {
    ids.emplace_back(trial_id(k), fmt::format("Trial {}", k));
  }
  ids.emplace_back("reproduce", "How to reproduce");
  const std::vector<ContentsEntry> contents(ids.begin(), ids.end());
  std::string out =
      page_begin("policy", summary.problem.name, "policy search", summary.version, contents);
  out += "<main>\n" + section_head("verdict", "Findings");
  for (const std::string& finding : policy_findings(summary)) out += paragraph(finding);
  out += "</section>\n" + motion + cost_section(summary, document);
  for (std::size_t k = 0; k < summary.trials.size(); ++k) out += trial_section(summary, k);
  return out + reproduce_section(summary) + "</main>\n</body>\n</html>\n";
}

}  // namespace kinescope
