// SPDX-License-Identifier: Apache-2.0
//
// The last section of a page: by which command, settings and inputs it came about.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "app/report/run_summary.h"

namespace kinescope::report {

/// A name and what it is.
using Named = std::pair<std::string, std::string>;

struct Reproduction {
  std::string command;
  std::vector<Named> settings = {};
  std::vector<InputFile> inputs = {};
  std::vector<Named> products = {};  ///< files beside the page, and what is in them
};

/// HTML; texts are escaped here. The section's id is "reproduce".
[[nodiscard]] std::string reproduction_section(const Reproduction& of);

}  // namespace kinescope::report
