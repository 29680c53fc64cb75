// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "kinematics/core/error.h"
#include "kinematics/core/median.h"
#include "kinematics/structure/residual_scale.h"
#include "kinematics/structure/series.h"
#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

// Frames looked at on either side of one when it is judged by its neighbours.
constexpr std::size_t kNeighbours = 4;
// Neighbours further away than this (s) say nothing about a frame.
constexpr double kNeighbourTime = 0.4;
// A sighting this many times further from its neighbours than the median one is an outlier (about 9
// sigma).
constexpr double kOutlierRatio = 4.0;
// but no nearer than this many declared sigmas: a still stretch must not make a moving one look
// wild.
constexpr double kOutlierFloor = 7.0;
// Declared noise is not believed to be larger than the true one by more than this: what one frame
// shows against the next lacks every slow error.
constexpr double kLeastNoiseScale = 0.2;
// Neighbouring frames belong to one smooth motion when they lie this close, as a multiple of the
// declared noise.
constexpr double kSmoothRatio = 12.0;
// and in rad and m (at 1 m), for recordings with little noise.
constexpr double kSmoothStep = 0.06;
// or when frames no further apart than half a neighbour's time bend less than this part of their
// step: white noise, and stops in any order, bend by 1.7 of it.
constexpr double kSmoothBend = 0.5;
Matrix6d floored(Matrix6d covariance) {
  covariance.diagonal().array() += kNoiseFloor * kNoiseFloor;
  return covariance;
}

// Where the neighbours are as seen from a pose: their median displacement, component by component,
// and how far from it they lie themselves (median, whitened).
struct Neighbourhood {
  Vector6d median = Vector6d::Zero();
  double spread = 0.0;
};

using Displacements = std::array<Vector6d, 2 * kNeighbours>;

// Displacements of a body from each frame to the next ones, which most of the cleaning looks at.
class Steps {
 public:
  explicit Steps(const Body& body) : forward_(body.at.size() * kNeighbours, Vector6d::Zero()) {
    for (std::size_t f = 0; f < body.at.size(); ++f) {
      if (!body.at[f].seen) continue;
      const Pose inverse = body.at[f].pose.inverse();
      const std::size_t last = std::min(body.at.size() - 1, f + kNeighbours);
      for (std::size_t g = f + 1; g <= last; ++g) {
        if (body.at[g].seen) place(f, g) = fast_log(compose(inverse, body.at[g].pose));
      }
    }
  }

  // Of frame g as seen from frame f, both with a sighting and at most kNeighbours apart.
  [[nodiscard]] Vector6d operator()(std::size_t f, std::size_t g) const {
    return g > f ? forward_[index(f, g)] : Vector6d(-forward_[index(g, f)]);
  }

 private:
  [[nodiscard]] static std::size_t index(std::size_t f, std::size_t g) {
    return kNeighbours * f + (g - f - 1);
  }
  Vector6d& place(std::size_t f, std::size_t g) { return forward_[index(f, g)]; }

  std::vector<Vector6d> forward_;
};

using Numbers = std::array<double, 2 * kNeighbours>;

// By insertion: for so few there is nothing faster.
void sort_first(Numbers& values, std::size_t count) {
  for (std::size_t k = 1; k < count; ++k) {
    const double value = values[k];
    std::size_t at = k;
    for (; at > 0 && values[at - 1] > value; --at) values[at] = values[at - 1];
    values[at] = value;
  }
}

Vector6d median_displacement(const Displacements& d, std::size_t count) {
  Vector6d median;
  Numbers values{};
  for (Eigen::Index c = 0; c < 6; ++c) {
    for (std::size_t k = 0; k < count; ++k) values[k] = d[k](c);
    sort_first(values, count);
    const double upper = values[count / 2];
    median(c) = count % 2 == 0 ? 0.5 * (upper + values[count / 2 - 1]) : upper;
  }
  return median;
}

// Nothing with too few neighbours. `displacement_of(g)`: of frame g as seen from frame f.
template <typename DisplacementOf>
std::optional<Neighbourhood> neighbourhood_of(const Body& body, const std::vector<double>& times_s,
                                              std::size_t f, DisplacementOf displacement_of) {
  Displacements displacement;
  std::size_t count = 0;
  const std::size_t last = std::min(body.at.size() - 1, f + kNeighbours);
  for (std::size_t g = f - std::min<std::size_t>(f, kNeighbours); g <= last; ++g) {
    if (g == f || !body.at[g].seen || std::abs(times_s[g] - times_s[f]) > kNeighbourTime) continue;
    displacement[count++] = displacement_of(g);
  }
  if (count < 3) return std::nullopt;
  Neighbourhood out;
  out.median = median_displacement(displacement, count);
  Numbers squared{};
  for (std::size_t k = 0; k < count; ++k) {
    squared[k] = (body.at[f].whitening * (displacement[k] - out.median)).squaredNorm();
  }
  sort_first(squared, count);
  out.spread = std::sqrt(squared[count / 2]);
  return out;
}

struct Deviations {
  std::vector<double> spread;  // of the neighbours about their median
  std::vector<double> main;  // whitened length of the displacement, one a frame; NaN where unknown
  std::vector<double> alternative;  // of the other branch
  double median = 0.0;
  double step = 0.0;  // median displacement, rad and m together
};

Deviations deviations_of(const Body& body, const Steps& step, const std::vector<double>& times_s) {
  Deviations out;
  const double unknown = std::nan("");
  out.main.assign(body.at.size(), unknown);
  out.alternative.assign(body.at.size(), unknown);
  out.spread.assign(body.at.size(), 0.0);
  std::vector<double> known;
  std::vector<double> steps;
  for (std::size_t f = 0; f < body.at.size(); ++f) {
    const Sighting& s = body.at[f];
    if (!s.seen) continue;
    const auto d = neighbourhood_of(body, times_s, f, [&](std::size_t g) { return step(f, g); });
    if (!d) continue;
    out.main[f] = (s.whitening * d->median).norm();
    out.spread[f] = d->spread;
    known.push_back(out.main[f]);
    steps.push_back(d->median.norm());
    if (!s.alternative) continue;
    const Pose inverse = s.alternative->pose.inverse();
    const auto other = neighbourhood_of(body, times_s, f, [&](std::size_t g) {
      return fast_log(compose(inverse, body.at[g].pose));
    });
    if (other) out.alternative[f] = (s.alternative->whitening * other->median).norm();
  }
  out.median = median_of(std::move(known));
  out.step = median_of(std::move(steps));
  return out;
}

// Second differences of the pose over first ones, medians; nothing where frames are far apart.
std::optional<double> bend_of(const Body& body, const std::vector<double>& times_s) {
  std::vector<double> first;
  std::vector<double> second;
  for (std::size_t f = 1; f + 1 < body.at.size(); ++f) {
    if (!body.at[f - 1].seen || !body.at[f].seen || !body.at[f + 1].seen) continue;
    if (times_s[f + 1] - times_s[f - 1] > kNeighbourTime) continue;
    const Pose inverse = body.at[f].pose.inverse();
    const Vector6d before = fast_log(inverse * body.at[f - 1].pose);
    const Vector6d after = fast_log(inverse * body.at[f + 1].pose);
    first.push_back((body.at[f].whitening * (after - before)).norm());
    second.push_back((body.at[f].whitening * (after + before)).norm());
  }
  if (first.size() < 10) return std::nullopt;
  return median_of(std::move(second)) / std::max(1e-300, median_of(std::move(first)));
}

bool is_smooth(const Body& body, const Deviations& d, const std::vector<double>& times_s) {
  if (!(d.median > 0.0)) return false;
  if (d.median < kSmoothRatio || d.step < kSmoothStep) return true;
  const auto bend = bend_of(body, times_s);
  return bend && *bend < kSmoothBend;
}

void swap_branch(Sighting& s) {
  std::swap(static_cast<Branch&>(s), value_of(s.alternative));
  s.alternative_cost = -s.alternative_cost;
}

// Takes the branch that agrees with the neighbours; drops the sighting when none does. True when
// anything changed.
bool clean_in_time(Body& body, const Deviations& d) {
  bool changed = false;
  for (std::size_t f = 0; f < body.at.size(); ++f) {
    // The neighbours' own spread allows for fast motion, above all where they lie on one side only.
    const double limit =
        std::max({kOutlierRatio * d.median, kOutlierFloor, kOutlierRatio * d.spread[f]});
    if (!body.at[f].seen || std::isnan(d.main[f]) || d.main[f] <= limit) continue;
    changed = true;
    if (d.alternative[f] < limit) {
      swap_branch(body.at[f]);
    } else {
      body.at[f].seen = false;
    }
  }
  return changed;
}

// Robust noise over declared noise from fourth differences of the pose, which see no motion slower
// than a few hertz: (1, -4, 6, -4, 1) has variance 70 sigma^2. Nothing with too few runs of five
// frames.
std::optional<double> noise_from_differences(const Body& body, const Steps& step) {
  std::vector<double> absolute;
  for (std::size_t f = 2; f + 2 < body.at.size(); ++f) {
    const auto seen = [&](std::size_t g) { return body.at[g].seen; };
    if (!seen(f - 2) || !seen(f - 1) || !seen(f) || !seen(f + 1) || !seen(f + 2)) continue;
    const Vector6d difference =
        step(f, f - 2) - 4.0 * step(f, f - 1) - 4.0 * step(f, f + 1) + step(f, f + 2);
    const Vector6d white = body.at[f].whitening * difference / std::sqrt(70.0);
    for (int c = 0; c < 6; ++c) absolute.push_back(std::abs(white(c)));
  }
  if (absolute.size() < 120) return std::nullopt;
  return kSigmaOverMedian * median_of(std::move(absolute));
}

void scale_branch(Branch& branch, double scale) {
  branch.covariance = floored(branch.covariance * (scale * scale));
  branch.whitening = whitening_of(branch.covariance);
}

void scale_noise(Body& body, double scale) {
  body.noise_scale = scale;
  for (Sighting& s : body.at) {
    if (!s.seen) continue;
    scale_branch(s, scale);
    if (s.alternative) scale_branch(*s.alternative, scale);
    s.alternative_cost /= scale * scale;
  }
}

// A sighting that has to take such a branch counts as an outlier anyway.
void drop_unlikely_branches(Body& body) {
  for (Sighting& s : body.at) {
    if (s.alternative && s.alternative_cost > kOutlierCost) s.alternative.reset();
  }
}

// The covariance of the first branch as the camera sees it, for the other one.
Matrix6d turned_covariance(const PoseSample& sample) {
  const Eigen::Matrix3d turn =
      sample.T_camera_marker_alternative->matrix3().transpose() * sample.T_camera_marker.matrix3();
  Matrix6d both = Matrix6d::Zero();
  both.topLeftCorner<3, 3>() = turn;
  both.bottomRightCorner<3, 3>() = turn;
  return both * sample.covariance * both.transpose();
}

Branch branch_of(const Pose& pose, const Matrix6d& covariance) {
  const Matrix6d believed = floored(covariance);
  return {pose, believed, whitening_of(believed)};
}

Body body_of(const PoseTrack& track, std::size_t frames) {
  Body body;
  body.id = track.id;
  body.at.resize(frames);
  for (const PoseSample& sample : track.samples) {
    const bool finite = sample.T_camera_marker.translation.allFinite() &&
                        sample.T_camera_marker.rotation.coeffs().allFinite() &&
                        sample.covariance.allFinite();
    if (!finite || sample.frame < 0 || static_cast<std::size_t>(sample.frame) >= frames) continue;
    Sighting& s = body.at[static_cast<std::size_t>(sample.frame)];
    s.seen = true;
    static_cast<Branch&>(s) = branch_of(sample.T_camera_marker, sample.covariance);
    if (!sample.T_camera_marker_alternative) continue;
    const Matrix6d& other =
        sample.alternative_covariance ? *sample.alternative_covariance : turned_covariance(sample);
    s.alternative = branch_of(*sample.T_camera_marker_alternative, other);
    s.alternative_cost = sample.alternative_cost;
  }
  return body;
}

}  // namespace

Series clean_series(const PoseTracks& tracks) {
  Series series;
  series.times_s = tracks.times_s;
  for (std::size_t f = 0; f < tracks.times_s.size(); ++f)
    series.frames.push_back(static_cast<int>(f));
  for (const PoseTrack& track : tracks.tracks) {
    series.bodies.push_back(body_of(track, tracks.times_s.size()));
  }
  std::ranges::sort(series.bodies, {}, &Body::id);
  int smooth = 0;
  int judged = 0;
  for (Body& body : series.bodies) {
    Steps step(body);
    const Deviations d = deviations_of(body, step, series.times_s);
    if (d.median > 0.0) ++judged;
    if (!is_smooth(body, d, series.times_s)) continue;
    ++smooth;
    if (clean_in_time(body, d)) {
      step = Steps(body);
      if (clean_in_time(body, deviations_of(body, step, series.times_s))) step = Steps(body);
    }
    const auto noise = noise_from_differences(body, step);
    if (noise) scale_noise(body, std::max(*noise, kLeastNoiseScale));
  }
  for (Body& body : series.bodies) drop_unlikely_branches(body);
  series.smooth = judged > 0 && 2 * smooth > judged;
  count_seen(series);
  return series;
}

}  // namespace kinescope::structure_search
