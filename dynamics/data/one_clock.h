// SPDX-License-Identifier: Apache-2.0
//
// One clock for trajectories whose own clocks may start anew: laid one behind the other, and back.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace kinescope {

/// A moment by the clock of the trajectory it lies in.
struct LogMoment {
  int trajectory = 0;  ///< as in TorqueSamples::trajectory
  double t_s = 0.0;
};

struct OneClockOptions {
  /// A trajectory keeps its own clock if it begins later than this after the one before.
  double least_gap_s = 0.0;
  double gap_s = 0.0;  ///< to the one before where it does not: this,
  /// and in steps of its own samples; the larger of the two.
  double gap_steps = 50.0;
};

class OneClock {
 public:
  OneClock() = default;
  /// Stamps increase within a trajectory: the samples in a row that share a number.
  OneClock(const Eigen::VectorXd& t_s, const Eigen::VectorXi& trajectory,
           const OneClockOptions& options = {});

  /// Of every sample, increasing.
  [[nodiscard]] const Eigen::VectorXd& time_s() const { return time_s_; }
  /// Back to the log. A time between two trajectories belongs to the one before.
  [[nodiscard]] LogMoment moment(double time_s) const;
  /// The first moment of each trajectory on this clock.
  [[nodiscard]] std::vector<double> begins_s() const;
  /// Some trajectory is not at its own time.
  [[nodiscard]] bool moved() const;

 private:
  struct Stretch {
    int trajectory = 0;
    double begin_s = 0.0;  ///< on this clock
    double late_s = 0.0;   ///< this clock minus the log's
  };
  std::vector<Stretch> stretches_;
  Eigen::VectorXd time_s_;
};

}  // namespace kinescope
