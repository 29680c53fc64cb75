// SPDX-License-Identifier: Apache-2.0
//
// Takes   a dark and a bright grey level and a gamma.
// Gives   the tone curve between them: how grey a pixel is by the share of it that bright light
//         falls on, 0 (dark) to 1 (bright), and by how much that changes with share and gamma.
// Method  grey = light^(1/gamma); a table, as every pixel of a marker asks for it.
#pragma once

#include <array>

namespace kinescope {

class ToneTable {
 public:
  /// Levels in grey levels of 255.
  ToneTable(double dark, double bright, double gamma);

  struct Value {
    double value = 0.0;
    double slope = 0.0;  ///< by the share
    double per_gamma = 0.0;
  };
  /// Shares may be a little beyond 0 to 1: sharpened pictures.
  [[nodiscard]] Value at(double share) const;

 private:
  struct Entry {
    double value = 0.0;
    double per_gamma = 0.0;
  };
  std::array<Entry, 97> entries_;  // -0.25 .. 1.25
};

}  // namespace kinescope
