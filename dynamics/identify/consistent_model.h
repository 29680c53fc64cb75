// SPDX-License-Identifier: Apache-2.0
//
// From base parameters to a robot with masses: the full inertial parameters that explain the fit,
// that some real body has, and that stay near the prior where the torques say nothing.
#pragma once

#include "dynamics/identify/identify.h"

namespace kinescope {

struct ConsistentOptions {
  /// Relative standard deviation of the prior's masses and moments: a cost of (change / this)^2 / 2
  /// beside the data's, as a Bregman divergence of the log determinant (Lee, Wensing, Park 2020,
  /// eq. 23).
  double prior_relative_sigma = 1.0;
  int max_iterations = 500;
};

struct ConsistentModel {
  DynamicModel model;  ///< prior's tree and gravity with the identified inertias, friction, motors
  Eigen::VectorXd terms;       ///< value of each of Identification::terms
  Eigen::VectorXd parameters;  ///< the base parameters that these amount to
  double misfit =
      0.0;  ///< squared distance to the base parameters in their own sigmas (block jackknife)
  bool converged = false;
  int iterations = 0;
  std::vector<std::string>
      replaced_priors;  ///< links whose given inertia no body has; they got a plain one
};

/// Every inertia of the result is consistent, friction and motor inertia are not negative. Where
/// fixed joints tie links together, the links that hang on keep their given inertia if what is left
/// for the moving link is a body, else the moving link gets all and they nothing. Gains are divided
/// out. Torque offsets and coupled drives have no place in a DynamicModel; they are in `terms`.
[[nodiscard]] ConsistentModel consistent_model(const Identification& identification,
                                               const ConsistentOptions& options = {});

/// Of all bodies that can exist, the one that costs least: (x - target)' information (x - target)
/// plus the same prior, a Bregman divergence from `prior`. `target`, `information`: inertial
/// parameters in the order of InertialParameters::vector() and the inverse of their covariance. A
/// prior that no body has is moved to the nearest one (eigenvalues of its pseudo-inertia); throws
/// bad_request where it has no mass.
[[nodiscard]] InertialParameters consistent_body(const InertialParameters& target,
                                                 const Matrix10d& information,
                                                 const InertialParameters& prior,
                                                 const ConsistentOptions& options = {});

}  // namespace kinescope
