// SPDX-License-Identifier: Apache-2.0
//
// Takes   a nominal robot and what was measured of the real one.
// Gives   what of the drawing and its columns is grossly wrong: axes that point elsewhere, zeros
//         that are far off, channels exchanged, columns in degrees or mm; and the drawing without.
// Method  the columns of all joints of a type are tried in the other unit, every joint with each of
//         the other five directions of its frame and in the other unit, every two channels are
//         exchanged, and where a marker is missed every zero is turned by eighths of a turn; the
//         markers are placed anew and the robot fitted on few frames. The best is
//         taken, then the best beside it, until nothing helps; what does not cut the typical error
//         of any marker by half, with all the others in, is left out again.
// Why     a fit with a prior cannot leave a wrong axis, a robust loss hides it, and tracing names
//         nonsense on top.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "calib/bundle/calibrate.h"

namespace kinescope {

/// Medians over the sightings of a marker; zero where the measurement has no such part.
struct TypicalError {
  double px = 0.0;
  double m = 0.0;
  double rad = 0.0;
};

struct NominalFault {
  int joint = 0;
  std::optional<Eigen::Vector3d> axis = {};  ///< the direction it moves along or about, joint frame
  std::optional<int> exchanged_with = {};    ///< another joint, whose channel drives this one
  std::optional<double> unit = {};           ///< of its column, rad or m
  std::optional<double> zero = {};           ///< where it really is, of a revolute joint; rad
  TagId marker = {};                         ///< the one that it concerns most
  TypicalError before = {};                  ///< of that one, with this fault alone
  TypicalError after = {};                   ///< with none
};

struct CheckedNominal {
  CalibrationStart start;  ///< of the robot without the faults
  std::vector<NominalFault> faults;
};

/// `place` makes the start of a drawing; it may throw undetermined, as this does if nothing fits.
[[nodiscard]] CheckedNominal check_nominal(
    const KinematicTree& nominal,
    const std::function<CalibrationStart(const KinematicTree&)>& place,
    const Measurements& measurements, const MarkerSet& markers, const JointLog& log);

}  // namespace kinescope
