// SPDX-License-Identifier: Apache-2.0
//
// What a robot's mechanics makes of its encoders' values: play, eccentric discs, sagging links,
// screws, bent slides, wobbling shafts. From the physics of each, not from a linear model of it.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "tests/truth/filmed_robot.h"
#include "tests/truth/injected_effect.h"

namespace kinescope::truth {

/// A play operator (Krasnosel'skii and Pokrovskii 1989): the follower rests until the leader has
/// crossed the gap. Runs from 2 s before the recording to 2 s after it.
class Play {
 public:
  /// `start`: where in the gap it begins, -1 to 1.
  Play(const SmoothMotion& leader, double width, double duration_s, double start = 0.0);
  [[nodiscard]] double value(double t_s) const;

 private:
  const SmoothMotion leader_;
  double half_width_;
  std::vector<double> held_;
};

/// Point masses on the links and payloads at their ends, none at a link's origin.
class Masses {
 public:
  Masses(const KinematicTree& tree, std::uint64_t seed);
  /// Torque (force) of gravity on every joint, N m (N). `down`: unit, base frame.
  [[nodiscard]] Eigen::VectorXd torques(const KinematicTree& tree, const Eigen::VectorXd& values,
                                        const Eigen::Vector3d& down) const;
  /// Work of gravity from the base's origin to this posture, J: its slope is the torque.
  [[nodiscard]] double work_of_falling(const KinematicTree& tree, const Eigen::VectorXd& values,
                                       const Eigen::Vector3d& down) const;

 private:
  struct Mass {
    std::size_t link = 0;
    double mass_kg = 0.0;
    Eigen::Vector3d place_m = Eigen::Vector3d::Zero();  ///< link frame
  };
  std::vector<Mass> masses_;
};

/// Of gravity on a joint over the recording, encoders taken at their word, N m (N).
struct TorqueRange {
  double lowest = 0.0;
  double highest = 0.0;
  [[nodiscard]] double largest() const;  ///< of the absolute value
};
[[nodiscard]] TorqueRange gravity_range(const FilmedRobot& robot, std::size_t joint);

/// A value that remembers: follows another with a delay, as a spring beside a damper does.
class Creep {
 public:
  Creep(const SmoothMotion& leader, double time_constant_s, double duration_s);
  [[nodiscard]] double value(double t_s) const;

 private:
  std::vector<double> held_;
};

/// The robot must outlive it.
class Mechanics {
 public:
  /// Changes a joint's value; sees all encoders and the time.
  using Law = std::function<double(double value, const Eigen::VectorXd& encoders, double t_s)>;
  using Motion = std::function<Pose(double value)>;

  /// Effects of the camera, the clock and the tags are passed over. Throws std::logic_error for a
  /// name that is unknown and for a joint that is not there or cannot have the effect.
  Mechanics(const FilmedRobot& robot, const std::vector<InjectedEffect>& effects);
  /// True values of the joints at a time of the log's clock, rad or m.
  [[nodiscard]] Eigen::VectorXd values(double t_s) const;
  /// T_base_link of every link.
  [[nodiscard]] std::vector<Pose> links(double t_s) const;

 private:
  struct Sag {
    Eigen::Index joint = 0;
    double compliance = 0.0;  ///< rad per N m, m per N
  };

  void add(const InjectedEffect& effect);

  const FilmedRobot& robot_;
  Masses masses_;
  std::vector<std::optional<Play>> plays_;
  std::vector<std::vector<Law>> laws_;
  std::vector<Motion> motions_;
  std::vector<Sag> sags_;
};

}  // namespace kinescope::truth
