// SPDX-License-Identifier: Apache-2.0
//
// YAML that knows where it stands: every complaint names file, line and key. Private to app/io.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "kinematics/core/error.h"

namespace kinescope {

class YamlValue {
 public:
  /// The file's mapping. Throws bad_input: missing, over 1 MB, a syntax error (with its line),
  /// empty, no mapping.
  [[nodiscard]] static YamlValue read(const std::filesystem::path& path);

  /// "file:line".
  [[nodiscard]] std::string place() const;
  /// The path of keys that leads here: "sizes.12".
  [[nodiscard]] const std::string& key() const { return key_; }

  /// The entries of a mapping in the file's order; no key twice.
  [[nodiscard]] std::vector<std::pair<std::string, YamlValue>> entries() const;
  [[nodiscard]] std::vector<YamlValue> items() const;
  [[nodiscard]] bool is_list() const { return node_.IsSequence(); }
  [[nodiscard]] bool is_mapping() const { return node_.IsMap(); }
  /// The value of a key, where it is there.
  [[nodiscard]] std::optional<YamlValue> find(const std::string& key) const;
  /// The value of a key that must be there.
  [[nodiscard]] YamlValue require(const std::string& key) const;
  /// Throws bad_input that proposes the nearest key for one that is not in the list.
  void only_keys(const std::vector<std::string>& known) const;

  [[nodiscard]] std::string text() const;
  [[nodiscard]] double number() const;  ///< finite
  [[nodiscard]] double positive(const std::string& remedy) const;
  [[nodiscard]] int whole(int least) const;
  [[nodiscard]] bool flag() const;

  /// bad_input at this place: "file:line: key <what> (remedy)".
  [[nodiscard]] Error error(const std::string& what, const std::string& remedy) const;

 private:
  YamlValue(const YAML::Node& node, YAML::Mark mark, std::string source, std::string key)
      : node_(node), mark_(mark), source_(std::move(source)), key_(std::move(key)) {}
  [[nodiscard]] YamlValue below(const YAML::Node& node, const YAML::Mark& mark,
                                const std::string& key) const;

  YAML::Node node_;
  YAML::Mark mark_;
  std::string source_;
  std::string key_;
};

}  // namespace kinescope
