// SPDX-License-Identifier: Apache-2.0
//
// Takes   a number.
// Gives   a recording of a random robot with undeclared effects, as a user would have it, in
// corners
//         (or, for postures, in poses of a tracker) in place of a video.
// Method  everything follows from the number: kind, size, duration, rests, noise, effects and how
//         strong they are (3 to 100 times the weakest, evenly in the logarithm).
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/truth/camera_effects.h"

namespace kinescope {

enum class UndeclaredKind { kClean, kSingle, kPair, kTriple, kOwn };
[[nodiscard]] std::string_view to_string(UndeclaredKind kind);

/// What goes wrong with a file on its way to the user; or what the user forgot, the size of a
/// marker that is not as large as the others.
enum class Damage {
  kNone,
  kCorruptedRow,   ///< one reading, far out
  kCorruptedRows,  ///< one row in a hundred, within the range of each channel
  kDegrees,
  kShuffledRows,
  kDroppedColumn,
  kSwappedColumns,
  kExchangedHalfway,  ///< two columns, from the middle of the log on
  kForgottenSize,
  kLateFrames,  ///< stamped as they arrive, some together
};

struct UndeclaredCase {
  int number = 0;
  UndeclaredKind kind = UndeclaredKind::kClean;
  truth::EffectWorldOptions world;  ///< its effects included
  bool postures = false;            ///< robot at rest before a tracker: rows without time
  bool idle_channel = false;        ///< a column that moves and drives nothing
};

/// A third are postures, as many are clean as hold one of each number of effects.
/// A forgotten size is an effect more, where there are images.
[[nodiscard]] UndeclaredCase undeclared_case(int number, Damage damage = Damage::kNone);

/// Writes corners.csv or poses.csv, joints.csv, camera.yaml and tags.yaml into a folder that
/// exists; gives the truth, joints named after their columns.
truth::World write_case(const UndeclaredCase& of, const std::filesystem::path& folder,
                        Damage damage = Damage::kNone);

}  // namespace kinescope
