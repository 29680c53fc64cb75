// SPDX-License-Identifier: Apache-2.0
//
// What a plan says: words and plan.json.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/report/facts.h"
#include "app/report/numbers.h"
#include "app/report/plan_summary.h"
#include "app/report/result_values.h"

namespace kinescope {
namespace {

using nlohmann::json;
using report::number;
using report::Quantity;
using report::text;

// A robot larger than this is none: what is known to no better is not known.
constexpr double kUnknown_m = 0.5;

std::string expanded_length(double sigma_m) {
  if (!(sigma_m < kUnknown_m)) return "not determined";
  return report::text_with_unit(report::kCoverageFactor * sigma_m, Quantity::kLength);
}

std::string change(const Sigma& before, const Sigma& after, Quantity quantity) {
  const auto shown = [&](const Sigma& sigma) {
    return sigma ? report::text_with_unit(report::kCoverageFactor * *sigma, quantity)
                 : std::string("not determined");
  };
  return fmt::format("{} to {}", shown(before), shown(after));
}

Quantity value_quantity(const PlannedJoint& joint) {
  return joint.type == JointType::kPrismatic ? Quantity::kLength : Quantity::kAngle;
}

std::string way_words(const PlannedJoint& joint) {
  const Quantity quantity = value_quantity(joint);
  return fmt::format("{} to {}", report::value_text(joint.planned.lower, quantity),
                     report::text_with_unit(joint.planned.upper, quantity));
}

std::string axis_words(const PlannedJoint& joint) {
  std::string out =
      fmt::format("{}: direction {}", joint.name,
                  change(joint.before.direction_rad, joint.after.direction_rad, Quantity::kAngle));
  if (joint.after.position_m)
    out += fmt::format(", place {}",
                       change(joint.before.position_m, joint.after.position_m, Quantity::kLength));
  return out + fmt::format("; moves from {}", way_words(joint));
}

// How many times better the axis will be known; 0: nothing says.
double gain_of(const PlannedJoint& joint) {
  const auto ratio = [](const Sigma& before, const Sigma& after) {
    return before && after && *after > 0.0 ? *before / *after : 0.0;
  };
  return std::max(ratio(joint.before.direction_rad, joint.after.direction_rad),
                  ratio(joint.before.position_m, joint.after.position_m));
}

// Joints whose range the run used to less than half.
std::string lacking_words(const PlanSummary& plan) {
  std::vector<std::string> names;
  for (const PlannedJoint& joint : plan.joints) {
    const double recorded = joint.recorded.upper - joint.recorded.lower;
    const double planned = joint.planned.upper - joint.planned.lower;
    if (std::isfinite(recorded) && recorded < 0.5 * planned) names.push_back(joint.name);
  }
  if (names.empty()) return {};
  return fmt::format("The run used less than half of what the plan does of {}.",
                     fmt::join(names, ", "));
}

std::string rival_words(const PlannedRivals& pair) {
  if (!pair.sigmas_apart)
    return fmt::format("{} or {}: such a recording does not part the two.", pair.believed,
                       pair.other);
  return fmt::format("{} or {}: at least {:.1f} standard deviations apart by this recording alone.",
                     pair.believed, pair.other, *pair.sigmas_apart);
}

std::string unseen_words(const PlanSummary& plan) {
  std::vector<std::string> ids;
  for (const PlannedMarker& marker : plan.markers)
    if (marker.frames == 0) ids.push_back(fmt::format("tag_{}", marker.id));
  if (ids.empty()) return {};
  return fmt::format("Not seen in the plan: {}.", fmt::join(ids, ", "));
}

std::string promise_words(const PlanSummary& plan) {
  return fmt::format(
      "This holds for both recordings calibrated together (kinescope run FIRST NEW), with the "
      "camera about where it was, corners exact to {} as in the run{}, and nothing in the way.",
      report::text_with_unit(plan.noise_px, Quantity::kPixels),
      plan.rate_hz > 0.0 ? fmt::format(", {:.3g} frames/s", plan.rate_hz) : std::string());
}

json axis_json(const PlannedAxis& axis) {
  return {{"direction_sigma_rad", report::standard(axis.direction_rad)},
          {"position_sigma_m", report::standard(axis.position_m)}};
}

json limits_json(const JointLimits& limits) {
  return json::array({number(limits.lower), number(limits.upper)});
}

json planned_joint_json(const PlannedJoint& joint) {
  return {{"name", text(joint.name)},
          {"channel", text(joint.channel)},
          {"type", to_string(joint.type)},
          {"allowed", limits_json(joint.allowed)},
          {"recorded", limits_json(joint.recorded)},
          {"planned", limits_json(joint.planned)},
          {"before", axis_json(joint.before)},
          {"after", axis_json(joint.after)}};
}

}  // namespace

std::string plan_verdict(const PlanSummary& plan) {
  const std::string what =
      plan.seconds > 0.0
          ? fmt::format("A motion of {:.1f} s through {} postures", plan.seconds, plan.postures)
          : fmt::format("{} postures at rest", plan.postures);
  const std::string point = plan.goal == "tip" ? "the tip is" : "points on the axes are";
  return fmt::format(
      "{}: {} known to {} after it, {} now (rms over the joints' ranges, among the robot's parts; "
      "expanded uncertainty, k = 2).",
      what, point, expanded_length(plan.after_m), expanded_length(plan.before_m));
}

std::vector<std::string> plan_findings(const PlanSummary& plan) {
  std::vector<std::string> out;
  std::vector<const PlannedJoint*> joints;
  for (const PlannedJoint& joint : plan.joints) joints.push_back(&joint);
  std::ranges::stable_sort(joints, [](const PlannedJoint* a, const PlannedJoint* b) {
    return gain_of(*a) > gain_of(*b);
  });
  out.emplace_back("Axes among one another, before and after, k = 2; those first that gain most:");
  for (const PlannedJoint* joint : joints) out.push_back("  " + axis_words(*joint));
  for (const PlannedRivals& pair : plan.rivals) out.push_back(rival_words(pair));
  for (const std::string& words : {lacking_words(plan), unseen_words(plan), promise_words(plan)})
    if (!words.empty()) out.push_back(words);
  return out;
}

json plan_json(const PlanSummary& plan) {
  json joints = json::array(), rivals = json::array(), markers = json::array();
  for (const PlannedJoint& joint : plan.joints) joints.push_back(planned_joint_json(joint));
  for (const PlannedRivals& pair : plan.rivals)
    rivals.push_back({{"believed", text(pair.believed)},
                      {"other", text(pair.other)},
                      {"sigmas_apart", report::standard(pair.sigmas_apart)}});
  for (const PlannedMarker& marker : plan.markers)
    markers.push_back({{"id", marker.id}, {"frames", marker.frames}});
  return {{"schema", "kinescope.plan"},
          {"schema_version", 1},
          {"version", text(plan.version)},
          {"command", text(plan.command)},
          {"inputs", report::inputs_json(plan.inputs)},
          {"source", text(plan.source)},
          {"robot", text(plan.robot)},
          {"goal", text(plan.goal)},
          {"seconds", plan.seconds > 0.0 ? number(plan.seconds) : json()},
          {"rate_hz", plan.rate_hz > 0.0 ? number(plan.rate_hz) : json()},
          {"postures", plan.postures},
          {"frames", plan.frames},
          {"noise_px", number(plan.noise_px)},
          {"before_sigma_m", plan.before_m < kUnknown_m ? number(plan.before_m) : json()},
          {"after_sigma_m", plan.after_m < kUnknown_m ? number(plan.after_m) : json()},
          {"joints", std::move(joints)},
          {"rivals", std::move(rivals)},
          {"markers", std::move(markers)},
          {"seen_share", number(plan.seen_share)},
          {"verdict", text(plan_verdict(plan))},
          {"findings", report::texts(plan_findings(plan))},
          {"warnings", report::texts(plan.warnings)}};
}

}  // namespace kinescope
