// SPDX-License-Identifier: Apache-2.0
//
// The verdict: sentences that say no more than the numbers do.
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/answer.h"
#include "app/report/facts.h"
#include "app/report/findings.h"
#include "app/report/verdict_words.h"
#include "calib/vision/double_ids.h"

namespace kinescope::report {

Verdict make_verdict(const RunSummary& run, const Analysis& analysis) {
  Verdict verdict;
  verdict.found = found_words(run);
  verdict.accurate = accuracy_words(run, analysis.tip);
  constexpr std::size_t kMostFindings = 3;
  bool other_postures = false;
  std::vector<Finding> findings = find_limits(run, analysis);
  if (findings.size() > kMostFindings) findings.resize(kMostFindings);
  for (const Finding& finding : findings) {
    if (!verdict.limits.empty()) verdict.limits += ' ';
    verdict.limits += finding.what;
    if (finding.remedy.empty() || verdict.next.find(finding.remedy) != std::string::npos) continue;
    if (!verdict.next.empty()) verdict.next += ' ';
    verdict.next += finding.remedy;
    other_postures = other_postures || finding.asks_postures;
  }
  // Of a run that is no answer, or whose joints no log drives, there is nothing to plan with.
  if (other_postures && !run.log.empty() && judge(run).given)
    verdict.next += " `kinescope plan` with the folder of this run chooses them.";
  for (std::string warning : run.warnings) {
    if (!warning.starts_with(kTwoMarkers)) continue;
    warning.front() = 'T';
    verdict.limits += fmt::format("{}{}.", verdict.limits.empty() ? "" : " ", warning);
  }
  if (verdict.next.empty()) {
    verdict.next =
        "Nothing in this recording calls for another one; to confirm the figures, record the same "
        "robot again and compare the two results.";
  }
  return verdict;
}

}  // namespace kinescope::report

namespace kinescope {

Verdict make_verdict(const RunSummary& run) {
  return report::make_verdict(run, report::analyse(run));
}

}  // namespace kinescope
