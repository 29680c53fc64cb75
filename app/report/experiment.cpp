// SPDX-License-Identifier: Apache-2.0
#include "app/report/experiment.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/page.h"
#include "app/report/reproduction.h"
#include "app/report/result_values.h"
#include "app/report/sections.h"
#include "kinematics/core/error.h"

namespace kinescope::report {
namespace {

constexpr int kExperimentSchema = 1;

nlohmann::json table_json(const ExperimentTable& table) {
  nlohmann::json out{{"id", table.id},
                     {"caption", text(table.caption)},
                     {"labels", texts(table.labels)},
                     {"values", texts(table.values)},
                     {"rows", nlohmann::json::array()}};
  for (const ExperimentTable::Row& row : table.rows) {
    nlohmann::json values = nlohmann::json::array();
    for (const double value : row.values) values.push_back(number(value));
    out["rows"].push_back({{"labels", texts(row.labels)}, {"values", std::move(values)}});
  }
  return out;
}

std::string table_html(const ExperimentSummary& summary, const std::string& id,
                       const nlohmann::json& document) {
  const auto found = std::ranges::find(summary.tables, id, &ExperimentTable::id);
  KINESCOPE_CHECK(found != summary.tables.end(), "a table of the summary");
  const auto at = found - summary.tables.begin();
  Table table(id + "-table", found->caption, document);
  std::vector<std::string> head = found->labels;
  head.insert(head.end(), found->values.begin(), found->values.end());
  table.header(head);
  for (std::size_t r = 0; r < found->rows.size(); ++r) {
    table.begin_row();
    for (const std::string& label : found->rows[r].labels) table.text(label);
    for (std::size_t c = 0; c < found->rows[r].values.size(); ++c) {
      table.number(fmt::format("/tables/{}/rows/{}/values/{}", at, r, c), Quantity::kPlain);
    }
  }
  return table.str();
}

std::string section_html(const ExperimentSummary& summary, const ExperimentSection& section,
                         const nlohmann::json& document) {
  std::string out = section_head(section.id, section.title);
  for (const std::string& words : section.words) out += paragraph(words);
  if (!section.figures.empty()) {
    out += "<div class=\"figures\">";
    for (const ExperimentSection::Figure& one : section.figures) {
      out += figure(one.drawing, one.caption, "half");
    }
    out += "</div>\n";
  }
  for (const std::string& id : section.tables) out += table_html(summary, id, document);
  return out + "</section>\n";
}

std::string reproduce(const ExperimentSummary& summary) {
  Reproduction of{summary.command, summary.settings, summary.inputs};
  for (const ExperimentTable& table : summary.tables)
    of.products.emplace_back(table.id + ".csv", table.caption);
  return reproduction_section(of);
}

std::string csv_word(const std::string& word) {
  if (word.find_first_of(",\"\n") == std::string::npos) return word;
  std::string out = "\"";
  for (const char c : word) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

}  // namespace
}  // namespace kinescope::report

namespace kinescope {

nlohmann::json experiment_json(const ExperimentSummary& summary) {
  using namespace report;
  nlohmann::json settings = nlohmann::json::array();
  for (const auto& [name, value] : summary.settings) {
    settings.push_back({{"name", text(name)}, {"value", text(value)}});
  }
  nlohmann::json tables = nlohmann::json::array();
  for (const ExperimentTable& table : summary.tables) tables.push_back(table_json(table));
  return {{"schema", "kinescope.experiment"}, {"schema_version", kExperimentSchema},
          {"version", summary.version},       {"experiment", summary.name},
          {"command", text(summary.command)}, {"inputs", inputs_json(summary.inputs)},
          {"settings", std::move(settings)},  {"findings", texts(summary.findings)},
          {"tables", std::move(tables)}};
}

std::string experiment_html(const ExperimentSummary& summary) {
  using namespace report;
  const nlohmann::json document = experiment_json(summary);
  std::vector<ContentsEntry> contents{{"verdict", "Findings"}};
  for (const ExperimentSection& section : summary.sections) {
    contents.emplace_back(section.id, section.title);
  }
  contents.emplace_back("reproduce", "How to reproduce");
  std::string out =
      page_begin("experiment", summary.title, summary.name, summary.version, contents);
  out += "<main>\n" + section_head("verdict", "Findings");
  for (const std::string& finding : summary.findings) out += paragraph(finding);
  out += "</section>\n";
  for (const ExperimentSection& section : summary.sections) {
    out += section_html(summary, section, document);
  }
  return out + reproduce(summary) + "</main>\n</body>\n</html>\n";
}

std::string experiment_csv(const ExperimentTable& table) {
  using namespace report;
  std::string out;
  const auto add = [&](const std::string& cell, bool first) { out += (first ? "" : ",") + cell; };
  for (std::size_t c = 0; c < table.labels.size(); ++c) add(csv_word(table.labels[c]), c == 0);
  for (const std::string& name : table.values) add(csv_word(name), out.empty());
  out += "\n";
  for (const ExperimentTable::Row& row : table.rows) {
    bool first = true;
    for (const std::string& label : row.labels) {
      add(csv_word(label), first);
      first = false;
    }
    for (const double value : row.values) {
      add(std::isfinite(value) ? fmt::format("{:.9g}", value) : "", first);
      first = false;
    }
    out += "\n";
  }
  return out;
}

}  // namespace kinescope
