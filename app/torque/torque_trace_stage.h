// SPDX-License-Identifier: Apache-2.0
//
// Closing the loop on a torque log: what rigid bodies lack is traced; the corrected model and the
// log without the effects are written.
#pragma once

#include "app/io/output_folder.h"
#include "app/io/torque_model_file.h"
#include "app/report/torque_summary.h"
#include "app/torque/torque_options.h"
#include "dynamics/effects/trace_torque.h"

namespace kinescope {

struct TracedLog {
  TorqueTrace trace;
  SavedTrace saved;
  TorqueSamples samples;       ///< that were traced
  TorqueTraceOptions options;  ///< how
  bool has_urdf = false;       ///< robot_traced.urdf was written
};

/// One answer for each drive: where tracing sizes a term of a joint, its value (with what the URDF
/// declares, where the trace is of its masses) takes the place of the parametric model's, which had
/// to make up for effects that it lacks. So it is with viscous and Coulomb friction that tracing
/// found not to be there beside another kind of friction: they are left out.
void take_traced_drives(const TorqueTrace& trace, const DynamicModel& declared,
                        std::vector<DriveEstimate>& drives);

/// Filters the log at the cut-off that tracing asks for, given the one chosen for identification.
/// Writes trace.json (or the name given), robot_traced.urdf (unless no reader would take it: the
/// model's notes say why) and torque_compensated.csv. Throws as
/// filtered_data() and trace_torque().
[[nodiscard]] TracedLog trace_torque_stage(const DynamicsOptions& options,
                                           const DynamicModel& model, const TorqueLogReport& log,
                                           const CutoffChoice& cutoff, const OutputFolder& folder,
                                           const Progress& progress);

/// Removes what the above wrote in an earlier run of the same command.
void remove_torque_trace(const std::string& trace_file, const OutputFolder& folder);

}  // namespace kinescope
