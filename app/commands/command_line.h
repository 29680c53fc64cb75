// SPDX-License-Identifier: Apache-2.0
//
// What the command line can say, and the help that explains it. For cli.cpp and
// app/manual: shows CLI11.
#pragma once

#include <filesystem>
#include <optional>

#include <CLI/CLI.hpp>

#include "app/commands/capture.h"
#include "app/commands/commands.h"
#include "app/commands/markers.h"
#include "app/commands/policy.h"

namespace kinescope {

/// What all commands take.
struct OutputOptions {
  bool json = false;
  bool quiet = false;
};

/// Everything the command line can say.
struct CommandLine {
  RunOptions run;
  MergeOptions merge;
  FleetOptions fleet;
  DynamicsOptions dynamics;
  PredictOptions predict;
  SimulateOptions simulate;
  ControlOptions control;
  ExportOptions exported;
  ContactCommandOptions contact;
  ExperimentOptions experiment;
  PolicyCommandOptions policy;
  InspectOptions inspect;
  CameraOptions camera;
  CaptureOptions capture;
  MarkersOptions markers;
  TraceCommandOptions trace;
  CorrectOptions correct;
  CompareOptions compare;
  PlanCommandOptions plan;
  std::optional<std::filesystem::path> settings;  ///< recording.yaml of a torque log
  OutputOptions output;
  bool no_time_offset = false;
};

/// Adds the program's name, its commands with their options, which write into `line`, and the help.
void add_commands(CLI::App& app, CommandLine& line);

}  // namespace kinescope
