// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/lasting_load.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "dynamics/contact/sliding.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/regressor.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

// All chosen.
constexpr Eigen::Index kMostInstants = 3000;
constexpr Eigen::Index kFewestInstants = 200;
constexpr Eigen::Index kGrid = 60;  ///< begins and ends that are tried first
/// s that are unseen at once; longer than the errors of a drive last.
constexpr double kStretch_s = 1.0;
constexpr Eigen::Index kDriveColumns = 7;
constexpr Eigen::Index kPayload = 10;
constexpr Eigen::Index kForce = 12;  ///< a force and its moments about the link, each along 3 axes
constexpr Eigen::Index kLoad = kPayload + kForce;
constexpr double kRidge = 1e-7;     ///< of columns of length 1; chosen
constexpr double kFewSigmas = 5.0;  ///< sigmas: a short contact must not choose the span
constexpr double kUsualSize = 0.6745;

/// Rows of every joint at the instants that are looked at.
struct Rows {
  std::vector<Eigen::Index> samples;               ///< of each instant
  Eigen::VectorXd time_s;                          ///< laid end to end
  Eigen::MatrixXd torque;                          ///< instants x joints
  Eigen::MatrixXd weight;                          ///< 0: says nothing
  std::vector<Eigen::MatrixXd> common;             ///< of each joint: what the whole log may have
  std::vector<std::vector<Eigen::MatrixXd>> load;  ///< [body][joint]: what a load may; empty: none
  Eigen::Index parameters = 0;                     ///< of the common columns

  [[nodiscard]] Eigen::Index instants() const { return time_s.size(); }
  [[nodiscard]] Eigen::Index joints() const { return torque.cols(); }
};

std::vector<Eigen::Index> chosen_instants(const TorqueSamples& samples) {
  const Eigen::Index step = std::max<Eigen::Index>(1, samples.size() / kMostInstants);
  std::vector<Eigen::Index> out;
  for (Eigen::Index k = step / 2; k < samples.size(); k += step) out.push_back(k);
  return out;
}

Eigen::VectorXd laid_out(const TorqueSamples& samples, const std::vector<Eigen::Index>& rows) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(std::ssize(rows));
  for (Eigen::Index k = 1; k < out.size(); ++k) {
    const Eigen::Index now = rows[static_cast<std::size_t>(k)];
    const Eigen::Index before = rows[static_cast<std::size_t>(k) - 1];
    const bool joined = samples.trajectory[now] == samples.trajectory[before];
    out[k] = out[k - 1] + (joined ? samples.t_s[now] - samples.t_s[before] : 0.0);
  }
  return out;
}

/// The combinations of columns that the rows show, each of unit length.
Eigen::MatrixXd shown(const std::vector<Eigen::MatrixXd>& columns) {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(columns.front().cols(), columns.front().cols());
  for (const Eigen::MatrixXd& own : columns) H += own.transpose() * own;
  const Eigen::VectorXd scale = unit_scale(H);
  const SymmetricEigen axes = symmetric_eigen(scale.asDiagonal() * H * scale.asDiagonal());
  const Eigen::Index n = H.cols();
  Eigen::Index first = 0;
  while (first < n && !(axes.values[first] > kRidge * axes.values[n - 1])) ++first;
  return scale.asDiagonal() * axes.vectors.rightCols(n - first);
}

/// Offset, Coulomb and viscous friction, each with a linear drift, and friction that grows with the
/// square of the speed.
Eigen::MatrixXd drive_columns(const Eigen::VectorXd& dq, const Eigen::VectorXi& direction,
                              const Eigen::VectorXd& time_s) {
  const Eigen::ArrayXd t = time_s.array() / std::max(1e-9, time_s.maxCoeff()) - 0.5;
  const Eigen::ArrayXd way = direction.cast<double>().array();
  Eigen::MatrixXd out(dq.size(), kDriveColumns);
  out << Eigen::VectorXd::Ones(dq.size()), t.matrix(), way.matrix(), (way * t).matrix(), dq,
      (dq.array() * t).matrix(), (dq.array() * dq.array().abs()).matrix();
  return out;
}

/// Regressor columns of mass and first moments under a unit of gravity along an axis, less those
/// under none: the torque of a force along it, and of its moments.
std::vector<Eigen::MatrixXd> pulled(const RigidModel& model, const Eigen::MatrixXd& q, int axis) {
  const Eigen::MatrixXd still = Eigen::MatrixXd::Zero(q.rows(), q.cols());
  RigidModel own = model;
  own.gravity_m_s2 = Eigen::Vector3d::Unit(axis);
  return regressors_of_samples(own, q, still, still);
}

Rows rows_of(const RigidModel& model, const TorqueSamples& samples) {
  Rows out;
  out.samples = chosen_instants(samples);
  out.time_s = laid_out(samples, out.samples);
  const Eigen::MatrixXd q = samples.q(out.samples, Eigen::all);
  const Eigen::MatrixXd dq = samples.dq(out.samples, Eigen::all);
  const Eigen::MatrixXd ddq = samples.ddq(out.samples, Eigen::all);
  out.torque = samples.torque(out.samples, Eigen::all);
  const Eigen::MatrixXi states = sliding_states(model, samples)(out.samples, Eigen::all);
  out.weight = (states.array() != 0).cast<double>();
  if (samples.torque_missing.size() > 0) {
    for (Eigen::Index k = 0; k < out.instants(); ++k)
      for (Eigen::Index j = 0; j < out.joints(); ++j)
        if (samples.torque_missing(out.samples[static_cast<std::size_t>(k)], j))
          out.weight(k, j) = 0.0;
  }
  const std::vector<Eigen::MatrixXd> Y = regressors_of_samples(model, q, dq, ddq);
  std::array<std::vector<Eigen::MatrixXd>, 3> force;
  for (int axis = 0; axis < 3; ++axis)
    force[static_cast<std::size_t>(axis)] = pulled(model, q, axis);
  const Eigen::MatrixXd basis = shown(Y);
  const Eigen::Index n = out.joints();
  out.parameters = basis.cols() + (kDriveColumns + 1) * n;
  for (Eigen::Index j = 0; j < n; ++j) {
    const auto at = static_cast<std::size_t>(j);
    Eigen::MatrixXd common = Eigen::MatrixXd::Zero(out.instants(), out.parameters);
    common.leftCols(basis.cols()) = Y[at] * basis;
    const Eigen::Index own = basis.cols() + (kDriveColumns + 1) * j;
    common.middleCols(own, kDriveColumns) = drive_columns(dq.col(j), states.col(j), out.time_s);
    common.col(own + kDriveColumns) = ddq.col(j);  // of the motor
    out.common.push_back(std::move(common));
  }
  for (Eigen::Index b = 0; b < model.size(); ++b) {
    std::vector<Eigen::MatrixXd> load(static_cast<std::size_t>(n));
    for (std::size_t j = 0; j < load.size(); ++j) {
      Eigen::MatrixXd own(out.instants(), kLoad);
      own.leftCols(kPayload) = Y[j].middleCols(10 * b, kPayload);
      for (std::size_t axis = 0; axis < 3; ++axis)
        own.middleCols(kPayload + 4 * static_cast<Eigen::Index>(axis), 4) =
            force[axis][j].middleCols(10 * b, 4);
      if (!own.isZero(0.0)) load[j] = std::move(own);
    }
    out.load.push_back(std::move(load));
  }
  return out;
}

/// A load's columns among kLoad.
struct Kind {
  bool is_payload = true;
  [[nodiscard]] Eigen::Index first() const { return is_payload ? 0 : kPayload; }
  [[nodiscard]] Eigen::Index count() const { return is_payload ? kPayload : kForce; }
};
constexpr std::array<Kind, 2> kKinds{Kind{true}, Kind{false}};

/// Instants [begin, end) with a load on a body.
struct Span {
  Eigen::Index begin = 0;
  Eigen::Index end = 0;
  int body = 0;
  Kind kind;
  double gain = 0.0;  ///< of the whitened sum of squares
};

/// Least squares of common columns and of the loads in their spans.
class LoadFit {
 public:
  LoadFit(const Rows& rows, std::vector<Span> loads, const Eigen::MatrixXd& weight)
      : rows_(rows), loads_(std::move(loads)) {
    Eigen::Index n = rows.parameters;
    for (const Span& load : loads_) n += load.kind.count();
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(n);
    for (Eigen::Index j = 0; j < rows.joints(); ++j) {
      const Eigen::MatrixXd W = columns(j);
      const Eigen::VectorXd w = weight.col(j).cwiseAbs2();
      H.noalias() += W.transpose() * w.asDiagonal() * W;
      g.noalias() += W.transpose() * w.cwiseProduct(rows.torque.col(j));
    }
    const Eigen::VectorXd scale = unit_scale(H);
    H = scale.asDiagonal() * H * scale.asDiagonal();
    H.diagonal().array() += kRidge;
    parameters_ = scale.cwiseProduct(CholeskyFactor(H).solve(scale.cwiseProduct(g).eval()));
  }

  /// Torque that is left, and that of the loads alone: instants x joints.
  [[nodiscard]] Eigen::MatrixXd residual() const {
    Eigen::MatrixXd out = rows_.torque;
    for (Eigen::Index j = 0; j < out.cols(); ++j) out.col(j) -= columns(j) * parameters_;
    return out;
  }
  [[nodiscard]] Eigen::MatrixXd load() const {
    Eigen::MatrixXd out(rows_.instants(), rows_.joints());
    const Eigen::Index own = parameters_.size() - rows_.parameters;
    for (Eigen::Index j = 0; j < out.cols(); ++j)
      out.col(j) = columns(j).rightCols(own) * parameters_.tail(own);
    return out;
  }

 private:
  [[nodiscard]] Eigen::MatrixXd columns(Eigen::Index joint) const {
    const auto j = static_cast<std::size_t>(joint);
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(
        rows_.instants(),
        rows_.parameters + std::accumulate(loads_.begin(), loads_.end(), Eigen::Index{0},
                                           [](Eigen::Index sum, const Span& load) {
                                             return sum + load.kind.count();
                                           }));
    out.leftCols(rows_.parameters) = rows_.common[j];
    Eigen::Index at = rows_.parameters;
    for (const Span& load : loads_) {
      const Eigen::MatrixXd& own = rows_.load[static_cast<std::size_t>(load.body)][j];
      const Eigen::Index length = load.end - load.begin;
      if (own.size() > 0)
        out.block(load.begin, at, length, load.kind.count()) =
            own.block(load.begin, load.kind.first(), length, load.kind.count());
      at += load.kind.count();
    }
    return out;
  }

  const Rows& rows_;
  std::vector<Span> loads_;
  Eigen::VectorXd parameters_;
};

/// Weights over each joint's noise, outliers having less (Huber).
Eigen::MatrixXd whitened_weights(const Rows& rows, const Eigen::MatrixXd& residual) {
  Eigen::MatrixXd out = rows.weight;
  for (Eigen::Index j = 0; j < out.cols(); ++j) {
    std::vector<double> sizes;
    for (Eigen::Index k = 0; k < out.rows(); ++k)
      if (rows.weight(k, j) > 0.0) sizes.push_back(std::abs(residual(k, j)));
    if (sizes.size() < static_cast<std::size_t>(kFewestInstants) / 2) {
      out.col(j).setZero();
      continue;
    }
    const double sigma = std::max(1e-12, median_of(std::move(sizes)) / kUsualSize);
    for (Eigen::Index k = 0; k < out.rows(); ++k) {
      const double size = std::abs(residual(k, j)) / sigma;
      out(k, j) *= std::sqrt(std::min(1.0, kFewSigmas / std::max(size, 1e-12))) / sigma;
    }
  }
  return out;
}

/// The best span among those that begin and end on a grid of instants: normal equations of the
/// loads, with the common columns solved for, are sums over the span.
class SpanSearch {
 public:
  SpanSearch(const Rows& rows, const Eigen::MatrixXd& weight, const Eigen::MatrixXd& residual)
      : rows_(rows), weight_(weight), residual_(residual) {
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(rows.parameters, rows.parameters);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(rows.parameters);
    for (Eigen::Index j = 0; j < rows.joints(); ++j) {
      const Eigen::MatrixXd N =
          weight.col(j).asDiagonal() * rows.common[static_cast<std::size_t>(j)];
      A.noalias() += N.transpose() * N;
      g.noalias() += N.transpose() * weight.col(j).cwiseProduct(residual.col(j));
    }
    scale_ = unit_scale(A);
    A = scale_.asDiagonal() * A * scale_.asDiagonal();
    A.diagonal().array() += kRidge;
    factor_ = CholeskyFactor(A).lower();
    z_ = factor_.triangularView<Eigen::Lower>().solve(scale_.cwiseProduct(g));
  }

  /// Of the body; `may_be`: which spans are tried.
  template <typename MayBe>
  [[nodiscard]] Span best(int body, const std::vector<Eigen::Index>& grid,
                          const MayBe& may_be) const {
    const std::vector<Sums> sums = sums_of(body, grid);
    Span out;
    out.body = body;
    for (std::size_t a = 0; a < grid.size(); ++a) {
      for (std::size_t b = a + 1; b < grid.size(); ++b) {
        if (!may_be(grid[a], grid[b])) continue;
        for (const Kind kind : kKinds) {
          const double gain = gain_of(sums[a], sums[b], kind);
          if (gain > out.gain) out = {grid[a], grid[b], body, kind, gain};
        }
      }
    }
    return out;
  }

 private:
  /// From the first instant on: L'L, L'r, and whitened N'L.
  struct Sums {
    Eigen::MatrixXd square, mixed;
    Eigen::VectorXd g;
  };

  [[nodiscard]] std::vector<Sums> sums_of(int body, const std::vector<Eigen::Index>& grid) const {
    Sums sum{Eigen::MatrixXd::Zero(kLoad, kLoad), Eigen::MatrixXd::Zero(rows_.parameters, kLoad),
             Eigen::VectorXd::Zero(kLoad)};
    std::vector<Sums> out;
    Eigen::Index from = 0;
    for (const Eigen::Index to : grid) {
      const Eigen::Index length = to - from;
      for (Eigen::Index j = 0; j < rows_.joints(); ++j) {
        const auto at = static_cast<std::size_t>(j);
        const Eigen::MatrixXd& load = rows_.load[static_cast<std::size_t>(body)][at];
        if (load.size() == 0) continue;
        const Eigen::VectorXd w = weight_.col(j).segment(from, length);
        const Eigen::MatrixXd L = w.asDiagonal() * load.middleRows(from, length);
        const Eigen::MatrixXd N = w.asDiagonal() * rows_.common[at].middleRows(from, length);
        sum.square.noalias() += L.transpose() * L;
        sum.mixed.noalias() += N.transpose() * L;
        sum.g.noalias() += L.transpose() * w.cwiseProduct(residual_.col(j).segment(from, length));
      }
      from = to;
      out.push_back(sum);
      out.back().mixed =
          factor_.triangularView<Eigen::Lower>().solve(scale_.asDiagonal() * sum.mixed);
    }
    return out;
  }

  [[nodiscard]] double gain_of(const Sums& from, const Sums& to, Kind kind) const {
    const auto own = Eigen::seqN(kind.first(), kind.count());
    const Eigen::MatrixXd square = to.square(own, own) - from.square(own, own);
    const Eigen::MatrixXd mixed = to.mixed(Eigen::all, own) - from.mixed(Eigen::all, own);
    const Eigen::VectorXd scale = unit_scale(square);
    Eigen::MatrixXd H =
        scale.asDiagonal() * (square - mixed.transpose() * mixed) * scale.asDiagonal();
    H.diagonal().array() += kRidge;
    const Eigen::VectorXd g = scale.cwiseProduct(to.g(own) - from.g(own) - mixed.transpose() * z_);
    const CholeskyFactor factor(H);
    return factor.positive_definite() ? g.dot(factor.solve(g)) : 0.0;
  }

  const Rows& rows_;
  const Eigen::MatrixXd& weight_;
  const Eigen::MatrixXd& residual_;
  Eigen::VectorXd scale_, z_;
  Eigen::MatrixXd factor_;
};

std::vector<Eigen::Index> evenly(Eigen::Index first, Eigen::Index last, Eigen::Index count) {
  std::vector<Eigen::Index> out;
  for (Eigen::Index k = 0; k <= count; ++k) {
    const Eigen::Index at = first + (last - first) * k / count;
    if (out.empty() || at > out.back()) out.push_back(at);
  }
  return out;
}

/// Where samples say that a load acts within the limits of its length.
struct Limits {
  const Rows& rows;
  const LastingLoadOptions& options;

  [[nodiscard]] double length_s(Eigen::Index begin, Eigen::Index end) const {
    return rows.time_s[end - 1] - rows.time_s[begin];
  }
  [[nodiscard]] bool hold(Eigen::Index begin, Eigen::Index end) const {
    const double length = length_s(begin, end);
    return length >= options.shortest_s &&
           length <= options.most_share * length_s(0, rows.instants());
  }
};

/// Beside those that were found, and not across them.
Span search(const Rows& rows, const std::vector<Span>& found, const Eigen::MatrixXd& weight,
            const LastingLoadOptions& options) {
  const Eigen::MatrixXd torque =
      found.empty() ? rows.torque : rows.torque - LoadFit(rows, found, weight).load();
  const SpanSearch spans(rows, weight, torque);
  const Limits limits{rows, options};
  const auto may_be = [&](Eigen::Index begin, Eigen::Index end) {
    return limits.hold(begin, end) && std::ranges::all_of(found, [&](const Span& other) {
             return end <= other.begin || other.end <= begin;
           });
  };
  const std::vector<Eigen::Index> grid = evenly(0, rows.instants(), kGrid);
  Span best;
  for (int body = 0; body < std::ssize(rows.load); ++body) {
    const Span own = spans.best(body, grid, may_be);
    if (own.gain > best.gain) best = own;
  }
  // Both ends between their neighbours, ever closer.
  for (Eigen::Index step = rows.instants() / kGrid; best.gain > 0.0 && step > 0; step /= 4) {
    constexpr Eigen::Index kSteps = 8;
    std::vector<Eigen::Index> near;
    for (const Eigen::Index end : {best.begin, best.end}) {
      // An end of the log is an end.
      const bool is_end = end == 0 || end == rows.instants();
      const std::vector<Eigen::Index> own =
          is_end ? std::vector{end}
                 : evenly(std::max<Eigen::Index>(0, end - step),
                          std::min(rows.instants(), end + step), kSteps);
      near.insert(near.end(), own.begin(), own.end());
    }
    std::ranges::sort(near);
    const auto repeated = std::ranges::unique(near);
    near.erase(repeated.begin(), repeated.end());
    const Span closer = spans.best(best.body, near, may_be);
    if (closer.gain >= best.gain) best = closer;
  }
  return best;
}

/// Mean whitened square of every stretch that the fit has not seen: every second one in turn.
Eigen::VectorXd unseen(const Rows& rows, const std::vector<Span>& loads,
                       const Eigen::MatrixXd& weight) {
  const auto stretch = [&](Eigen::Index k) {
    return static_cast<Eigen::Index>(rows.time_s[k] / kStretch_s);
  };
  const Eigen::Index count = stretch(rows.instants() - 1) + 1;
  Eigen::VectorXd out = Eigen::VectorXd::Zero(count);
  for (const Eigen::Index odd : {0, 1}) {
    Eigen::MatrixXd seen = weight;
    for (Eigen::Index k = 0; k < rows.instants(); ++k)
      if (stretch(k) % 2 == odd) seen.row(k).setZero();
    const Eigen::MatrixXd left = weight.cwiseProduct(LoadFit(rows, loads, seen).residual());
    for (Eigen::Index k = 0; k < rows.instants(); ++k)
      if (stretch(k) % 2 == odd) out[stretch(k)] += left.row(k).squaredNorm();
  }
  return out;
}

/// Student's t of the logarithm by which a load makes the squares of unseen stretches less, those
/// in its span.
double advantage(const Rows& rows, const std::vector<Span>& before, const Span& load,
                 const Eigen::MatrixXd& weight) {
  std::vector<Span> with = before;
  with.push_back(load);
  const Eigen::VectorXd worse = unseen(rows, before, weight);
  const Eigen::VectorXd better = unseen(rows, with, weight);
  const double begin_s = rows.time_s[load.begin];
  const double end_s = rows.time_s[load.end - 1];
  std::vector<double> gains;
  for (Eigen::Index k = 0; k < worse.size(); ++k) {
    const double from_s = static_cast<double>(k) * kStretch_s;
    if (from_s < begin_s || from_s + kStretch_s > end_s || !(better[k] > 0.0)) continue;
    gains.push_back(std::log(worse[k] / better[k]));
  }
  if (gains.size() < 3) return 0.0;
  const Eigen::Map<const Eigen::VectorXd> gain(gains.data(), std::ssize(gains));
  const auto n = static_cast<double>(gain.size());
  const double spread = std::sqrt((gain.array() - gain.mean()).square().sum() / (n - 1.0) / n);
  return spread > 0.0 ? gain.mean() / spread : 0.0;
}

/// Of the whitened squares in the span, the share that the load leaves.
double share_left(const Rows& rows, const std::vector<Span>& before, const Span& load,
                  const Eigen::MatrixXd& weight) {
  std::vector<Span> with = before;
  with.push_back(load);
  const Eigen::Index length = load.end - load.begin;
  const auto squares = [&](const std::vector<Span>& loads) {
    const Eigen::MatrixXd left = weight.cwiseProduct(LoadFit(rows, loads, weight).residual());
    return left.middleRows(load.begin, length).squaredNorm();
  };
  return squares(with) / std::max(squares(before), 1e-300);
}

/// The rows beyond the declared masses, which are no more free.
Rows with_masses(Rows rows, const RigidModel& model, const TorqueSamples& samples) {
  rows.torque -= inverse_dynamics_of_samples(model, samples.q(rows.samples, Eigen::all),
                                             samples.dq(rows.samples, Eigen::all),
                                             samples.ddq(rows.samples, Eigen::all));
  const Eigen::Index drives = (kDriveColumns + 1) * rows.joints();
  for (Eigen::MatrixXd& common : rows.common) common = common.rightCols(drives).eval();
  rows.parameters = drives;
  return rows;
}

double squares_left(const Rows& rows, const Span& load, const Eigen::MatrixXd& weight) {
  return weight.cwiseProduct(LoadFit(rows, {load}, weight).residual()).squaredNorm();
}

/// Up to the end of the log where nothing says that it ended before: each number behind it differs
/// by no more than its noise.
Span up_to_the_end(const Rows& rows, Span load, const Eigen::MatrixXd& weight) {
  Span longer = load;
  longer.end = rows.instants();
  const double count =
      (weight.bottomRows(longer.end - load.end).array() > 0.0).cast<double>().sum();
  const double worse = squares_left(rows, longer, weight) - squares_left(rows, load, weight);
  return worse <= count ? longer : load;
}

/// With free masses a load up to an instant is another robot from there on. Declared ones tell
/// which it is, else the log begins without it.
Span on_its_side(const Rows& rows, const std::optional<Rows>& declared, const Span& load,
                 const Eigen::MatrixXd& weight) {
  const bool is_first = load.begin == 0;
  if (is_first == (load.end == rows.instants())) return load;
  Span other = load;
  other.begin = is_first ? load.end : 0;
  other.end = is_first ? rows.instants() : load.begin;
  if (!declared) return is_first ? other : load;
  return squares_left(*declared, other, weight) < squares_left(*declared, load, weight) ? other
                                                                                        : load;
}

}  // namespace

std::vector<LastingLoad> lasting_loads(const RigidModel& model, const TorqueSamples& samples,
                                       const LastingLoadOptions& options) {
  if (samples.size() < kFewestInstants) return {};
  const Rows rows = rows_of(model, samples);
  const double length_s = rows.time_s[rows.instants() - 1];
  if (length_s < 2.0 * options.shortest_s) return {};
  std::optional<Rows> declared;
  if (options.masses_known) declared = with_masses(rows, model, samples);
  std::vector<Span> found;
  std::vector<LastingLoad> out;
  Eigen::MatrixXd weight = whitened_weights(rows, LoadFit(rows, {}, rows.weight).residual());
  while (std::ssize(found) < options.most_loads) {
    Span load = search(rows, found, weight, options);
    if (!(load.gain > 0.0)) break;
    // The noise beside the load, and the load by that noise.
    std::vector<Span> with = found;
    with.push_back(load);
    weight = whitened_weights(rows, LoadFit(rows, with, weight).residual());
    load = up_to_the_end(rows, search(rows, found, weight, options), weight);
    if (found.empty()) load = on_its_side(rows, declared, load, weight);
    const double t = advantage(rows, found, load, weight);
    const bool is_known = Limits{rows, options}.hold(load.begin, load.end) && t >= options.level &&
                          share_left(rows, found, load, weight) <= options.most_left;
    if (!is_known) break;
    found.push_back(load);
    out.push_back({.first = rows.samples[static_cast<std::size_t>(load.begin)],
                   .last = load.end == rows.instants()
                               ? samples.size() - 1
                               : rows.samples[static_cast<std::size_t>(load.end - 1)],
                   .body = load.body,
                   .is_payload = load.kind.is_payload,
                   .t = t});
  }
  std::ranges::sort(out, {}, &LastingLoad::first);
  return out;
}

}  // namespace kinescope
