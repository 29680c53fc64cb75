// SPDX-License-Identifier: Apache-2.0
//
// Takes   a way to fit a model on some samples and predict others.
// Gives   BandFactors: widths of 90 and 95 % bands in sigmas; SigmaParts: a sigma that holds.
// Units   those of the samples; rows are samples, columns joints.
// Method  a model's sigma assumes that noise is white and normal and that the model lacks nothing;
//         on robots neither is so. Widths are quantiles of residuals on motion that was left out of
//         the fit: whole trajectories, or blocks with a gap (cross-conformal prediction, Vovk 2015;
//         Barber, Candes, Ramdas, Tibshirani 2021), studentised by a sigma whose parts are those of
//         the largest predictive likelihood there. Everything is estimated anew in every fold:
//         hyperparameters of all samples know the motion that is left out, and its residuals come
//         out too small (tests/experiments/torque_bands).
// Not here: the fits (torque_model.h), how motion is left out (dynamics/data/splits.h).
#pragma once

#include <functional>
#include <optional>

#include "dynamics/data/torque_samples.h"
#include "dynamics/identify/prediction.h"

namespace kinescope {

/// Half-widths of predictive bands in predicted sigmas, one a joint. Empty: the normal
/// distribution's.
struct BandFactors {
  Eigen::VectorXd of_90;
  Eigen::VectorXd of_95;
  int folds = 0;               ///< that they come from
  bool by_trajectory = false;  ///< else blocks, with motion learned from on both sides
  /// Residuals that they come from, one a joint; 0: too few, and the normal distribution's.
  Eigen::VectorXi residuals = {};
  /// Residuals without a finite sigma, which say nothing about its widths; one a joint.
  Eigen::VectorXi skipped = {};
  /// Largest model_sigma among the residuals: a model that doubts itself more than that is judged
  /// by what it never was, and its band is extrapolated. One a joint; empty: not known.
  Eigen::VectorXd seen_sigma = {};

  [[nodiscard]] double width_90(Eigen::Index joint) const;
  [[nodiscard]] double width_95(Eigen::Index joint) const;
};

/// Fits the model on some samples and predicts others.
using FoldPredictor =
    std::function<TorquePrediction(const TorqueSamples& train, const TorqueSamples& test)>;

/// What models said about motion that they had not seen.
struct LeftOutTorques {
  Eigen::MatrixXd residual;
  Eigen::MatrixXd model_sigma;
  Eigen::MatrixXd sigma;
  Eigen::MatrixXd torque;             ///< measured
  Eigen::MatrixXd constant_residual;  ///< of the mean of what was learned from
  Eigen::VectorXi fold;               ///< of each row
  int folds = 0;
  bool by_trajectory = false;  ///< the folds are whole trajectories, not blocks
};

/// At most `folds` fits (dynamics/data/splits.h), and about `most_rows` predictions evenly spread
/// over the samples; 0: all. Nothing where there are too few samples for two folds, or for a fit.
/// `threads`: folds side by side, 0 all of the machine; never changes a result.
[[nodiscard]] std::optional<LeftOutTorques> leave_folds_out(const TorqueSamples& samples, int folds,
                                                            Eigen::Index most_rows,
                                                            const FoldPredictor& predict,
                                                            int threads = 1);

/// Quantiles of |residual| / sigma where sigma is finite. Each is widened by what it is in doubt
/// itself, as Student's t is by the doubt of a sigma: its logarithm's variance by the jackknife
/// over folds (Shao and Wu 1989: groups, not single values, for quantiles) stands for 1 / (2
/// degrees of freedom).
[[nodiscard]] BandFactors bands_of(const LeftOutTorques& left);

/// bands_of(leave_folds_out()); the normal distribution's where that gives nothing.
[[nodiscard]] BandFactors cross_validated_bands(const TorqueSamples& samples, int folds,
                                                const FoldPredictor& predict);

/// sigma^2 = model_factor^2 model_sigma^2 + noise_sigma^2, one entry a joint. Where a model errs
/// coherently (coloured noise, what it lacks), its own noise is too small a part and its doubt
/// about the function grows otherwise than its error does.
struct SigmaParts {
  Eigen::VectorXd model_factor;
  Eigen::VectorXd noise_sigma;
};

/// Those of the largest normal predictive likelihood of residuals on motion left out (Gneiting and
/// Raftery 2007, the logarithmic score), the common scale profiled out.
[[nodiscard]] SigmaParts sigma_parts_of(const LeftOutTorques& left);

/// The parts, and the bands of a sigma of these parts: with a fold left out the parts are others,
/// too, and so the jackknife finds them anew.
struct CalibratedSigma {
  SigmaParts parts;
  BandFactors bands;
};
[[nodiscard]] CalibratedSigma calibrate(const LeftOutTorques& left);

/// The same mean with a sigma of these parts.
[[nodiscard]] TorquePrediction with_sigma_parts(TorquePrediction prediction,
                                                const SigmaParts& parts);

}  // namespace kinescope
