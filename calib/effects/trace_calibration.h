// SPDX-License-Identifier: Apache-2.0
//
// Takes   what calibrate() takes, the start near its solution.
// Gives   CalibrationTrace: the effects of camera, encoders and mechanics that the calibration
//         lacks, and the corrections that put them into it.
// Units   m, rad, s, px.
// Method  calib/trace over the bundle (calib/bundle/effect_bundle.h); the plain model trusts the
//         clocks, the channels' units, the declared camera and markers, and rigid links.
// Not here: torques (dynamics/effects).
#pragma once

#include <optional>
#include <vector>

#include "calib/bundle/calibrate.h"
#include "calib/effects/error_table.h"
#include "calib/trace/trace.h"

namespace kinescope {

struct CalibrationTraceOptions {
  /// Recordings whose effects are all known take 7 to 30 fits (`undeclared`, numbers from 11000
  /// on); those with a cause that no effect has the shape of took up to 230 a search without a
  /// limit.
  TraceOptions trace = {.most_fits = 100};
  CalibrateOptions calibrate;
  /// Unit vector in the base frame along which things fall, where it is known.
  std::optional<Eigen::Vector3d> gravity_base;
};

/// An effect with its numbers: what is kept of it, and what undoes it.
struct FittedEffect {
  EffectId id;
  double scan = 0.0;
  std::vector<EffectParameter> parameters;
  Eigen::VectorXd values;
  /// Of each parameter: what its share was divided by (compliance: the largest load's arm, m; clock
  /// drift: the time at which it is zero, s).
  Eigen::VectorXd references;
  /// Of a joint_map, whose parameters mean nothing one by one: what they make, and of which shares.
  ErrorTable table;
  Eigen::MatrixXd table_shares;  ///< points of the table x values
  /// Values of a joint over which it was observed (observed_range.h). Not set: it counts anywhere.
  std::optional<JointLimits> range = {};
};

struct CalibrationTrace {
  Trace trace;
  std::vector<FittedEffect> effects;  ///< all that were accepted
  /// Of all accepted effects but the time offset, in their order, then nuisances: for
  /// CalibrationStart.
  std::vector<Correction> corrections;
  std::optional<Eigen::Vector3d> gravity_base;  ///< as declared, or as a joint's sag says
  double stamp_jitter_s = 0.0;                  ///< EffectBundle's
};

/// Throws as calibrate().
[[nodiscard]] CalibrationTrace trace_calibration(const Measurements& measurements,
                                                 const MarkerSet& markers, const JointLog& log,
                                                 const CalibrationStart& start,
                                                 const CalibrationTraceOptions& options,
                                                 const Progress& progress = {});

}  // namespace kinescope
