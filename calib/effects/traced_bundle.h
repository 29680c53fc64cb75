// SPDX-License-Identifier: Apache-2.0
//
// The bundle as a model that can be traced.
#pragma once

#include "calib/effects/camera_effects.h"
#include "calib/effects/trace_calibration.h"

namespace kinescope::effects {

class TracedBundle final : public TracedModel {
 public:
  /// Keeps a reference to `bundle`, whose couplings by design it has, but for those named.
  TracedBundle(const EffectBundle& bundle, const CalibrationTraceOptions& options,
               std::vector<std::size_t> without_couplings = {});
  /// Begins where earlier fits ended, and ends at the same minimum but for the solver's tolerance.
  [[nodiscard]] TracedFit fit(const std::vector<AddedEffect>& effects) const override;

  /// The same with its numbers: the corrections that stand for the effects, at their values.
  struct Corrected {
    std::vector<FittedEffect> effects;
    std::vector<Correction> corrections;  ///< of all effects but the time offset, then nuisances
    std::optional<Eigen::Vector3d> gravity_base;  ///< as known before, turned as sags say
  };
  /// `traced`: the same effects as tracing has them, which knows how certain curves are; without it
  /// curves have no table.
  [[nodiscard]] Corrected corrected(const std::vector<AddedEffect>& effects,
                                    const std::vector<TracedEffect>& traced) const;

  /// Those of the effects that this robot can have: what was known of another may sit elsewhere.
  /// Without curves, which hold what is left beside the others.
  [[nodiscard]] std::vector<AddedEffect> possible(std::vector<AddedEffect> effects) const;

  /// What happens once, at the instant that most sightings bear out, those among them that are left
  /// out: near another one they stand out, and those that are used do not tell it from the right
  /// one. The same where that is borne out as well, and of several recordings.
  [[nodiscard]] std::vector<AddedEffect> at_likeliest_instants(
      std::vector<AddedEffect> effects) const;

  /// The robot and its motion as the fit with these effects has them: the log read that much later,
  /// loads where the effects leave the joints.
  [[nodiscard]] EffectWorld world_of(const std::vector<AddedEffect>& effects) const;

 private:
  /// What a fit needs; everything belongs to one world.
  struct Ready {
    EffectWorld world;
    std::vector<CameraEffect> library;
    BundleChange change;
    std::optional<BundleSolution> solved;  ///< of the change; ready_for() knows it
  };
  /// What depends on how large effects are, as a fit left it.
  struct Sized {
    std::vector<AddedEffect> effects;  ///< those that depend on their size
    KinematicTree tree;
    Eigen::MatrixXd added;                ///< frames x joints: to the joints' values, rad or m
    std::map<int, Eigen::VectorXd> sags;  ///< as EffectWorld has them
    std::map<int, Eigen::Vector2d> bends;
  };
  /// What fits found that later ones begin with.
  struct Memory {
    std::optional<Eigen::MatrixXd> ahead_s;  ///< by the last with an effect of the clock
    std::optional<Sized> sizes;
    std::map<int, double> play_starts;  ///< as EffectWorld has them
  };
  [[nodiscard]] Ready ready_for(const std::vector<AddedEffect>& effects) const;
  [[nodiscard]] Ready ready_at(const Eigen::MatrixXd& ahead_s,
                               const std::vector<AddedEffect>& effects) const;
  [[nodiscard]] Sized sizes_of(const std::vector<AddedEffect>& effects, const Ready& ready,
                               const BundleSolution& solution) const;
  /// Where the links with play began. True where that is news.
  [[nodiscard]] bool find_play_starts(const std::vector<AddedEffect>& effects, const Ready& ready,
                                      const BundleSolution& solution) const;
  /// `ahead_s`: frames x joints, joint-log time minus frame time.
  [[nodiscard]] EffectWorld world_at(const Eigen::MatrixXd& ahead_s) const;
  [[nodiscard]] Eigen::MatrixXd clock_ahead(double time_offset_s) const;
  [[nodiscard]] Eigen::MatrixXd likely_clock(const std::vector<AddedEffect>& effects) const;
  [[nodiscard]] BundleChange change_of(const std::vector<CameraEffect>& library,
                                       const std::vector<AddedEffect>& effects) const;

  const EffectBundle* bundle_;
  CalibrationTraceOptions options_;
  std::vector<std::size_t> without_couplings_;
  std::map<int, UnsteadyReading> unsteady_;
  mutable Memory memory_;
};

}  // namespace kinescope::effects
