// SPDX-License-Identifier: Apache-2.0
#include "app/io/torque_effects_file.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/io/nearest_name.h"
#include "app/io/yaml_value.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

using nlohmann::json;

constexpr const char* kEffectsRemedy =
    "give a trace.json of kinescope dynamics, or a YAML list of effects";

void add_parameter(TorqueEffect& effect, const std::string& name, double value) {
  effect.parameters.push_back({name, ""});
  effect.values.conservativeResize(effect.values.size() + 1);
  effect.values[effect.values.size() - 1] = value;
}

class TraceReader {
 public:
  explicit TraceReader(const std::filesystem::path& path) : path_(path.string()) {}

  ListedEffects read(const json& document) {
    if (!document.is_object() || !document.contains("effects") || !document.contains("base")) {
      throw wrong("is no trace of torques");
    }
    ListedEffects out;
    out.traced = true;
    out.identified_masses = document.at("base").is_object() &&
                            document.at("base").value("masses", json()) == json("identified");
    if (!document.at("effects").is_array()) throw wrong("'effects' is no list");
    for (const json& entry : document.at("effects")) out.effects.push_back(effect(entry));
    if (document.contains("motion")) read_motion(document.at("motion"), out);
    return out;
  }

 private:
  [[nodiscard]] Error wrong(const std::string& what) const {
    return bad_input(path_, what, kEffectsRemedy);
  }
  [[nodiscard]] const json& member(const json& entry, const char* key) const {
    if (!entry.is_object() || !entry.contains(key)) {
      throw wrong(fmt::format("an entry without '{}'", key));
    }
    return entry.at(key);
  }
  [[nodiscard]] std::string word(const json& entry, const char* key) const {
    const json& value = member(entry, key);
    if (!value.is_string()) throw wrong(fmt::format("'{}' is no word", key));
    return value.get<std::string>();
  }
  [[nodiscard]] double number(const json& entry, const char* key) const {
    const json& value = member(entry, key);
    if (!value.is_number() || !std::isfinite(value.get<double>())) {
      throw wrong(fmt::format("'{}' is no number", key));
    }
    return value.get<double>();
  }
  [[nodiscard]] ListedEffect effect(const json& entry) const {
    ListedEffect out;
    out.effect.id = {word(entry, "effect"), word(entry, "place")};
    out.effect.scan = number(entry, "at");
    out.in_urdf = member(entry, "in_urdf") == json(true);
    out.place = path_;
    if (!member(entry, "parameters").is_array()) throw wrong("'parameters' is no list");
    for (const json& parameter : entry.at("parameters")) {
      add_parameter(out.effect, word(parameter, "name"), number(parameter, "value"));
    }
    return out;
  }
  void read_motion(const json& motion, ListedEffects& out) const {
    out.log = LogSpan{};
    out.log->begin_s = number(motion, "begin_s");
    out.log->duration_s = number(motion, "duration_s");
    const json& joints = member(motion, "joints");
    if (!joints.is_array()) throw wrong("'joints' is no list");
    for (const json& joint : joints) {
      out.high_speeds[word(joint, "name")] = number(joint, "high_speed");
    }
  }

  std::string path_;
};

ListedEffect yaml_effect(const YamlValue& entry) {
  entry.only_keys({"effect", "joint", "place", "at", "parameters"});
  ListedEffect out;
  const auto joint = entry.find("joint");
  const auto place = entry.find("place");
  if (joint.has_value() == place.has_value()) {
    throw entry.error("names not one place", "state joint (or place): the joint's name");
  }
  out.effect.id = {entry.require("effect").text(), (joint ? joint : place)->text()};
  if (const auto at = entry.find("at")) out.effect.scan = at->number();
  for (const auto& [name, value] : entry.require("parameters").entries()) {
    add_parameter(out.effect, name, value.number());
  }
  out.place = entry.place();
  return out;
}

ListedEffects read_yaml(const std::filesystem::path& path) {
  const YamlValue root = YamlValue::read(path);
  root.only_keys({"effects"});
  ListedEffects out;
  for (const YamlValue& entry : root.require("effects").items()) {
    out.effects.push_back(yaml_effect(entry));
  }
  return out;
}

const Candidate& candidate_named(const ListedEffect& listed, const std::vector<Candidate>& known) {
  std::set<std::string> names;
  std::set<std::string> places;
  for (const Candidate& candidate : known) {
    if (candidate.id == listed.effect.id) return candidate;
    names.insert(candidate.id.effect);
    if (candidate.id.effect == listed.effect.id.effect) places.insert(candidate.id.place);
  }
  const bool other_place = !places.empty();
  const std::vector<std::string> words(other_place ? places.begin() : names.begin(),
                                       other_place ? places.end() : names.end());
  throw bad_input(
      listed.place,
      other_place ? fmt::format("{} has no place '{}' on this robot", listed.effect.id.effect,
                                listed.effect.id.place)
                  : fmt::format("'{}' is no effect", listed.effect.id.effect),
      did_you_mean(other_place ? listed.effect.id.place : listed.effect.id.effect, words));
}

TorqueEffect in_order(const ListedEffect& listed, const Candidate& candidate) {
  TorqueEffect out = listed.effect;
  out.scan_name = candidate.scan_name;
  out.scan_unit = candidate.scan_unit;
  out.parameters = candidate.parameters;
  out.values = Eigen::VectorXd::Zero(std::ssize(candidate.parameters));
  for (std::size_t k = 0; k < listed.effect.parameters.size(); ++k) {
    const std::string& name = listed.effect.parameters[k].name;
    const auto own = std::ranges::find(candidate.parameters, name, &EffectParameter::name);
    if (own == candidate.parameters.end()) {
      std::vector<std::string> names;
      for (const EffectParameter& parameter : candidate.parameters) names.push_back(parameter.name);
      throw bad_input(listed.place,
                      fmt::format("{} has no parameter '{}'", listed.effect.id.effect, name),
                      did_you_mean(name, names));
    }
    out.values[own - candidate.parameters.begin()] =
        listed.effect.values[static_cast<Eigen::Index>(k)];
  }
  const bool needs_scan = !candidate.scan.empty() && listed.effect.id.effect != "gravity_direction";
  if (needs_scan && !(listed.effect.scan > 0.0)) {
    throw bad_input(listed.place,
                    fmt::format("{} at {} says no 'at' above 0", listed.effect.id.effect,
                                listed.effect.id.place),
                    fmt::format("add at: the {}{}{}", candidate.scan_name,
                                candidate.scan_unit.empty() ? "" : ", ", candidate.scan_unit));
  }
  return out;
}

}  // namespace

ListedEffects read_listed_effects(const std::filesystem::path& path) {
  if (path.extension() != ".json") return read_yaml(path);
  json document;
  try {
    document = json::parse(read_text_file(path));
  } catch (const json::exception&) {
    throw bad_input(path.string(), "is no JSON", kEffectsRemedy);
  }
  return TraceReader(path).read(document);
}

std::vector<TorqueEffect> resolved(const std::vector<ListedEffect>& effects,
                                   const std::vector<Candidate>& known) {
  std::vector<TorqueEffect> out;
  out.reserve(effects.size());
  for (const ListedEffect& listed : effects) {
    out.push_back(in_order(listed, candidate_named(listed, known)));
  }
  return out;
}

}  // namespace kinescope
