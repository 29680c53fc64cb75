// SPDX-License-Identifier: Apache-2.0
#include "app/commands/camera_command_line.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "app/commands/command_options.h"
#include "calib/vision/tag_detector.h"
#include "kinematics/core/csv.h"

namespace kinescope {
namespace {

/// Of what is measured on a board, m: more would be mm.
constexpr double kLongest = 10.0;

/// A finite length above zero, m.
CLI::Validator length_m() {
  return {[](const std::string& text) -> std::string {
            const std::optional<double> value = parse_number(text);
            if (value && *value > 0.0 && *value < kLongest) return {};
            return fmt::format("'{}' is no length in m above 0 and below {}", text, kLongest);
          },
          fmt::format("up to {} m", kLongest)};
}

void add_board_options(CLI::App& camera, BoardSpec& board) {
  static const std::map<std::string, BoardType> kBoards = {{"chessboard", BoardType::kChessboard},
                                                           {"charuco", BoardType::kCharuco},
                                                           {"aprilgrid", BoardType::kAprilGrid}};
  const char* group = "Board";
  add_choice(camera, "--board", kBoards, board.type, "chessboard, charuco or aprilgrid")
      ->required()
      ->type_name("TYPE")
      ->group(group);
  const auto count = [&](const char* name, int& value, const char* help) {
    camera.add_option(name, value, help)
        ->required()
        ->check(number_in(1, 100))
        ->type_name("N")
        ->group(group);
  };
  count("--columns", board.columns,
        "Inner corners (chessboard), squares (charuco) or tags (aprilgrid) across");
  count("--rows", board.rows, "The same down");
  camera
      .add_option("--square", board.square_m,
                  "Edge of a square, of a tag for aprilgrid; m, as measured")
      ->required()
      ->check(length_m())
      ->type_name("M")
      ->group(group);
  camera.add_option("--marker", board.marker_m, "charuco: edge of a marker, m")
      ->check(length_m())
      ->type_name("M")
      ->group(group);
  camera
      .add_option("--spacing", board.spacing, "aprilgrid: gap between tags as a share of the tag")
      ->check(number_in(0.01, 5))
      ->capture_default_str()
      ->type_name("SHARE")
      ->group(group);
  camera
      .add_option("--dictionary", board.dictionary,
                  "charuco: dictionary (DICT_5X5_100); aprilgrid: family")
      ->type_name("NAME")
      ->group(group);
  camera
      .add_flag("--legacy", board.legacy_charuco,
                "charuco: layout of OpenCV before 4.6 (even row counts)")
      ->group(group);
}

// "0-7,12" in its order, each id once; nothing where it says something else.
std::optional<std::vector<int>> parse_ids(const std::string& text) {
  constexpr int kMost = 1000;  // on a sheet
  std::vector<int> out;
  for (const std::string& part : CLI::detail::split(text, ',')) {
    const std::size_t dash = part.find('-');
    const auto first = parse_number(part.substr(0, dash));
    const auto last = dash == std::string::npos ? first : parse_number(part.substr(dash + 1));
    if (!first || !last || *first < 0.0 || *last < *first || *last - *first >= kMost ||
        *first > 1e9 || std::floor(*first) != *first || std::floor(*last) != *last)
      return std::nullopt;
    for (int id = static_cast<int>(*first); id <= static_cast<int>(*last); ++id) {
      if (std::ranges::find(out, id) == out.end()) out.push_back(id);
    }
    if (out.size() > kMost) return std::nullopt;
  }
  return out;
}

void add_capture_inputs(CLI::App& capture, CaptureOptions& options) {
  const char* group = "What is known";
  const auto add_file = [&](const char* name, std::optional<std::filesystem::path>& file,
                            const char* help) {
    capture
        .add_option_function<std::string>(
            name, [&file](const std::string& text) { file = text; }, help)
        ->check(refuse_empty)
        ->type_name("FILE")
        ->group(group);
  };
  capture
      .add_option("--size", options.size_m, "Edge of the markers' black square, m (such as 0.04)")
      ->check(length_m())
      ->type_name("M")
      ->group(group);
  capture
      .add_option("--family", options.family,
                  "As in tags.yaml (default: tag36h11, or what is seen where it is not)")
      ->check(one_of(known_families()))
      ->type_name("NAME")
      ->group(group);
  add_file("--tags", options.tags,
           "Marker family and sizes, to be copied (default: tags.yaml in the folder)");
  add_file("--camera", options.camera,
           "Intrinsics, to be copied (default: camera.yaml in the folder)");
  capture
      .add_option("--joints", options.joints,
                  "Joint values as lines of CSV, a header first: - (standard input), a pipe, or a "
                  "file that grows; stamped by its column t, else when they are received")
      ->check(refuse_empty)
      ->type_name("FILE")
      ->group(group);
}

}  // namespace

void add_camera(CLI::App& app, CommandLine& line) {
  static const std::map<std::string, DistortionModel> kModels = {
      {"plumb_bob", DistortionModel::kPlumbBob},
      {"rational_polynomial", DistortionModel::kRationalPolynomial},
      {"equidistant", DistortionModel::kEquidistant}};
  CLI::App& camera = *app.add_subcommand("camera", "Intrinsics from images or a video of a board");
  camera
      .add_option_function<std::string>(
          "SOURCE", [&line](const std::string& text) { line.camera.source = text; },
          "Folder of images, or a video")
      ->required()
      ->type_name("PATH");
  add_board_options(camera, line.camera.board);
  add_choice(camera, "--model", kModels, line.camera.calibration.model,
             "plumb_bob (default), rational_polynomial or equidistant")
      ->type_name("MODEL");
  camera
      .add_option_function<std::string>(
          "-o,--output", [&line](const std::string& text) { line.camera.output = text; },
          "ROS camera_info file to write (default: camera.yaml)")
      ->type_name("FILE");
  add_force(camera, line.camera.force, kReplaceFile);
  add_output_options(camera, line.output);
  camera.footer(fmt::format(
      "Example:\n  kinescope camera board_images --board chessboard --columns 9 --rows 6 "
      "--square 0.025\n\n{}",
      kExitCodes));
}

void add_markers(CLI::App& app, CommandLine& line) {
  static const std::map<std::string, Paper> kPapers = {{"A4", Paper::kA4},
                                                       {"letter", Paper::kLetter}};
  CLI::App& markers = *app.add_subcommand("markers", "A PDF of markers to print, in true size");
  MarkerSheet& sheet = line.markers.sheet;
  markers
      .add_option_function<std::string>(
          "--ids", [&sheet](const std::string& text) { sheet.ids = value_of(parse_ids(text)); },
          "Which markers: numbers and ranges, such as 0-7,12; at most 1000")
      ->check([](const std::string& text) -> std::string {
        return parse_ids(text) ? "" : fmt::format("'{}' names no markers (such as 0-7,12)", text);
      })
      ->required()
      ->type_name("IDS");
  markers.add_option("--size", sheet.size_m, "Edge of the black square, m (such as 0.04)")
      ->check(length_m())
      ->required()
      ->type_name("M");
  markers.add_option("--family", sheet.family, "As in tags.yaml (default: tag36h11)")
      ->type_name("NAME");
  add_choice(markers, "--paper", kPapers, sheet.paper, "A4 (default) or letter")
      ->type_name("PAPER");
  markers
      .add_option_function<std::string>(
          "-o,--output", [&line](const std::string& text) { line.markers.output = text; },
          "PDF to write (default: markers.pdf)")
      ->type_name("FILE");
  add_force(markers, line.markers.force, kReplaceFile);
  add_output_options(markers, line.output);
  markers.footer(
      fmt::format("Example:\n  kinescope markers --ids 0-7 --size 0.04\n\n{}", kExitCodes));
}

void add_capture(CLI::App& app, CommandLine& line) {
  CLI::App& capture = *app.add_subcommand(
      "capture", "A recording from a running camera, with a page that says what it lacks");
  CaptureOptions& options = line.capture;
  capture
      .add_option(
          "SOURCE", options.source,
          "Camera (0, /dev/video0), stream (rtsp://.., http://..), or a video file, which is "
          "played at its own speed")
      ->check(refuse_empty)
      ->required()
      ->type_name("SOURCE");
  capture
      .add_option_function<std::string>(
          "-o,--output", [&options](const std::string& text) { options.output = text; },
          "Folder of the recording to make")
      ->required()
      ->type_name("FOLDER");
  add_capture_inputs(capture, options);
  capture
      .add_option("--port", options.port,
                  "Port of the page on 127.0.0.1; 0 (default): any that is free")
      ->check(number_in(0, 65535))
      ->type_name("N");
  capture.add_flag("--no-page", options.no_page, "Without a page: the recording begins at once");
  capture.add_option("--seconds", options.seconds, "Longest duration of the recording")
      ->check(number_in(0.1, 86400))
      ->type_name("S");
  add_force(capture, options.force, "Replace the recording that is in the folder");
  add_output_options(capture, line.output);
  capture.footer(fmt::format(
      "Examples:\n  kinescope capture 0 --size 0.04 -o arm\n  read_joints | kinescope capture "
      "rtsp://camera/stream --size 0.04 --joints - -o arm\n\n{}",
      kExitCodes));
}

}  // namespace kinescope
