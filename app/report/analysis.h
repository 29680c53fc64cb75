// SPDX-License-Identifier: Apache-2.0
//
// Takes   a RunSummary.
// Gives   what the report derives from the residuals: where each corner lies in the image, what
// error of each joint
//         alone would explain each frame, how much of the residual follows a joint value or the
//         time.
// Method  error of a joint: the least-squares step of that joint over the sightings of one frame,
// from
//         the derivative of the prediction. Share of the residual that follows a variable:
//         explained variance over quantile bins, less what chance gives. Residuals are alike over
//         time, so chance is measured: for a joint value by shifting the residuals against it in
//         time, for the time itself from the correlation of what the bins leave.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "app/report/run_summary.h"
#include "app/report/tip_uncertainty.h"

namespace kinescope::report {

/// One used corner of the final model.
struct CornerPoint {
  int frame = 0;
  std::size_t marker = 0;    ///< index into the marker list of the analysis
  Eigen::Vector2d pixel;     ///< where it was seen
  Eigen::Vector2d residual;  ///< px
  std::size_t camera = 0;    ///< whose image it is in
};

/// What change of one joint alone would best explain one frame.
struct JointError {
  int frame = 0;
  double value = 0.0;  ///< of the joint, rad or m
  double error = 0.0;  ///< rad or m
};

/// How the residual follows one variable.
struct Dependence {
  std::string on;  ///< a joint's name, or "time"
  bool time = false;
  int joint = -1;           ///< of the tree; -1 for time
  double explained = 0.0;   ///< share of the residual's variance, chance taken off; 0 to 1
  double half_range = 0.0;  ///< of the binned mean: rad or m for a joint, px or m for time
  int frames = 0;
};

/// One bin of a residual over a variable: the middle half and two thirds of its values.
struct Bin {
  double centre = 0.0;
  double low = 0.0, median = 0.0, high = 0.0;  ///< 16, 50, 84 %
  double mean = 0.0;
  int count = 0;
};

struct Analysis {
  std::vector<TagId> markers;        ///< that have residuals, by id
  std::vector<CornerPoint> corners;  ///< empty for poses and points
  std::vector<std::vector<JointError>>
      joint_errors;                    ///< beside the tree's joints; empty for fixed ones
  std::vector<Dependence> dependence;  ///< largest share first
  std::vector<double> components;  ///< all used residual components (px; m for poses and points)
  double component_rms = 0.0;
  double outside_two_sigma = 0.0;  ///< fraction of the components beyond two of their rms
  double image_coverage = 0.0;     ///< fraction of an 8 x 6 grid over the image that holds a corner
  int independent_frames = 0;      ///< frames over the correlation time
  /// Nothing where there is none, the fit did not converge, or a nominal robot's axes are held.
  std::optional<TipUncertainty> tip;
};

/// Bins of (variable, value) pairs with equal counts. Fewer bins where the data are few.
[[nodiscard]] std::vector<Bin> quantile_bins(std::vector<std::pair<double, double>> pairs,
                                             int bins);

/// Pairs in the order of time: share of the variance of the second that follows the first. Chance
/// is the mean share over circular shifts of the second against the first, which keep the
/// correlation of both. Nothing when there are too few pairs. O(pairs log pairs).
[[nodiscard]] std::optional<double> share_of_value(
    const std::vector<std::pair<double, double>>& pairs, int bins);

/// The same where the first is the time. Chance is that of as many independent samples as the
/// correlation of what the bins leave allows.
[[nodiscard]] std::optional<double> share_of_time(
    const std::vector<std::pair<double, double>>& pairs, int bins);

/// The residual components of a sighting that a plot shows: px for corners (u and v of every
/// corner), m else.
[[nodiscard]] std::vector<double> residual_components(MeasurementKind kind,
                                                      const SightingResidual& sighting);

[[nodiscard]] Analysis analyse(const RunSummary& run);

}  // namespace kinescope::report
