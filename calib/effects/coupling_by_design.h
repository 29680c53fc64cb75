// SPDX-License-Identifier: Apache-2.0
//
// Takes   a trace of a model that has couplings by design in it, and its bundle.
// Gives   the same trace, with each of these couplings as an effect of its own: how large it is in
//         this recording, and the error without it.
// Not here: how couplings by design are found (kinematics/structure).
#pragma once

#include "calib/bundle/effect_bundle.h"
#include "calib/effects/trace_calibration.h"

namespace kinescope::effects {

/// Leaves a trace that says nothing as it is. The share of the squares that a coupling explains is
/// taken of the model without any of them. `trace_options`: those of the trace.
void add_couplings_by_design(const EffectBundle& bundle, const CalibrationTraceOptions& options,
                             const TraceOptions& trace_options, Trace& trace);

/// Of couplings by design that the search found something beyond, all that is accepted is `times`
/// the ratio more: the model knows what is beyond it.
void shift_ratios_by_design(const EffectBundle& bundle, double times, Trace& trace);

}  // namespace kinescope::effects
