// SPDX-License-Identifier: Apache-2.0
#include "app/commands/export_command_line.h"

#include <fmt/format.h>

#include "app/commands/command_options.h"

namespace kinescope {
namespace {

CLI::Option* add_path(CLI::App& command, const char* name, std::filesystem::path& path,
                      const char* type, const char* help) {
  return command
      .add_option_function<std::string>(
          name, [&path](const std::string& text) { path = text; }, help)
      ->check([](const std::string& text) { return text.empty() ? "the path is empty" : ""; })
      ->type_name(type);
}

void add_mjcf(CLI::App& command, ExportOptions& exported) {
  CLI::Option* mjcf = add_path(
      command, "--mjcf", exported.mjcf, "FILE",
      "Model for MuJoCo: masses, damping, frictionloss, armature, ranges, a motor a joint");
  add_gravity(command, exported.gravity_m_s2);
  command.get_option("--gravity")->needs(mjcf);
}

void add_tum(CLI::App& command, ExportOptions& exported) {
  CLI::Option* tum = add_path(command, "--tum", exported.tum, "FOLDER",
                              "Of a run: the path of every link (and of a camera that moves) in "
                              "the format of the TUM benchmark, a file each");
  command
      .add_option_function<std::string>(
          "--tum-frame",
          [&exported](const std::string& word) { exported.tum_in_camera = word == "camera"; },
          "Frame of the paths (default: base)")
      ->check(one_of({"base", "camera"}))
      ->needs(tum)
      ->type_name("FRAME");
}

void add_dh(CLI::App& command, ExportOptions& exported) {
  CLI::Option* dh = add_path(command, "--dh", exported.dh, "FILE",
                             "Denavit-Hartenberg table with base, tool and, of a run, expanded "
                             "uncertainties (CSV)");
  command
      .add_option_function<std::string>(
          "--dh-convention",
          [&exported](const std::string& word) {
            exported.dh_convention =
                word == "standard" ? DhConvention::kStandard : DhConvention::kModified;
          },
          "Of its rows: standard (distal) or modified (Craig; default)")
      ->check(one_of({"standard", "modified"}))
      ->needs(dh)
      ->type_name("NAME");
  command
      .add_option("--tip", exported.tip,
                  "Link at which the chain of the table ends (default: every end of the robot)")
      ->needs(dh)
      ->type_name("LINK");
}

void add_lerobot(CLI::App& command, ExportOptions& exported) {
  CLI::Option* lerobot = add_path(command, "--lerobot", exported.lerobot, "FILE",
                                  "Of a run with a nominal robot: the calibration file (JSON) with "
                                  "which the driver of a LeRobot arm gives that robot's angles");
  CLI::Option* from = add_path(command, "--lerobot-from", exported.lerobot_from, "FILE",
                               "The calibration file that the arm had when the log was recorded")
                          ->needs(lerobot);
  lerobot->needs(from);
  command
      .add_option_function<std::string>(
          "--lerobot-values",
          [&exported](const std::string& word) {
            exported.lerobot_values =
                word == "degrees" ? LerobotValues::kDegrees : LerobotValues::kPercent;
          },
          "What its values are: degrees, or percent of the range (default: by the joints' scales)")
      ->check(one_of({"degrees", "percent"}))
      ->needs(lerobot)
      ->type_name("UNIT");
}

}  // namespace

void add_export(CLI::App& app, CommandLine& line) {
  CLI::App& command =
      *app.add_subcommand("export", "A robot, or what a run saw of it, for other programs");
  ExportOptions& exported = line.exported;
  add_path(command, "SOURCE", exported.source, "FILE",
           "Folder of kinescope run or dynamics, or a URDF")
      ->required();
  add_mjcf(command, exported);
  add_tum(command, exported);
  add_dh(command, exported);
  add_path(command, "--mcap", exported.mcap, "FILE",
           "Of a run: frames, markers, joint values, residuals and effects over time, for viewers "
           "(Foxglove)");
  add_lerobot(command, exported);
  add_force(command, exported.force, kReplaceOthers);
  add_output_options(command, line.output);
  command.footer(
      fmt::format("Example:\n  kinescope dynamics log.csv --robot robot.urdf\n"
                  "  kinescope export log_dynamics --mjcf robot.xml\n"
                  "  kinescope export arm_run --tum arm_tum\n"
                  "  kinescope export arm_run --dh arm.csv --dh-convention standard\n"
                  "  kinescope export arm_run --mcap arm.mcap\n"
                  "  kinescope export arm_run --lerobot arm.json --lerobot-from arm_before.json"
                  "\n\n{}",
                  kExitCodes));
}

}  // namespace kinescope
