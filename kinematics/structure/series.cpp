// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/series.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/median.h"
#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

// Averaging stays within this much motion (rad; m at 1 m), so that the path is straight to its
// noise.
constexpr double kAverageSpan = 0.06;

// Largest motion (rad + m) from one frame to the next that all but one in twenty steps stay below.
double fast_step(const Series& series) {
  double fastest = 0.0;
  for (const Body& body : series.bodies) {
    std::vector<double> steps;
    for (std::size_t f = 4; f < body.at.size(); f += 4) {
      if (!body.at[f].seen || !body.at[f - 4].seen) continue;
      steps.push_back(fast_log(body.at[f - 4].pose.inverse() * body.at[f].pose).norm() / 4.0);
    }
    if (steps.size() < 10) continue;
    std::ranges::sort(steps);
    fastest = std::max(fastest, steps[steps.size() * 19 / 20]);
  }
  return fastest;
}

// The branch of a sighting that agrees with another pose, seen from there, and its cost.
struct Agreeing {
  Vector6d away;
  double cost = 0.0;
};

Agreeing agreeing_branch(const Sighting& sighting, const Branch& with, const Pose& inverse) {
  Agreeing out{fast_log(inverse * sighting.pose), 0.0};
  if (!sighting.alternative) return out;
  const Vector6d other = fast_log(inverse * sighting.alternative->pose);
  const double gain = (with.whitening * out.away).squaredNorm() -
                      (with.whitening * other).squaredNorm() - sighting.alternative_cost;
  if (gain > 0.0) out = {other, sighting.alternative_cost};
  return out;
}

// The mean of the branches about a frame that agree with one of its own; what they cost together
// is added to `cost`.
Branch mean_branch(const Body& body, int f, int half_width, const Branch& own, double& cost) {
  const Pose inverse = own.pose.inverse();
  Vector6d sum = Vector6d::Zero();
  int count = 1;
  for (int d = 1; d <= half_width; ++d) {
    if (f - d < 0 || f + d >= static_cast<int>(body.at.size())) continue;
    const Sighting& before = body.at[static_cast<std::size_t>(f - d)];
    const Sighting& after = body.at[static_cast<std::size_t>(f + d)];
    if (!before.seen || !after.seen) continue;
    const Agreeing a = agreeing_branch(before, own, inverse);
    const Agreeing b = agreeing_branch(after, own, inverse);
    sum += a.away + b.away;
    cost += a.cost + b.cost;
    count += 2;
  }
  return {own.pose * exp_pose(sum / count), own.covariance / count,
          own.whitening * std::sqrt(static_cast<double>(count))};
}

// The mean of the sightings symmetric about a frame, at that frame's time.
Sighting averaged(const Body& body, int f, int half_width) {
  const Sighting& own = body.at[static_cast<std::size_t>(f)];
  Sighting out = own;
  if (!own.seen || half_width == 0) return out;
  double cost = 0.0;
  static_cast<Branch&>(out) = mean_branch(body, f, half_width, own, cost);
  if (!own.alternative) return out;
  double other = own.alternative_cost;
  out.alternative = mean_branch(body, f, half_width, *own.alternative, other);
  out.alternative_cost = other - cost;
  return out;
}

}  // namespace

void count_seen(Series& series) {
  for (Body& body : series.bodies) {
    body.seen = static_cast<int>(std::ranges::count_if(body.at, &Sighting::seen));
  }
}

double distance_of(std::span<const Body> bodies) {
  std::vector<double> distances;
  for (const Body& body : bodies) {
    for (const Sighting& s : body.at) {
      if (s.seen) distances.push_back(s.pose.translation.norm());
    }
  }
  return median_of(std::move(distances));
}

Matrix6d whitening_of(const Matrix6d& covariance) {
  // covariance = U U' with U upper triangular, from the last row up; W = U^-1.
  Matrix6d U = Matrix6d::Zero();
  Matrix6d W = Matrix6d::Zero();
  for (int j = 5; j >= 0; --j) {
    double squared = covariance(j, j);
    for (int k = j + 1; k < 6; ++k) squared -= U(j, k) * U(j, k);
    if (!(squared > 0.0)) {
      return covariance.diagonal()
          .cwiseMax(kNoiseFloor * kNoiseFloor)
          .cwiseSqrt()
          .cwiseInverse()
          .asDiagonal();
    }
    const double inverse = 1.0 / std::sqrt(squared);
    U(j, j) = squared * inverse;
    W(j, j) = inverse;
    for (int i = 0; i < j; ++i) {
      double sum = covariance(i, j);
      for (int k = j + 1; k < 6; ++k) sum -= U(i, k) * U(j, k);
      U(i, j) = sum * inverse;
    }
  }
  for (int j = 1; j < 6; ++j) {
    for (int i = j - 1; i >= 0; --i) {
      double sum = 0.0;
      for (int k = i + 1; k <= j; ++k) sum += U(i, k) * W(k, j);
      W(i, j) = -sum * W(i, i);
    }
  }
  return W;
}

Series thinned(const Series& full, int max_instants) {
  const int stride = std::max(1, (full.size() + max_instants - 1) / max_instants);
  Series out;
  out.smooth = full.smooth;
  if (full.smooth && stride > 1) {
    const double step = fast_step(full);
    const int allowed = step > 0.0 ? static_cast<int>(kAverageSpan / step) : stride;
    out.half_width = std::min(stride / 2, allowed / 2);
  }
  for (int f = stride / 2; f < full.size(); f += stride) {
    out.frames.push_back(full.frames[static_cast<std::size_t>(f)]);
    out.times_s.push_back(full.times_s[static_cast<std::size_t>(f)]);
  }
  for (const Body& body : full.bodies) {
    Body& thin = out.bodies.emplace_back();
    thin.id = body.id;
    thin.noise_scale = body.noise_scale;
    for (const int f : out.frames) thin.at.push_back(averaged(body, f, out.half_width));
  }
  count_seen(out);
  return out;
}

}  // namespace kinescope::structure_search
