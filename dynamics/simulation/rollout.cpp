// SPDX-License-Identifier: Apache-2.0
#include "dynamics/simulation/rollout.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/LU>
#include <fmt/format.h>

#include "dynamics/data/splits.h"
#include "dynamics/simulation/simulation.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Rows of one window: from its first sample to the last within the horizon.
struct Window {
  Eigen::Index first = 0;
  Eigen::Index last = 0;
};

/// The leaf that most joints move, the last of them in the tree's order.
std::optional<LinkId> tip_of(const KinematicTree& tree) {
  std::optional<LinkId> out;
  std::size_t longest = 1;
  for (const Joint& joint : tree.joints) {
    const std::size_t length = tree.path_to(joint.child).size();
    if (length < longest) continue;
    longest = length;
    out = joint.child;
  }
  return out;
}

std::vector<Window> windows_of(const TorqueSamples& samples, double horizon_s, int most) {
  std::vector<Window> all;
  double next_start_s = -kInfinity;
  for (Eigen::Index i = 0; i < samples.size(); ++i) {
    if (i > 0 && samples.trajectory[i] != samples.trajectory[i - 1]) {
      next_start_s = -kInfinity;
    }
    if (samples.t_s[i] < next_start_s) continue;
    Eigen::Index last = i;
    // Rounding of stamps must not end a window a sample early.
    constexpr double kRounding = 1e-9;
    while (last + 1 < samples.size() && samples.trajectory[last + 1] == samples.trajectory[i] &&
           samples.t_s[last + 1] <= samples.t_s[i] + horizon_s * (1.0 + kRounding)) {
      ++last;
    }
    const bool whole = last + 1 == samples.size()
                           ? samples.t_s[last] >= samples.t_s[i] + horizon_s * (1.0 - kRounding)
                           : samples.trajectory[last + 1] == samples.trajectory[i];
    if (!whole || last == i) continue;
    all.push_back({i, last});
    next_start_s = samples.t_s[i] + 0.5 * horizon_s;
  }
  if (std::ssize(all) <= most) return all;
  std::vector<Window> out;
  for (int k = 0; k < most; ++k) {
    out.push_back(all[static_cast<std::size_t>(k) * (all.size() - 1) /
                      static_cast<std::size_t>(std::max(1, most - 1))]);
  }
  return out;
}

/// True torques of the actuators at the samples: what the sensors do undone.
Eigen::MatrixXd true_torques(const Plant& plant, const TorqueSamples& samples) {
  const EffectMotion motion(samples, {.every_sample = true});
  Eigen::MatrixXd in_time = samples.torque;
  for (Eigen::Index j = 0; j < in_time.cols(); ++j) {
    if (plant.delay_s[j] != 0.0) in_time.col(j) = motion.shifted(in_time.col(j), plant.delay_s[j]);
    in_time.col(j) = motion.before_lag(in_time.col(j), plant.lag_s[j]);
  }
  return plant.gain.fullPivLu().solve(in_time.transpose()).transpose();
}

void drive(Simulation& simulation, const TorqueSamples& samples, const Eigen::MatrixXd& torques,
           const Window& window, double most_step_s) {
  PlantState state =
      PlantState::at(simulation.plant(), samples.q.row(window.first).transpose(),
                     samples.dq.row(window.first).transpose(), samples.t_s[window.first]);
  state.ddq = samples.ddq.row(window.first).transpose();
  simulation.set_state(std::move(state));
  Eigen::VectorXd torque;
  for (Eigen::Index i = window.first; i < window.last; ++i) {
    const double span_s = samples.t_s[i + 1] - samples.t_s[i];
    const auto steps = std::max(1, static_cast<int>(std::ceil(span_s / most_step_s)));
    for (int k = 0; k < steps; ++k) {
      const double share = (k + 0.5) / steps;
      torque = ((1.0 - share) * torques.row(i) + share * torques.row(i + 1)).transpose();
      (void)simulation.step(torque, span_s / steps);
    }
  }
}

/// The posture at the window's end; not finite, with the reason, where the model gets lost.
Eigen::VectorXd end_of(Simulation& simulation, const TorqueSamples& samples,
                       const Eigen::MatrixXd& torques, const Window& window, double most_step_s,
                       std::string& reason) {
  try {
    drive(simulation, samples, torques, window, most_step_s);
    return simulation.state().q;
  } catch (const Error& error) {
    reason = error.what();
    return Eigen::VectorXd::Constant(samples.joints(), kInfinity);
  }
}

/// Errors of all windows of one horizon.
class Errors {
 public:
  Errors(const KinematicTree& tree, const std::optional<LinkId>& tip, Eigen::Index joints)
      : tree_(tree), tip_(tip), joints_(static_cast<std::size_t>(joints)) {}

  /// `q` is not finite where the model lost itself.
  void add(const Eigen::VectorXd& q, const Eigen::VectorXd& measured) {
    if (!q.allFinite()) {
      for (std::vector<double>& errors : joints_) errors.push_back(kInfinity);
      if (tip_) tool_.push_back(kInfinity);
      return;
    }
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      const auto i = static_cast<Eigen::Index>(j);
      joints_[j].push_back(std::abs(q[i] - measured[i]));
    }
    if (tip_) tool_.push_back((tip_at(q) - tip_at(measured)).norm());
  }

  [[nodiscard]] RolloutError median() {
    RolloutError out{Eigen::VectorXd(std::ssize(joints_)),
                     tip_ ? median_of(tool_) : std::numeric_limits<double>::quiet_NaN()};
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      out.joints[static_cast<Eigen::Index>(j)] = median_of(joints_[j]);
    }
    return out;
  }

 private:
  [[nodiscard]] Eigen::Vector3d tip_at(const Eigen::VectorXd& q) const {
    Eigen::VectorXd all = Eigen::VectorXd::Zero(std::ssize(tree_.joints));
    const std::vector<JointId> moving = moving_joints(tree_);
    for (std::size_t j = 0; j < moving.size(); ++j) {
      all[static_cast<Eigen::Index>(moving[j].index())] = q[static_cast<Eigen::Index>(j)];
    }
    return forward_kinematics(tree_, all)[tip_->index()].translation;
  }

  const KinematicTree& tree_;
  std::optional<LinkId> tip_;
  std::vector<std::vector<double>> joints_;
  std::vector<double> tool_;
};

CorrectedTorqueModel without_effects(const CorrectedTorqueModel& model) {
  CorrectedTorqueModel out = model;
  out.effects.clear();
  out.in_model.clear();
  return out;
}

}  // namespace

Rollout roll_out(const CorrectedTorqueModel& model, const KinematicTree& tree,
                 const TorqueSamples& log, const RolloutOptions& options) {
  const TorqueSamples samples = split_at_gaps(log);
  KINESCOPE_CHECK(samples.joints() == model.base.rigid.size(), "samples of this robot");
  Rollout out;
  const std::optional<LinkId> tip = tip_of(tree);
  if (tip) out.tip = tree.links[tip->index()].name;
  const Plant plant = make_plant(model);
  const Plant bare = make_plant(without_effects(model));
  const Eigen::MatrixXd torques = true_torques(plant, samples);
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(plant.size());
  Simulation traced(plant, PlantState::at(plant, zero, zero));
  Simulation plain(bare, PlantState::at(bare, zero, zero));
  std::string reason;
  std::string not_of_interest;
  for (const double horizon_s : options.horizons_s) {
    const std::vector<Window> windows = windows_of(samples, horizon_s, options.most_windows);
    if (windows.empty()) continue;
    Errors with(tree, tip, plant.size());
    Errors without = with;
    Errors held = with;
    for (const Window& window : windows) {
      const Eigen::VectorXd end = samples.q.row(window.last).transpose();
      with.add(end_of(traced, samples, torques, window, options.step_s, reason), end);
      without.add(end_of(plain, samples, samples.torque, window, options.step_s, not_of_interest),
                  end);
      held.add(samples.q.row(window.first).transpose(), end);
    }
    out.horizons.push_back({horizon_s, static_cast<int>(windows.size()), with.median(),
                            without.median(), held.median()});
  }
  if (out.horizons.empty()) out.failure = "the log is too short";
  const bool lost = std::ranges::any_of(out.horizons, [](const RolloutHorizon& horizon) {
    return !horizon.with_effects.joints.allFinite();
  });
  if (lost) out.failure = reason;
  return out;
}

}  // namespace kinescope
