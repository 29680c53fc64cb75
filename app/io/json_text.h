// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace kinescope {

/// Indent -1: in one line. What is no UTF-8 (names of files, columns of a table) becomes U+FFFD.
[[nodiscard]] inline std::string dumped(const nlohmann::json& document, int indent) {
  return document.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

/// A document as it goes into a file.
[[nodiscard]] inline std::string json_text(const nlohmann::json& document, int indent = 1) {
  return dumped(document, indent) + "\n";
}

}  // namespace kinescope
