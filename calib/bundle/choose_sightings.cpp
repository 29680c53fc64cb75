// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/choose_sightings.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include <Eigen/LU>

#include "calib/bundle/corrected.h"
#include "kinematics/core/chi_square.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/median.h"
#include "kinematics/log/unsteady_reading.h"

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

// A sighting's residual less the median of its neighbours'; zero without any.
Eigen::VectorXd from_neighbours(const std::vector<Eigen::VectorXd>& series, std::size_t at) {
  const std::size_t first = at < kNeighbours ? 0 : at - kNeighbours;
  const std::size_t last = std::min(series.size() - 1, at + kNeighbours);
  const Eigen::VectorXd& own = series[at];
  Eigen::VectorXd out = Eigen::VectorXd::Zero(own.size());
  for (Eigen::Index row = 0; row < own.size(); ++row) {
    std::vector<double> others;
    for (std::size_t i = first; i <= last; ++i) {
      if (i != at && series[i].size() == own.size()) others.push_back(series[i][row]);
    }
    if (others.empty()) return Eigen::VectorXd::Zero(own.size());
    out[row] = own[row] - median_of(std::move(others));
  }
  return out;
}

// Of the residual by each joint's value; joints that do not move the marker: zero.
Eigen::MatrixXd d_values_of(const Spec& spec, const Sighting& sighting, const CorrectedError& at) {
  const Marker& marker = spec.tree.markers[static_cast<std::size_t>(sighting.marker)];
  const std::vector<int>& path = spec.path[marker.link.index()];
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(
      at.error.residual.size(),
      static_cast<Eigen::Index>(std::max<std::size_t>(1, spec.tree.joints.size())));
  for (std::size_t k = 0; k < path.size(); ++k) {
    out.col(path[k]) = at.error.d_marker * at.chain.d_value[k];
  }
  return out;
}

// One marker's sightings by one camera, in time.
struct Series {
  std::vector<int> indices;
  std::vector<int> frames;
  std::vector<Eigen::VectorXd> residuals;  // whitened, as declared
  std::vector<SightingError> errors;       // of a marker at rest
  std::vector<Eigen::VectorXd> d_time;     // of the residuals, per s
  std::vector<Eigen::MatrixXd> d_values;   // rows x joints of the tree, per rad or m
  std::vector<Eigen::VectorXd> differences;
  std::vector<bool> far;

  // Per row, of the noise's variance.
  [[nodiscard]] double distance(std::size_t i) const {
    return differences[i].squaredNorm() / static_cast<double>(differences[i].size()) /
           kDifferenceVariance;
  }

  // A large error changes from frame to frame, as the marker turns, by more than the noise, and yet
  // by little of itself: its neighbours have it, too.
  [[nodiscard]] bool goes_on(std::size_t i) const {
    constexpr double kLittle = 0.1;
    return differences[i].norm() < kLittle * residuals[i].norm();
  }
};

// What the frames' stamps scatter by, s. All that moves in a frame is then off by the same time,
// and by another one in the next frame; what an encoder or a gear does goes with its own joint.
double stamp_jitter(const std::map<int, Series>& all) {
  constexpr std::size_t kFewestFrames = 30;
  constexpr double kTimesNoise = 3.0;  // what one time a frame explains, at the least
  constexpr double kShared = 0.5;      // of the differences beyond the noise, explained by it
  struct Frame {
    double speed = 0.0;           // sum of squares, 1 / s^2
    double product = 0.0;         // with the differences
    Eigen::ArrayXd joint_speeds;  // the same of each joint's value
    Eigen::ArrayXd joint_products;
    double squares = 0.0;  // of the differences
    double rows = 0.0;
  };
  std::map<int, Frame> by_frame;
  int moving = 0;
  for (const auto& [marker, series] : all) {
    if (!series.errors.empty()) continue;
    ++moving;
    for (std::size_t i = 0; i < series.indices.size(); ++i) {
      if (series.far[i]) continue;
      Frame& frame = by_frame[series.frames[i]];
      frame.speed += series.d_time[i].squaredNorm();
      frame.product += series.d_time[i].dot(series.differences[i]);
      const Eigen::MatrixXd& by_joint = series.d_values[i];
      if (frame.joint_speeds.size() == 0) {
        frame.joint_speeds = frame.joint_products = Eigen::ArrayXd::Zero(by_joint.cols());
      }
      frame.joint_speeds += by_joint.colwise().squaredNorm().transpose().array();
      frame.joint_products += (by_joint.transpose() * series.differences[i]).array();
      frame.squares += series.differences[i].squaredNorm();
      frame.rows += static_cast<double>(series.differences[i].size());
    }
  }
  if (moving < 2 || by_frame.size() < 3 * kFewestFrames) return 0.0;
  std::vector<Frame> frames;
  for (const auto& [number, frame] : by_frame) frames.push_back(frame);
  std::ranges::stable_sort(frames, {}, [](const Frame& f) { return f.speed / f.rows; });
  const std::size_t third = frames.size() / 3;
  std::vector<double> slow;
  for (std::size_t i = 0; i < third; ++i) slow.push_back(frames[i].squares / frames[i].rows);
  const double noise = median_of(std::move(slow));
  double explained = 0.0;
  Eigen::ArrayXd by_joint = Eigen::ArrayXd::Zero(frames.front().joint_speeds.size());
  double squares = 0.0;
  double speeds = 0.0;
  double rows = 0.0;
  for (std::size_t i = frames.size() - third; i < frames.size(); ++i) {
    const Frame& frame = frames[i];
    if (!(frame.speed > 0.0)) return 0.0;
    explained += frame.product * frame.product / frame.speed;
    by_joint += (frame.joint_speeds > 0.0)
                    .select(frame.joint_products.square() / frame.joint_speeds.max(1e-300), 0.0);
    squares += frame.squares;
    speeds += frame.speed;
    rows += frame.rows;
  }
  // Of noise alone one number a frame explains one row's part.
  const double by_noise = noise * static_cast<double>(third);
  const bool shared = explained - by_noise > kShared * (squares - noise * rows);
  const bool one_joints = by_joint.maxCoeff() >= explained;
  if (explained < kTimesNoise * by_noise || !shared || one_joints) return 0.0;
  return std::sqrt((explained - by_noise) / speeds / kDifferenceVariance);
}

std::size_t camera_of(const Spec& spec, const Series& series) {
  const auto first = static_cast<std::size_t>(series.indices.front());
  return static_cast<std::size_t>(spec.sightings[first].camera);
}

// Of every camera: each has stamps of its own.
std::vector<double> stamp_jitters(const Spec& spec, const std::map<int, Series>& all) {
  std::vector<double> out;
  for (std::size_t c = 0; c < spec.cameras.size(); ++c) {
    std::map<int, Series> own;
    for (const auto& [number, series] : all)
      if (camera_of(spec, series) == c) own.emplace(number, series);
    out.push_back(stamp_jitter(own));
  }
  return out;
}

// Of a sighting at rest, whitened as declared: the median of those that the jitter moves least.
double noise_of(const Series& series, double jitter_s) {
  std::vector<std::size_t> order(series.indices.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  if (jitter_s > 0.0) {
    std::ranges::stable_sort(order, {},
                             [&](std::size_t i) { return series.d_time[i].squaredNorm(); });
    order.resize(std::max<std::size_t>(1, order.size() / 3));
  }
  std::vector<double> distance;
  for (const std::size_t i : order) distance.push_back(series.distance(i));
  return std::max(median_of(std::move(distance)), 1e-12);
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

// What poses are declared to be uncertain by is seldom right for turns and shifts alike: each by
// its own scatter from neighbour to neighbour.
void balance_poses(Spec& spec, const State& state, const std::vector<int>& usable) {
  constexpr std::size_t kFewest = 30;
  const Readings readings(spec, state);
  std::map<int, std::vector<Eigen::VectorXd>> turns;
  std::map<int, std::vector<Eigen::VectorXd>> shifts;
  for (const int index : usable) {
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(index)];
    const auto at = corrected_error_of(spec, state, readings, sighting);
    if (!at || !at->error.residual.allFinite()) continue;
    const Matrix6d& W = sighting.whitening;
    const Vector6d d = W.partialPivLu().solve(Vector6d(at->error.residual));
    turns[sighting.series].emplace_back(W.topLeftCorner<3, 3>() * d.head<3>());
    shifts[sighting.series].emplace_back(W.bottomRightCorner<3, 3>() * d.tail<3>());
  }
  const auto scatter = [](const std::map<int, std::vector<Eigen::VectorXd>>& all) {
    std::vector<double> squares;
    for (const auto& [marker, series] : all) {
      for (std::size_t i = 0; i < series.size(); ++i)
        squares.push_back(from_neighbours(series, i).squaredNorm());
    }
    return squares.size() < kFewest ? 0.0 : std::sqrt(median_of(std::move(squares)));
  };
  const double turn = scatter(turns);
  const double shift = scatter(shifts);
  if (!(turn > 0.0) || !(shift > 0.0)) return;
  for (Sighting& sighting : spec.sightings) {
    sighting.whitening.leftCols<3>() *= std::sqrt(shift / turn);
    sighting.whitening.rightCols<3>() *= std::sqrt(turn / shift);
  }
}

// Multiplies a sighting's sigma.
void widen(Sighting& sighting, double factor) {
  sighting.sigma *= factor;
  sighting.whitening /= factor;
}

// One marker's sightings in some order, and which of them were rejected.
struct Rejections {
  std::vector<int> indices;
  std::vector<bool> rejected;
};

// Those rejected one after the other, where at the rate of the others that would not happen by
// chance; those at either end alone or all.
std::vector<int> rejected_in_a_row(const Rejections& of, bool at_the_ends_alone) {
  constexpr double kChance = 1e-6;
  const std::vector<bool>& rejected = of.rejected;
  const auto all = static_cast<double>(std::ranges::count(rejected, true));
  const auto count = static_cast<double>(rejected.size());
  const double places = at_the_ends_alone ? 2.0 : count;
  std::vector<int> out;
  for (std::size_t first = 0; first < rejected.size(); ++first) {
    if (!rejected[first]) continue;
    std::size_t end = first;
    while (end < rejected.size() && rejected[end]) ++end;
    const auto run = static_cast<double>(end - first);
    // Laplace's rule of succession.
    const double rate = (all - run + 1.0) / (count - run + 2.0);
    const bool at_an_end = first == 0 || end == rejected.size();
    if (run < count && (at_an_end || !at_the_ends_alone) &&
        places * std::pow(rate, run) < kChance) {
      out.insert(out.end(), of.indices.begin() + static_cast<std::ptrdiff_t>(first),
                 of.indices.begin() + static_cast<std::ptrdiff_t>(end));
    }
    first = end;
  }
  return out;
}

}  // namespace

std::vector<int> with_what_lasts(const Spec& spec, const State& state,
                                 const RobustSolution& solution) {
  const Readings readings(spec, state);
  std::map<int, std::vector<int>> by_series;
  for (const auto* indices : {&solution.used, &solution.rejected}) {
    for (const int index : *indices)
      by_series[spec.sightings[static_cast<std::size_t>(index)].series].push_back(index);
  }
  std::set<int> out(solution.used.begin(), solution.used.end());
  const auto frame_of = [&](int index) {
    return spec.sightings[static_cast<std::size_t>(index)].frame;
  };
  for (auto& [series, indices] : by_series) {
    const auto is_rejected = [&](int index) {
      return !std::ranges::binary_search(solution.used, index);
    };
    const auto add = [&](bool at_the_ends_alone) {
      Rejections of{indices, {}};
      for (const int index : indices) of.rejected.push_back(is_rejected(index));
      const std::vector<int> kept = rejected_in_a_row(of, at_the_ends_alone);
      out.insert(kept.begin(), kept.end());
    };
    std::ranges::stable_sort(indices, {},
                             [&](int index) { return std::pair(frame_of(index), index); });
    add(true);
    const Sighting& first = spec.sightings[static_cast<std::size_t>(indices.front())];
    const Marker& seen = spec.tree.markers[static_cast<std::size_t>(first.marker)];
    for (const int joint : spec.path[seen.link.index()]) {
      if (spec.channel[static_cast<std::size_t>(joint)] < 0) continue;
      std::ranges::stable_sort(indices, {},
                               [&](int index) { return readings.value(frame_of(index), joint); });
      add(false);
    }
  }
  return {out.begin(), out.end()};
}

ChosenSightings choose_by_neighbours(Spec& spec, const State& state, const std::vector<int>& usable,
                                     double reject_sigma) {
  if (spec.kind == MeasurementKind::kPose) balance_poses(spec, state, usable);
  // A reading that jumps makes neighbours differ that the camera sees alike.
  Spec steady = spec;
  steady.log = steadied(std::move(steady.log));
  const Readings readings(steady, state);
  std::map<int, Series> all;
  for (const int index : usable) {
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(index)];
    auto at = corrected_error_of(spec, state, readings, sighting);
    if (!at || !at->error.residual.allFinite()) continue;
    Series& series = all[sighting.series];
    series.indices.push_back(index);
    series.frames.push_back(sighting.frame);
    series.residuals.push_back(at->error.residual);
    series.d_time.push_back(std::move(at->d_time));
    series.d_values.push_back(d_values_of(spec, sighting, *at));
    if (!spec.carried && path_length(spec, sighting) == 0)
      series.errors.push_back(std::move(at->error));
  }
  for (auto& [number, series] : all) {
    for (std::size_t i = 0; i < series.indices.size(); ++i) {
      series.differences.push_back(from_neighbours(series.residuals, i));
    }
    series.far = far_runs(series.residuals);
  }
  ChosenSightings out;
  const std::vector<double> jitter_of_camera = stamp_jitters(spec, all);
  out.jitter_s = std::ranges::max(jitter_of_camera);
  for (const auto& [number, series] : all) {
    const double jitter_s = jitter_of_camera[camera_of(spec, series)];
    const double typical = noise_of(series, jitter_s);
    const Sighting& first = spec.sightings[static_cast<std::size_t>(series.indices.front())];
    double bias = first.kind == MeasurementKind::kCorners ? kCornerBias / first.sigma : 0.0;
    // A marker at rest repeats its bias in every frame: all of them together say what one does.
    if (!series.errors.empty()) {
      const double seen = lasting_bend(series.errors);
      out.bias_px = std::max(out.bias_px, seen * first.sigma);
      bias = std::max(bias, seen) * std::sqrt(static_cast<double>(series.indices.size()));
    }
    for (std::size_t i = 0; i < series.indices.size(); ++i) {
      Sighting& sighting = spec.sightings[static_cast<std::size_t>(series.indices[i])];
      const double freedom = sighting.dimension();
      // Median of a mean of `freedom` squares, to first order.
      // All rows are off by the same time: together they say no more of it than one does.
      const double noise = typical / (1.0 - 2.0 / (9.0 * freedom)) +
                           jitter_s * jitter_s * series.d_time[i].squaredNorm();
      widen(sighting, std::sqrt(noise + bias * bias));
      const bool as_near = series.distance(i) * freedom <
                           noise * chi_square_quantile(sighting.dimension(), reject_sigma);
      if (!series.far[i] && (as_near || series.goes_on(i))) {
        out.used.push_back(series.indices[i]);
      }
    }
  }
  std::ranges::sort(out.used);
  return out;
}

}  // namespace kinescope::bundle
