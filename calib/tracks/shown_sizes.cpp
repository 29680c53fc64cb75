// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/shown_sizes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/student_t.h"

namespace kinescope {
namespace {

constexpr double kLongestArm = 10.0;    // m: a prior, for arms that nothing tells
constexpr double kSame = 0.1;           // of a size: what tracing finds by itself
constexpr double kLeastMisfit = 1e-12;  // of the poses' covariance
constexpr std::size_t kFewestFrames = 10;

// Two markers in one frame, in the camera's.
struct Both {
  Pose one, other;
  Eigen::Matrix3d covariance;  // of the difference of their positions
};

Eigen::Matrix3d position_covariance(const PoseSample& sample) {
  const Eigen::Matrix3d R = sample.T_camera_marker.matrix3();
  return R * sample.covariance.bottomRightCorner<3, 3>() * R.transpose();
}

std::vector<Both> seen_together(const PoseTrack& one, const PoseTrack& other) {
  std::vector<Both> out;
  auto next = other.samples.begin();
  for (const PoseSample& sample : one.samples) {
    while (next != other.samples.end() && next->frame < sample.frame) ++next;
    if (next == other.samples.end()) break;
    if (next->frame != sample.frame) continue;
    out.push_back({sample.T_camera_marker, next->T_camera_marker,
                   position_covariance(sample) + position_covariance(*next)});
  }
  return out;
}

/// How large the one marker is beside the other, if they move as a joint lets them.
struct Ratio {
  std::size_t one = 0, other = 0;  ///< of the tracks
  double factor = 1.0;             ///< of the first's positions, as the second's have it
  double sigma = 0.0;
  double misfit = 0.0;  ///< squared, beside the poses' covariance
};

// Of one frame: coordinates that are zero for the right lengths and the right ratio, the last
// unknown.
template <int kRows, int kUnknowns>
struct Closure {
  Eigen::Matrix<double, kRows, kUnknowns> by;
  Eigen::Matrix<double, kRows, 1> of;

  Closure(const Eigen::Matrix<double, kRows, kUnknowns>& by_unknowns,
          const Eigen::Matrix<double, kRows, 1>& offset,
          const Eigen::Matrix<double, kRows, kRows>& covariance)
      : by(by_unknowns), of(offset) {
    const Eigen::LLT<Eigen::Matrix<double, kRows, kRows>> factor(covariance);
    factor.matrixL().solveInPlace(by);
    factor.matrixL().solveInPlace(of);
  }
};

template <int kRows, int kUnknowns>
std::optional<Ratio> fitted(std::span<const Closure<kRows, kUnknowns>> frames) {
  constexpr int kSteps = 6, kRatio = kUnknowns - 1;
  Ratio out;
  out.misfit = 1.0;
  std::vector<double> squares(frames.size()), weights(frames.size(), 1.0);
  for (int step = 0; step < kSteps; ++step) {
    Eigen::Matrix<double, kUnknowns, kUnknowns> normal;
    normal.setZero();
    normal.diagonal().template head<kRatio>().setConstant(out.misfit / (kLongestArm * kLongestArm));
    Eigen::Matrix<double, kUnknowns, 1> gradient;
    gradient.setZero();
    for (std::size_t k = 0; k < frames.size(); ++k) {
      normal += weights[k] * frames[k].by.transpose() * frames[k].by;
      gradient += weights[k] * frames[k].by.transpose() * frames[k].of;
    }
    const CholeskyFactor factor(normal);
    if (!factor.positive_definite()) return std::nullopt;
    const Eigen::Matrix<double, kUnknowns, 1> at = factor.solve(Eigen::VectorXd(gradient));
    for (std::size_t k = 0; k < frames.size(); ++k)
      squares[k] = (frames[k].by * at - frames[k].of).squaredNorm();
    out.misfit = fit_student_t(squares, kRows, kLeastMisfit).scale_squared;
    for (std::size_t k = 0; k < frames.size(); ++k)
      weights[k] = student_weight(squares[k], kRows, out.misfit);
    const Eigen::VectorXd of_ratio = Eigen::VectorXd::Unit(kUnknowns, kRatio);
    out.factor = at[kRatio];
    out.sigma = std::sqrt(out.misfit * factor.solve(of_ratio)[kRatio]);
  }
  if (!(out.factor > 0.0) || !std::isfinite(out.sigma)) return std::nullopt;
  return out;
}

// R_i q_i + s p_i = R_j q_j + p_j.
std::optional<Ratio> as_hinge(std::span<const Both> seen) {
  std::vector<Closure<3, 7>> closures;
  for (const Both& both : seen) {
    Eigen::Matrix<double, 3, 7> by;
    by << both.one.matrix3(), -both.other.matrix3(), both.one.translation;
    closures.emplace_back(by, both.other.translation, both.covariance);
  }
  return fitted<3, 7>(closures);
}

// Where the one is as the other sees it, about the mean, 3 x frames.
Eigen::Matrix3Xd places(std::span<const Both> seen, double factor) {
  Eigen::Matrix3Xd out(3, static_cast<Eigen::Index>(seen.size()));
  for (std::size_t k = 0; k < seen.size(); ++k) {
    const Both& both = seen[k];
    out.col(static_cast<Eigen::Index>(k)) =
        both.other.rotation.inverse() * (factor * both.one.translation - both.other.translation);
  }
  out.colwise() -= out.rowwise().mean().eval();
  return out;
}

SymmetricEigen spread_of(const Eigen::Matrix3Xd& points) {
  return symmetric_eigen(points * points.transpose());
}

// Under which the one is nearest to a line as the other sees it.
double straightest(std::span<const Both> seen) {
  constexpr int kTried = 40;
  constexpr double kMost = 4.0;  // times as large or as small
  double best = 1.0, least = std::numeric_limits<double>::infinity();
  for (int k = 0; k <= kTried; ++k) {
    const double factor = std::pow(kMost, 2.0 * k / kTried - 1.0);
    const Eigen::VectorXd spread = spread_of(places(seen, factor)).values;
    const double beside = (spread[0] + spread[1]) / (1.0 + factor * factor);
    if (beside >= least) continue;
    least = beside;
    best = factor;
  }
  return best;
}

// s R_j' p_i - R_j' p_j = c + a x, across a.
std::optional<Ratio> as_slide(std::span<const Both> seen) {
  constexpr int kSteps = 4;
  std::optional<Ratio> out;
  double factor = straightest(seen);
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::MatrixXd axes = spread_of(places(seen, factor)).vectors;
    const Eigen::Matrix<double, 3, 2> across = axes.leftCols<2>();
    std::vector<Closure<2, 4>> closures;
    for (const Both& both : seen) {
      const Eigen::Matrix<double, 2, 3> seen_across = (both.other.matrix3() * across).transpose();
      Eigen::Matrix<double, 2, 4> by;
      by << -across.transpose(), seen_across * both.one.translation;
      closures.emplace_back(by, seen_across * both.other.translation,
                            seen_across * both.covariance * seen_across.transpose());
    }
    out = fitted<2, 4>(closures);
    if (!out) return out;
    factor = out->factor;
  }
  return out;
}

std::optional<Ratio> ratio_of(const PoseTracks& tracks, std::size_t one, std::size_t other) {
  const std::vector<Both> seen = seen_together(tracks.tracks[one], tracks.tracks[other]);
  if (seen.size() < kFewestFrames) return std::nullopt;
  std::optional<Ratio> out = as_hinge(seen);
  const std::optional<Ratio> slide = as_slide(seen);
  if (!out || (slide && slide->misfit < out->misfit)) out = slide;
  if (!out) return out;
  out->one = one;
  out->other = other;
  return out;
}

// The pairs that move best as a joint lets them, as many as join all that they tell something of.
std::vector<Ratio> spanning_ratios(const PoseTracks& tracks) {
  std::vector<Ratio> all;
  for (std::size_t i = 0; i < tracks.tracks.size(); ++i) {
    for (std::size_t j = i + 1; j < tracks.tracks.size(); ++j) {
      if (const auto ratio = ratio_of(tracks, i, j)) all.push_back(*ratio);
    }
  }
  std::ranges::stable_sort(all, {}, &Ratio::misfit);
  std::vector<std::size_t> tree(tracks.tracks.size());
  for (std::size_t i = 0; i < tree.size(); ++i) tree[i] = i;
  std::vector<Ratio> out;
  for (const Ratio& ratio : all) {
    const std::size_t from = tree[ratio.one], to = tree[ratio.other];
    if (from == to) continue;
    std::ranges::replace(tree, from, to);
    out.push_back(ratio);
  }
  return out;
}

// Factors of the tracks that ratios bind to the first of them; 0 of the others.
std::vector<double> factors_beside(std::size_t first, std::size_t count,
                                   std::span<const Ratio> ratios) {
  std::vector<double> out(count, 0.0);
  out[first] = 1.0;
  for (bool any = true; any;) {
    any = false;
    for (const Ratio& ratio : ratios) {
      double& one = out[ratio.one];
      double& other = out[ratio.other];
      if ((one > 0.0) == (other > 0.0) || ratio.sigma > kSame * ratio.factor) continue;
      (one > 0.0 ? other : one) = one > 0.0 ? one / ratio.factor : other * ratio.factor;
      any = true;
    }
  }
  return out;
}

bool is_same(double factor) { return std::abs(std::log(factor)) < kSame; }

}  // namespace

std::vector<ShownSize> shown_sizes(const PoseTracks& tracks) {
  const std::size_t count = tracks.tracks.size();
  const std::vector<Ratio> ratios = spanning_ratios(tracks);
  std::vector<ShownSize> out;
  std::vector<bool> is_done(count, false);
  for (std::size_t i = 0; i < count; ++i) {
    if (is_done[i]) continue;
    std::vector<double> best;
    std::ptrdiff_t most = 0;
    for (std::size_t reference = i; reference < count; ++reference) {
      std::vector<double> factors = factors_beside(reference, count, ratios);
      if (factors[i] == 0.0) continue;
      const auto alike = std::ranges::count_if(
          factors, [](double factor) { return factor > 0.0 && is_same(factor); });
      if (alike <= most) continue;
      most = alike;
      best = std::move(factors);
    }
    for (std::size_t k = 0; k < count; ++k) {
      if (best[k] == 0.0) continue;
      is_done[k] = true;
      if (!is_same(best[k])) out.push_back({tracks.tracks[k].id, best[k]});
    }
  }
  std::ranges::sort(out, {}, &ShownSize::id);
  return out;
}

}  // namespace kinescope
