// SPDX-License-Identifier: Apache-2.0
//
// Two effects, each of which explains what the other explains so far.
//
// Method  T-optimality (Atkinson and Fedorov 1975): what remains of the believed effect after all
//         else, the rival among it, has been fitted to the recording; linearised, so that it is a
//         Schur complement of the information matrix.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "calib/bundle/calibration.h"

namespace kinescope::design {

/// Columns of an information matrix.
struct RivalColumns {
  std::vector<Eigen::Index> believed;
  Eigen::VectorXd values;              ///< of its parameters, as found
  std::vector<Eigen::Index> nuisance;  ///< all that is fitted beside it, the rival's among them
};

/// By how many standard deviations the two differ in what has this information: the square root of
/// the sum of whitened squares that the rival leaves; 0 where nothing is left.
[[nodiscard]] double sigmas_apart(const Eigen::MatrixXd& information, const RivalColumns& columns);

/// `own`, `rival`: names of the two effects' parameters; `others`: of effects that are in neither
/// model.
[[nodiscard]] RivalColumns rival_columns(const std::vector<Parameter>& parameters,
                                         const std::vector<std::string>& own,
                                         const Eigen::VectorXd& values,
                                         const std::vector<std::string>& others);

}  // namespace kinescope::design
