// SPDX-License-Identifier: Apache-2.0
//
// A system of the user's own: a program that is asked for one rollout and moves the robot, or a
// simulation of it. Two tables pass line by line, states one way and inputs the other (what they
// look like: dynamics/README.md, "A system of one's own").
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "dynamics/policy/sensing.h"

namespace kinescope {

struct ProgramCall {
  std::vector<std::string> words;    ///< the program and its first arguments
  std::filesystem::path folder;      ///< where it runs; empty: here
  double timeout_s = 10.0;           ///< for each of its lines
  double smoothing_cutoff_hz = 0.0;  ///< afterwards, where only positions are measured
};

class ProgramSystem : public policy::System {
 public:
  ProgramSystem(policy::StateLayout layout, policy::SensingOptions sensing, ProgramCall call);

  [[nodiscard]] const policy::StateLayout& layout() const override { return layout_; }
  /// Throws bad_input where the program cannot be started or writes other columns than the
  /// layout's; undetermined where it hangs, ends too soon or with an error, or writes what is no
  /// number.
  [[nodiscard]] policy::Trial run(const policy::Controller& controller, int steps,
                                  std::uint64_t seed, int trial) const override;

 private:
  policy::StateLayout layout_;
  policy::SensingOptions sensing_;
  ProgramCall call_;
};

}  // namespace kinescope
