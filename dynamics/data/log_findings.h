// SPDX-License-Identifier: Apache-2.0
//
// What is wrong with a torque log, as a value: each fault with its channel, its share, its place in
// the file and what to do about it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace kinescope {

enum class LogFault {
  kStaleRows,         ///< rows that repeat the row before although the robot moves
  kRepeatedStamps,    ///< two rows of one time
  kStampsGoBack,      ///< rows out of order, or a clock that starts again
  kGap,               ///< missed samples
  kIrregularSteps,    ///< steps that scatter although none is missing
  kSlow,              ///< sampled too slowly for dynamics
  kNoClock,           ///< no stamps: the rate was estimated from velocity and position
  kNotANumber,        ///< empty or NaN cells
  kInfinite,          ///< infinite or absurdly large cells
  kSpike,             ///< single samples far from their neighbours
  kConstant,          ///< a channel that never changes
  kClipped,           ///< a channel cut off at a limit
  kFrozen,            ///< a torque that keeps one value while its joint moves on
  kDeadZone,          ///< a torque that reads exactly 0 within a band
  kQuantised,         ///< a channel of few, equally spaced values
  kHeld,              ///< a channel that is renewed more slowly than the rows
  kWrapped,           ///< jumps by a whole turn
  kUnit,              ///< degrees for radians, mm for m, ms for s
  kVelocityScale,     ///< velocity is not the derivative of position: factor
  kVelocityLag,       ///< velocity comes later (or earlier) than the position's derivative
  kVelocityMismatch,  ///< velocity does not follow the position's derivative at all
  kAcceleration,      ///< acceleration is not the derivative of velocity
  kLag,               ///< position follows its command, or torque its model, with a delay
  kTorqueScale,       ///< measured torque against the model: factor, sign, unit
  kCommanded,         ///< the torque is the controller's command, no measurement
  kAssignment,        ///< how columns were taken for joints
  kRepeatedPath,      ///< two trajectories follow one path
  kTooShort,          ///< a trajectory too short to filter; left out
  kReading            ///< what the reader of the file left out
};

/// The name in reports and JSON, such as "stale_rows".
[[nodiscard]] std::string_view to_string(LogFault fault);

enum class FaultWeight {
  kNote,     ///< worth knowing
  kWarning,  ///< repaired or worked around as said; judge the result with it in mind
  kRefusal   ///< the data must not be used like this
};

[[nodiscard]] std::string_view to_string(FaultWeight weight);

struct LogFinding {
  LogFault fault = LogFault::kStaleRows;
  FaultWeight weight = FaultWeight::kNote;
  std::string channel;  ///< column, or empty where it concerns whole rows
  double share = 0.0;   ///< of the rows, 0 to 1
  double value =
      0.0;            ///< the size in the fault's own unit (s, factor, step); 0 where there is none
  std::string place;  ///< "file:line" of the first or worst case; file alone where it is everywhere
  std::string what;   ///< one clause
  std::string remedy;  ///< what to do, or what was done

  bool operator==(const LogFinding&) const = default;
};

/// "file:line: what (remedy)"
[[nodiscard]] std::string to_line(const LogFinding& finding);

/// The findings of one kind, in their order.
[[nodiscard]] std::vector<LogFinding> findings_of(const std::vector<LogFinding>& findings,
                                                  LogFault fault);

/// Throws bad_input with the first refusal, if there is one.
void throw_refusals(const std::vector<LogFinding>& findings);

}  // namespace kinescope
