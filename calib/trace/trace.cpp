// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/trace.h"

#include "calib/trace/tracer.h"

namespace kinescope {

std::string_view to_string(TraceVerdict verdict) {
  switch (verdict) {
    case TraceVerdict::kEffects:
      return "effects";
    case TraceVerdict::kAmbiguous:
      return "ambiguous";
    case TraceVerdict::kUnknown:
      return "unknown";
    case TraceVerdict::kClean:
      return "clean";
    case TraceVerdict::kNothingToSay:
      return "nothing_to_say";
    case TraceVerdict::kNotRun:
      break;
  }
  return "not_run";
}

std::string_view to_string(CandidateState state) {
  switch (state) {
    case CandidateState::kRefitted:
      return "refitted";
    case CandidateState::kAccepted:
      return "accepted";
    case CandidateState::kRemoved:
      return "removed";
    case CandidateState::kHidden:
      return "hidden";
    case CandidateState::kTested:
      break;
  }
  return "tested";
}

Trace trace_effects(const TracedModel& model, const TraceOptions& options,
                    const Progress& progress) {
  return trace::Tracer(model, options, progress).run();
}

std::optional<AddedEffect> first_effect(const TracedModel& model, const TraceOptions& options) {
  return trace::Tracer(model, options, {}).first();
}

void size_again(const TracedModel& model, Trace& found) {
  trace::Tracer(model, {}, {}).size_again(found);
}

}  // namespace kinescope
