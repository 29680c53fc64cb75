// SPDX-License-Identifier: Apache-2.0
#include "dynamics/simulation/simulation.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "dynamics/simulation/drive_torque.h"
#include "kinematics/core/error.h"

namespace kinescope {

PlantState PlantState::at(const Plant& plant, Eigen::VectorXd q, Eigen::VectorXd dq, double t_s) {
  KINESCOPE_CHECK(q.size() == plant.size() && dq.size() == q.size(),
                  "one position and rate a movable joint");
  PlantState out{t_s, std::move(q), std::move(dq), Eigen::VectorXd::Zero(plant.size()), {}};
  for (std::size_t j = 0; j < plant.drives.size(); ++j) {
    out.presliding.emplace_back(plant.drives[j].presliding.size(),
                                effects::sign_of(out.dq[static_cast<Eigen::Index>(j)]));
  }
  return out;
}

Simulation::Simulation(Plant plant, PlantState state)
    : plant_(std::move(plant)),
      momentum_(plant_.rigid),
      newton_euler_(plant_.rigid),
      load_newton_euler_(plant_.unloaded) {
  const Eigen::Index n = plant_.size();
  zero_ = q_mid_ = dq_mid_ = bias_ = load_ = right_ = speed_ = Eigen::VectorXd::Zero(n);
  const Eigen::Index count = n + std::ssize(plant_.coupled);
  rows_ = Eigen::MatrixXd::Zero(count, n);
  rows_.topRows(n).setIdentity();
  elements_.resize(static_cast<std::size_t>(count));
  for (Eigen::Index j = 0; j < n; ++j) {
    const JointDrive& drive = plant_.drives[static_cast<std::size_t>(j)];
    has_load_ = has_load_ || drive.share_of_load != 0.0;
    DryElement& element = elements_[static_cast<std::size_t>(j)];
    element.width = drive.width;
    for (const auto& part : drive.presliding) {
      element.presliding.push_back({part.friction, part.length, 0.0});
    }
  }
  for (Eigen::Index k = n; k < count; ++k) {
    const CoupledDrive& drive = plant_.coupled[static_cast<std::size_t>(k - n)];
    rows_.row(k) = drive.weights.transpose();
    elements_[static_cast<std::size_t>(k)].width = drive.width;
  }
  set_state(std::move(state));
}

void Simulation::set_state(PlantState state) {
  KINESCOPE_CHECK(state.q.size() == plant_.size() && state.dq.size() == plant_.size() &&
                      state.ddq.size() == plant_.size() &&
                      state.presliding.size() == plant_.drives.size(),
                  "a state of this plant");
  state_ = std::move(state);
  friction_ = Eigen::VectorXd::Zero(rows_.rows());
}

/// Mass matrix, torque of everything smooth, amplitudes of friction, at q_mid_ and dq_mid_.
void Simulation::evaluate(double t_s) {
  mass_ = momentum_.evaluate(q_mid_, dq_mid_).mass + plant_.coupled_inertia;
  newton_euler_.torque(q_mid_, dq_mid_, zero_, bias_);
  if (has_load_) load_newton_euler_.torque(q_mid_, dq_mid_, state_.ddq, load_);
  for (Eigen::Index j = 0; j < bias_.size(); ++j) {
    const auto joint = static_cast<std::size_t>(j);
    const JointDrive& drive = plant_.drives[joint];
    bias_[j] += smooth_torque(drive, q_mid_[j], dq_mid_[j], t_s);
    double amplitude = dry_amplitude(drive, q_mid_[j], dq_mid_[j], t_s, load_[j]);
    DryElement& element = elements_[joint];
    if (amplitude < 0.0) {
      // A law that drives is no friction: explicit, and no hold at rest.
      bias_[j] += amplitude * effects::direction(dq_mid_[j], element.width);
      amplitude = 0.0;
    }
    element.amplitude = amplitude;
  }
}

/// (M + h/2 V) dq_after = right - h friction.
void Simulation::make_right_side(const Eigen::VectorXd& torque, double step_s) {
  const double half = 0.5 * step_s;
  q_mid_ = state_.q + half * state_.dq;
  dq_mid_ = state_.dq + half * state_.ddq;
  evaluate(state_.t_s + half);
  right_.noalias() = mass_ * state_.dq;
  right_.noalias() -= half * plant_.viscous * state_.dq;
  right_ += step_s * (torque - bias_);
  mass_ += half * plant_.viscous;
}

void Simulation::make_elements() {
  const std::size_t joints = plant_.drives.size();
  for (std::size_t e = 0; e < elements_.size(); ++e) {
    DryElement& element = elements_[e];
    element.speed_before = rows_.row(static_cast<Eigen::Index>(e)).dot(state_.dq);
    if (e >= joints) element.amplitude = plant_.coupled[e - joints].coulomb;
    for (std::size_t k = 0; k < element.presliding.size(); ++k) {
      element.presliding[k].state = state_.presliding[e][k];
    }
  }
}

void Simulation::add_friction(double step_s) {
  solved_rows_ = rows_.transpose();
  factor_.solveInPlace(solved_rows_);
  compliance_.noalias() = rows_ * solved_rows_;
  free_.noalias() = rows_ * speed_;
  const DrySolution& dry = solver_.solve(elements_, compliance_, free_, step_s, friction_);
  friction_ = dry.torque;
  speed_.noalias() -= step_s * solved_rows_ * friction_;
  // A joint that is held, exactly.
  for (Eigen::Index j = 0; j < speed_.size(); ++j) {
    if (dry.speed[j] == 0.0) speed_[j] = 0.0;
  }
}

void Simulation::move_presliding(double step_s) {
  for (std::size_t j = 0; j < plant_.drives.size(); ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    const double moved = 0.5 * step_s * (state_.dq[i] + speed_[i]);
    for (std::size_t k = 0; k < plant_.drives[j].presliding.size(); ++k) {
      double& z = state_.presliding[j][k];
      z = effects::dahl_after(z, moved, plant_.drives[j].presliding[k].length);
    }
  }
}

void Simulation::factorise() {
  factor_.compute(mass_);
  if (factor_.info() != Eigen::Success) {
    throw undetermined(
        "simulation",
        fmt::format("the mass matrix is not positive definite at {:.3f} s", state_.t_s),
        "give every moving link a mass, or its joint a motor inertia");
  }
}

const PlantState& Simulation::step(const Eigen::VectorXd& torque, double step_s) {
  KINESCOPE_CHECK(torque.size() == plant_.size() && step_s > 0.0, "one torque a movable joint");
  make_right_side(torque, step_s);
  factorise();
  speed_ = factor_.solve(right_);
  make_elements();
  add_friction(step_s);
  // No joint turns so fast: what drives it has lost it.
  constexpr double kLost = 1e6;
  if (!((speed_.array().abs() < kLost).all())) {
    throw undetermined("simulation",
                       fmt::format("the motion grows without bound at {:.3f} s", state_.t_s),
                       "lower the servo's gains or its delay, or take smaller steps");
  }
  move_presliding(step_s);
  state_.ddq = (speed_ - state_.dq) / step_s;
  state_.q = q_mid_ + 0.5 * step_s * speed_;
  state_.dq = speed_;
  state_.t_s += step_s;
  return state_;
}

Eigen::VectorXd Simulation::acceleration(const Eigen::VectorXd& torque) {
  KINESCOPE_CHECK(torque.size() == plant_.size(), "one torque a movable joint");
  q_mid_ = state_.q;
  dq_mid_ = state_.dq;
  evaluate(state_.t_s);
  make_elements();
  bias_ += plant_.viscous * state_.dq;
  // What friction is where it is known; the rest may hold its joint.
  std::vector<DryElement> at_rest(elements_.size());
  for (std::size_t e = 0; e < elements_.size(); ++e) {
    const DryElement& element = elements_[e];
    double known = element.amplitude * effects::direction(element.speed_before, element.width);
    for (const auto& part : element.presliding) known += part.friction * part.state;
    bias_ += known * rows_.row(static_cast<Eigen::Index>(e)).transpose();
    const bool holds = element.width == 0.0 && element.speed_before == 0.0;
    at_rest[e].amplitude = holds ? element.amplitude : 0.0;
  }
  factorise();
  Eigen::VectorXd out = factor_.solve(torque - bias_);
  solved_rows_ = rows_.transpose();
  factor_.solveInPlace(solved_rows_);
  const DrySolution& dry = solver_.solve(at_rest, rows_ * solved_rows_, rows_ * out, 1.0,
                                         Eigen::VectorXd::Zero(rows_.rows()));
  out -= solved_rows_ * dry.torque;
  return out;
}

}  // namespace kinescope
