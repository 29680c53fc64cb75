// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "app/report/page.h"
#include "app/report/torque_sections.h"
#include "app/report/trace_section.h"

namespace kinescope {
namespace {

constexpr std::array<report::ContentsEntry, 7> kContents = {{
    {"verdict", "Verdict"},
    {"data", "Data quality"},
    {"models", "Models side by side"},
    {"prediction", "Measured and predicted"},
    {"parameters", "Friction and parameters"},
    {"trace", "Closing the loop"},
    {"reproduce", "How to reproduce"},
}};

}  // namespace

std::string torque_report_html(const TorqueSummary& summary) {
  const report::TorqueFacts facts{summary, torque_json(summary)};
  return report::page_begin("torque report", summary.robot, summary.log, summary.version,
                            kContents) +
         "<main>\n" + report::torque_verdict_section(facts) + report::torque_data_section(facts) +
         report::torque_models_section(facts) + report::torque_prediction_section(facts) +
         report::torque_parameters_section(facts) +
         (facts.summary.trace ? report::trace_section(*facts.summary.trace) : "") +
         report::torque_reproduce_section(facts) + "</main>\n</body>\n</html>\n";
}

}  // namespace kinescope
