// SPDX-License-Identifier: Apache-2.0
//
// Drawings of experiments: distributions over runs, and curves with what lies about them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "app/report/plot.h"

namespace kinescope::report {

struct BoxRow {
  std::string name;
  std::vector<double> values;  ///< above zero, one a run; those that are not are left out
};

/// One row each: the quartiles as a bar, the median as a line across it, every value as a dot; on
/// decimal logarithms.
[[nodiscard]] std::string box_plot(std::string_view name, std::string_view axis,
                                   const std::vector<BoxRow>& rows);

struct Curve {
  std::string name;
  std::vector<Eigen::Vector2d> points;
  std::vector<double> lower, upper;  ///< of y, one a point; empty: no band
  bool dots = false;                 ///< dots, not a line
};

struct CurveAxis {
  std::string label;
  bool log10 = false;  ///< the numbers, not their logarithms, are given
};

/// Axes hold all that is drawn.
[[nodiscard]] std::string curve_plot(std::string_view name, const CurveAxis& x, const CurveAxis& y,
                                     const std::vector<Curve>& curves);

}  // namespace kinescope::report
