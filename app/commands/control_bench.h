// SPDX-License-Identifier: Apache-2.0
//
// Takes   the options of `kinescope control`.
// Gives   ControlBench: the simulated robot with and without its load, the controller's knowledge
//         of it, the trajectory; one controller after another runs on it.
// Not here: which controllers (control.cpp), the loop (dynamics/control/servo.h).
#pragma once

#include <array>
#include <memory>
#include <string>

#include "app/commands/commands.h"
#include "app/io/output_folder.h"
#include "app/report/control_summary.h"
#include "app/torque/torque_inputs.h"

namespace kinescope {

/// A controller to be tried.
struct Contender {
  std::string name;
  std::string file;  ///< of its log, without ending
  ControlLaw law = ControlLaw::kFeedForward;
  std::string kind = {};  ///< of what was learned; empty: nothing
  std::shared_ptr<const LearnedTorque> learned = {};
  bool loaded = false;
  std::optional<InertialParameters> known_load = {};
  std::optional<int> round = {};
};

class ControlBench {
 public:
  /// Throws bad_input for robots, effects and trajectories that do not fit, bad_request for limits
  /// that contradict the trajectory or each other.
  /// Both must outlive it.
  ControlBench(const ControlOptions& options, const Console& console);

  [[nodiscard]] const TorqueRobot& robot() const { return robot_; }
  [[nodiscard]] const TorqueRobot& nominal() const { return nominal_; }
  [[nodiscard]] const std::filesystem::path& nominal_file() const { return nominal_file_; }
  [[nodiscard]] const TorqueSamples& reference() const { return reference_; }
  [[nodiscard]] const ServoOptions& servo() const { return servo_; }
  [[nodiscard]] const Console& console() const { return console_; }
  [[nodiscard]] Eigen::VectorXd shown_times() const;

  /// The path that a round learns on; the same number, the same path.
  [[nodiscard]] TorqueSamples training(int round) const;
  [[nodiscard]] ServoLog follow(const Contender& contender, const TorqueSamples& path) const;
  /// On the trajectory; its log goes into the folder.
  [[nodiscard]] ControlRun judge(const Contender& contender, const OutputFolder& folder) const;

 private:
  void check_path(const TorqueSamples& path, const std::filesystem::path& file) const;
  void check_limits() const;

  const ControlOptions& options_;
  const Console& console_;
  TorqueRobot robot_, nominal_;
  std::filesystem::path nominal_file_;
  ServoOptions servo_;
  TorqueSamples reference_;
  std::array<Plant, 2> plants_;  ///< without and with the load
};

}  // namespace kinescope
