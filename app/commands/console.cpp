// SPDX-License-Identifier: Apache-2.0
#include "app/commands/console.h"

#include <cstdio>

#include <fmt/format.h>

#include "app/io/json_text.h"

namespace kinescope {

void Console::print(const nlohmann::json& document) const {
  const std::string text = dumped(document, 2);
  if (result) {
    result(text);
  } else {
    fmt::print("{}\n", text);
  }
}

void Console::warn(const std::string& text) const {
  if (warning) {
    warning(text);
  } else {
    fmt::print(stderr, "warning: {}\n", text);
  }
}

void Console::say_passed_limit(const std::string& text) const {
  if (passed_limit) {
    passed_limit(text);
  } else {
    fmt::print(stderr, "kinescope: outside the limit {}\n", text);
  }
}

}  // namespace kinescope
