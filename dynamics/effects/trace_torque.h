// SPDX-License-Identifier: Apache-2.0
//
// Takes   a DynamicModel and TorqueSamples, with the low-pass these went through.
// Gives   TorqueTrace: the effects that the model lacked (calib/trace), contact spans left out, the
//         model with all of that in it, and functions that take the effects out of a log again.
// Units   N m (N for joints that slide) or A.
// Method  contact spans, then calib/trace over TorqueTracedModel, until no more spans are found.
//         Where what was found may be masses that are declared wrongly, the same beside identified
//         ones: the account stays that predicts unseen stretches better.
// Not here: what the effects are (effect_library.h), reading logs (dynamics/data), files (app/io).
#pragma once

#include <string>
#include <vector>

#include "calib/trace/trace.h"
#include "dynamics/effects/contact_spans.h"
#include "dynamics/effects/traced_torque.h"

namespace kinescope {

struct TorqueTraceOptions {
  TracedTorqueOptions model = {};
  /// Every joint has friction of its own: offset, Coulomb, viscous are its plain causes.
  TraceOptions trace = {.max_effects = 80, .plain_causes = 3};
  /// Effects that move no torque by more than this share of its noise are not looked for.
  double noise_share = 0.1;
  bool contacts = true;  ///< look for spans in which the robot was touched
  ContactSpanOptions contact_spans = {};
};

/// An effect that was found, as far as a program needs it to apply or to undo it.
struct TorqueEffect {
  EffectId id;
  double scan = 0.0;
  std::string scan_name;
  std::string scan_unit;
  std::vector<EffectParameter> parameters;
  Eigen::VectorXd values;
};

/// A robot's torque: rigid bodies and what drives and sensors add.
struct CorrectedTorqueModel {
  DynamicModel model;  ///< viscous and Coulomb friction, motor inertia, payload, gravity in it
  /// All of them. Those that `in_model` says are in the DynamicModel must not be added twice.
  std::vector<TorqueEffect> effects;
  std::vector<char> in_model;
  /// Of effects that a DynamicModel has a place for: why one is not in it, or not as it was found.
  std::vector<std::string> notes;
  FittedTorque base;                 ///< what the effects come on top of
  std::vector<JointTravel> travels;  ///< of the log in which they were found
  LogSpan log;
};

struct TorqueTrace {
  Trace trace;
  TorqueBase base;
  std::vector<ContactSpan> contacts;  ///< left out
  std::vector<Eigen::Index> rows;     ///< samples that `trace` has its instants at
  CorrectedTorqueModel corrected;
};

/// Cut-off for a log that is traced: what friction does at every turn is not needed to its last
/// harmonic, but noise of the speed at the turns is felt. Not above what was chosen for
/// identification.
[[nodiscard]] double tracing_cutoff_hz(const CutoffChoice& chosen);

/// Throws as TorqueTracedModel does.
[[nodiscard]] TorqueTrace trace_torque(const DynamicModel& model, const TorqueSamples& samples,
                                       const TorqueTraceOptions& options = {},
                                       const Progress& progress = {});

/// The same effects on top of the same kind of base, fitted to the samples for which `wanted` is
/// not 0, contact spans left out: to judge on the others what was found. Which effects they are was
/// chosen on all that `found` is of. Throws as TorqueTracedModel does.
[[nodiscard]] CorrectedTorqueModel refit(const DynamicModel& model, const TorqueSamples& samples,
                                         const TorqueTraceOptions& options,
                                         const TorqueTrace& found, const std::vector<char>& wanted);

/// Torque of the rigid bodies and of every effect at every sample, as the sensors would show it.
[[nodiscard]] Eigen::MatrixXd predict_torque(const CorrectedTorqueModel& corrected,
                                             const TorqueSamples& samples,
                                             const TorqueFilter& filter = {});

/// The log without its effects: torques in time, at scale, and of the rigid bodies alone.
[[nodiscard]] TorqueSamples compensate(const CorrectedTorqueModel& corrected,
                                       const TorqueSamples& samples,
                                       const TorqueFilter& filter = {});

}  // namespace kinescope
