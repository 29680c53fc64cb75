// SPDX-License-Identifier: Apache-2.0
//
// Takes   what `kinescope plan` chose and promises.
// Gives   its verdict and findings in words, plan.json (schema: app/io/schema/plan.schema.json).
// Units   SI; readings of channels in their own.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/run_summary.h"

namespace kinescope {

/// How well an axis is known, standard uncertainties; among the axes where they are known so.
struct PlannedAxis {
  Sigma direction_rad, position_m;
};

struct PlannedJoint {
  std::string name, channel;
  JointType type = JointType::kRevolute;
  JointLimits allowed;   ///< rad or m
  JointLimits recorded;  ///< in the run; not finite: not known
  JointLimits planned;   ///< what the plan goes through
  PlannedAxis before, after;
};

struct PlannedRivals {
  std::string believed, other;  ///< "eccentricity of q2"
  std::optional<double> sigmas_apart;
};

struct PlannedMarker {
  int id = 0;
  int frames = 0;  ///< of the plan, in which it is expected
};

struct PlanSummary {
  std::string version, command;
  std::vector<InputFile> inputs;
  std::string source, robot;
  std::string goal;      ///< "tip", "axes"
  double seconds = 0.0;  ///< 0: postures at rest
  double rate_hz = 0.0;  ///< of the frames; 0 likewise
  int postures = 0;      ///< that it stands in, or stops at
  int frames = 0;
  double noise_px = 0.0;
  double before_m = 0.0, after_m = 0.0;  ///< of a point of the goal, rms
  std::vector<PlannedJoint> joints;
  std::vector<PlannedRivals> rivals;
  std::vector<PlannedMarker> markers;
  double seen_share = 0.0;  ///< of postures within the ranges, those that show any marker
  std::vector<std::string> warnings;
};

/// One line: the recording, and what is known before and after it.
[[nodiscard]] std::string plan_verdict(const PlanSummary& plan);
/// Lines that follow: joints, rivals, what the promise rests on.
[[nodiscard]] std::vector<std::string> plan_findings(const PlanSummary& plan);
[[nodiscard]] nlohmann::json plan_json(const PlanSummary& plan);

}  // namespace kinescope
