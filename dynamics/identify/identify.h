// SPDX-License-Identifier: Apache-2.0
//
// Takes   a DynamicModel (kinematics, gravity; masses as a prior where there are any) and
// TorqueSamples. Gives   Identification: base parameters and drive parameters with covariance;
// predictions; a consistent model. Frames  as in dynamics/rigid. Torques in the unit of the
// samples; parameters are then in that unit per SI. Method  IDIM-WLS (Gautier 1997), robust by
// reweighting, covariance by a block jackknife (Künsch 1989);
//         consistent parameters: log-Cholesky (Rucker, Wensing 2022) with a Bregman prior (Lee et
//         al. 2020).
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
  /// A gain a joint: measured = gain * torque, for currents or doubtful drive constants. One
  /// joint's stays 1.
  bool gains = false;
  int gain_reference = -1;  ///< joint whose gain is 1; -1: the one with the largest torque
  /// Draw towards the model's own parameters, relative to what the data say: only for what they say
  /// nothing on.
  double ridge = 1e-10;
  double block_correlations =
      10.0;                ///< length of a jackknife block in correlation times of the residuals
  int fewest_blocks = 40;  ///< shorter blocks rather than fewer
  int max_iterations = 50;
};

enum class IdentifyStatus {
  kNotRun,
  kConverged,
  kIterationLimit  ///< the noise levels had not settled; parameters are usable, their sigmas less
                   ///< so
};

struct Identification {
  IdentifyStatus status = IdentifyStatus::kNotRun;
  DynamicModel prior;  ///< as given
  RigidModel rigid;    ///< its bodies
  DriveTerms drives = {};
  std::vector<TorqueTerm> terms;   ///< all, before regrouping
  ColumnBasis basis;               ///< of the terms
  std::vector<std::string> names;  ///< of the parameters, as formulas of the terms
  Eigen::VectorXd parameters;
  Eigen::MatrixXd covariance;         ///< block jackknife: noise coloured in time, common to joints
  Eigen::MatrixXd white_covariance;   ///< what it would be for noise that is white and independent
  Eigen::MatrixXd information;        ///< weighted normal matrix, inverse of white_covariance
  Eigen::VectorXd gains;              ///< one a joint, 1 unless asked for
  Eigen::VectorXd gain_sigma;         ///< 0 for those that were not estimated
  Eigen::VectorXd sigma;              ///< noise of each joint's torque
  Eigen::VectorXd fit_error_percent;  ///< normalised mean squared error on the samples used
  Eigen::VectorXi used;               ///< samples a joint
  Eigen::VectorXd down_weighted;      ///< share of them with less than half their weight
  std::vector<int> undetermined;  ///< parameters that no sample moves; their variance is infinite
  double condition = 0.0;         ///< of the scaled columns
  double correlation_samples = 1.0;  ///< of the residuals
  int blocks = 0;  ///< of the jackknife; sigmas have blocks - 1 degrees of freedom
  int iterations = 0;

  [[nodiscard]] double sigma_of(Eigen::Index parameter) const;
};

/// `weights`: samples x joints, 0 leaves a torque out, empty is 1 everywhere. Throws bad_request
/// for sizes that do not fit, numbers that are not finite where the weight is not 0; undetermined
/// for fewer torques than parameters or a log that is too short for blocks.
[[nodiscard]] Identification identify_dynamics(const DynamicModel& model,
                                               const TorqueSamples& samples,
                                               const IdentifyOptions& options = {},
                                               const Eigen::MatrixXd& weights = {});

}  // namespace kinescope
