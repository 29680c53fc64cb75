// SPDX-License-Identifier: Apache-2.0
//
// Rendered recordings against their truth: one row a joint, the error beside the claimed standard
// uncertainty and the Cramér-Rao floor of independent noise of the level found. `accuracy
// [RECORDING...]`; default: all known.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/urdf/urdf.h"
#include "tests/acceptance/truth_robot.h"
#include "tests/truth/shared_data.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kDegree = std::numbers::pi / 180.0;

// Square root of the mean ratio of variances: what the widening for correlated noise came to.
double widening(const json& calibration) {
  double sum = 0.0;
  int count = 0;
  for (const json& parameter : calibration.at("parameters")) {
    if (!parameter.at("sigma").is_number() || !parameter.at("sigma_white").is_number()) continue;
    const double white = parameter.at("sigma_white").get<double>();
    if (!(white > 0.0)) continue;
    sum += std::pow(parameter.at("sigma").get<double>() / white, 2);
    ++count;
  }
  return count > 0 ? std::sqrt(sum / count) : 1.0;
}

void judge(const fs::path& recording) {
  const fs::path output = truth::temporary_path("accuracy") / recording.filename();
  RunOptions options;
  options.recording.folder = recording;
  options.output = output;
  static_cast<void>(run_command(options, {false, true, {}}));
  const auto truth = acceptance::read_truth(recording / "truth.json");
  const KinematicTree learned = read_urdf(output / "robot.urdf");
  const json calibration = json::parse(read_text_file(output / "calibration.json"));
  const json result = json::parse(read_text_file(output / "result.json"));
  const std::string difference = acceptance::structure_difference(truth, learned);
  fmt::print("\n{} (undeclared: {})\n", recording.filename().string(), truth.effect);
  fmt::print("  structure {}\n", difference.empty() ? "right" : "WRONG: " + difference);
  const auto error = acceptance::compare_with_truth(truth, learned);
  fmt::print(
      "  axis direction median {:.4f} worst {:.4f} deg; position median {:.4f} worst {:.4f} mm; "
      "markers at unseen postures {:.4f} mm rms, scale {:+.4f} %\n",
      error.median_direction_rad / kDegree, error.worst_direction_rad / kDegree,
      1e3 * error.median_position_m, 1e3 * error.worst_position_m, 1e3 * error.marker_rms_m,
      100.0 * error.scale);
  const double training = calibration.at("training_rms").get<double>();
  const double held_out = calibration.at("held_out_rms").get<double>();
  fmt::print(
      "  training {:.4f} px, held out {:.4f} px, ratio {:.3f}; uncertainties widened x {:.2f} "
      "over the Cramér-Rao floor of white noise\n",
      training, held_out, held_out / training, widening(calibration));
  fmt::print("  time offset {:.3f} ms (truth {:.3f})\n",
             1e3 * calibration.at("time_offset_s").get<double>(), -1e3 * truth.latency_s);
  for (const auto& axis : error.axes) {
    fmt::print("  {:8} {:9} direction {:.4f} deg  position {:.4f} mm\n", axis.joint,
               to_string(axis.type), axis.direction_rad / kDegree, 1e3 * axis.position_m);
  }
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  using kinescope::shared_data;
  std::vector<std::filesystem::path> recordings(argv + 1, argv + argc);
  if (recordings.empty()) {
    for (const char* name : {"scara4_none", "ur6_none", "gantry_time_lag"}) {
      recordings.push_back(std::filesystem::path(KINESCOPE_SOURCE_DIR) / "sample_videos" / name);
    }
    if (const auto gear = shared_data("synthetic/ur6_gear_eccentricity"))
      recordings.push_back(*gear);
  }
  for (const auto& recording : recordings) {
    try {
      kinescope::judge(recording);
    } catch (const std::exception& error) {
      fmt::print(stderr, "{}: {}\n", recording.string(), error.what());
      return 1;
    }
  }
  return 0;
}
