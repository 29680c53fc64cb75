// SPDX-License-Identifier: Apache-2.0
//
// The model that tracing corrected, judged on the samples that the other models are judged on.
#pragma once

#include "app/torque/torque_trace_stage.h"

namespace kinescope {

struct TracedScore {
  TorqueScore score;
  TorquePrediction prediction;  ///< of the test
  BandFactors bands;
};

/// Its parameters are fitted to the training samples alone, and once without each fold of them for
/// the bands and the error on motion left out; which effects it has was chosen on the whole log.
/// A model that cannot be fitted so gets its reason.
[[nodiscard]] TracedScore score_traced(const DynamicModel& model, const TracedLog& traced,
                                       const TorqueSummary& summary, bool unseen_test);

}  // namespace kinescope
