// SPDX-License-Identifier: Apache-2.0
//
// Takes   a RunSummary.
// Gives   result.json and one self-contained report.html (inline SVG and CSS; complete with scripts off; the
//         script adds the 3-D view). Pure functions: the same summary gives the same bytes.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/run_summary.h"

namespace kinescope {

/// What the report opens with, and the program prints at the end.
struct Verdict {
  std::string found;     ///< "4 joints (R R P R), every one matched to a channel, probability > 0.999"
  std::string accurate;  ///< "markers predicted to 0.07 px held out; axes to 0.02 deg, 0.05 mm (k = 2)"
  std::string limits;    ///< what limits it
  std::string next;      ///< what to record next
};

[[nodiscard]] Verdict make_verdict(const RunSummary& run);
[[nodiscard]] nlohmann::json result_json(const RunSummary& run);
[[nodiscard]] std::string report_html(const RunSummary& run, std::string_view urdf);

}  // namespace kinescope
