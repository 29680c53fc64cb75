// SPDX-License-Identifier: Apache-2.0
//
// What a column's name says: quantity, joint, unit, and whether it was measured. Knows the names in
// use: q1 q_1 q[0] joint1_position actual_q_0 state.tau_J[0] q_deg1 tau_cmd3 current_mA t_ms ...
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace kinescope {

enum class LoggedQuantity {
  kTime,
  kPosition,
  kVelocity,
  kAcceleration,
  kTorque,
  kCurrent,
  kTrajectory
};

[[nodiscard]] std::string_view to_string(LoggedQuantity quantity);

/// Where a column's values come from, best first.
enum class LoggedOrigin {
  kSensor,     ///< says that it is measured
  kPlain,      ///< says nothing
  kCommanded,  ///< desired, target, command
  kComputed    ///< a model, an estimate, an error: never taken unless named
};

struct ColumnMeaning {
  LoggedQuantity quantity = LoggedQuantity::kPosition;
  LoggedOrigin origin = LoggedOrigin::kPlain;
  std::vector<std::string> joint;  ///< what is left of the name, in lower case: {"1"}, {"arm", "1"}
  std::string unit;                ///< "deg", "ms", ..; empty when the name does not say
};

/// Nothing where the name is none of a joint's signals.
[[nodiscard]] std::optional<ColumnMeaning> read_column_name(std::string_view name);

/// Words of a name in lower case, cut at punctuation and between letters and digits.
[[nodiscard]] std::vector<std::string> words_of(std::string_view name);

/// SI units per unit, by its name: rad deg m mm (and the same per s, per s^2), s ms us ns, Nm N mNm
/// kNm A mA; % of a rated torque or current, which is 1 of itself. Nothing for an unknown name.
[[nodiscard]] std::optional<double> unit_factor(std::string_view unit);

}  // namespace kinescope
