// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/choose_sightings.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/median.h"

namespace kinescope::bundle {
namespace {

// Neighbours in time on either side that a sighting is compared with.
constexpr int kNeighbours = 3;
// A sighting's difference to the median of 2 x 3 neighbours has 1 + pi / 12 of the noise's
// variance.
constexpr double kDifferenceVariance = 1.26;

std::size_t path_length(const Spec& spec, const Sighting& sighting) {
  const Marker& marker = spec.tree.markers[static_cast<std::size_t>(sighting.marker)];
  return spec.path[marker.link.index()].size();
}

// Squared distance, per row, of a sighting's residual to the median of its neighbours'.
double stands_out(const std::vector<Eigen::VectorXd>& series, std::size_t at) {
  const std::size_t first = at < kNeighbours ? 0 : at - kNeighbours;
  const std::size_t last = std::min(series.size() - 1, at + kNeighbours);
  const Eigen::VectorXd& own = series[at];
  double sum = 0.0;
  for (Eigen::Index row = 0; row < own.size(); ++row) {
    std::vector<double> others;
    for (std::size_t i = first; i <= last; ++i) {
      if (i != at && series[i].size() == own.size()) others.push_back(series[i][row]);
    }
    if (others.empty()) return 0.0;
    const double difference = own[row] - median_of(std::move(others));
    sum += difference * difference;
  }
  return sum / static_cast<double>(own.size()) / kDifferenceVariance;
}

// Marks runs that are far beyond whatever else their marker does, and end again: something covered
// it, or it was taken for another one. Neighbours in such a run agree with each other. What lasts
// to an end of the recording may be a slip.
std::vector<bool> far_runs(const std::vector<Eigen::VectorXd>& series) {
  constexpr double kUsual = 0.95;  // of the sightings are no such run
  constexpr double kFar = 30.0;    // times as far as those
  std::vector<double> rms;
  for (const Eigen::VectorXd& residual : series) {
    rms.push_back(residual.norm() / std::sqrt(static_cast<double>(residual.size())));
  }
  std::vector<double> sorted = rms;
  const auto usual =
      sorted.begin() + static_cast<std::ptrdiff_t>(kUsual * static_cast<double>(sorted.size() - 1));
  std::ranges::nth_element(sorted, usual);
  std::vector<bool> out(series.size(), false);
  for (std::size_t first = 0; first < rms.size(); ++first) {
    if (rms[first] <= kFar * *usual) continue;
    std::size_t end = first;
    while (end < rms.size() && rms[end] > kFar * *usual) ++end;
    if (first > 0 && end < rms.size()) {
      std::fill(out.begin() + static_cast<std::ptrdiff_t>(first),
                out.begin() + static_cast<std::ptrdiff_t>(end), true);
    }
    first = end;
  }
  return out;
}

// Corners are off by this much in ways that repeat with the view.
constexpr double kCornerBias = 0.02;  // px

// What no pose of the marker explains of its residual and what stays the same over the sightings,
// root mean square over such rows: the marker may have slipped, the camera may have been bumped,
// but neither bends a square.
double lasting_bend(const std::vector<SightingError>& errors) {
  const Eigen::Index rows = errors.front().residual.size();
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(rows);
  for (const SightingError& error : errors) {
    if (error.residual.size() != rows) continue;
    const Eigen::Matrix<double, Eigen::Dynamic, 6>& J = error.d_marker;
    const Matrix6d normal = J.transpose() * J;
    const Vector6d right = J.transpose() * error.residual;
    sum += error.residual - J * solve_symmetric(normal, right);
  }
  const double freedom = std::max(1.0, static_cast<double>(rows) - 6.0);
  return sum.norm() / static_cast<double>(errors.size()) / std::sqrt(freedom);
}

// Multiplies a sighting's sigma.
void widen(Sighting& sighting, double factor) {
  sighting.sigma *= factor;
  sighting.whitening /= factor;
}

}  // namespace

ChosenSightings choose_by_neighbours(Spec& spec, const State& state, const std::vector<int>& usable,
                                     double reject_sigma) {
  const Readings readings(spec, state);
  std::map<int, std::vector<int>> of_marker;
  std::map<int, std::vector<Eigen::VectorXd>> residuals;
  std::map<int, std::vector<SightingError>> errors;
  for (const int index : usable) {
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(index)];
    const auto error = error_of(spec, state, readings, sighting);
    if (!error || !error->residual.allFinite()) continue;
    of_marker[sighting.marker].push_back(index);
    residuals[sighting.marker].push_back(error->residual);
    if (path_length(spec, sighting) == 0) errors[sighting.marker].push_back(*error);
  }
  ChosenSightings out;
  for (const auto& [marker, indices] : of_marker) {
    std::vector<double> distance;
    for (std::size_t i = 0; i < indices.size(); ++i) {
      distance.push_back(stands_out(residuals[marker], i));
    }
    const std::vector<bool> far = far_runs(residuals[marker]);
    const double typical = std::max(median_of(distance), 1e-12);
    const Sighting& first = spec.sightings[static_cast<std::size_t>(indices.front())];
    double bias = first.kind == MeasurementKind::kCorners ? kCornerBias / first.sigma : 0.0;
    // A marker at rest repeats its bias in every frame: all of them together say what one does.
    const bool rests = path_length(spec, first) == 0;
    if (rests) {
      const double seen = lasting_bend(errors[marker]);
      out.bias_px = std::max(out.bias_px, seen * first.sigma);
      bias = std::max(bias, seen) * std::sqrt(static_cast<double>(indices.size()));
    }
    for (std::size_t i = 0; i < indices.size(); ++i) {
      Sighting& sighting = spec.sightings[static_cast<std::size_t>(indices[i])];
      const double freedom = sighting.dimension();
      // Median and scatter of a mean of `freedom` squares, to first order.
      const double noise = typical / (1.0 - 2.0 / (9.0 * freedom));
      widen(sighting, std::sqrt(noise + bias * bias));
      if (!far[i] && distance[i] < noise * (1.0 + reject_sigma * std::sqrt(2.0 / freedom))) {
        out.used.push_back(indices[i]);
      }
    }
  }
  std::ranges::sort(out.used);
  return out;
}

}  // namespace kinescope::bundle
