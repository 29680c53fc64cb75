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

  /// The corrections that stand for some effects, one list an effect.
  [[nodiscard]] std::vector<std::vector<Correction>> corrections(
      const std::vector<AddedEffect>& effects) const;

 private:
  [[nodiscard]] EffectWorld world_at(double time_offset_s) const;

  const EffectBundle* bundle_;
  CalibrationTraceOptions options_;
};

}  // namespace kinescope::effects
