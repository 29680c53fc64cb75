// SPDX-License-Identifier: Apache-2.0
#include "app/report/trace_json.h"

#include "app/report/result_values.h"

namespace kinescope {
namespace {

using nlohmann::json;
using report::number;
using report::text;

constexpr int kTraceSchema = 1;

json interval_json(const Interval& interval) {
  return json::array({number(interval.low), number(interval.high)});
}

json error_json(const HeldOutError& error) {
  return {{"value", number(error.value)},
          {"interval", interval_json(error.interval)},
          {"unit", text(error.unit)}};
}

json curve_json(const Eigen::VectorXd& values) {
  json list = json::array();
  for (const double value : values) list.push_back(number(value));
  return list;
}

json effect_json(const TracedEffect& effect) {
  json values = json::array();
  for (const EffectValue& value : effect.values) {
    values.push_back({{"name", text(value.parameter.name)},
                      {"unit", text(value.parameter.unit)},
                      {"value", number(value.value)},
                      {"sigma", number(value.sigma)}});
  }
  json out = {{"effect", text(effect.id.effect)},
              {"place", text(effect.id.place)},
              {"words", text(effect.words)},
              {"check", text(effect.check)},
              {"size", number(effect.size)},
              {"unit", text(effect.unit)},
              {"interval", interval_json(effect.interval)},
              {"explained", number(effect.explained)},
              {"p_value", number(effect.p_value)},
              {"parameters", values},
              {"held_out_before", error_json(effect.held_out_before)},
              {"held_out_after", error_json(effect.held_out_after)}};
  if (!effect.scan_name.empty()) {
    out["at"] = {{"name", text(effect.scan_name)},
                 {"value", number(effect.scan)},
                 {"unit", text(effect.scan_unit)},
                 {"words", text(effect.scan_words)}};
    out["at"]["as_likely"] = json::array();
    for (const ScanAlternative& other : effect.as_likely) {
      out["at"]["as_likely"].push_back({{"value", number(other.scan)},
                                        {"words", text(other.words)},
                                        {"interval", interval_json(other.size)}});
    }
  }
  if (effect.is_curve()) {
    out["curve"] = {{"at", curve_json(effect.picture.at)},
                    {"mean", curve_json(effect.picture.effect)},
                    {"sigma", curve_json(effect.picture.sigma)}};
  }
  return out;
}

json ambiguity_json(const Ambiguity& ambiguity) {
  json effects = json::array();
  for (const EffectId& id : ambiguity.effects) {
    effects.push_back({{"effect", text(id.effect)}, {"place", text(id.place)}});
  }
  return {{"effects", effects}, {"record", text(ambiguity.record)}};
}

json field_json(const FieldMap& field) {
  const auto vectors = [](const Eigen::MatrixX2d& rows) {
    json out = json::array();
    for (const auto& row : rows.rowwise()) out.push_back({number(row.x()), number(row.y())});
    return out;
  };
  return {{"at", vectors(field.at)},
          {"mean", vectors(field.mean)},
          {"sigma", vectors(field.sigma)},
          {"spacing", number(field.spacing)}};
}

json rest_json(const Rest& rest) {
  json out = {{"place", text(rest.place)},
              {"unit", text(rest.unit)},
              {"depends_on", text(rest.covariate)},
              {"depends_on_unit", text(rest.covariate_unit)},
              {"p_value", number(rest.p_value)},
              {"explained", number(rest.explained)},
              {"at", curve_json(rest.at)},
              {"mean", curve_json(rest.mean)},
              {"sigma", curve_json(rest.sigma)},
              {"held_out_before", error_json(rest.held_out_before)},
              {"held_out_after", error_json(rest.held_out_after)}};
  if (rest.is_field()) out["field"] = field_json(rest.field);
  return out;
}

json candidate_json(const TestedCandidate& tested) {
  json out = {{"round", tested.round},
              {"effect", text(tested.id.effect)},
              {"place", text(tested.id.place)},
              {"state", to_string(tested.state)},
              {"statistic", number(tested.statistic)},
              {"parameters", tested.parameters},
              {"freedom", number(tested.freedom)},
              {"p_value", number(tested.p_value)},
              {"at", number(tested.scan)},
              {"size", number(tested.size)},
              {"unit", text(tested.unit)},
              {"moves", number(tested.moves)}};
  if (tested.held_out) out["held_out"] = number(*tested.held_out);
  return out;
}

json not_found_json(const NotFoundEffect& missing) {
  json out = {{"effect", text(missing.id.effect)},
              {"place", text(missing.id.place)},
              {"unit", text(missing.unit)},
              {"hidden", missing.hidden},
              {"smallest_size", missing.hidden ? json(nullptr) : number(missing.smallest_size)}};
  if (!missing.record.empty()) out["record"] = text(missing.record);
  return out;
}

json left_over_json(const LeftOver& left) {
  json out = {{"place", text(left.place)}, {"times", number(left.times)}, {"lasts", left.lasts}};
  if (!left.covariate.empty()) {
    out["depends_on"] = text(left.covariate);
    out["explained"] = number(left.explained);
  }
  return out;
}

template <typename Item, typename Function>
json list_of(const std::vector<Item>& items, Function to_json_item) {
  json list = json::array();
  for (const Item& item : items) list.push_back(to_json_item(item));
  return list;
}

}  // namespace

json trace_json(const Trace& trace) {
  return {{"schema", kTraceSchema},
          {"verdict", to_string(trace.verdict)},
          {"reason", text(trace.reason)},
          {"false_alarm_rate", number(trace.false_alarm_rate)},
          {"stretches", trace.stretches},
          {"noise", number(trace.noise)},
          {"over_neighbours", number(trace.over_neighbours)},
          {"left_over", list_of(trace.left_over, left_over_json)},
          {"held_out_before", error_json(trace.held_out_before)},
          {"held_out_after", error_json(trace.held_out_after)},
          {"accepted", list_of(trace.accepted, effect_json)},
          {"ambiguous", list_of(trace.ambiguities, ambiguity_json)},
          {"unexplained", list_of(trace.rest, rest_json)},
          {"not_found", list_of(trace.not_found, not_found_json)},
          {"candidates", list_of(trace.candidates, candidate_json)},
          {"steps", list_of(trace.steps, [](const TraceStep& step) {
             return json{{"round", step.round},
                         {"words", text(step.words)},
                         {"rms", number(step.rms)},
                         {"held_out", error_json(step.held_out)}};
           })}};
}

}  // namespace kinescope
