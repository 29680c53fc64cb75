// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/log_findings.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope {

std::string_view to_string(LogFault fault) {
  switch (fault) {
    using enum LogFault;
    case kStaleRows:
      return "stale_rows";
    case kRepeatedStamps:
      return "repeated_stamps";
    case kStampsGoBack:
      return "stamps_go_back";
    case kGap:
      return "gap";
    case kIrregularSteps:
      return "irregular_steps";
    case kSlow:
      return "slow";
    case kNoClock:
      return "no_clock";
    case kNotANumber:
      return "not_a_number";
    case kInfinite:
      return "infinite";
    case kSpike:
      return "spike";
    case kConstant:
      return "constant";
    case kClipped:
      return "clipped";
    case kFrozen:
      return "frozen";
    case kDeadZone:
      return "dead_zone";
    case kQuantised:
      return "quantised";
    case kHeld:
      return "held";
    case kWrapped:
      return "wrapped";
    case kUnit:
      return "unit";
    case kVelocityScale:
      return "velocity_scale";
    case kVelocityLag:
      return "velocity_lag";
    case kVelocityMismatch:
      return "velocity_mismatch";
    case kAcceleration:
      return "acceleration";
    case kLag:
      return "lag";
    case kTorqueScale:
      return "torque_scale";
    case kCommanded:
      return "commanded";
    case kAssignment:
      return "assignment";
    case kRepeatedPath:
      return "repeated_path";
    case kTooShort:
      return "too_short";
    case kReading:
      return "reading";
  }
  return "unknown";
}

std::string_view to_string(FaultWeight weight) {
  switch (weight) {
    using enum FaultWeight;
    case kNote:
      return "note";
    case kWarning:
      return "warning";
    case kRefusal:
      return "refusal";
  }
  return "unknown";
}

std::string to_line(const LogFinding& finding) {
  const std::string place = finding.place.empty() ? "" : finding.place + ": ";
  if (finding.remedy.empty()) return fmt::format("{}{}", place, finding.what);
  return fmt::format("{}{} ({})", place, finding.what, finding.remedy);
}

std::vector<LogFinding> findings_of(const std::vector<LogFinding>& findings, LogFault fault) {
  std::vector<LogFinding> out;
  std::ranges::copy_if(findings, std::back_inserter(out),
                       [&](const LogFinding& finding) { return finding.fault == fault; });
  return out;
}

void throw_refusals(const std::vector<LogFinding>& findings) {
  const auto refusal = std::ranges::find(findings, FaultWeight::kRefusal, &LogFinding::weight);
  if (refusal != findings.end()) throw bad_input(refusal->place, refusal->what, refusal->remedy);
}

}  // namespace kinescope
