// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/ripple_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

namespace kinescope {
namespace {

constexpr int kPeriods = 20;
constexpr double kHighestFrequency = 8.0;
constexpr double kFrequencyStep = 0.004;
constexpr double kRidge = 1e-2;
constexpr double kBin = 0.02;

Eigen::VectorXd features(const std::vector<double>& frequencies, double q, double v) {
  Eigen::VectorXd f(4 + 4 * static_cast<Eigen::Index>(frequencies.size()));
  f.head(4) << std::tanh(v / 0.3), v, v * std::abs(v), 1.0;
  for (std::size_t k = 0; k < frequencies.size(); ++k) {
    const double angle = 2.0 * std::numbers::pi * frequencies[k] * q;
    f.segment(4 + 4 * static_cast<Eigen::Index>(k), 4) << std::cos(angle), std::sin(angle),
        v / 4.0 * std::cos(angle), v / 4.0 * std::sin(angle);
  }
  return f;
}

struct Rows {
  Eigen::VectorXd q, v, y;
};

Rows steady_rows(const std::vector<const JointRun*>& runs) {
  Rows rows;
  Eigen::Index count = 0;
  for (const JointRun* run : runs) count += run->free;
  rows.q.resize(count);
  rows.v.resize(count);
  rows.y.resize(count);
  Eigen::Index at = 0;
  for (const JointRun* run : runs) {
    for (Eigen::Index k = 0; k < run->free; ++k) {
      if (run->quiet_speed[k] == 0.0) continue;
      rows.q[at] = run->q[k];
      rows.v[at] = run->speed[k];
      rows.y[at++] = run->current[k];
    }
  }
  rows.q.conservativeResize(at);
  rows.v.conservativeResize(at);
  rows.y.conservativeResize(at);
  return rows;
}

/// Weights and residual for the frequencies so far.
Eigen::VectorXd fit(const Rows& rows, RippleModel& model) {
  const Eigen::Index d = 4 + 4 * static_cast<Eigen::Index>(model.frequencies.size());
  Eigen::MatrixXd F(rows.q.size(), d);
  for (Eigen::Index k = 0; k < rows.q.size(); ++k) {
    F.row(k) = features(model.frequencies, rows.q[k], rows.v[k]);
  }
  Eigen::MatrixXd H = F.transpose() * F;
  H.diagonal().array() += kRidge;
  const Eigen::LLT<Eigen::MatrixXd> factor(H);
  model.weights = factor.solve(F.transpose() * rows.y);
  Eigen::VectorXd left = rows.y - F * model.weights;
  model.steady_sigma = std::sqrt(left.squaredNorm() / static_cast<double>(rows.q.size() - d));
  model.covariance =
      model.steady_sigma * model.steady_sigma * factor.solve(Eigen::MatrixXd::Identity(d, d));
  return left;
}

/// Over means in narrow bins of position: ripple is slow beside the sampling.
double strongest_frequency(const Rows& rows, const Eigen::VectorXd& left) {
  const double lowest = rows.q.minCoeff();
  const auto bins = static_cast<Eigen::Index>((rows.q.maxCoeff() - lowest) / kBin) + 1;
  Eigen::ArrayXd sum = Eigen::ArrayXd::Zero(bins);
  for (Eigen::Index k = 0; k < left.size(); ++k) {
    sum[static_cast<Eigen::Index>((rows.q[k] - lowest) / kBin)] += left[k];
  }
  const Eigen::ArrayXd centre =
      lowest + kBin * (Eigen::ArrayXd::LinSpaced(bins, 0.5, static_cast<double>(bins) - 0.5));
  double best = 0.0;
  double frequency = 0.0;
  for (double f = 0.02; f < kHighestFrequency; f += kFrequencyStep) {
    const Eigen::ArrayXd angle = 2.0 * std::numbers::pi * f * centre;
    const double c = (angle.cos() * sum).sum();
    const double s = (angle.sin() * sum).sum();
    if (c * c + s * s <= best) continue;
    best = c * c + s * s;
    frequency = f;
  }
  return frequency;
}

}  // namespace

void add_speeds(JointRun& run, double window_s, double settle_s) {
  const Eigen::Index n = run.t_s.size();
  run.speed = Eigen::VectorXd::Zero(n);
  run.quiet_speed = Eigen::VectorXd::Zero(n);
  for (Eigen::Index k = 1; k < n; ++k) {
    Eigen::Index first = k;
    while (first > 0 && run.t_s[k] - run.t_s[first] < window_s) --first;
    const auto count = k - first + 1;
    const Eigen::ArrayXd t =
        run.t_s.segment(first, count).array() - run.t_s.segment(first, count).mean();
    run.speed[k] = (t * run.q.segment(first, count).array()).sum() / t.square().sum();
    Eigen::Index begin = k;
    while (begin > 0 && run.t_s[k] - run.t_s[begin] < settle_s) --begin;
    const Eigen::ArrayXd lately = run.speed.segment(begin, k - begin + 1).array();
    // Only speeding up counts: slowing down is what an obstacle does.
    const bool steady = run.t_s[k] - run.t_s[begin] >= settle_s && std::abs(run.speed[k]) > 0.3 &&
                        lately.abs().minCoeff() > 0.75 * std::abs(run.speed[k]) - 0.05;
    run.quiet_speed[k] = steady ? 1.0 : 0.0;
  }
}

Eigen::VectorXd RippleModel::predict(const JointRun& run) const {
  Eigen::VectorXd out(run.q.size());
  for (Eigen::Index k = 0; k < out.size(); ++k) {
    out[k] = features(frequencies, run.q[k], run.speed[k]).dot(weights);
  }
  return out;
}

/// Of the model, in units of what it usually leaves.
Eigen::VectorXd RippleModel::sigma(const JointRun& run) const {
  Eigen::VectorXd out(run.q.size());
  for (Eigen::Index k = 0; k < out.size(); ++k) {
    const Eigen::VectorXd f = features(frequencies, run.q[k], run.speed[k]);
    const double usual = run.quiet_speed[k] > 0.0 ? steady_sigma : unsteady_sigma;
    out[k] = std::sqrt(usual * usual + f.dot(covariance * f));
  }
  return out;
}

std::vector<double> find_frequencies(const std::vector<const JointRun*>& runs) {
  const Rows rows = steady_rows(runs);
  RippleModel model;
  Eigen::VectorXd left = fit(rows, model);
  for (int k = 0; k < kPeriods; ++k) {
    model.frequencies.push_back(strongest_frequency(rows, left));
    left = fit(rows, model);
  }
  return model.frequencies;
}

RippleModel learn_ripple(const std::vector<const JointRun*>& runs,
                         const std::vector<double>& frequencies) {
  RippleModel model;
  model.frequencies = frequencies;
  fit(steady_rows(runs), model);
  double squares = 0.0;
  double count = 0.0;
  for (const JointRun* run : runs) {
    const Eigen::VectorXd miss = run->current - model.predict(*run);
    for (Eigen::Index k = 0; k < run->free; ++k) {
      if (run->quiet_speed[k] > 0.0) continue;
      squares += miss[k] * miss[k];
      count += 1.0;
    }
  }
  model.unsteady_sigma = std::sqrt(squares / std::max(1.0, count));
  return model;
}

}  // namespace kinescope
