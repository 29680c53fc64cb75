// SPDX-License-Identifier: Apache-2.0
//
// Takes   markers, the size of their edge, a paper.
// Gives   a PDF to print: every marker in true size with its white margin, its id, a line where to
//         cut and one that shows what to measure; on every page a ruler that shows whether the
//         printer scaled it.
// Not here: what the markers look like (calib/vision/tag_pattern.h).
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace kinescope {

enum class Paper { kA4, kLetter };

[[nodiscard]] std::string_view to_string(Paper paper);

struct MarkerSheet {
  std::string family;
  std::vector<int> ids = {};
  double size_m = 0.0;  ///< of the edge between two corners
  Paper paper = Paper::kA4;
};

struct SheetPdf {
  std::string bytes;
  int pages = 0;
};

/// The same bytes for the same sheet. Throws bad_request: no such family or id, a marker that does
/// not fit on the paper.
[[nodiscard]] SheetPdf marker_sheet_pdf(const MarkerSheet& sheet);

}  // namespace kinescope
