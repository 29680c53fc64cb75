// SPDX-License-Identifier: Apache-2.0
//
// Every subcommand is a function from its options to the program's exit code, so that tests call it
// without a process. Commands throw Error; only run_program() catches.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/commands/console.h"
#include "app/commands/shard_parts.h"
#include "app/experiments/experiment_choice.h"
#include "app/explain/sight_options.h"
#include "app/io/lerobot_file.h"
#include "app/io/recording.h"
#include "app/io/shard.h"
#include "app/torque/torque_options.h"
#include "calib/design/goal.h"
#include "calib/vision/board.h"
#include "dynamics/control/servo.h"
#include "dynamics/data/torque_data.h"
#include "kinematics/core/error.h"
#include "kinematics/core/progress.h"
#include "kinematics/model/denavit_hartenberg.h"

namespace kinescope {

struct RunOptions : SightOptions {
  RecordingPaths recording;
  std::vector<std::filesystem::path> further;  ///< recordings of the same robot, beside that folder
  std::filesystem::path
      output;         ///< the run folder; default: <recording's name>_run in the current folder
  bool trace = true;  ///< close the loop: look for effects that the calibration lacks
  bool must_trace = false;  ///< tracing is what was asked for: exit code 4 where it says nothing
  /// Run every stage again, also where nothing changed, and replace what others wrote.
  bool force = false;
  std::vector<std::string>
      fail_on;               ///< limits such as "held_out_px>0.2" that turn the exit code to 5
  std::string command_line;  ///< for the report
  std::vector<std::string> arguments;    ///< the same, for run.json; without the program's name
  std::filesystem::path working_folder;  ///< that they are seen from; empty: the current one
  /// Look for the markers of this shard's recordings alone, and leave a part in `output`.
  std::optional<Shard> shard = {};
  std::vector<ShardPart> parts = {};  ///< detection that was done so; empty: none was
};

[[nodiscard]] ExitCode run_command(const RunOptions& options, const Console& console);

/// Of `run --shard`, all shards of one run: the same run in one piece.
struct MergeOptions {
  std::vector<std::filesystem::path> parts;  ///< folders
  std::filesystem::path output;              ///< as RunOptions
  bool force = false;                        ///< replace what others wrote
  std::string command_line;                  ///< for the report
};

/// Many robots, each with recordings of its own.
struct FleetOptions {
  std::filesystem::path table;         ///< CSV: robot, recording
  std::vector<std::string> run_words;  ///< options of `run`, for all: "--folds=3"
  std::vector<std::string> fail_on;    ///< limits, which are among them
  std::optional<Shard> shard = {};     ///< these robots alone, and no table
  std::filesystem::path output;        ///< folder: a run folder a robot, and the table
  bool force = false;                  ///< run again what is done, replace what others wrote
  std::string command_line;            ///< for the products
};

[[nodiscard]] ExitCode fleet_command(const FleetOptions& options, const Console& console);

/// On a finished run folder: the run's own command again, with detection taken from the folder.
struct TraceCommandOptions {
  std::filesystem::path run_folder;
};

struct CorrectOptions {
  std::filesystem::path run_folder;
  std::filesystem::path log;
  std::filesystem::path output = "joints_corrected.csv";
  bool force = false;  ///< replace a file that is there
};

[[nodiscard]] ExitCode correct_command(const CorrectOptions& options, const Console& console);

/// What turns the exit code of `compare` to 5.
enum class CompareLimit {
  kNone,
  kChange,  ///< the robot differs, or could not be compared
  kCarry,   ///< a model predicts another's recording worse, or could not be tried
  kAny
};

struct CompareOptions {
  std::vector<std::filesystem::path>
      runs;             ///< folders of finished runs; the first is compared with
  double level = 0.05;  ///< of calling anything changed where nothing is
  CompareLimit fail_on = CompareLimit::kNone;
  std::filesystem::path output;  ///< folder; empty: only prints
  bool force = false;            ///< replace what others wrote
  std::string command_line;      ///< for the page
};

[[nodiscard]] ExitCode compare_command(const CompareOptions& options, const Console& console);

struct PlanCommandOptions {
  std::filesystem::path source;  ///< run folder
  design::Goal goal = design::Goal::kTip;
  std::optional<int> postures;  ///< at rest, in place of a motion
  /// Of a motion; neither: of a run of postures 20 postures, else 20 s.
  std::optional<double> seconds;
  std::optional<std::filesystem::path> limits;  ///< URDF with limits of the joints
  double range = 1.0;             ///< what the run recorded of each joint's range, times this
  double speed = 1.0;             ///< the fastest that the run recorded, times this
  std::optional<double> rate_hz;  ///< of the camera's frames; none: as in the run
  std::uint64_t seed = 1;
  std::filesystem::path output;  ///< folder
  bool force = false;            ///< replace what others wrote
  std::string command_line;      ///< for the products
};

[[nodiscard]] ExitCode plan_command(const PlanCommandOptions& options, const Console& console);

[[nodiscard]] ExitCode dynamics_command(const DynamicsOptions& options, const Console& console);

struct PredictOptions {
  std::vector<std::filesystem::path> logs;
  std::filesystem::path model;   ///< of dynamics --save-model
  std::filesystem::path output;  ///< CSV
  TorqueDataOptions data;
  bool force = false;  ///< replace a file that is there
};

[[nodiscard]] ExitCode predict_command(const PredictOptions& options, const Console& console);

struct SimulateOptions {
  std::filesystem::path robot;                   ///< URDF with masses
  std::filesystem::path trajectory;              ///< joint positions over time
  std::optional<std::filesystem::path> effects;  ///< trace.json or YAML; none: the URDF's friction
  std::filesystem::path output;                  ///< CSV
  ServoOptions servo;
  bool in_servo = false;  ///< in a servo loop; else inverse dynamics along the trajectory itself
  std::optional<Eigen::Vector3d> gravity_m_s2;  ///< in the base frame; default: 9.81 down z
  std::uint64_t seed = 1;
  bool force = false;  ///< replace a file that is there
};

[[nodiscard]] ExitCode simulate_command(const SimulateOptions& options, const Console& console);

struct ControlOptions {
  std::filesystem::path robot;                   ///< URDF with masses: what is simulated
  std::filesystem::path trajectory;              ///< joint positions over time
  std::optional<std::filesystem::path> effects;  ///< of the simulated robot, as SimulateOptions
  std::optional<std::filesystem::path> nominal;  ///< URDF that the controller knows; none: robot
  /// A file of dynamics --save-model, or the dynamics.json or trace.json of dynamics.
  std::optional<std::filesystem::path> model;
  int rounds = 0;                                 ///< of running, learning and running again
  std::string learn = "parametric";               ///< the kind of model that rounds learn
  std::optional<std::filesystem::path> training;  ///< that rounds move along; none: sinusoids
  std::optional<double> payload_kg;
  Eigen::Vector3d payload_centre_m = Eigen::Vector3d::Zero();  ///< in the last link's frame
  ServoOptions servo{.bandwidth_hz = 3.0, .velocity_cutoff_hz = 40.0};
  std::optional<Eigen::Vector3d> gravity_m_s2;  ///< in the base frame; default: 9.81 down z
  std::uint64_t seed = 1;
  std::filesystem::path output;  ///< folder
  bool force = false;            ///< as DynamicsOptions
  std::string command_line;      ///< for the page
};

[[nodiscard]] ExitCode control_command(const ControlOptions& options, const Console& console);

/// What is written is what is named; at least one.
struct ExportOptions {
  std::filesystem::path source;                 ///< folder of run or dynamics, or a URDF
  std::filesystem::path mjcf;                   ///< file for MuJoCo
  std::optional<Eigen::Vector3d> gravity_m_s2;  ///< in the base frame; default: the folder's
  std::filesystem::path tum;                    ///< folder of trajectories, of a run
  bool tum_in_camera = false;                   ///< in the camera's frame; else in the base's
  std::filesystem::path dh;                     ///< Denavit-Hartenberg table, of a run or a URDF
  DhConvention dh_convention = DhConvention::kModified;
  std::filesystem::path mcap;          ///< recording for viewers, of a run
  std::filesystem::path lerobot;       ///< calibration file of a LeRobot arm, of a run
  std::filesystem::path lerobot_from;  ///< the one that the arm had when the log was recorded
  std::optional<LerobotValues> lerobot_values;  ///< of the log; default: by the joints' scales
  std::string tip;                              ///< link that its chain ends at; empty: all chains
  bool force = false;                           ///< replace a file that is there
};

[[nodiscard]] ExitCode export_command(const ExportOptions& options, const Console& console);

[[nodiscard]] ExitCode contact_command(const ContactCommandOptions& options,
                                       const Console& console);

struct ExperimentOptions {
  std::string name;  ///< scara, barrett, ..
  ExperimentChoice choice;
  std::filesystem::path log;    ///< in place of the experiment's own worlds; empty: none
  std::filesystem::path robot;  ///< URDF, with a log
  TorqueDataOptions data;
  std::optional<Eigen::Vector3d> gravity_m_s2;  ///< as DynamicsOptions
  std::filesystem::path output;                 ///< folder
  bool force = false;                           ///< as DynamicsOptions
  std::string command_line;                     ///< for the page
};

[[nodiscard]] ExitCode experiment_command(const ExperimentOptions& options, const Console& console);

struct InspectOptions {
  RecordingPaths recording;                    ///< its folder may be a file: a torque log
  TorqueDataOptions data;                      ///< of a torque log
  std::optional<std::filesystem::path> robot;  ///< URDF that a torque log must fit
};

[[nodiscard]] ExitCode inspect_command(const InspectOptions& options, const Console& console);

struct CameraOptions {
  std::filesystem::path source;  ///< folder of images, or a video
  BoardSpec board;
  BoardOptions calibration;
  std::filesystem::path output = "camera.yaml";
  bool force = false;  ///< replace a file that is there
};

[[nodiscard]] ExitCode camera_command(const CameraOptions& options, const Console& console);

}  // namespace kinescope
