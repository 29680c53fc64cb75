// SPDX-License-Identifier: Apache-2.0
//
// Writes the synthetic reports into a folder, to look at them in a browser.
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "app/report/report.h"
#include "tests/app/report/synthetic_run.h"

int main(int argc, char** argv) {
  using kinescope::MeasurementKind;
  using kinescope::SyntheticRunOptions;
  const std::filesystem::path folder = argc > 1 ? argv[1] : ".";
  const std::vector<std::pair<std::string, SyntheticRunOptions>> runs = {
      {"video", {.frames = 990, .gear_error_rad = 0.0015}},
      {"poses", {.kind = MeasurementKind::kPose}},
      {"points", {.kind = MeasurementKind::kPoint, .nominal = true}},
      {"nolog", {.log = false}},
  };
  for (const auto& [name, options] : runs) {
    const kinescope::RunSummary run = kinescope::synthetic_run(options);
    std::ofstream(folder / (name + ".html")) << kinescope::report_html(run, "<robot/>\n");
    std::ofstream(folder / (name + ".json")) << kinescope::result_json(run).dump(2);
    std::cout << (folder / (name + ".html")).string() << '\n';
  }
  return 0;
}
