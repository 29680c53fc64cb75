// SPDX-License-Identifier: Apache-2.0
#include <vector>

#include "app/report/html.h"
#include "app/report/page.h"
#include "app/report/torque_sections.h"
#include "app/report/trace_section.h"

namespace kinescope {
namespace {

// Without those sections that this page does not have.
std::vector<report::ContentsEntry> contents(const TorqueSummary& summary) {
  std::vector<report::ContentsEntry> out = {{"verdict", "Verdict"}};
  if (summary.trace) out.emplace_back("trace", "Closing the loop");
  out.emplace_back("prediction", "Measured and predicted");
  out.emplace_back("parameters", "Friction and parameters");
  if (summary.payload) out.emplace_back("payload", "Payload");
  out.emplace_back("models", "Models side by side");
  if (summary.rollout) out.emplace_back("rollout", "Forward in time");
  if (summary.robust) out.emplace_back("robust", "Robust regression");
  out.emplace_back("data", "Data quality");
  out.emplace_back("reproduce", "How to reproduce");
  return out;
}

}  // namespace

std::string torque_report_html(const TorqueSummary& summary) {
  const report::TorqueFacts facts{summary, torque_json(summary)};
  return report::page_begin("torque report", summary.robot, summary.log, summary.version,
                            contents(summary)) +
         "<main>\n" + report::torque_verdict_section(facts) +
         (facts.summary.trace ? report::trace_section(*facts.summary.trace) : "") +
         report::torque_prediction_section(facts) + report::torque_parameters_section(facts) +
         report::torque_payload_section(facts) + report::torque_models_section(facts) +
         report::folded(report::torque_rollout_section(facts)) +
         report::folded(report::torque_robust_section(facts)) +
         report::folded(report::torque_data_section(facts)) +
         report::folded(report::torque_reproduce_section(facts)) + "</main>\n</body>\n</html>\n";
}

}  // namespace kinescope
