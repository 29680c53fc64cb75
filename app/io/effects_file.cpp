// SPDX-License-Identifier: Apache-2.0
#include "app/io/effects_file.h"

#include <cmath>

#include <fmt/format.h>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

using nlohmann::json;

constexpr const char* kCalibrationRemedy = "give the calibration.json of a finished run";

constexpr double kLargest = 1e6;  // rad, m, s or of a ratio

Error wrong(const std::filesystem::path& path, const std::string& what) {
  return bad_input(path.string(), what, kCalibrationRemedy);
}

double finite(const json& value, const std::filesystem::path& path, const std::string& key) {
  if (!value.is_number() || !std::isfinite(value.get<double>())) {
    throw wrong(path, fmt::format("{} is no number", key));
  }
  return value.get<double>();
}

std::string word(const json& entry, const char* key, const std::filesystem::path& path) {
  if (!entry.is_object() || !entry.contains(key) || !entry.at(key).is_string()) {
    throw wrong(path, fmt::format("an entry without '{}'", key));
  }
  return entry.at(key).get<std::string>();
}

std::vector<double> numbers_of(const Eigen::VectorXd& values) {
  return {values.begin(), values.end()};
}

Eigen::VectorXd column_of(const json& table, const char* key, const std::string& name,
                          const std::filesystem::path& path) {
  if (!table.is_object() || !table.contains(key) || !table.at(key).is_array()) {
    throw wrong(path, fmt::format("{}: a table without '{}'", name, key));
  }
  Eigen::VectorXd out(std::ssize(table.at(key)));
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    out[i] = finite(table.at(key)[static_cast<std::size_t>(i)], path,
                    fmt::format("{}: {} {}", name, key, i + 1));
  }
  return out;
}

ErrorTable table_of(const json& table, const std::string& name, const std::filesystem::path& path) {
  ErrorTable out{column_of(table, "value", name, path), column_of(table, "error", name, path),
                 column_of(table, "sigma", name, path)};
  const bool alike = out.value.size() == out.error.size() && out.value.size() == out.sigma.size();
  if (!alike || out.value.size() < 2) {
    throw wrong(path, fmt::format("{}: columns of {}, {} and {} numbers", name, out.value.size(),
                                  out.error.size(), out.sigma.size()));
  }
  for (Eigen::Index i = 1; i < out.value.size(); ++i) {
    if (!(out.value[i] > out.value[i - 1])) {
      throw wrong(path, fmt::format("{}: value {} is not above the one before", name, i + 1));
    }
  }
  return out;
}

// Of a joint or an effect; none where it is absent or not known.
std::optional<JointLimits> range_of(const json& entry, const std::filesystem::path& path) {
  const auto range = entry.find("range");
  if (range == entry.end()) return std::nullopt;
  if (!range->is_array() || range->size() != 2) throw wrong(path, "'range' is no pair of numbers");
  if ((*range)[0].is_null() || (*range)[1].is_null()) return std::nullopt;
  const JointLimits out{finite((*range)[0], path, "range"), finite((*range)[1], path, "range")};
  if (!(out.lower <= out.upper)) throw wrong(path, "'range' ends below where it begins");
  return out;
}

FittedEffect effect_of(const json& entry, const std::filesystem::path& path) {
  FittedEffect out;
  out.id = {word(entry, "effect", path), word(entry, "place", path)};
  const std::string name = fmt::format("{} at {}", out.id.effect, out.id.place);
  out.range = range_of(entry, path);
  if (const auto table = entry.find("table"); table != entry.end()) {
    out.scan = finite(entry.value("at", json()), path, name + ": at");
    out.table = table_of(*table, name, path);
    return out;
  }
  if (!entry.contains("at") || !entry.contains("parameters") ||
      !entry.at("parameters").is_array() || entry.at("parameters").empty()) {
    throw wrong(path, fmt::format("{} has no parameters", name));
  }
  out.scan = finite(entry.at("at"), path, name + ": at");
  const json& parameters = entry.at("parameters");
  const auto count = static_cast<Eigen::Index>(parameters.size());
  out.values.resize(count);
  out.references.resize(count);
  Eigen::Index next = 0;
  for (const json& parameter : parameters) {
    out.parameters.push_back({word(parameter, "name", path), word(parameter, "unit", path)});
    out.values[next] = finite(parameter.value("value", json()), path, name + ": value");
    if (std::abs(out.values[next]) > kLargest)
      throw wrong(path, fmt::format("{}: no effect has a size of {:.3g}", name, out.values[next]));
    out.references[next] = finite(parameter.value("reference", json()), path, name + ": reference");
    if (out.references[next] == 0.0) throw wrong(path, name + ": reference is 0");
    ++next;
  }
  return out;
}

std::vector<ChannelShare> couplings_of(const json& joint, const std::filesystem::path& path) {
  std::vector<ChannelShare> out;
  const auto list = joint.find("couplings");
  if (list == joint.end()) return out;
  if (!list->is_array()) throw wrong(path, "'couplings' is no list");
  for (const json& share : *list) {
    if (!share.is_object()) throw wrong(path, "a coupling is no object");
    out.push_back(
        {word(share, "channel", path), finite(share.value("ratio", json()), path, "ratio")});
  }
  return out;
}

std::vector<std::string> copies_of(const json& joint, const std::filesystem::path& path) {
  std::vector<std::string> out;
  const auto list = joint.find("copies");
  if (list == joint.end()) return out;
  if (!list->is_array()) throw wrong(path, "'copies' is no list");
  for (const json& column : *list) {
    if (!column.is_string()) throw wrong(path, "a copy is no name of a channel");
    out.push_back(column.get<std::string>());
  }
  return out;
}

std::map<std::string, double> unit_factors(const json& document,
                                           const std::filesystem::path& path) {
  std::map<std::string, double> out;
  const auto factors = document.find("unit_factors");
  if (factors == document.end()) return out;
  if (!factors->is_object()) throw wrong(path, "unit_factors is no list of channels");
  for (const auto& [channel, factor] : factors->items()) {
    out[channel] = finite(factor, path, "unit_factors: " + channel);
    if (out[channel] <= 0.0) throw wrong(path, "unit_factors: " + channel + " is not above 0");
  }
  return out;
}

}  // namespace

json effects_json(const std::vector<FittedEffect>& effects) {
  json list = json::array();
  for (const FittedEffect& effect : effects) {
    json parameters = json::array();
    // None of a table.
    for (std::size_t k = 0; k < effect.parameters.size(); ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      parameters.push_back({{"name", effect.parameters[k].name},
                            {"unit", effect.parameters[k].unit},
                            {"value", effect.values[at]},
                            {"reference", effect.references[at]}});
    }
    json entry{{"effect", effect.id.effect},
               {"place", effect.id.place},
               {"at", effect.scan},
               {"parameters", std::move(parameters)}};
    if (!effect.table.empty()) {
      entry["table"] = {{"value", numbers_of(effect.table.value)},
                        {"error", numbers_of(effect.table.error)},
                        {"sigma", numbers_of(effect.table.sigma)}};
    }
    if (effect.range) entry["range"] = {effect.range->lower, effect.range->upper};
    list.push_back(std::move(entry));
  }
  return list;
}

CalibratedEffects read_effects(const std::filesystem::path& calibration_json) {
  const json document = json::parse(read_text_file(calibration_json), nullptr, false);
  if (!document.is_object() || document.value("schema", json()) != "kinescope.calibration") {
    throw wrong(calibration_json, "this is no calibration");
  }
  const json version = document.value("schema_version", json());
  if (version != 1) {
    throw wrong(calibration_json,
                fmt::format("this program reads version 1 of calibrations, not {}",
                            version.is_null() ? "none" : version.dump()));
  }
  CalibratedEffects out;
  out.unit_factors = unit_factors(document, calibration_json);
  if (const auto gravity = document.find("gravity_base"); gravity != document.end()) {
    if (!gravity->is_array() || gravity->size() != 3) {
      throw wrong(calibration_json, "gravity_base is no vector");
    }
    out.gravity_base = Eigen::Vector3d(finite((*gravity)[0], calibration_json, "gravity_base"),
                                       finite((*gravity)[1], calibration_json, "gravity_base"),
                                       finite((*gravity)[2], calibration_json, "gravity_base"));
  }
  if (!document.contains("robot") || !document.at("robot").is_object() ||
      !document.at("robot").contains("joints") || !document.at("robot").at("joints").is_array()) {
    throw wrong(calibration_json, "no robot with joints");
  }
  for (const json& joint : document.at("robot").at("joints")) {
    out.channels.push_back({word(joint, "name", calibration_json),
                            word(joint, "channel", calibration_json),
                            finite(joint.value("scale", json()), calibration_json, "scale"),
                            finite(joint.value("offset", json()), calibration_json, "offset"),
                            couplings_of(joint, calibration_json),
                            copies_of(joint, calibration_json), range_of(joint, calibration_json)});
  }
  const auto effects = document.find("effects");
  if (effects == document.end()) return out;
  if (!effects->is_array()) throw wrong(calibration_json, "'effects' is no list");
  for (const json& entry : *effects) out.effects.push_back(effect_of(entry, calibration_json));
  return out;
}

}  // namespace kinescope
