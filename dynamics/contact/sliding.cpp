// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/sliding.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/median.h"

namespace kinescope {
namespace {

/// Normal noise is beyond it once in 1e9 samples.
constexpr double kNoiseSigmas = 6.0;

/// White noise of the positions from their third differences, at least that of their quantum.
double position_noise(const Eigen::VectorXd& q) {
  std::vector<double> sizes;
  double quantum = 0.0;
  for (Eigen::Index k = 3; k < q.size(); ++k) {
    sizes.push_back(std::abs(q[k] - 3.0 * q[k - 1] + 3.0 * q[k - 2] - q[k - 3]));
    const double step = std::abs(q[k] - q[k - 1]);
    if (step > 0.0 && (quantum == 0.0 || step < quantum)) quantum = step;
  }
  constexpr double kMedianOfNormal = 0.6745;
  return std::max(median_of(std::move(sizes)) / kMedianOfNormal / std::sqrt(20.0),
                  quantum / std::sqrt(12.0));
}

/// For each sample the one `window_s` before and after it, at least one sample away, within the
/// motion.
struct Neighbours {
  std::vector<Eigen::Index> before, after;
};

Neighbours neighbours(const Eigen::VectorXd& t_s, double window_s) {
  const double window = window_s * (1.0 - 1e-9);
  Neighbours out;
  Eigen::Index before = 0;
  Eigen::Index after = 0;
  for (Eigen::Index k = 0; k < t_s.size(); ++k) {
    while (before + 1 < k && t_s[k] - t_s[before + 1] >= window) ++before;
    after = std::max(after, std::min(k + 1, t_s.size() - 1));
    while (after + 1 < t_s.size() && t_s[after] - t_s[k] < window) ++after;
    out.before.push_back(before);
    out.after.push_back(after);
  }
  return out;
}

/// -1, 0, 1: which way the joint goes before and after the sample, 0 where it rests or turns.
int direction_at(const Eigen::VectorXd& t_s, const Eigen::VectorXd& q, const Neighbours& near,
                 Eigen::Index k, double rest_speed, double noise) {
  int out = 0;
  for (const auto* side : {&near.before, &near.after}) {
    const Eigen::Index other = (*side)[static_cast<std::size_t>(k)];
    if (other == k) continue;  // the motion's own end
    const double way = (q[other] - q[k]) * (other > k ? 1.0 : -1.0);
    const double least = rest_speed * std::abs(t_s[other] - t_s[k]) + noise;
    const int own = way > least ? 1 : way < -least ? -1 : 0;
    if (own == 0 || (out != 0 && own != out)) return 0;
    out = own;
  }
  return out;
}

bool turns(const RigidModel& model, Eigen::Index joint) {
  return model.bodies[static_cast<std::size_t>(joint)].type != JointType::kPrismatic;
}

}  // namespace

Eigen::MatrixXd ways_since_turns(const RigidModel& model, const Eigen::VectorXd& t_s,
                                 const Eigen::MatrixXd& q, const SlidingOptions& options) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(q.rows(), q.cols());
  const Neighbours near = neighbours(t_s, options.window_s);
  for (Eigen::Index j = 0; j < q.cols(); ++j) {
    const Eigen::VectorXd own = q.col(j);
    const double noise = kNoiseSigmas * std::sqrt(2.0) * position_noise(own);
    const double rest = turns(model, j) ? options.rest_speed_rad_s : options.rest_speed_m_s;
    int direction = 0;
    double from = 0.0;
    for (Eigen::Index k = 0; k < q.rows(); ++k) {
      const int now = direction_at(t_s, own, near, k, rest, noise);
      if (now != direction) from = own[k];
      direction = now;
      if (now != 0) out(k, j) = now * std::max(0.0, (own[k] - from) * now - noise);
    }
  }
  return out;
}

double presliding_of(const RigidModel& model, Eigen::Index joint, const SlidingOptions& options) {
  const double own = options.presliding.size() > 0 ? options.presliding[joint] : 0.0;
  if (own > 0.0) return own;
  return turns(model, joint) ? options.presliding_rad : options.presliding_m;
}

Eigen::MatrixXi sliding_states(const RigidModel& model, const Eigen::VectorXd& t_s,
                               const Eigen::MatrixXd& q, const SlidingOptions& options) {
  const Eigen::MatrixXd ways = ways_since_turns(model, t_s, q, options);
  Eigen::MatrixXi out = Eigen::MatrixXi::Zero(q.rows(), q.cols());
  for (Eigen::Index j = 0; j < q.cols(); ++j) {
    const double far = presliding_of(model, j, options);
    for (Eigen::Index k = 0; k < q.rows(); ++k)
      if (std::abs(ways(k, j)) >= far) out(k, j) = ways(k, j) > 0.0 ? 1 : -1;
  }
  return out;
}

Eigen::MatrixXi sliding_states(const RigidModel& model, const TorqueSamples& samples,
                               const SlidingOptions& options) {
  Eigen::MatrixXi out(samples.q.rows(), samples.q.cols());
  for (Eigen::Index first = 0; first < samples.size();) {
    Eigen::Index end = first;
    while (end < samples.size() && samples.trajectory[end] == samples.trajectory[first]) ++end;
    out.middleRows(first, end - first) =
        sliding_states(model, samples.t_s.segment(first, end - first),
                       samples.q.middleRows(first, end - first), options);
    first = end;
  }
  return out;
}

SlidCount slid(const Eigen::MatrixXi& states, Eigen::Index joint) {
  return {.forward = (states.col(joint).array() > 0).count(),
          .backward = (states.col(joint).array() < 0).count()};
}

}  // namespace kinescope
