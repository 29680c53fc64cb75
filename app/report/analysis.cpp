// SPDX-License-Identifier: Apache-2.0
#include "app/report/analysis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "app/report/prediction.h"
#include "calib/camera/marker_set.h"
#include "kinematics/core/mean_step.h"

namespace kinescope::report {
namespace {

constexpr int kDependenceBins = 10;
constexpr int kMinPerBin = 5;
constexpr int kFewestGroups = 3;
constexpr std::array<int, 2> kCoverageGrid = {8, 6};

/// Mean time from one frame to the next, s; 0 where there is one frame or none.
double frame_interval(const std::vector<double>& times_s) {
  return times_s.size() < 2 ? 0.0 : mean_step_s(times_s);
}

/// Frames that count as one because their residuals are alike.
double frames_alike(const Calibration& calibration) {
  const double interval = frame_interval(calibration.times_s);
  if (interval <= 0.0) return 1.0;
  return std::max(1.0, calibration.correlation_time_s / interval);
}

double percentile(const std::vector<double>& sorted, double fraction) {
  const double place = fraction * static_cast<double>(sorted.size() - 1);
  const auto low = static_cast<std::size_t>(place);
  const std::size_t high = std::min(low + 1, sorted.size() - 1);
  return sorted[low] + (place - static_cast<double>(low)) * (sorted[high] - sorted[low]);
}

void add_corners(const RunSummary& run, Analysis& analysis) {
  const Predictor predictor(run.calibration);
  for (const SightingResidual& sighting : run.calibration.residuals) {
    if (!sighting.used || sighting.corners_px.empty()) continue;
    const auto found = std::ranges::find(analysis.markers, sighting.id);
    const std::vector<Eigen::Vector2d> predicted = predictor.corners(sighting);
    if (predicted.size() != sighting.corners_px.size()) continue;
    for (std::size_t k = 0; k < predicted.size(); ++k) {
      analysis.corners.push_back(
          {.frame = sighting.frame,
           .marker = static_cast<std::size_t>(found - analysis.markers.begin()),
           .pixel = predicted[k] + sighting.corners_px[k],
           .residual = sighting.corners_px[k],
           .camera = run.calibration.camera_at(sighting.frame)});
    }
  }
}

/// Sums of one frame's least squares: error = numerator / denominator.
struct FrameSum {
  double numerator = 0.0;
  double denominator = 0.0;
};

std::vector<JointError> joint_error_series(const Calibration& calibration,
                                           const Predictor& predictor, std::size_t joint) {
  std::map<int, FrameSum> sums;
  for (const SightingResidual& sighting : calibration.residuals) {
    if (!sighting.used) continue;
    const std::vector<ResidualAndRate> rates = predictor.rates(sighting, joint);
    FrameSum& sum = sums[sighting.frame];
    for (const ResidualAndRate& one : rates) {
      sum.numerator += one.residual * one.rate;
      sum.denominator += one.rate * one.rate;
    }
  }
  double largest = 0.0;
  for (const auto& [frame, sum] : sums) largest = std::max(largest, sum.denominator);
  // Frames in which the joint hardly moves anything in view would only add noise.
  constexpr double kLeastLever = 0.04;
  std::vector<JointError> series;
  for (const auto& [frame, sum] : sums) {
    if (sum.denominator <= kLeastLever * largest || largest <= 0.0) continue;
    const double value = calibration.joint_values(frame, static_cast<Eigen::Index>(joint));
    if (!std::isfinite(value)) continue;
    series.push_back({.frame = frame, .value = value, .error = sum.numerator / sum.denominator});
  }
  return series;
}

double half_range_of_means(const std::vector<Bin>& bins) {
  if (bins.empty()) return 0.0;
  const auto [low, high] = std::ranges::minmax(bins, {}, &Bin::mean);
  return 0.5 * (high.mean - low.mean);
}

void add_joint_dependence(const RunSummary& run, Analysis& analysis) {
  const Calibration& calibration = run.calibration;
  const Predictor predictor(calibration);
  analysis.joint_errors.resize(calibration.tree.joints.size());
  for (std::size_t j = 0; j < calibration.tree.joints.size(); ++j) {
    const Joint& joint = calibration.tree.joints[j];
    // A joint without a channel has its values from the same images: nothing is left along its
    // motion.
    if (joint.type == JointType::kFixed || joint.channel.empty()) continue;
    analysis.joint_errors[j] = joint_error_series(calibration, predictor, j);
    std::vector<std::pair<double, double>> pairs;
    for (const JointError& one : analysis.joint_errors[j]) pairs.emplace_back(one.value, one.error);
    const std::optional<double> share = share_of_value(pairs, kDependenceBins);
    if (!share) continue;
    analysis.dependence.push_back(
        {.on = joint.name,
         .joint = static_cast<int>(j),
         .explained = *share,
         .half_range = half_range_of_means(quantile_bins(pairs, kDependenceBins)),
         .frames = static_cast<int>(pairs.size())});
  }
}

/// The residual components of every marker over time, one series a marker and component.
std::map<std::pair<TagId, int>, std::vector<std::pair<double, double>>> time_series(
    const Calibration& calibration) {
  std::map<std::pair<TagId, int>, std::vector<std::pair<double, double>>> series;
  for (const SightingResidual& sighting : calibration.residuals) {
    if (!sighting.used) continue;
    const double time = calibration.times_s.at(static_cast<std::size_t>(sighting.frame));
    if (calibration.kind == MeasurementKind::kCorners) {
      if (sighting.corners_px.empty()) continue;
      Eigen::Vector2d mean = Eigen::Vector2d::Zero();
      for (const Eigen::Vector2d& corner : sighting.corners_px) mean += corner;
      mean /= static_cast<double>(sighting.corners_px.size());
      series[{sighting.id, 0}].emplace_back(time, mean.x());
      series[{sighting.id, 1}].emplace_back(time, mean.y());
    } else {
      for (int k = 0; k < 3; ++k) {
        series[{sighting.id, k}].emplace_back(time, sighting.displacement(3 + k));
      }
    }
  }
  return series;
}

void add_time_dependence(const RunSummary& run, Analysis& analysis) {
  double weight = 0.0, share = 0.0, half_range = 0.0;
  int frames = 0;
  for (const auto& [key, pairs] : time_series(run.calibration)) {
    const std::optional<double> one = share_of_time(pairs, kDependenceBins);
    if (!one) continue;
    double squares = 0.0;
    for (const auto& [time, residual] : pairs) squares += residual * residual;
    weight += squares;
    share += *one * squares;
    half_range = std::max(half_range, half_range_of_means(quantile_bins(pairs, kDependenceBins)));
    frames = std::max(frames, static_cast<int>(pairs.size()));
  }
  if (weight <= 0.0) return;
  analysis.dependence.push_back({.on = "time",
                                 .time = true,
                                 .explained = share / weight,
                                 .half_range = half_range,
                                 .frames = frames});
}

void add_components(const RunSummary& run, Analysis& analysis) {
  double squares = 0.0;
  for (const SightingResidual& sighting : run.calibration.residuals) {
    if (!sighting.used) continue;
    for (const double component : residual_components(run.calibration.kind, sighting)) {
      analysis.components.push_back(component);
      squares += component * component;
    }
  }
  if (analysis.components.empty()) return;
  const auto count = static_cast<double>(analysis.components.size());
  analysis.component_rms = std::sqrt(squares / count);
  const auto outside = std::ranges::count_if(analysis.components, [&](double component) {
    return std::abs(component) > 2.0 * analysis.component_rms;
  });
  analysis.outside_two_sigma = static_cast<double>(outside) / count;
}

double image_coverage(const Analysis& analysis, const CameraModel& camera) {
  if (camera.width <= 0 || camera.height <= 0) return 0.0;
  std::set<std::pair<int, int>> cells;
  for (const CornerPoint& corner : analysis.corners) {
    const int column = static_cast<int>(corner.pixel.x() / camera.width * kCoverageGrid[0]);
    const int row = static_cast<int>(corner.pixel.y() / camera.height * kCoverageGrid[1]);
    if (column >= 0 && column < kCoverageGrid[0] && row >= 0 && row < kCoverageGrid[1]) {
      cells.emplace(column, row);
    }
  }
  return static_cast<double>(cells.size()) / (kCoverageGrid[0] * kCoverageGrid[1]);
}

/// Samples sorted into groups of equal count by their first; how much of the second's variance the
/// groups carry.
class Binning {
 public:
  Binning(const std::vector<std::pair<double, double>>& pairs, int bins) : pairs_(pairs) {
    std::vector<std::size_t> order(pairs.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return pairs[i].first; });
    groups_ = std::min(bins, static_cast<int>(pairs.size()) / kMinPerBin);
    group_.resize(pairs.size());
    for (std::size_t rank = 0; rank < order.size() && groups_ > 0; ++rank) {
      group_[order[rank]] = rank * static_cast<std::size_t>(groups_) / order.size();
    }
  }

  [[nodiscard]] int groups() const { return groups_; }

  /// Share of the variance between the groups when sample i + shift is put in the place of sample
  /// i.
  [[nodiscard]] double explained(std::size_t shift) const {
    const std::vector<double> means = group_means(shift);
    double mean = 0.0, total = 0.0, within = 0.0;
    for (const auto& [variable, value] : pairs_) mean += value;
    mean /= static_cast<double>(pairs_.size());
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      const double value = pairs_[(i + shift) % pairs_.size()].second;
      total += (value - mean) * (value - mean);
      within += (value - means[group_[i]]) * (value - means[group_[i]]);
    }
    return total > 0.0 ? 1.0 - within / total : 0.0;
  }

  /// What the groups leave, in the order of the pairs.
  [[nodiscard]] std::vector<double> left() const {
    const std::vector<double> means = group_means(0);
    std::vector<double> rest;
    for (std::size_t i = 0; i < pairs_.size() && groups_ > 0; ++i) {
      rest.push_back(pairs_[i].second - means[group_[i]]);
    }
    return rest;
  }

 private:
  [[nodiscard]] std::vector<double> group_means(std::size_t shift) const {
    std::vector<double> sums(static_cast<std::size_t>(std::max(1, groups_)), 0.0);
    std::vector<double> counts(sums.size(), 0.0);
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      sums[group_[i]] += pairs_[(i + shift) % pairs_.size()].second;
      counts[group_[i]] += 1.0;
    }
    for (std::size_t g = 0; g < sums.size(); ++g) sums[g] /= std::max(1.0, counts[g]);
    return sums;
  }

  const std::vector<std::pair<double, double>>& pairs_;
  std::vector<std::size_t> group_;
  int groups_ = 0;
};

/// Samples that count as one: 1 + 2 sum of the autocorrelation up to its first value that is not
/// positive.
double correlation_length(const std::vector<double>& series) {
  double variance = 0.0;
  for (const double value : series) variance += value * value;
  if (variance <= 0.0) return 1.0;
  double length = 1.0;
  for (std::size_t lag = 1; lag < series.size() / 2; ++lag) {
    double product = 0.0;
    for (std::size_t i = lag; i < series.size(); ++i) product += series[i] * series[i - lag];
    if (product <= 0.0) break;
    length += 2.0 * product / variance;
  }
  return length;
}

}  // namespace

std::vector<Bin> quantile_bins(std::vector<std::pair<double, double>> pairs, int bins) {
  std::erase_if(pairs, [](const auto& pair) {
    return !std::isfinite(pair.first) || !std::isfinite(pair.second);
  });
  std::ranges::sort(pairs);
  const int count = static_cast<int>(pairs.size());
  const int used = std::min(bins, count / kMinPerBin);
  std::vector<Bin> result;
  for (int b = 0; b < used; ++b) {
    const auto from = static_cast<std::size_t>(static_cast<long>(count) * b / used);
    const auto to = static_cast<std::size_t>(static_cast<long>(count) * (b + 1) / used);
    Bin bin;
    std::vector<double> values;
    for (std::size_t i = from; i < to; ++i) {
      bin.centre += pairs[i].first;
      bin.mean += pairs[i].second;
      values.push_back(pairs[i].second);
    }
    std::ranges::sort(values);
    bin.count = static_cast<int>(values.size());
    bin.centre /= bin.count;
    bin.mean /= bin.count;
    bin.low = percentile(values, 0.16);
    bin.median = percentile(values, 0.50);
    bin.high = percentile(values, 0.84);
    result.push_back(bin);
  }
  return result;
}

std::optional<double> share_of_value(const std::vector<std::pair<double, double>>& pairs,
                                     int bins) {
  const Binning binning(pairs, bins);
  if (binning.groups() < kFewestGroups) return std::nullopt;
  constexpr int kShifts = 24;
  const auto count = static_cast<int>(pairs.size());
  double chance = 0.0;
  for (int k = 1; k <= kShifts; ++k) {
    chance += binning.explained(static_cast<std::size_t>(count) * static_cast<std::size_t>(k) /
                                (kShifts + 1)) /
              kShifts;
  }
  if (chance >= 1.0) return 0.0;
  return std::clamp((binning.explained(0) - chance) / (1.0 - chance), 0.0, 1.0);
}

std::optional<double> share_of_time(const std::vector<std::pair<double, double>>& pairs, int bins) {
  const Binning binning(pairs, bins);
  const double groups = binning.groups();
  const double independent = static_cast<double>(pairs.size()) / correlation_length(binning.left());
  if (groups < kFewestGroups || independent <= 2.0 * groups) return std::nullopt;
  // Adjusted coefficient of determination at the effective sample size.
  const double share =
      1.0 - (1.0 - binning.explained(0)) * (independent - 1.0) / (independent - groups);
  return std::clamp(share, 0.0, 1.0);
}

std::vector<double> residual_components(MeasurementKind kind, const SightingResidual& sighting) {
  std::vector<double> components;
  if (kind == MeasurementKind::kCorners) {
    for (const Eigen::Vector2d& corner : sighting.corners_px) {
      components.push_back(corner.x());
      components.push_back(corner.y());
    }
  } else {
    for (int k = 3; k < 6; ++k) components.push_back(sighting.displacement(k));
  }
  return components;
}

namespace {

// Axes that are held as drawn are not known the better for it.
bool is_geometry_free(const RunSummary& run) {
  const auto level = std::ranges::find_if(run.levels, &FreedomLevel::exported);
  return level == run.levels.end() || level->free == FreeGeometry::kGeometry;
}

}  // namespace

Analysis analyse(const RunSummary& run) {
  Analysis analysis;
  std::set<TagId> seen;
  for (const SightingResidual& sighting : run.calibration.residuals) seen.insert(sighting.id);
  analysis.markers.assign(seen.begin(), seen.end());
  if (run.calibration.kind == MeasurementKind::kCorners) add_corners(run, analysis);
  add_components(run, analysis);
  add_joint_dependence(run, analysis);
  add_time_dependence(run, analysis);
  std::ranges::stable_sort(analysis.dependence, std::greater{}, &Dependence::explained);
  analysis.image_coverage = image_coverage(analysis, run.calibration.camera);
  if (run.calibration.status == CalibrationStatus::kConverged && is_geometry_free(run))
    analysis.tip = tip_uncertainty(run.calibration);
  std::set<int> frames;
  for (const SightingResidual& sighting : run.calibration.residuals) frames.insert(sighting.frame);
  analysis.independent_frames = static_cast<int>(
      std::lround(static_cast<double>(frames.size()) / frames_alike(run.calibration)));
  return analysis;
}

}  // namespace kinescope::report
