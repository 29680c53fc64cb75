// SPDX-License-Identifier: Apache-2.0
#include "app/io/trace_file.h"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

using nlohmann::json;

// Half of a 95 % interval over its standard deviation.
constexpr double kNormal95 = 1.959964;

EffectId effect_of(const json& entry) {
  return {entry.at("effect").get<std::string>(), entry.at("place").get<std::string>()};
}

void take_rivals(const json& document, StoredTrace& out) {
  for (const json& entry : document.value("ambiguous", json::array())) {
    std::vector<EffectId>& rivals = out.ambiguous.emplace_back();
    for (const json& effect : entry.at("effects")) rivals.push_back(effect_of(effect));
  }
  for (const json& entry : document.value("candidates", json::array()))
    if (entry.at("at").is_number()) out.scans[effect_of(entry)] = entry.at("at").get<double>();
}

StoredTrace stored_trace_of(const json& document) {
  StoredTrace out;
  out.stretches = document.value("stretches", 0);
  out.unexplained = document.at("verdict") == "unknown";
  take_rivals(document, out);
  for (const json& entry : document.at("accepted")) {
    const json& interval = entry.at("interval");
    if (!entry.at("size").is_number() || !interval.at(0).is_number() || !interval.at(1).is_number())
      continue;  // not known: not compared
    out.found.push_back(
        {entry.at("effect"), entry.at("place"), entry.at("unit"), entry.at("size"),
         (interval.at(1).get<double>() - interval.at(0).get<double>()) / (2.0 * kNormal95)});
  }
  for (const json& entry : document.at("not_found")) {
    StoredAbsence absence{entry.at("effect"), entry.at("place"), entry.at("unit"), {}};
    const json& size = entry.at("smallest_size");
    if (size.is_number()) absence.smallest_size = size.get<double>();
    out.absent.push_back(std::move(absence));
  }
  return out;
}

}  // namespace

std::optional<StoredTrace> read_trace(const std::filesystem::path& trace_json) {
  std::error_code error;
  if (!std::filesystem::exists(trace_json, error)) return std::nullopt;
  const json document = json::parse(read_text_file(trace_json), nullptr, false);
  try {
    if (!document.is_discarded()) return stored_trace_of(document);
  } catch (const json::exception&) {
    // below
  }
  throw bad_input(trace_json.string(), "it is no trace of a run, or ends early",
                  "run the recording again");
}

}  // namespace kinescope
