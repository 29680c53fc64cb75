// SPDX-License-Identifier: Apache-2.0
//
// The pieces of the library, by what causes them. Internal to this room.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "dynamics/effects/effect_library.h"

namespace kinescope::effects {

using SharedContext = std::shared_ptr<const EffectContext>;

/// Tilts (deg) from which the base's is sought: as declared, on the walls, on the ceiling.
inline constexpr int kGravityStarts = 6;
[[nodiscard]] std::array<Eigen::Vector2d, kGravityStarts> gravity_starts();

/// Carriers by name; see effect_library.h for the rows.
struct Carriers {
  Eigen::Index joints = 0;
  [[nodiscard]] int joint(std::size_t j) const { return static_cast<int>(j); }
  /// Joints j and j + 1 as one drive turns them: the sum of their motion, or the difference.
  [[nodiscard]] int pair(std::size_t j, bool sum) const {
    return static_cast<int>(joints) + 2 * static_cast<int>(j) + (sum ? 0 : 1);
  }
  [[nodiscard]] int gravity(int axis) const {
    return static_cast<int>(joints + 2 * (joints - 1)) + axis;
  }
  /// Gravity as it is from a base that stands as the `start`-th of gravity_starts() says.
  [[nodiscard]] int turned_gravity(int start) const { return gravity(2) + start; }
  [[nodiscard]] int body(int tip, int parameter) const {
    return turned_gravity(kGravityStarts) + 10 * tip + parameter;
  }
  [[nodiscard]] int count(int tips) const { return body(tips, 0); }
};

/// A joint's friction, low-passed: a function of the fine path, kept by name.
[[nodiscard]] Eigen::VectorXd joint_column(
    const EffectContext& context, std::size_t joint, const std::string& name,
    const std::function<Eigen::ArrayXd(const FinePath&)>& torque);

/// Friction that turns round with the speed's sign, within the joint's width: `torque` of a path
/// and a width. Made at widths in equal ratios and interpolated between them.
[[nodiscard]] Eigen::VectorXd turning_column(
    const EffectContext& context, std::size_t joint, const std::string& name,
    const std::function<Eigen::ArrayXd(const FinePath&, double width)>& torque);
[[nodiscard]] Eigen::VectorXd direction_column(const EffectContext& context, std::size_t joint);
/// Friction in its simplest form, which all that refines it waits for.
[[nodiscard]] std::vector<EffectId> plain_friction(const EffectContext& context, std::size_t joint);

/// `count` values from `first` to `last` in equal ratios.
[[nodiscard]] std::vector<double> ratios(double first, double last, int count);

/// Stribeck speeds that are looked for, rad/s or m/s; EffectContext::least_stribeck_speed of a
/// joint.
[[nodiscard]] std::vector<double> stribeck_speeds(const JointTravel& travel);
[[nodiscard]] double least_stribeck_speed(const EffectContext& context, std::size_t joint);

/// Periods a turn (or a metre) that a log can show.
[[nodiscard]] std::vector<double> ripple_periods(const EffectContext& context, std::size_t joint);

void add_friction(const SharedContext& context, std::vector<Candidate>& out);
void add_friction_of(const SharedContext& context, std::size_t joint, std::vector<Candidate>& out);
void add_drives(const SharedContext& context, std::vector<Candidate>& out);
void add_sensors(const SharedContext& context, std::vector<Candidate>& out);
void add_bodies(const SharedContext& context, std::vector<Candidate>& out);

/// Bodies that carry no other.
[[nodiscard]] std::vector<int> tips(const RigidModel& rigid);

}  // namespace kinescope::effects
