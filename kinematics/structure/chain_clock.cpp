// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/chain_clock.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr double kLever_m = 0.3;  // at which turns and shifts count alike
constexpr double kCoarse_s = 0.02;
constexpr double kFine_s = 0.001;
// More frames say nothing more of one number.
constexpr std::size_t kMostSteps = 600;
// Of the usual sum of squares over all offsets: a chain at its own leaves less than half of it.
constexpr double kClear = 0.5;

struct Velocities {
  std::vector<double> times_s;
  Eigen::MatrixXd twist;  // instants x 6, rad/s and kLever_m/s
};

// Over two frames about each, where they follow one another.
Velocities velocities_of(const PoseTrack& track, const std::vector<double>& times_s) {
  std::vector<std::size_t> middles;
  const std::vector<PoseSample>& samples = track.samples;
  for (std::size_t i = 1; i + 1 < samples.size(); ++i)
    if (samples[i + 1].frame - samples[i - 1].frame == 2) middles.push_back(i);
  const std::size_t step = (middles.size() + kMostSteps - 1) / kMostSteps;
  Velocities out;
  std::vector<Vector6d> twists;
  for (std::size_t k = 0; k < middles.size(); k += std::max<std::size_t>(1, step)) {
    const PoseSample& before = samples[middles[k] - 1];
    const PoseSample& after = samples[middles[k] + 1];
    const double first_s = times_s[static_cast<std::size_t>(before.frame)];
    const double last_s = times_s[static_cast<std::size_t>(after.frame)];
    Vector6d d = log_pose(before.T_camera_marker.inverse() * after.T_camera_marker);
    d.tail<3>() /= kLever_m;
    twists.emplace_back(d / (last_s - first_s));
    out.times_s.push_back(0.5 * (first_s + last_s));
  }
  out.twist.resize(static_cast<Eigen::Index>(twists.size()), 6);
  for (std::size_t k = 0; k < twists.size(); ++k)
    out.twist.row(static_cast<Eigen::Index>(k)) = twists[k].transpose();
  return out;
}

// Of channels that move, centred and scaled.
struct Scaled {
  std::vector<int> channels;
  std::vector<double> mean, deviation;
};

Scaled scaled(const JointLog& log) {
  Scaled out;
  for (int c = 0; c < static_cast<int>(log.channels.size()); ++c) {
    const Eigen::VectorXd values = log.values.col(c);
    const double mean = values.mean();
    const double deviation = std::sqrt((values.array() - mean).square().mean());
    if (!(deviation > 1e-9 * std::max(1e-3, std::abs(mean)))) continue;
    out.channels.push_back(c);
    out.mean.push_back(mean);
    out.deviation.push_back(deviation);
  }
  return out;
}

// Rates, and (order 1) their products with each value; NaN where the log has nothing.
Eigen::MatrixXd features_at(const JointLog& log, const Scaled& scale,
                            const std::vector<double>& times_s, double offset_s, double gap_s,
                            int order) {
  const Eigen::MatrixXd readings = resample(log, times_s, offset_s, gap_s);
  const Eigen::MatrixXd changes = resample_rates(log, times_s, offset_s, gap_s);
  const auto K = static_cast<Eigen::Index>(scale.channels.size());
  Eigen::MatrixXd out(readings.rows(), order == 0 ? K : K + K * K);
  for (Eigen::Index k = 0; k < K; ++k) {
    const auto i = static_cast<std::size_t>(k);
    out.col(k) = changes.col(scale.channels[i]) / scale.deviation[i];
  }
  for (Eigen::Index a = 0; order > 0 && a < K; ++a) {
    const auto i = static_cast<std::size_t>(a);
    const Eigen::ArrayXd value =
        (readings.col(scale.channels[i]).array() - scale.mean[i]) / scale.deviation[i];
    out.middleCols(K + a * K, K) = (out.leftCols(K).array().colwise() * value).matrix();
  }
  return out;
}

// Mean square that is left, a number; infinite where too few instants have readings.
double left_at(const Velocities& body, const JointLog& log, const Scaled& scale, double offset_s,
               double gap_s, int order) {
  const Eigen::MatrixXd all = features_at(log, scale, body.times_s, offset_s, gap_s, order);
  std::vector<Eigen::Index> known;
  for (Eigen::Index i = 0; i < all.rows(); ++i)
    if (all.row(i).allFinite()) known.push_back(i);
  if (std::ssize(known) < 2 * all.cols()) return std::numeric_limits<double>::infinity();
  const Eigen::MatrixXd A = all(known, Eigen::all);
  const Eigen::MatrixXd y = body.twist(known, Eigen::all);
  Eigen::MatrixXd H = A.transpose() * A;
  H.diagonal().array() += 1e-9 * H.trace() / static_cast<double>(H.rows()) + 1e-300;
  const Eigen::MatrixXd X = LdltFactor(H).solve(Eigen::MatrixXd(A.transpose() * y));
  const double freedom = static_cast<double>(A.rows() - A.cols());
  return (y - A * X).squaredNorm() / (6.0 * freedom);
}

struct Minimum {
  double left = std::numeric_limits<double>::infinity();
  double offset_s = 0.0;
  double usual = std::numeric_limits<double>::infinity();  // median over the offsets
  [[nodiscard]] double share() const { return std::isfinite(left) ? left / usual : 1.0; }
};

template <typename Left>
Minimum scan(const Left& left, double centre_s, double half_s, double step_s) {
  Minimum out;
  std::vector<double> all;
  const int steps = static_cast<int>(std::lround(half_s / step_s));
  for (int k = -steps; k <= steps; ++k) {
    const double offset_s = centre_s + k * step_s;
    const double sum = left(offset_s);
    if (!std::isfinite(sum)) continue;
    all.push_back(sum);
    if (sum < out.left) out = {sum, offset_s, out.usual};
  }
  if (!all.empty()) out.usual = median_of(std::move(all));
  return out;
}

}  // namespace

std::optional<double> chain_clock_offset(const PoseTrack& track, const std::vector<double>& times_s,
                                         const JointLog& log, double max_offset_s,
                                         double max_gap_s) {
  const Velocities body = velocities_of(track, times_s);
  const Scaled scale = scaled(log);
  if (scale.channels.empty()) return std::nullopt;
  std::optional<double> out;
  double least = kClear;
  for (const int order : {0, 1}) {
    const auto left = [&](double offset_s) {
      return left_at(body, log, scale, offset_s, max_gap_s, order);
    };
    const Minimum coarse = scan(left, 0.0, max_offset_s, kCoarse_s);
    if (coarse.share() >= least) continue;
    least = coarse.share();
    out = scan(left, coarse.offset_s, kCoarse_s, kFine_s).offset_s;
  }
  return out;
}

}  // namespace kinescope
