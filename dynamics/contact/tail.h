// SPDX-License-Identifier: Apache-2.0
//
// How often a statistic passes a level that it passed rarely or never in the record: the tail above
// a high level as a generalised Pareto distribution. Pickands 1975; parameters by L-moments,
// Hosking and Wallis 1987.
#pragma once

#include <vector>

namespace kinescope {

inline constexpr double kSecondsPerHour = 3600.0;

/// Exceedances come in clusters; a cluster counts once, with its peak.
struct TailFit {
  double level = 0.0;        ///< above it the tail is fitted
  double rate_per_s = 0.0;   ///< of clusters above the level
  double mean_excess = 0.0;  ///< of the clusters' peaks above the level
  double own_shape = 0.0;    ///< as estimated, of any sign
  double scale = 0.0;
  /// Not negative: the record must not be taken for the worst that can happen. Larger by 1 / peaks
  /// than the estimate, which is the predictive distribution of an exponential tail whose scale was
  /// estimated from so many peaks.
  double shape = 0.0;
  int peaks = 0;            ///< clusters in the record
  double exposure_s = 0.0;  ///< length of the record

  /// Takes a shape that was found elsewhere (from several tails of one kind together), as if it had
  /// been estimated here.
  void set_shape(double shape);
  /// The value passed by `rate_per_s` clusters.
  [[nodiscard]] double quantile(double rate_per_s) const;
  /// Clusters per s that pass the value (at least `level`).
  [[nodiscard]] double rate_above(double value) const;
};

/// A statistic over time; values of one stretch are consecutive, NaN separates stretches and does
/// not count.
struct StatisticRecord {
  std::vector<double> values;
  double step_s = 0.0;
  double cluster_gap_s = 0.05;  ///< exceedances that are further apart are two clusters
  int fewest_peaks = 10;        ///< refused below; fewer mean a larger TailFit::shape
};

/// The highest level with 100 peaks, at least the upper half of the values. Throws undetermined
/// where there are too few.
[[nodiscard]] TailFit fit_tail(const StatisticRecord& record);

}  // namespace kinescope
