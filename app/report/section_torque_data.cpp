// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "app/report/findings.h"
#include "app/report/html.h"
#include "app/report/sections.h"
#include "app/report/torque_sections.h"
#include "app/report/trace_words.h"

namespace kinescope::report {
namespace {

std::string findings_table(const TorqueFacts& facts) {
  const auto& findings = facts.summary.data.findings;
  if (findings.empty()) return paragraph("Nothing is wrong with the log.", "note");
  Table table("findings-table", "What was found in the log", facts.result);
  table.header({"Weight", "Fault", "Channel", "Share, %", "What", "Remedy"});
  for (std::size_t k = 0; k < findings.size(); ++k) {
    const LogFinding& finding = findings[k];
    table.begin_row();
    table.text(to_string(finding.weight));
    table.text(to_string(finding.fault));
    table.text(finding.channel.empty() ? "–" : finding.channel);
    table.number(fmt::format("/data/findings/{}/share", k), Quantity::kPercent);
    table.text(fmt::format("{} ({})", finding.what, finding.place));
    table.text(finding.remedy);
  }
  return table.str();
}

}  // namespace

namespace {

std::string torque_line(std::string_view label, std::string_view words) {
  if (words.empty()) return "";
  return fmt::format("<dt>{}</dt><dd>{}</dd>\n", label, with_code(words));
}

// What of the log was not used, and what is wrong with it.
std::string log_words(const TorqueSummary& summary) {
  std::string out =
      fmt::format("{} of {} rows used", summary.data.rows_used, summary.data.rows_read);
  for (const LogFinding& finding : summary.data.findings)
    out +=
        fmt::format("; {}{}", finding.channel.empty() ? "" : finding.channel + ": ", finding.what);
  out += ".";
  for (const std::string& warning : summary.warnings) out += " " + sentence(warning);
  return out;
}

}  // namespace

std::string torque_verdict_section(const TorqueFacts& facts) {
  const TorqueVerdict verdict = torque_verdict(facts.summary);
  const std::string traced = facts.summary.trace ? trace_paragraph(*facts.summary.trace) : "";
  return section_head("verdict", "Verdict") +
         (verdict.accurate.empty() ? "" : paragraph(verdict.accurate, "headline")) +
         "<dl class=\"verdict\">\n" + torque_line("Found", verdict.found) +
         torque_line("Log", log_words(facts.summary)) + torque_line("Beyond rigid bodies", traced) +
         torque_line("What limits it", verdict.limits) +
         torque_line("Forward in time", verdict.rollout) + torque_line("Payload", verdict.payload) +
         torque_line("Gravity", verdict.gravity) + "</dl></section>\n";
}

std::string torque_data_section(const TorqueFacts& facts) {
  const TorqueSummary& summary = facts.summary;
  std::string out = section_head("data", "Data quality");
  out += paragraph(fmt::format(
      "{}: {} rows read, {} used, logged at {:.4g} Hz. Motion and torque went through the same "
      "{} with a cut-off at {:.3g} Hz, which promises the smallest error of the accelerations; "
      "{} samples at {:.4g} Hz remain, of which {} were learned from. Held out: {}.",
      summary.log, summary.data.rows_read, summary.data.rows_used, summary.data.log_rate_hz,
      to_string(summary.data.filter), summary.data.cutoff.cutoff_hz, summary.data.samples.size(),
      summary.data.rate_hz, summary.train.size(), summary.split));
  out += findings_table(facts);
  if (!summary.warnings.empty()) {
    out += "<h3>Warnings</h3><ul id=\"warnings\">";
    for (const std::string& warning : summary.warnings) out += "<li>" + escaped(warning) + "</li>";
    out += "</ul>\n";
  }
  return out + "</section>\n";
}

std::string torque_reproduce_section(const TorqueFacts& facts) {
  const TorqueSummary& summary = facts.summary;
  std::string out = section_head("reproduce", "How to reproduce");
  out += "<pre id=\"command\">" + escaped(summary.command) + "</pre>\n";
  Table inputs("inputs-table", "Input files", facts.result);
  inputs.header({"File", "SHA-256"});
  for (const InputFile& input : summary.inputs) {
    inputs.begin_row();
    inputs.text(input.name);
    inputs.html("<code class=\"hash\">" + escaped(input.sha256) + "</code>");
  }
  out += inputs.str();
  Table times("times-table", "Stage times", facts.result);
  times.header({"Stage", "Time, s"});
  for (const StageTime& time : summary.times) {
    times.begin_row();
    times.text(time.stage);
    times.text(fmt::format("{:.3g}", time.seconds));
  }
  return out + times.str() + "</section>\n";
}

}  // namespace kinescope::report
