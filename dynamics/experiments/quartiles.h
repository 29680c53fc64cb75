// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <vector>

namespace kinescope::experiments {

/// In place of a value that nothing was measured for.
inline constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();

struct Quartiles {
  double lower = 0.0;
  double median = 0.0;
  double upper = 0.0;
};

/// Linear between the order statistics; of at least one value.
[[nodiscard]] Quartiles quartiles(std::vector<double> values);

struct Interval {
  double lower = 0.0;
  double upper = 0.0;
};

/// Order statistics that hold the median of what the values were drawn from with a probability of
/// at least 95 %, whatever it is (David and Nagaraja 2003, section 7.1). NaN for less than six
/// values, which cannot say so much.
[[nodiscard]] Interval median_interval(std::vector<double> values);

}  // namespace kinescope::experiments
