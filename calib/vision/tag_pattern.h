// SPDX-License-Identifier: Apache-2.0
//
// Takes   a family and an id.
// Gives   the marker as it is printed.
// Not here: where it stands on a page (app/io/marker_sheet.h).
#pragma once

#include <string>
#include <vector>

namespace kinescope {

struct TagPattern {
  int cells = 0;             ///< along an edge of the pattern, with its white margin
  int edge = 0;              ///< of them between two corners: what is measured as the marker's size
  std::vector<bool> bright;  ///< cells x cells, row by row from the upper left; upright

  [[nodiscard]] int margin() const { return (cells - edge) / 2; }
};

/// Throws bad_request: a family or an id that is none.
[[nodiscard]] TagPattern tag_pattern(const std::string& family, int id);

}  // namespace kinescope
