// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/uncertainty.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include <fmt/format.h>

#include "calib/bundle/gauge.h"
#include "calib/bundle/information.h"
#include "calib/bundle/linearise.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"
#include "kinematics/core/stretch_widening.h"

namespace kinescope::bundle {
namespace {

// Scaled singular values below this, relative to the largest, are called weak: the combination is
// known a thousand times worse than the best one.
constexpr double kWeak = 1e-3;
// Blocks of the sandwich: no fewer than this many, or its scatter says nothing.
constexpr int kMinStretches = 12;
// A marker that rests within so many pixels shows the same pixels in every frame.
constexpr double kRest_px = 0.5;
constexpr std::size_t kMinRest = 10;  // sightings, or its scatter says nothing
// Its scatter against that of the others, as variances, below which its error rests with it.
constexpr double kMostScatter = 0.5;

// Which stretch of time each frame belongs to, and what the stretches' sums miss of the variance.
struct Stretches {
  std::map<int, int> of_frame;
  double length_s = 0.0;
  double widening = 1.0;
};

Stretches stretches(const Spec& spec, const LinearBundle& linear, double correlation_s) {
  Stretches out;
  const double begin = spec.times_s.front();
  const double duration = std::max(1e-9, spec.times_s.back() - begin);
  const double length = std::clamp(4.0 * correlation_s, duration / 200.0, duration / kMinStretches);
  if (!spec.postures) out.length_s = length;
  // Half a step is the integral time of white noise.
  const double step = duration / std::max(1.0, static_cast<double>(spec.times_s.size()) - 1.0);
  if (!spec.postures) out.widening = stretch_widening(length, correlation_s - 0.5 * step);
  int next = 1 << 20;
  for (const auto& [frame, rows] : linear.frames) {
    if (spec.postures || frame < 0) {
      out.of_frame[frame] = next++;
    } else {
      out.of_frame[frame] =
          static_cast<int>((spec.times_s[static_cast<std::size_t>(frame)] - begin) / length);
    }
  }
  return out;
}

// Factors by which variances grow because the residuals are not independent.
struct Inflation {
  Eigen::VectorXd of_parameter;
  double pooled = 1.0;
};

// Of some parameters, from their rows of the covariance of all.
Inflation inflation(const LinearBundle& linear, const Stretches& stretch,
                    const Eigen::MatrixXd& covariance, const std::vector<Eigen::Index>& of) {
  std::map<int, Eigen::VectorXd> scores;
  const Eigen::Index n = covariance.cols();
  for (const auto& [frame, rows] : linear.frames) {
    auto [entry, fresh] = scores.try_emplace(stretch.of_frame.at(frame), Eigen::VectorXd::Zero(n));
    entry->second(rows.shown) += rows.J.transpose() * rows.r;
  }
  const auto count = static_cast<double>(scores.size());
  if (count < 3.0) return {Eigen::VectorXd::Ones(std::ssize(of))};
  Eigen::MatrixXd by_stretch(n, std::ssize(scores));
  Eigen::Index next = 0;
  for (const auto& [key, g] : scores) by_stretch.col(next++) = g;
  const Eigen::VectorXd sandwich = (covariance * by_stretch).rowwise().squaredNorm() *
                                   (stretch.widening * count / (count - 1.0));
  Eigen::VectorXd ratio(std::ssize(of));
  for (Eigen::Index i = 0; i < ratio.size(); ++i) {
    const double own = covariance(i, of[static_cast<std::size_t>(i)]);
    ratio[i] = own > 0.0 ? sandwich[i] / own : 1.0;
  }
  // The ratio of one parameter scatters by sqrt(2 / stretches); half of it is taken from the pool.
  const double pooled = ratio.mean();
  return {(0.5 * (ratio.array() + pooled)).max(1.0), std::max(1.0, pooled)};
}

// A marker at rest in the image: what its sightings say together.
struct Rest {
  const Sighting* first = nullptr;
  double last_s = 0.0;
  double declared_square = 0.0;  // sum over the sightings, px^2
  std::vector<Eigen::VectorXd> residuals_px;
  Eigen::MatrixXd pull;  // of an error of 1 px that all sightings share, on the score

  // Of the residuals about their mean, one coordinate, px^2.
  [[nodiscard]] double scatter() const {
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(residuals_px.front().size());
    for (const Eigen::VectorXd& r : residuals_px) mean += r;
    mean /= static_cast<double>(residuals_px.size());
    double sum = 0.0;
    for (const Eigen::VectorXd& r : residuals_px) sum += (r - mean).squaredNorm();
    return sum / (static_cast<double>(residuals_px.size() - 1) * static_cast<double>(mean.size()));
  }
};

bool is_near(const Sighting& a, const Sighting& b) {
  for (std::size_t c = 0; c < a.corners_px.size(); ++c) {
    if ((a.corners_px[c] - b.corners_px[c]).norm() > kRest_px) return false;
  }
  return true;
}

// The markers' rests that outlast a stretch of time; and the noise that was found in all other
// sightings of each camera over the declared one, as variances.
struct Rests {
  std::vector<Rest> rests;
  std::vector<double> noise_ratio;
};

Rests find_rests(const Spec& spec, const LinearBundle& linear, const std::vector<int>& used,
                 double stretch_s) {
  Rests out;
  std::vector<double> found(spec.cameras.size(), 0.0);
  std::vector<double> declared(spec.cameras.size(), 0.0);
  std::map<int, Rest> open;         // by series
  std::map<int, Eigen::Index> row;  // by frame, the next sighting's
  const auto close = [&](Rest& rest) {
    const double begin_s = spec.times_s[static_cast<std::size_t>(rest.first->frame)];
    if (rest.residuals_px.size() >= kMinRest && rest.last_s - begin_s > stretch_s) {
      out.rests.push_back(std::move(rest));
      return;
    }
    const auto camera = static_cast<std::size_t>(rest.first->camera);
    declared[camera] += rest.declared_square;
    for (const Eigen::VectorXd& r : rest.residuals_px)
      found[camera] += r.squaredNorm() / static_cast<double>(r.size());
  };
  for (const int index : used) {
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(index)];
    const FrameRows& rows = linear.frames.at(sighting.frame);
    Eigen::Index& begin = row.try_emplace(sighting.frame, 0).first->second;
    const Eigen::Index size = sighting.dimension();
    Rest& rest = open[sighting.series];
    if (rest.first != nullptr && !is_near(*rest.first, sighting)) {
      close(rest);
      rest = {};
    }
    if (rest.first == nullptr) {
      rest.first = &sighting;
      rest.pull = Eigen::MatrixXd::Zero(size, width_of(linear.blocks));
    }
    rest.last_s = spec.times_s[static_cast<std::size_t>(sighting.frame)];
    rest.declared_square += sighting.declared_sigma * sighting.declared_sigma;
    rest.residuals_px.emplace_back(sighting.sigma * rows.r.segment(begin, size));
    rest.pull(Eigen::all, rows.shown) += rows.J.middleRows(begin, size) / sighting.sigma;
    begin += size;
  }
  for (auto& [series, rest] : open) close(rest);
  for (std::size_t c = 0; c < found.size(); ++c)
    out.noise_ratio.push_back(declared[c] > 0.0 ? found[c] / declared[c] : 1.0);
  return out;
}

// How the score scatters because a marker at rest has one error in all its frames, not one in each:
// compressed video repeats the pixels of what does not move, and any camera samples it in one
// place. Its residuals cannot show that, as the marker's pose takes it up; their scatter does,
// where it is less than the noise.
// Parameters x any: the scatter is what this makes with its transpose.
Eigen::MatrixXd scatter_of_rests(const Rests& all, Eigen::Index parameters) {
  std::vector<Eigen::MatrixXd> pulls;
  Eigen::Index columns = 0;
  for (const Rest& rest : all.rests) {
    const double noise = all.noise_ratio[static_cast<std::size_t>(rest.first->camera)] *
                         rest.declared_square / static_cast<double>(rest.residuals_px.size());
    const double scatter = rest.scatter();
    if (!(scatter < kMostScatter * noise)) continue;
    pulls.emplace_back(std::sqrt(noise - scatter) * rest.pull.transpose());
    columns += pulls.back().cols();
  }
  Eigen::MatrixXd out(parameters, columns);
  for (Eigen::Index next = 0; const Eigen::MatrixXd& pull : pulls) {
    out.middleCols(next, pull.cols()) = pull;
    next += pull.cols();
  }
  return out;
}

std::string in_words(const std::vector<Parameter>& parameters, const WeakDirection& direction) {
  const std::size_t count = std::min<std::size_t>(3, direction.parameters.size());
  std::string words = count > 1 ? "this recording does not tell " : "this recording does not show ";
  for (std::size_t i = 0; i < count; ++i) {
    const std::string& name =
        parameters[static_cast<std::size_t>(direction.parameters[i].first)].name;
    words += (i == 0 ? "" : i + 1 == count ? " and " : ", ") + name;
  }
  return words + (count > 1 ? " apart" : "");
}

// Singular values of the Jacobian with its columns scaled to unit length, and the directions behind
// the small ones.
void observe(const Eigen::MatrixXd& data, const std::vector<Parameter>& parameters,
             Observability& out) {
  const Eigen::Index n = data.rows();
  const Eigen::VectorXd scale = unit_scale(data);
  const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * data * scale.asDiagonal());
  const double largest = std::sqrt(std::max(eigen.values[n - 1], 1e-300));
  for (Eigen::Index k = n; k-- > 0;) {
    out.singular_values.push_back(std::sqrt(std::max(eigen.values[k], 0.0)));
  }
  out.condition_number = largest / std::max(out.singular_values.back(), 1e-300);
  for (Eigen::Index k = 0; k < n; ++k) {
    const double relative = std::sqrt(std::max(eigen.values[k], 0.0)) / largest;
    if (relative > kWeak) break;
    WeakDirection weak{relative, {}, {}};
    for (Eigen::Index i = 0; i < n; ++i) {
      const double weight = eigen.vectors(i, k);
      if (std::abs(weight) > 0.2) weak.parameters.emplace_back(static_cast<int>(i), weight);
    }
    std::ranges::stable_sort(weak.parameters, [](const auto& a, const auto& b) {
      return std::abs(a.second) > std::abs(b.second);
    });
    weak.words = in_words(parameters, weak);
    out.weak.push_back(std::move(weak));
  }
}

bool is_local(const Spec& spec, const State& state, const FreeBlock& block) {
  if (block.block != "effects") return false;
  return spec.corrections[static_cast<std::size_t>(block.data - state.corrections.data())].is_local;
}

ParameterPlaces places_of(const Spec& spec, const State& state,
                          const std::vector<FreeBlock>& blocks) {
  ParameterPlaces out;
  Eigen::Index next = 0;
  for (const FreeBlock& block : blocks) {
    const bool local = is_local(spec, state, block);
    std::vector<Eigen::Index>& to = local ? out.local : out.other;
    for (std::size_t i = 0; i < block.names.size(); ++i) {
      out.place.push_back(std::ssize(to));
      out.is_local.push_back(local);
      to.push_back(next++);
    }
  }
  return out;
}

// Of every parameter, whether it is of an effect.
std::vector<bool> effects_among(const std::vector<FreeBlock>& blocks) {
  std::vector<bool> out;
  for (const FreeBlock& block : blocks)
    out.insert(out.end(), block.names.size(), block.block == "effects");
  return out;
}

}  // namespace

Uncertainty estimate_uncertainty(const Spec& spec, State& state, const std::vector<int>& used) {
  LinearBundle linear = linearise(spec, state, used);
  if (spec.prior) linear = with_frames_held(spec, state, std::move(linear));
  Uncertainty out;
  const int n = width_of(linear.blocks);
  const ParameterPlaces places = places_of(spec, state, linear.blocks);
  for (const FreeBlock& block : linear.blocks) {
    if (is_local(spec, state, block)) continue;
    out.blocks.push_back(block);
    for (std::size_t i = 0; i < block.names.size(); ++i)
      out.parameters.push_back({block.names[i], block.block, block.units[i], 0.0, {}, {}});
  }
  if (n == 0) return out;
  Information information(places);
  for (const auto& [frame, rows] : linear.frames) {
    information.add(rows);
    out.chi_square += rows.r.squaredNorm();
    out.rows += static_cast<int>(rows.r.size());
  }
  // A correction with a prior is one that the data need not show.
  const std::vector<bool> is_effect = effects_among(linear.blocks);
  const auto is_of_effects = [&](Eigen::Index i, Eigen::Index j) {
    return is_effect[static_cast<std::size_t>(i)] && is_effect[static_cast<std::size_t>(j)];
  };
  information.add(linear.prior_information, is_of_effects);
  observe(information.reduced(), out.parameters, out.observability);
  information.add(linear.prior_information, std::not_fn(is_of_effects));
  std::vector<bool> unseen(places.other.size(), false);
  const Eigen::MatrixXd white = information.covariance_rows(unseen);
  out.correlation_time_s = spec.postures ? 0.0 : correlation_time(spec, state, used);
  const Stretches stretch = stretches(spec, linear, out.correlation_time_s);
  const Inflation inflated = inflation(linear, stretch, white, places.other);
  out.noise_widening = inflated.pooled;
  const Eigen::VectorXd factor = inflated.of_parameter.cwiseSqrt();
  out.covariance = factor.asDiagonal() * white(Eigen::all, places.other) * factor.asDiagonal();
  if (spec.kind == MeasurementKind::kCorners) {
    const Eigen::MatrixXd shift =
        white * scatter_of_rests(find_rests(spec, linear, used, stretch.length_s), n);
    if (shift.cols() > 0) out.covariance += shift * shift.transpose();
  }
  for (std::size_t i = 0; i < out.parameters.size(); ++i) {
    Parameter& parameter = out.parameters[i];
    // Where a nominal robot stands as a whole may be nobody's to know; its axes are known beside
    // one another.
    const bool is_of_robot = spec.prior && parameter.block != "effects";
    if (unseen[i] && !is_of_robot) continue;
    const auto at = static_cast<Eigen::Index>(i);
    parameter.sigma_white = std::sqrt(white(at, places.other[i]));
    parameter.sigma = std::sqrt(out.covariance(at, at));
  }
  return out;
}

}  // namespace kinescope::bundle
