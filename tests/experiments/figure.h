// SPDX-License-Identifier: Apache-2.0
//
// Figures of the experiments: plots of the report as SVG files, medians and quartiles.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace kinescope {

/// `plots`: the texts of report::Plot, one below the other.
void write_figure(const std::filesystem::path& path, const std::vector<std::string>& plots,
                  double width, double height_of_one);

struct Quartiles {
  double lower = 0.0;
  double median = 0.0;
  double upper = 0.0;
};

/// Linear between the order statistics; of at least one value.
[[nodiscard]] Quartiles quartiles(std::vector<double> values);

}  // namespace kinescope
