// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include <nlohmann/json.hpp>

#include "kinematics/core/progress.h"

namespace kinescope {

/// Where the words of a command go: results to standard output, progress and warnings to standard
/// error, or to whoever calls the command as a function.
struct Console {
  using Words = std::function<void(const std::string& text)>;

  bool json = false;
  bool quiet = false;
  Progress progress = {};   ///< filled by the program; empty in tests
  Words result = {};        ///< takes the result of --json; empty: standard output
  Words warning = {};       ///< takes what is odd about the input; empty: standard error
  Words passed_limit = {};  ///< takes what is outside a limit of --fail-on; empty: standard error

  void print(const nlohmann::json& document) const;
  /// The report has it, too.
  void warn(const std::string& text) const;
  void say_passed_limit(const std::string& text) const;
};

}  // namespace kinescope
