// SPDX-License-Identifier: Apache-2.0
//
// What the model's own parameters can do to the rows, as a basis. Where hundreds of columns are
// freed of it the inverse normal matrix would lose too many digits: directions that the data hardly
// show come out of it wrong by as much as they are large.
#pragma once

#include "calib/trace/normal_system.h"
#include "kinematics/core/dense_algebra.h"

namespace kinescope::trace {

class OwnSpace {
 public:
  explicit OwnSpace(const NormalSystem& system);

  [[nodiscard]] const Eigen::MatrixXd& basis() const { return basis_; }  ///< rows x directions
  /// Coordinates of the least squares fit (with the priors) to rows whose products with the basis
  /// are `products`.
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& products) const {
    return factor_.solve(products);
  }

 private:
  Eigen::MatrixXd basis_;
  CholeskyFactor factor_;
};

}  // namespace kinescope::trace
