// SPDX-License-Identifier: Apache-2.0
//
// Takes   rows of a linearised bundle and the information of priors.
// Gives   rows of the covariance. Corrections that bear on a few frames each (where in its step an
//         encoder stands), of which there may be thousands, are eliminated (Schur complement).
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include "calib/bundle/linearise.h"

namespace kinescope::bundle {

/// Which parameters are corrections of a few frames, and which are others.
struct ParameterPlaces {
  std::vector<Eigen::Index> local;
  std::vector<Eigen::Index> other;
  std::vector<Eigen::Index> place;  ///< of every parameter among its own
  std::vector<bool> is_local;       ///< of every parameter
};

class Information {
 public:
  /// Keeps a reference to `places`.
  explicit Information(const ParameterPlaces& places);
  explicit Information(const ParameterPlaces&&) = delete;

  /// J'J.
  void add(const FrameRows& rows);
  /// Of those pairs of parameters of which `is_meant` is true.
  void add(const Eigen::SparseMatrix<double>& priors,
           const std::function<bool(Eigen::Index, Eigen::Index)>& is_meant);

  /// Of the other parameters, the local ones eliminated: other x other.
  [[nodiscard]] Eigen::MatrixXd reduced() const { return reduced_with_answer().information; }
  /// Of the other parameters, their rows of the covariance of all: other x all. Pseudo-inverse:
  /// directions that are no more than rounding of its eigenvalues are left out, and the parameters
  /// that they touch become true in `unseen` (one of each other parameter).
  [[nodiscard]] Eigen::MatrixXd covariance_rows(std::vector<bool>& unseen) const;

 private:
  struct Reduced {
    Eigen::MatrixXd information;
    Eigen::MatrixXd answer;  // local x other: how they follow the others
  };
  // Of the pairs i >= j.
  void add_lower(Eigen::Index i, Eigen::Index j, double value);
  [[nodiscard]] Reduced reduced_with_answer() const;

  const ParameterPlaces& places_;
  Eigen::MatrixXd other_;                      // lower half
  Eigen::MatrixXd beside_;                     // local x other
  std::vector<Eigen::Triplet<double>> local_;  // lower half
};

}  // namespace kinescope::bundle
