// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/figure.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "app/report/assets.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {

void write_figure(const std::filesystem::path& path, const std::vector<std::string>& plots,
                  double width, double height_of_one) {
  std::string text = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\"><style>{}</style>\n", width,
      height_of_one * static_cast<double>(plots.size()), report::page_style());
  for (std::size_t k = 0; k < plots.size(); ++k) {
    text += fmt::format("<svg y=\"{}\" width=\"{}\" height=\"{}\">{}</svg>\n",
                        height_of_one * static_cast<double>(k), width, height_of_one, plots[k]);
  }
  write_file_atomically(path, text + "</svg>\n");
}

Quartiles quartiles(std::vector<double> values) {
  KINESCOPE_CHECK(!values.empty(), "quartiles of something");
  std::ranges::sort(values);
  const auto at = [&](double share) {
    const double place = share * static_cast<double>(values.size() - 1);
    const auto low = static_cast<std::size_t>(std::floor(place));
    const std::size_t high = std::min(low + 1, values.size() - 1);
    return values[low] + (place - std::floor(place)) * (values[high] - values[low]);
  };
  return {at(0.25), at(0.5), at(0.75)};
}

}  // namespace kinescope
