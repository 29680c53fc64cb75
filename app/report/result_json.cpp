// SPDX-License-Identifier: Apache-2.0
//
// The result document; its keys are described in report.h.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "app/report/answer.h"
#include "app/report/facts.h"
#include "app/report/recordings_json.h"
#include "app/report/result_values.h"
#include "app/report/trace_json.h"

namespace kinescope::report {
namespace {

using nlohmann::json;

json statistics_json(const ErrorStatistics& s) {
  if (s.count == 0) return {{"count", 0}};
  return {{"count", s.count},
          {"rms", number(s.rms)},
          {"median", number(s.median)},
          {"p95", number(s.p95)},
          {"max", number(s.max)}};
}

json error_row(const ErrorRow& row) {
  return {{"name", text(row.name)},
          {"before_px", statistics_json(row.before_px)},
          {"training_px", statistics_json(row.training_px)},
          {"held_out_px", statistics_json(row.held_out_px)},
          {"before_m", statistics_json(row.before_m)},
          {"training_m", statistics_json(row.training_m)},
          {"held_out_m", statistics_json(row.held_out_m)},
          {"before_rad", statistics_json(row.before_rad)},
          {"training_rad", statistics_json(row.training_rad)},
          {"held_out_rad", statistics_json(row.held_out_rad)}};
}

json errors_json(const ErrorSummary& errors) {
  json document = {
      {"all", error_row(errors.all)}, {"links", json::array()}, {"markers", json::array()}};
  for (const ErrorRow& row : errors.links) document["links"].push_back(error_row(row));
  for (const ErrorRow& row : errors.markers) document["markers"].push_back(error_row(row));
  return document;
}

std::string joint_of_channel(const RunSummary& run, const std::string& channel) {
  for (const Joint& joint : run.calibration.tree.joints) {
    if (joint.channel == channel && !channel.empty()) return joint.name;
  }
  return "";
}

// Samples of the log while frames were taken.
std::pair<Eigen::Index, Eigen::Index> filmed_samples(const RunSummary& run) {
  const std::vector<double>& frames = run.calibration.times_s;
  if (frames.empty()) return {0, 0};
  const std::vector<double>& log = run.log.times_s;
  const double offset = run.calibration.time_offset_s;
  return {std::ranges::lower_bound(log, frames.front() + offset) - log.begin(),
          std::ranges::upper_bound(log, frames.back() + offset) - log.begin()};
}

json channels_json(const RunSummary& run) {
  json list = json::array();
  const auto [first, last] = filmed_samples(run);
  for (std::size_t c = 0; c < run.log.channels.size(); ++c) {
    const auto column = static_cast<Eigen::Index>(c);
    const bool filled = column < run.log.values.cols() && run.log.values.rows() > 0;
    const bool filmed = filled && first < last;
    const auto while_filmed = run.log.values.col(column).segment(first, filmed ? last - first : 0);
    const bool idle =
        run.structure && std::ranges::count(run.structure->idle_channels, static_cast<int>(c)) > 0;
    list.push_back({{"name", text(run.log.channels[c])},
                    {"samples", run.log.size()},
                    {"min", filled ? number(run.log.values.col(column).minCoeff()) : json(nullptr)},
                    {"max", filled ? number(run.log.values.col(column).maxCoeff()) : json(nullptr)},
                    {"filmed_min", filmed ? number(while_filmed.minCoeff()) : json(nullptr)},
                    {"filmed_max", filmed ? number(while_filmed.maxCoeff()) : json(nullptr)},
                    {"joint", text(joint_of_channel(run, run.log.channels[c]))},
                    {"idle", idle}});
  }
  return list;
}

json markers_seen_json(const RunSummary& run) {
  json list = json::array();
  for (const MarkerSummary& marker : run.markers) {
    const double share =
        run.frames > 0 ? static_cast<double>(marker.frames_seen) / run.frames : 0.0;
    list.push_back({{"id", marker.id.value},
                    {"link", text(marker_link(run.calibration.tree, marker.id))},
                    {"size_m", number(marker.size_m)},
                    {"frames_seen", marker.frames_seen},
                    {"share_seen", number(share)},
                    {"median_edge_px", number(marker.median_edge_px)},
                    {"median_sigma_px", number(marker.median_sigma_px)}});
  }
  return list;
}

json second_columns_json(const RunSummary& run) {
  json out = json::array();
  for (const SecondColumn& second : run.second_columns) {
    json effects = json::array();
    for (const TracedEffect& effect : second.trace.accepted) {
      effects.push_back({{"effect", text(effect.id.effect)},
                         {"place", text(effect.id.place)},
                         {"size", number(effect.size)},
                         {"interval", {number(effect.interval.low), number(effect.interval.high)}},
                         {"unit", text(effect.unit)}});
    }
    out.push_back({{"column", text(second.column)},
                   {"of", text(second.channel)},
                   {"joint", text(second.joint)},
                   {"unit", text(second.unit)},
                   {"offset", number(second.offset)},
                   {"rms", number(second.before)},
                   {"rms_left", number(second.after)},
                   {"effects", std::move(effects)},
                   {"words", text(words_of(second))}});
  }
  return out;
}

json data_json(const RunSummary& run, const Analysis& analysis) {
  json rejected = json::array();
  for (const auto& [reason, count] : run.rejected) {
    rejected.push_back({{"reason", text(reason)}, {"count", count}});
  }
  const bool corners = run.calibration.kind == MeasurementKind::kCorners;
  return {{"frames", run.frames},
          {"duration_s", number(run.duration_s)},
          {"independent_frames", analysis.independent_frames},
          {"image_coverage", corners ? number(analysis.image_coverage) : json(nullptr)},
          {"camera_declared", run.camera_declared},
          {"markers", markers_seen_json(run)},
          {"rejected", rejected},
          {"channels", channels_json(run)},
          {"second_columns", second_columns_json(run)},
          {"warnings", texts(run.warnings)}};
}

json channel_term(const RunSummary& run, const ChannelTerm& term) {
  const auto index = static_cast<std::size_t>(term.channel);
  const bool known = term.channel >= 0 && index < run.log.channels.size();
  return {{"channel", known ? text(run.log.channels[index]) : json(nullptr)},
          {"scale", number(term.scale)},
          {"scale_sigma", number(term.scale_sigma)}};
}

json structure_joint(const RunSummary& run, const StructureJoint& joint) {
  json couplings = json::array();
  for (const ChannelTerm& term : joint.couplings) couplings.push_back(channel_term(run, term));
  return {{"type", kinescope::to_string(joint.type)},
          {"parent", text(structure_link_name(run, joint.parent_link))},
          {"child", text(structure_link_name(run, joint.child_link))},
          {"driven_by", joint.channel ? channel_term(run, *joint.channel) : json(nullptr)},
          {"couplings", couplings},
          {"offset", number(joint.offset)},
          {"travel", number(joint.travel)},
          {"rotation_rms_rad", number(joint.rotation_rms_rad)},
          {"translation_rms_m", number(joint.translation_rms_m)},
          {"unexplained", number(joint.unexplained)},
          {"unexplained_across", number(joint.unexplained_across)},
          {"log_odds", number(joint.log_odds)},
          {"runner_up", text(joint.runner_up)}};
}

json structure_json(const RunSummary& run) {
  if (!run.structure) return nullptr;
  const Structure& structure = *run.structure;
  json joints = json::array(), links = json::array(), doubts = json::array();
  json free_markers = json::array(), idle = json::array();
  for (const StructureJoint& joint : structure.joints)
    joints.push_back(structure_joint(run, joint));
  for (std::size_t k = 0; k < structure.links.size(); ++k) {
    json ids = json::array();
    for (const TagId id : structure.links[k].markers) ids.push_back(id.value);
    links.push_back(
        {{"name", text(structure_link_name(run, static_cast<int>(k)))}, {"markers", ids}});
  }
  for (const StructureDoubt& doubt : structure.doubts) {
    doubts.push_back({{"what", text(doubt.what)},
                      {"remedy", text(doubt.remedy)},
                      {"names", texts(doubt.names)}});
  }
  for (const TagId id : structure.free_markers) free_markers.push_back(id.value);
  for (const int channel : structure.idle_channels) {
    const auto index = static_cast<std::size_t>(channel);
    if (channel >= 0 && index < run.log.channels.size()) {
      idle.push_back(text(run.log.channels[index]));
    }
  }
  json copied = json::array();
  for (const ChannelCopy& copy : structure.copied_channels) {
    copied.push_back(
        {{"channel", text(run.log.channels.at(static_cast<std::size_t>(copy.channel)))},
         {"of", text(run.log.channels.at(static_cast<std::size_t>(copy.of)))}});
  }
  return {{"status", status_words(structure.status)},
          {"probability", number(structure.probability)},
          {"runner_up", text(structure.runner_up)},
          {"runner_up_log_odds", number(structure.runner_up_log_odds)},
          {"joints", joints},
          {"links", links},
          {"free_markers", free_markers},
          {"idle_channels", idle},
          {"copied_channels", copied},
          {"doubts", doubts}};
}

json residuals_json(const Analysis& analysis, MeasurementKind kind) {
  json dependence = json::array();
  const std::string_view residual_unit = kind == MeasurementKind::kCorners ? "px" : "m";
  for (const Dependence& one : analysis.dependence) {
    dependence.push_back({{"on", text(one.on)},
                          {"share", number(one.explained)},
                          {"half_range", number(one.half_range)},
                          {"half_range_unit", one.time ? residual_unit : "of the joint"},
                          {"frames", one.frames}});
  }
  return {{"unit", residual_unit},
          {"components", analysis.components.size()},
          {"component_rms", number(analysis.component_rms)},
          {"outside_two_sigma", number(analysis.outside_two_sigma)},
          {"dependence", dependence}};
}

json run_json(const RunSummary& run) {
  json options = json::array(), times = json::array();
  double total = 0.0;
  for (const auto& [name, value] : run.options) {
    options.push_back({{"name", text(name)}, {"value", text(value)}});
  }
  for (const StageTime& time : run.times) {
    times.push_back({{"stage", text(time.stage)}, {"seconds", number(time.seconds)}});
    total += time.seconds;
  }
  return {{"robot", text(run.robot)},
          {"recording", text(run.recording)},
          {"entry", text(run.entry)},
          {"kind", to_string(run.calibration.kind)},
          {"version", text(run.version)},
          {"command", text(run.command)},
          {"inputs", inputs_json(run.inputs)},
          {"options", options},
          {"times", times},
          {"total_s", number(total)}};
}

json error_json(const TypicalError& error) {
  return {{"px", number(error.px)}, {"m", number(error.m)}, {"rad", number(error.rad)}};
}

json tip_json(const RunSummary& run, const std::optional<TipUncertainty>& tip) {
  if (!tip) return nullptr;
  const auto& links = run.calibration.tree.links;
  return {{"marker", tip->marker.value},
          {"link", text(links[tip->link.index()].name)},
          {"joints", tip->joints},
          {"translation_expanded_m", expanded(tip->in_base.translation_m)},
          {"rotation_expanded_rad", expanded(tip->in_base.rotation_rad)},
          {"worst_translation_expanded_m", expanded(tip->worst_m)},
          {"among_translation_expanded_m",
           tip->among ? expanded(tip->among->translation_m) : json(nullptr)},
          {"among_rotation_expanded_rad",
           tip->among ? expanded(tip->among->rotation_rad) : json(nullptr)}};
}

json nominal_faults_json(const RunSummary& run) {
  json list = json::array();
  for (const NominalFault& fault : run.nominal_faults) {
    const auto& joints = run.calibration.tree.joints;
    const auto name = [&](int joint) { return text(joints[static_cast<std::size_t>(joint)].name); };
    list.push_back(
        {{"joint", name(fault.joint)},
         {"axis", fault.axis ? vector3(*fault.axis) : json(nullptr)},
         {"exchanged_with", fault.exchanged_with ? name(*fault.exchanged_with) : json(nullptr)},
         {"unit", fault.unit ? number(*fault.unit) : json(nullptr)},
         {"zero_rad", fault.zero ? number(*fault.zero) : json(nullptr)},
         {"marker", fault.marker.value},
         {"typical_error_with_it", error_json(fault.before)},
         {"typical_error_without", error_json(fault.after)}});
  }
  return list;
}

json nominal_levels_json(const RunSummary& run) {
  json list = json::array();
  for (const FreedomLevel& level : run.levels) {
    const ErrorRow& all = level.errors;
    list.push_back({{"words", words_of(level)},
                    {"effects", level.effects},
                    {"status", to_string(level.status)},
                    {"held_out_px", statistics_json(all.held_out_px)},
                    {"held_out_m", statistics_json(all.held_out_m)},
                    {"held_out_rad", statistics_json(all.held_out_rad)},
                    {"log_odds", number(level.log_odds)},
                    {"exported", level.exported}});
  }
  return list;
}

}  // namespace

json make_result(const RunSummary& run, const Analysis& analysis, const Verdict& verdict) {
  const Answer answer = judge(run);
  json out{{"schema", "kinescope.result"},
           {"schema_version", 1},
           {"coverage_factor", kCoverageFactor},
           {"run", run_json(run)},
           {"verdict",
            {{"answer", answer.given},
             {"no_answer", answer.given ? json(nullptr) : json(text(answer.what))},
             {"found", text(verdict.found)},
             {"accurate", text(verdict.accurate)},
             {"limits", text(verdict.limits)},
             {"next", text(verdict.next)}}},
           {"data", data_json(run, analysis)},
           {"structure", structure_json(run)},
           {"nominal_faults", nominal_faults_json(run)},
           {"nominal_levels", nominal_levels_json(run)},
           {"calibration", calibration_json(run)},
           {"tip", tip_json(run, analysis.tip)},
           {"errors", errors_json(run.errors)},
           {"trace", run.trace ? trace_json(*run.trace) : json(nullptr)},
           {"residuals", residuals_json(analysis, run.calibration.kind)},
           {"observability", observability_json(run.calibration)}};
  if (!run.recordings.empty()) out["recordings"] = recordings_json(run);
  return out;
}

}  // namespace kinescope::report

namespace kinescope {

nlohmann::json result_json(const RunSummary& run) {
  nlohmann::json result = report::gather_facts(run).result;
  // What differs from one run to the next on the same input stands in run.json.
  for (const char* key : {"command", "times", "total_s"}) result["run"].erase(key);
  return result;
}

}  // namespace kinescope
