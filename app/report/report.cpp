// SPDX-License-Identifier: Apache-2.0
//
// The page: its order, its head, and what the script reads.
#include "app/report/report.h"

#include <array>

#include "app/report/assets.h"
#include "app/report/facts.h"
#include "app/report/findings.h"
#include "app/report/page.h"
#include "app/report/sections.h"
#include "app/report/trace_section.h"
#include "app/report/verdict_words.h"

namespace kinescope {
namespace {

using report::Facts;

constexpr std::array<report::ContentsEntry, 13> kContents = {{
    {"verdict", "Verdict"},
    {"view", "The robot"},
    {"data", "Data quality"},
    {"structure", "Structure"},
    {"trace", "Closing the loop"},
    {"parameters", "Parameters"},
    {"errors", "Errors"},
    {"residuals", "Residuals"},
    {"observability", "What the data see"},
    {"method", "Method and limits"},
    {"identity", "Identity"},
    {"reproduce", "How to reproduce"},
    {"licences", "Licences"},
}};

std::string sections(const Facts& facts, std::string_view urdf) {
  return report::verdict_section(facts) + report::view_section(facts) +
         report::data_section(facts) + report::structure_section(facts) +
         (facts.run.trace
              ? report::trace_section(*facts.run.trace,
                                      report::sentence(report::beside_urdf_words(facts.run)))
              : "") +
         report::parameters_section(facts) + report::errors_section(facts) +
         report::residuals_section(facts) + report::observability_section(facts) +
         report::torque_section(facts) + report::method_section(facts) +
         report::identity_section(facts) + report::reproduce_section(facts, urdf) +
         report::licences_section();
}

}  // namespace

std::string report_html(const RunSummary& run, std::string_view urdf) {
  const Facts facts = report::gather_facts(run);
  return report::page_begin("calibration report", run.robot, "Recording " + run.recording,
                            run.version, kContents) +
         "<main>\n" + sections(facts, urdf) + "</main>\n" +
         "<script type=\"application/json\" id=\"viewer-data\">" + report::viewer_data(facts) +
         "</script>\n<script>" + std::string(report::viewer_script()) +
         "</script>\n</body>\n</html>\n";
}

}  // namespace kinescope
