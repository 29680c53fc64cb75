// SPDX-License-Identifier: Apache-2.0
//
// Mean and standard deviation of one speed's increment for a block of particles, and their
// pullback, which needs no further product of N^2 (Rasmussen and Williams 2006, eqs. 2.25, 2.26):
// with A = K + noise and W = K* A^-1, d variance / d K* = d k** / d K* - 2 W.
#pragma once

#include "dynamics/policy/gp_passes.h"
#include "dynamics/policy/triangle_product.h"

namespace kinescope::policy {

/// What the pullback needs of a prediction. Made once, used again without allocation.
struct PosteriorTape {
  PosteriorTape(Eigen::Index particles, Eigen::Index columns, Eigen::Index samples);
  Eigen::MatrixXd scaled;     ///< particles x D
  LaneMatrix smooth;          ///< particles x N
  LaneMatrix solved;          ///< particles x N: W
  Eigen::MatrixXd mean;       ///< particles x 1, of targets over target_scale
  Eigen::MatrixXd deviation;  ///< particles x 1
};

/// Workspace of one thread.
struct PosteriorScratch {
  PosteriorScratch(Eigen::Index particles, Eigen::Index columns, Eigen::Index linear,
                   Eigen::Index samples);
  LaneMatrix kernel;
  LaneMatrix rotated;
  Eigen::MatrixXd sums;
  Eigen::MatrixXd d_variance;
  Eigen::MatrixXd d_scaled;
};

class VelocityPosterior {
 public:
  /// Factors the samples' kernel matrix.
  VelocityPosterior(const VelocityProcess& process, const PhysicsFeatures* physics);

  [[nodiscard]] Eigen::Index samples() const { return product_.size(); }
  [[nodiscard]] Eigen::Index factors() const { return prepared_.factors; }
  [[nodiscard]] double target_scale() const { return target_scale_; }

  /// Mean and deviation of particles, rows a multiple of eight. `linear`: what the kernel's factors
  /// are linear in. `with_tape`: fills what the pullback needs.
  void predict(const ConstBlock& inputs, const ConstBlock& linear, bool with_tape,
               PosteriorTape& tape, PosteriorScratch& scratch) const;
  /// d_inputs += by the exponential part, d_linear = by the factors, given the pullback to mean and
  /// deviation (particles x 1 each).
  void pullback(const ConstBlock& linear, const PosteriorTape& tape, const ConstBlock& d_mean,
                const ConstBlock& d_deviation, PosteriorScratch& scratch, Block d_inputs,
                Block d_linear) const;

 private:
  void add_prior(const ConstBlock& linear, Block variance) const;
  void pull_back_prior(const ConstBlock& linear, const ConstBlock& d_variance,
                       Block d_linear) const;

  PreparedSamples prepared_;
  TriangleProduct product_;
  double target_scale_ = 1.0;
  std::vector<LinearFactor> factors_;
  double floor_ = 0.0;  // of the variance
};

}  // namespace kinescope::policy
