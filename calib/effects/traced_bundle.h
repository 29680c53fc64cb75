// SPDX-License-Identifier: Apache-2.0
//
// The bundle as a model that can be traced.
#pragma once

#include "calib/effects/camera_effects.h"
#include "calib/effects/trace_calibration.h"

namespace kinescope::effects {

class TracedBundle final : public TracedModel {
 public:
  TracedBundle(const EffectBundle& bundle, const CalibrationTraceOptions& options);
  [[nodiscard]] TracedFit fit(const std::vector<AddedEffect>& effects) const override;

  /// The same with its numbers: the corrections that stand for the effects, at their values.
  struct Corrected {
    std::vector<FittedEffect> effects;
    std::vector<Correction> corrections;  ///< of all effects but the time offset
  };
  [[nodiscard]] Corrected corrected(const std::vector<AddedEffect>& effects) const;

 private:
  [[nodiscard]] EffectWorld world_at(double time_offset_s) const;

  const EffectBundle* bundle_;
  CalibrationTraceOptions options_;
};

}  // namespace kinescope::effects
