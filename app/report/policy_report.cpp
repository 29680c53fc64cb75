// SPDX-License-Identifier: Apache-2.0
#include "app/report/policy_report.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "app/report/experiment_plots.h"
#include "app/report/html.h"
#include "app/report/page.h"
#include "app/report/policy_sections.h"
#include "app/report/reproduction.h"
#include "app/report/result_values.h"
#include "app/report/sections.h"

namespace kinescope::report {
namespace {

using Eigen::Index;

constexpr int kPolicySchema = 1;

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
  if (judges(summary)) out["success"] = one.success;
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
    const bool known = record && judges(summary);
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
  if (paid.points.size() > 1) {  // one is in the table
    out += figure(curve_plot("Cost over trials", {.label = "trial"}, {.label = "cost of a trial"},
                             {promised, paid}),
                  "What the particles promised before each trial, and what the system then cost",
                  "half");
  }
  return out + trials_table(summary, document) + "</section>\n";
}

std::vector<double> data_seconds(const PolicySummary& summary) {
  std::vector<double> out;
  double seconds = 0.0;
  for (const PolicyTrialSummary& one : summary.trials) {
    out.push_back(seconds);
    seconds += trial_seconds(summary, one.trial);
  }
  return out;
}

}  // namespace
}  // namespace kinescope::report

namespace kinescope {

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
  using namespace report;
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
  } else if (judges(summary)) {
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
  using namespace report;
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
          {"schema_version", kPolicySchema},
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
  using namespace report;
  const nlohmann::json document = policy_search_json(summary);
  std::vector<std::pair<std::string, std::string>> ids{{"verdict", "Findings"}};
  const std::string motion = summary.trials.empty() ? "" : policy_motion_section(summary);
  if (!motion.empty()) ids.emplace_back("motion", "Motion");
  ids.emplace_back("cost", "Cost");
  for (std::size_t k = 0; k < summary.trials.size(); ++k) {
    ids.emplace_back(policy_trial_id(k), fmt::format("Trial {}", k));
  }
  ids.emplace_back("reproduce", "How to reproduce");
  const std::vector<ContentsEntry> contents(ids.begin(), ids.end());
  std::string out =
      page_begin("policy", summary.problem.name, "policy search", summary.version, contents);
  out += "<main>\n" + section_head("verdict", "Findings");
  for (const std::string& finding : policy_findings(summary)) out += paragraph(finding);
  out += "</section>\n" + motion + cost_section(summary, document);
  for (std::size_t k = 0; k < summary.trials.size(); ++k) out += policy_trial_section(summary, k);
  return out + reproduction_section({summary.command, summary.settings, summary.inputs}) +
         "</main>\n</body>\n</html>\n";
}

}  // namespace kinescope
