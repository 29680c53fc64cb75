// SPDX-License-Identifier: Apache-2.0
//
// The page: its order, its head, and what the script reads.
#include "app/report/report.h"

#include <array>
#include <utility>

#include <fmt/format.h>

#include "app/report/assets.h"
#include "app/report/facts.h"
#include "app/report/html.h"
#include "app/report/sections.h"

namespace kinescope {
namespace {

using report::Facts;

constexpr std::array<std::pair<std::string_view, std::string_view>, 12> kContents = {{
    {"verdict", "Verdict"},
    {"identity", "Identity"},
    {"view", "The robot"},
    {"data", "Data quality"},
    {"structure", "Structure"},
    {"parameters", "Parameters"},
    {"errors", "Errors"},
    {"residuals", "Residuals"},
    {"observability", "What the data see"},
    {"method", "Method and limits"},
    {"reproduce", "How to reproduce"},
    {"licences", "Licences"},
}};

std::string head(const RunSummary& run) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      // Nothing may be loaded from anywhere: the page is complete in itself.
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src "
      "'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:\">\n"
      "<meta name=\"generator\" content=\"Kinescope {}\">\n<title>{}: calibration report</title>\n"
      "<style>\n{}</style>\n</head>\n",
      report::escaped(run.version), report::escaped(run.robot), report::page_style());
}

std::string banner(const RunSummary& run) {
  std::string out = fmt::format(
      "<header><p class=\"brand\">Kinescope calibration report</p><h1>{}</h1><p "
      "class=\"note\">Recording {} · "
      "version {}</p></header>\n<nav aria-label=\"Contents\"><ol>",
      report::escaped(run.robot), report::escaped(run.recording), report::escaped(run.version));
  for (const auto& [id, title] : kContents) {
    out += fmt::format("<li><a href=\"#{}\">{}</a></li>", id, title);
  }
  return out + "</ol></nav>\n";
}

std::string sections(const Facts& facts, std::string_view urdf) {
  return report::verdict_section(facts) + report::identity_section(facts) +
         report::view_section(facts) + report::data_section(facts) +
         report::structure_section(facts) + report::parameters_section(facts) +
         report::errors_section(facts) + report::residuals_section(facts) +
         report::observability_section(facts) + report::method_section(facts) +
         report::reproduce_section(facts, urdf) + report::licences_section();
}

}  // namespace

std::string report_html(const RunSummary& run, std::string_view urdf) {
  const Facts facts = report::gather_facts(run);
  return head(run) + "<body>\n" + banner(run) + "<main>\n" + sections(facts, urdf) + "</main>\n" +
         "<script type=\"application/json\" id=\"viewer-data\">" + report::viewer_data(facts) +
         "</script>\n<script>" + std::string(report::viewer_script()) +
         "</script>\n</body>\n</html>\n";
}

}  // namespace kinescope
