// SPDX-License-Identifier: Apache-2.0
#include "calib/hand_eye/fit.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "kinematics/core/chi_square.h"
#include "kinematics/core/dense_algebra.h"

namespace kinescope::hand_eye {
namespace {

using Frames = std::vector<std::size_t>;
using Rows = std::vector<std::optional<FrameRows>>;

std::vector<FrameRows> chosen(const Rows& rows, const Frames& frames) {
  std::vector<FrameRows> out;
  for (const std::size_t f : frames)
    if (rows[f]) out.push_back(*rows[f]);
  return out;
}

Frames seen_frames(const Rows& rows) {
  Frames out;
  for (std::size_t f = 0; f < rows.size(); ++f)
    if (rows[f]) out.push_back(f);
  return out;
}

Eigen::MatrixXd information_of(const Rows& rows, const Frames& used, const Noise& noise,
                               Eigen::Index parameters) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(parameters, parameters);
  for (const std::size_t f : used) {
    if (!rows[f]) continue;
    const WhiteRows w = white(*rows[f], noise);
    out += w.jacobian.transpose() * w.jacobian;
  }
  return out;
}

// By a chi-square of the controller's six errors; what the frame itself does to the fit is allowed
// for.
bool contradicts(const FrameRows& rows, const Noise& noise,
                 const std::optional<Eigen::MatrixXd>& covariance, bool used, double sigma) {
  const FlangeError e = flange_error(rows, noise);
  Matrix6d expected = e.covariance;
  if (covariance) {
    const Matrix6d by_fit = e.by_parameter * *covariance * e.by_parameter.transpose();
    expected += used ? Matrix6d(-by_fit) : by_fit;
  }
  if (!inverse_of_positive(expected)) expected = e.covariance;
  const double squared = e.error.dot(solve_symmetric(expected, e.error));
  return squared > chi_square_quantile(6.0, sigma);
}

// Those in a row up to an end stay in: something moved, which is no fault of theirs.
void keep_ends(const Frames& seen, std::vector<bool>& out) {
  constexpr std::size_t kInARow = 3;
  std::size_t first = 0;
  while (first < seen.size() && out[seen[first]]) ++first;
  std::size_t last = seen.size();
  while (last > 0 && out[seen[last - 1]]) --last;
  if (first >= kInARow)
    for (std::size_t k = 0; k < first; ++k) out[seen[k]] = false;
  if (seen.size() - last >= kInARow)
    for (std::size_t k = last; k < seen.size(); ++k) out[seen[k]] = false;
}

// More than this share of the frames is no fault of single rows.
constexpr double kMostOut = 0.3;

Frames without_outliers(const Model& model, const Rows& rows, const Frames& used,
                        const Noise& noise, double sigma) {
  const Frames seen = seen_frames(rows);
  const auto covariance = covariance_of(information_of(rows, used, noise, model.parameters()));
  std::vector<bool> out(rows.size(), false);
  for (const std::size_t f : seen) {
    const bool in = std::ranges::binary_search(used, f);
    out[f] = contradicts(*rows[f], noise, covariance, in, sigma);
  }
  keep_ends(seen, out);
  Frames kept;
  for (const std::size_t f : seen)
    if (!out[f]) kept.push_back(f);
  const auto left = static_cast<double>(seen.size() - kept.size());
  return left > kMostOut * static_cast<double>(seen.size()) ? seen : kept;
}

bool settled(const Noise& a, const Noise& b) {
  constexpr double kSame = 1e-3;
  const auto same = [](double x, double y) { return std::abs(x - y) <= kSame * std::max(x, y); };
  return same(a.camera, b.camera) && same(a.camera_turn, b.camera_turn) &&
         same(a.flange_rad, b.flange_rad) && same(a.flange_m, b.flange_m);
}

// Stretches of a few correlation times, as calib/trace/partition.h has them.
std::vector<int> stretches(const Model& model, const Fit& fit, double correlation_s) {
  constexpr double kCorrelationTimes = 6.0;
  constexpr double kMost = 24.0;
  const double first = model.data().first_s();
  const double all = model.data().last_s() - first;
  const double length = std::max(all / kMost, kCorrelationTimes * correlation_s);
  std::vector<int> out;
  for (const std::size_t f : fit.used)
    out.push_back(static_cast<int>((model.data().frames[f].time_s - first) / length));
  return out;
}

}  // namespace

WhiteRows white(const FrameRows& rows, const Noise& noise) {
  const Whitening whitening(noise, rows);
  return {whitening.apply(rows.residual), whitening.apply(rows.by_parameter),
          whitening.log_determinant()};
}

std::optional<Eigen::MatrixXd> covariance_of(const Eigen::MatrixXd& information) {
  constexpr double kSingular = 1e-13;  // of matrices whose columns have unit length: rounding
  const Eigen::VectorXd s = unit_scale(information);
  if (!(s.minCoeff() > 0.0)) return std::nullopt;
  const SymmetricEigen even = symmetric_eigen(s.asDiagonal() * information * s.asDiagonal());
  if (!(even.values[0] > kSingular)) return std::nullopt;
  const Eigen::MatrixXd inverse =
      even.vectors * even.values.cwiseInverse().asDiagonal() * even.vectors.transpose();
  return s.asDiagonal() * inverse * s.asDiagonal();
}

double correlation_time(const Model& model, const Fit& fit) {
  if (model.data().postures || fit.used.size() < 3) return 0.0;
  std::vector<Eigen::VectorXd> errors;  // six a frame: rows may differ in number
  std::vector<double> times_s;
  for (const std::size_t f : fit.used) {
    if (!fit.rows[f]) continue;
    const FlangeError e = flange_error(*fit.rows[f], fit.noise);
    errors.push_back(CholeskyFactor(e.covariance).whitened(e.error));
    times_s.push_back(model.data().frames[f].time_s);
  }
  const std::size_t n = errors.size();
  if (n < 3) return 0.0;
  const double step = (times_s.back() - times_s.front()) / static_cast<double>(n - 1);
  double zero = 0.0;
  for (const Eigen::VectorXd& e : errors) zero += e.squaredNorm() / static_cast<double>(n);
  double sum = 0.5;
  for (std::size_t lag = 1; lag < n / 4; ++lag) {
    double product = 0.0;
    for (std::size_t i = lag; i < n; ++i) product += errors[i].dot(errors[i - lag]);
    product /= static_cast<double>(n - lag) * zero;
    if (!(product > 0.0)) break;  // Geyer 1992: the initial positive sequence
    sum += product;
  }
  return sum * step;
}

std::optional<Eigen::MatrixXd> covariance_of(const Model& model, const Fit& fit) {
  const auto plain = covariance_of(fit.information);
  if (!plain || model.data().postures) return plain;
  const std::vector<int> stretch = stretches(model, fit, correlation_time(model, fit));
  const int count = stretch.empty() ? 0 : stretch.back() + 1;
  std::vector<Eigen::VectorXd> sums(static_cast<std::size_t>(count),
                                    Eigen::VectorXd::Zero(model.parameters()));
  for (std::size_t k = 0; k < fit.used.size(); ++k) {
    const auto& rows = fit.rows[fit.used[k]];
    if (!rows) continue;
    const WhiteRows w = white(*rows, fit.noise);
    sums[static_cast<std::size_t>(stretch[k])] += w.jacobian.transpose() * w.residual;
  }
  constexpr int kFewest = 8;  // the sums of fewer say little of their scatter
  if (count < kFewest) return plain;
  Eigen::MatrixXd meat = Eigen::MatrixXd::Zero(model.parameters(), model.parameters());
  for (const Eigen::VectorXd& g : sums) meat += g * g.transpose();
  meat *= static_cast<double>(count) / static_cast<double>(count - 1);
  const Eigen::MatrixXd sandwich = *plain * meat * *plain;
  // Each parameter's larger one: few stretches may show less scatter than there is.
  Eigen::VectorXd widen(model.parameters());
  for (Eigen::Index k = 0; k < widen.size(); ++k)
    widen[k] = std::sqrt(std::max(1.0, sandwich(k, k) / (*plain)(k, k)));
  return widen.asDiagonal() * *plain * widen.asDiagonal();
}

Fit fit(const Model& model, const State& start, double reject_sigma) {
  constexpr int kRobustRounds = 3;
  constexpr int kMaxRounds = 10;
  Fit out;
  out.state = start;
  out.rows = rows_of_all(model, start);
  out.used = seen_frames(out.rows);
  if (out.used.empty()) return out;
  for (int round = 0; round < kRobustRounds; ++round) {
    out.noise = robust_noise(chosen(out.rows, out.used));
    out.state = solve(model, out.state, out.noise, out.used, true).state;
    out.rows = rows_of_all(model, out.state);
    out.used = seen_frames(out.rows);
  }
  out.noise = robust_noise(chosen(out.rows, out.used));
  out.used = without_outliers(model, out.rows, {}, out.noise, reject_sigma);
  for (int round = 0; round < kMaxRounds; ++round) {
    const Solved solved = solve(model, out.state, out.noise, out.used, false);
    out.state = solved.state;
    out.converged = solved.converged;
    out.rows = rows_of_all(model, out.state);
    const Noise before =
        std::exchange(out.noise, estimate_noise(chosen(out.rows, out.used), out.noise));
    const Frames next = without_outliers(model, out.rows, out.used, out.noise, reject_sigma);
    const bool same = next == out.used && settled(before, out.noise);
    out.used = next;
    if (same) break;
  }
  out.information = information_of(out.rows, out.used, out.noise, model.parameters());
  return out;
}

}  // namespace kinescope::hand_eye
