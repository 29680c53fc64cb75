// SPDX-License-Identifier: Apache-2.0
//
// Takes   a DynamicModel (kinematics, gravity; masses as a prior, if any) and TorqueSamples.
// Gives   Identification: base and drive parameters with covariance; for predictions and models.
// Frames  as in dynamics/rigid. Parameters are in the samples' unit of torque per SI.
// Method  IDIM-WLS (Gautier 1997), robust by reweighting; block jackknife (Künsch 1989).
// Not here: filtering and differentiation (dynamics/data), effects that are not linear, GPs.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dynamics/data/torque_samples.h"
#include "dynamics/identify/torque_terms.h"
#include "dynamics/identify/weighted_fit.h"
#include "dynamics/rigid/base_parameters.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

struct IdentifyOptions {
  DriveTerms drives = {};
  RobustLoss loss = RobustLoss::kHuber;
  /// A gain a joint: measured = gain * torque, for currents or doubtful drive constants.
  bool gains = false;
  /// Joint whose gain stays 1; -1: the one with the largest torque.
  int gain_reference = -1;
  /// Draws towards the model's own parameters where the data say nothing; relative to the data.
  double ridge = 1e-10;
  /// Length of a jackknife block in correlation times of the residuals.
  double block_correlations = 10.0;
  /// Shorter blocks rather than fewer.
  int fewest_blocks = 20;
  int max_iterations = 60;
};

enum class IdentifyStatus {
  kNotRun,
  kConverged,
  kIterationLimit  ///< parameters had not settled to 1e-5 of the noise
};

struct Identification {
  IdentifyStatus status = IdentifyStatus::kNotRun;
  DynamicModel prior;  ///< as given
  RigidModel rigid;    ///< its bodies
  DriveTerms drives;
  std::vector<TorqueTerm> terms;   ///< all, before regrouping
  ColumnBasis basis;               ///< of the terms
  std::vector<std::string> names;  ///< of the parameters, as formulas of the terms
  Eigen::VectorXd parameters;
  Eigen::MatrixXd covariance;         ///< block jackknife: noise coloured in time, common to joints
  Eigen::MatrixXd white_covariance;   ///< for noise that is white and independent
  Eigen::MatrixXd information;        ///< weighted normal matrix, scale 1 / sigma^2
  Eigen::VectorXd gains;              ///< one a joint, 1 unless asked for
  Eigen::VectorXd gain_sigma;         ///< 0 for those that were not estimated
  Eigen::VectorXd sigma;              ///< noise of each joint's torque
  Eigen::VectorXd fit_error_percent;  ///< normalised mean squared error on the samples used
  Eigen::VectorXi used;               ///< samples a joint
  Eigen::VectorXd down_weighted;      ///< share of them with less than half their weight
  std::vector<int> undetermined;      ///< parameters that no sample moves: infinite variance
  double condition = 0.0;             ///< of the scaled columns
  double correlation_samples = 1.0;   ///< of the residuals
  int blocks = 0;                     ///< of the jackknife; blocks - 1 degrees of freedom
  bool short_blocks = false;  ///< under three correlation times each: sigmas come out too small
  int iterations = 0;

  [[nodiscard]] double sigma_of(Eigen::Index parameter) const;
};

/// `weights`: samples x joints, 0 leaves a torque out, empty is 1 everywhere. Throws bad_request
/// for sizes that do not fit and numbers that are not finite where the weight is not 0;
/// undetermined for fewer torques than two a parameter, or fewer samples than blocks.
[[nodiscard]] Identification identify_dynamics(const DynamicModel& model,
                                               const TorqueSamples& samples,
                                               const IdentifyOptions& options = {},
                                               const Eigen::MatrixXd& weights = {});

}  // namespace kinescope
