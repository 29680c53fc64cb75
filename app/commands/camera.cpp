// SPDX-License-Identifier: Apache-2.0
//
// `kinescope camera`: intrinsics from views of a board, written as ROS camera_info.
#include <array>
#include <string_view>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "app/io/output_folder.h"
#include "calib/camera/camera_file.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

constexpr double kExpanded = 2.0;  // k of the uncertainties printed

struct Named {
  std::string_view name;
  double value = 0.0;
  double uncertainty = 0.0;  // k = 2; 0 where held
};

std::vector<Named> intrinsics(const IntrinsicCalibration& result) {
  constexpr std::array<std::string_view, 8> kPolynomial = {"k1", "k2", "p1", "p2",
                                                           "k3", "k4", "k5", "k6"};
  constexpr std::array<std::string_view, 4> kEquidistant = {"k1", "k2", "k3", "k4"};
  const CameraModel& camera = result.camera;
  std::vector<Named> out = {{"fx", camera.fx, 0.0},
                            {"fy", camera.fy, 0.0},
                            {"cx", camera.cx, 0.0},
                            {"cy", camera.cy, 0.0}};
  const bool equidistant = camera.model == DistortionModel::kEquidistant;
  for (std::size_t i = 0; i < static_cast<std::size_t>(distortion_count(camera.model)); ++i) {
    out.push_back({equidistant ? kEquidistant[i] : kPolynomial[i], camera.distortion[i], 0.0});
  }
  for (std::size_t i = 0; i < out.size(); ++i) out[i].uncertainty = kExpanded * result.sigma[i];
  return out;
}

int used_views(const IntrinsicCalibration& result) {
  int used = 0;
  for (const BoardView& view : result.views) used += view.used ? 1 : 0;
  return used;
}

nlohmann::json result_to_json(const IntrinsicCalibration& result, const CameraOptions& options) {
  nlohmann::json parameters = nlohmann::json::array();
  for (const Named& p : intrinsics(result)) {
    parameters.push_back({{"name", p.name},
                          {"value", p.value},
                          {"uncertainty_k2", p.uncertainty},
                          {"estimated", p.uncertainty > 0.0}});
  }
  nlohmann::json views = nlohmann::json::array();
  for (const BoardView& view : result.views) {
    views.push_back({{"source", view.source},
                     {"corners", view.corners},
                     {"rms_px", view.rms_px},
                     {"used", view.used},
                     {"reason", view.reason}});
  }
  return {{"schema", 1},
          {"output", options.output.string()},
          {"image_width", result.camera.width},
          {"image_height", result.camera.height},
          {"distortion_model", to_string(result.camera.model)},
          {"parameters", std::move(parameters)},
          {"rms_px", result.rms_px},
          {"held_out_rms_px", result.held_out_rms_px},
          {"coverage", result.coverage},
          {"coverage_counts", result.coverage_counts},
          {"tilt_range_deg", result.tilt_range_deg},
          {"views_used", used_views(result)},
          {"views", std::move(views)},
          {"warnings", result.warnings}};
}

void print_words(const IntrinsicCalibration& result, const CameraOptions& options) {
  fmt::print("camera    {} x {}, {}\n", result.camera.width, result.camera.height,
             to_string(result.camera.model));
  for (const Named& p : intrinsics(result)) {
    const bool pixels = p.name[0] == 'f' || p.name[0] == 'c';
    if (p.uncertainty == 0.0) {
      fmt::print("  {}      {:12.{}f}   (held)\n", p.name, p.value, pixels ? 2 : 5);
    } else {
      fmt::print("  {}      {:12.{}f} +- {:.{}f}{}\n", p.name, p.value, pixels ? 2 : 5,
                 p.uncertainty, pixels ? 2 : 5, pixels ? " px (k = 2)" : " (k = 2)");
    }
  }
  fmt::print("error     {:.3f} px RMS, {:.3f} px on views left out of the fit\n", result.rms_px,
             result.held_out_rms_px);
  fmt::print(
      "views     {} of {} used, corners in {:.0f} % of the image, board turned by up to {:.0f} "
      "deg\n",
      used_views(result), result.views.size(), 100.0 * result.coverage, result.tilt_range_deg);
  for (const BoardView& view : result.views) {
    if (!view.used) fmt::print("  left out {}: {}\n", view.source, view.reason);
  }
  for (const std::string& warning : result.warnings) fmt::print("next      {}\n", warning);
  fmt::print("written   {}\n", options.output.string());
}

// A video, or the files of a folder of images.
std::vector<std::filesystem::path> files_of(const std::filesystem::path& source) {
  std::error_code error;
  if (!std::filesystem::is_directory(source, error)) return {source};
  std::vector<std::filesystem::path> out;
  for (const auto& entry : std::filesystem::directory_iterator(source, error)) {
    out.push_back(entry.path());
  }
  return out;
}

}  // namespace

ExitCode camera_command(const CameraOptions& options, const Console& console) {
  require_folder_of(options.output);
  require_new_file(options.output, "--output", files_of(options.source), options.force);
  const std::filesystem::path folder = options.output.parent_path();
  require_writable_folder(folder.empty() ? "." : folder);  // before the long work
  const IntrinsicCalibration result =
      calibrate_intrinsics(options.source, options.board, options.calibration, console.progress);
  write_file_atomically(options.output, write_camera_info(result.camera));
  if (console.json) {
    console.print(result_to_json(result, options));
  } else {
    print_words(result, options);
  }
  return ExitCode::kDone;
}

}  // namespace kinescope
