// SPDX-License-Identifier: Apache-2.0
#include "app/io/yaml_value.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "app/io/nearest_name.h"
#include "kinematics/core/csv.h"
#include "kinematics/core/file.h"
#include "kinematics/core/text.h"

namespace kinescope {
namespace {

constexpr std::uintmax_t kLargestYamlBytes = 1U << 20U;

std::string line_of(const std::string& source, const YAML::Mark& mark) {
  return mark.is_null() ? source : fmt::format("{}:{}", source, mark.line + 1);
}

}  // namespace

YamlValue YamlValue::read(const std::filesystem::path& path) {
  const std::string source = path.string();
  YAML::Node root;
  try {
    root = YAML::Load(read_text_file(path, kLargestYamlBytes));
  } catch (const YAML::Exception& error) {
    throw bad_input(line_of(source, error.mark),
                    fmt::format("is not YAML ({})", clean_text(error.msg)),
                    "check indentation, colons and quotes in this line and the one above");
  }
  if (!root.IsDefined() || root.IsNull()) {
    throw bad_input(source, "is empty", "write it, or remove the file");
  }
  if (!root.IsMap()) {
    throw bad_input(source, "does not hold keys with values", "write lines such as key: value");
  }
  return {root, root.Mark(), source, ""};
}

std::string YamlValue::place() const { return line_of(source_, mark_); }

Error YamlValue::error(const std::string& what, const std::string& remedy) const {
  return bad_input(place(), key_.empty() ? what : fmt::format("{} {}", key_, what), remedy);
}

YamlValue YamlValue::below(const YAML::Node& node, const YAML::Mark& mark,
                           const std::string& key) const {
  return {node, mark, source_, key_.empty() ? key : fmt::format("{}.{}", key_, key)};
}

std::vector<std::pair<std::string, YamlValue>> YamlValue::entries() const {
  if (!node_.IsMap()) throw error("is no mapping", "write it as lines of key: value below it");
  std::vector<std::pair<std::string, YamlValue>> out;
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar()) throw error("has a key that is no word", "write key: value");
    const std::string name = entry.first.Scalar();
    // Of a value that is not there yaml-cpp says the next line; and a mapping begins below its key.
    YamlValue value = below(entry.second, entry.first.Mark(), name);
    if (std::ranges::find(out, name, &std::pair<std::string, YamlValue>::first) != out.end()) {
      throw value.error("stands there twice", "keep one of them");
    }
    out.emplace_back(name, std::move(value));
  }
  return out;
}

std::vector<YamlValue> YamlValue::items() const {
  if (!node_.IsSequence()) throw error("is no list", "write it as [a, b] or as lines of - a");
  std::vector<YamlValue> out;
  out.reserve(node_.size());
  for (std::size_t i = 0; i < node_.size(); ++i) {
    out.push_back(below(node_[i], node_[i].Mark(), fmt::format("{}", i)));
  }
  return out;
}

std::optional<YamlValue> YamlValue::find(const std::string& key) const {
  for (auto& [name, value] : entries()) {
    if (name == key) return value;
  }
  return std::nullopt;
}

YamlValue YamlValue::require(const std::string& key) const {
  if (auto value = find(key)) return *value;
  throw error(fmt::format("has no '{}'", key), fmt::format("add {}: ..", key));
}

void YamlValue::only_keys(const std::vector<std::string>& known) const {
  for (const auto& [name, value] : entries()) {
    if (std::ranges::find(known, name) != known.end()) continue;
    throw value.error("is a key nobody reads", did_you_mean(name, known));
  }
}

std::string YamlValue::text() const {
  if (!node_.IsScalar() || node_.Scalar().empty())
    throw error("is no word", "write one after the colon");
  return node_.Scalar();
}

double YamlValue::number() const {
  const std::string written = node_.IsScalar() ? node_.Scalar() : "";
  const std::optional<double> value = parse_number(written);
  if (!value || !std::isfinite(*value)) {
    throw error(fmt::format("is '{}', not a finite number", written),
                "write a number with a point");
  }
  return *value;
}

double YamlValue::positive(const std::string& remedy) const {
  const double value = number();
  if (value > 0.0) return value;
  throw error(fmt::format("is {}, not above zero", value), remedy);
}

int YamlValue::whole(int least) const {
  const double value = number();
  if (value != std::floor(value) || value < least || value > 1e9) {
    throw error(fmt::format("is {}, not a whole number from {} up", value, least), "correct it");
  }
  return static_cast<int>(value);
}

bool YamlValue::flag() const {
  const std::string word = text();
  if (word == "true") return true;
  if (word == "false") return false;
  throw error(fmt::format("is '{}'", word), "write true or false");
}

}  // namespace kinescope
