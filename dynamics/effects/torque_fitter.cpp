// SPDX-License-Identifier: Apache-2.0
//
// measured(t + delay) = lag (sensor * (rigid bodies + effects))(t) + noise: linear in nearly
// everything.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "dynamics/effects/candidates.h"
#include "dynamics/effects/torque_parts.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope::effects {
namespace {

constexpr int kMostSteps = 40;
constexpr double kSettled = 1e-5;    // of the residual's length
constexpr double kBasePrior = 1e-6;  // of what the whole log says about a base parameter
// Widths of the turn of friction: within these factors of the nominal one, by which they are drawn
// (a log that does not show them leaves them there).
constexpr double kNarrowest = 0.05;
constexpr double kWidest = 4.0;
constexpr double kWidthPrior = 1.0;  // of the logarithm

bool is_coupling(const Candidate& candidate) { return candidate.parameters.size() > 1; }

/// H x = g with columns scaled to length 1; directions that nothing determines stay.
Eigen::VectorXd scaled_solve(const Eigen::MatrixXd& H, const Eigen::VectorXd& g) {
  const Eigen::VectorXd scale = unit_scale(H);
  Eigen::MatrixXd scaled = scale.asDiagonal() * H * scale.asDiagonal();
  scaled.diagonal().array() += 1e-12;
  const Eigen::VectorXd right = scale.asDiagonal() * g;
  return scale.asDiagonal() * solve_symmetric(scaled, right);
}

}  // namespace

const Candidate& candidate_of(const std::vector<Candidate>& candidates, const EffectId& id) {
  const auto found = std::ranges::find(candidates, id, &Candidate::id);
  KINESCOPE_CHECK(found != candidates.end(), "effects that `candidates` named");
  return *found;
}

TorqueFitter::TorqueFitter(const TorqueTracedModel::Parts& parts,
                           const std::vector<AddedEffect>& effects)
    : parts_(parts), joints_(parts.motion->joints()), instants_(parts.motion->instants()) {
  set_gravity(Eigen::Vector2d::Zero());
  for (Eigen::Index j = 0; j < joints_; ++j) {
    if (parts_.coulomb[j] > 0.0) turning_.push_back(j);
  }
  read(effects);
}

void TorqueFitter::read(const std::vector<AddedEffect>& effects) {
  for (const AddedEffect& effect : effects) {
    const Candidate& candidate = candidate_of(candidates_, effect.id);
    Added added;
    added.effect = effect;
    added.first = effect_parameters_;
    added.values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(candidate.parameters.size()));
    effect_parameters_ += added.values.size();
    const std::string& name = effect.id.effect;
    if (name == "torque_delay") added.kind = Kind::kDelay;
    if (name == "torque_lag") added.kind = Kind::kLag;
    if (name == "torque_gain") added.kind = Kind::kGain;
    if (name == "gravity_direction") added.kind = Kind::kGravity;
    if (name == "cross_talk" && !is_coupling(candidate)) added.kind = Kind::kCross;
    const auto& names = parts_.context.joints;
    for (std::size_t j = 0; j < names.size(); ++j) {
      if (effect.id.place == names[j] || effect.id.place.starts_with(names[j] + " ")) {
        added.joint = static_cast<Eigen::Index>(j);
      }
      if (effect.id.place.ends_with(" from " + names[j])) added.from = static_cast<Eigen::Index>(j);
    }
    const bool turns = std::ranges::find(turning_, added.joint) != turning_.end();
    if (name == "coulomb" && !turns) turning_.push_back(added.joint);
    added_.push_back(std::move(added));
  }
}

void TorqueFitter::set_gravity(const Eigen::Vector2d& tilt_deg) {
  set_gravity(tilt_deg.isZero(0.0) ? parts_.upright
                                   : make_gravity_case(parts_, tilt_deg, parts_.context.rigid));
}

/// From where it points by now, the masses as they are found.
void TorqueFitter::tilt_base(const Eigen::Vector2d& tilt_deg) {
  if (parts_.base.kind == TorqueBaseKind::kIdentified) {
    // The tilt's columns at the masses found; what the log does not show of them stays unknown.
    set_gravity(make_gravity_case(parts_, tilt_deg, fitted().rigid));
  } else {
    set_gravity(tilt_deg);
  }
}

void TorqueFitter::set_gravity_start(int start) {
  const Eigen::Vector2d tilt_deg = gravity_starts()[static_cast<std::size_t>(start)];
  set_gravity(tilt_deg.isZero(0.0) ? parts_.upright : parts_.starts.get(start, [&] {
    return make_gravity_case(parts_, tilt_deg, parts_.context.rigid);
  }));
}

void TorqueFitter::set_gravity(std::shared_ptr<const GravityCase> gravity) {
  case_ = std::move(gravity);
  const Eigen::VectorXd widths = context_.widths;
  context_ = case_->context;
  if (widths.size() > 0) context_.widths = widths;
  candidates_ = make_candidates(context_);
  base_values_ = Eigen::VectorXd::Zero(case_->parameters());
}

void TorqueFitter::set_widths(const Eigen::VectorXd& widths) {
  context_.widths = widths;
  candidates_ = make_candidates(context_);
}

FittedTorque TorqueFitter::fitted() const {
  FittedTorque out{case_->rigid, context_.widths, parts_.viscous, parts_.coulomb};
  if (parts_.base.kind == TorqueBaseKind::kIdentified) {
    out.rigid = with_body_parameters(case_->rigid, case_->bodies * base_values_);
  }
  return out;
}

Eigen::MatrixXd TorqueFitter::own_prior() const {
  const Eigen::Index n = own_parameters() + effect_parameters_;
  Eigen::VectorXd of_each = Eigen::VectorXd::Zero(n);
  of_each.head(base_values_.size()).setConstant(kBasePrior);
  of_each.segment(base_values_.size(), free_widths()).setConstant(kWidthPrior);
  return of_each.asDiagonal();
}

/// A width that would leave its range stays at its end.
bool TorqueFitter::at_a_bound(Eigen::Index turning, double change) const {
  const Eigen::Index joint = turning_[static_cast<std::size_t>(turning)];
  const double ratio = context_.widths[joint] / parts_.context.widths[joint];
  constexpr double kRounding = 1e-9;
  return (change < 0.0 && ratio <= kNarrowest * (1.0 + kRounding)) ||
         (change > 0.0 && ratio >= kWidest * (1.0 - kRounding));
}

Eigen::VectorXd TorqueFitter::solve(const Normal& normal, bool move) const {
  const Eigen::Index p = base_values_.size();
  Eigen::MatrixXd H = normal.H + own_prior();
  Eigen::VectorXd g = normal.g;
  g.head(p) -= kBasePrior * base_values_;
  for (Eigen::Index k = 0; k < free_widths(); ++k) {
    const Eigen::Index joint = turning_[static_cast<std::size_t>(k)];
    g[p + k] -= kWidthPrior * std::log(context_.widths[joint] / parts_.context.widths[joint]);
  }
  Eigen::VectorXd change = Eigen::VectorXd::Zero(g.size());
  if (move || free_widths() == 0) change = scaled_solve(H, g);
  bool held = false;
  for (Eigen::Index k = 0; k < free_widths(); ++k) {
    if (move && !at_a_bound(k, change[p + k])) continue;
    H.row(p + k).setZero();
    H.col(p + k).setZero();
    g[p + k] = 0.0;
    held = true;
  }
  if (held) change = scaled_solve(H, g);
  return change;
}

/// One step of all parameters; gives its length beside the residual's.
double TorqueFitter::step() {
  make_design();
  const Normal equations = normal();
  if (equations.g.size() == 0) return 0.0;
  if (free_widths() > 0) keep_best_widths(equations);
  const Eigen::VectorXd change = solve(equations, true);
  const double length = std::sqrt(std::max(0.0, change.dot(equations.H * change)) /
                                  std::max(equations.squares, 1e-300));
  apply(change);
  return length;
}

/// By what is left when all that is linear is fitted beside them.
void TorqueFitter::keep_best_widths(const Normal& equations) {
  const double left = equations.squares - equations.g.dot(solve(equations, false));
  if (best_widths_.size() > 0 && !(left < least_left_)) return;
  least_left_ = left;
  best_widths_ = context_.widths;
}

/// All that is linear, beside the best widths there were: a last step that moved them far has left
/// the rest where it was.
void TorqueFitter::settle_on_best_widths() {
  make_design();
  keep_best_widths(normal());
  set_widths(best_widths_);
  make_design();
  const Eigen::VectorXd change = solve(normal(), false);
  last_widths_.resize(0);
  apply(change);
}

/// Widths bend the model: Gauss-Newton alone halves their error in a step or two. Each is nearly a
/// matter of its own, so that a secant over the changes that were asked for finds where none is.
void TorqueFitter::move_widths(const Eigen::VectorXd& change) {
  constexpr double kLongest = 0.5;  // step of a width's logarithm
  constexpr double kFlattest = 0.2, kSteepest = 2.0;
  Eigen::VectorXd now(free_widths());
  Eigen::VectorXd widths = context_.widths;
  for (Eigen::Index k = 0; k < free_widths(); ++k) {
    const Eigen::Index joint = turning_[static_cast<std::size_t>(k)];
    const double nominal = parts_.context.widths[joint];
    now[k] = std::log(widths[joint]);
    double step = change[k];
    const double moved = last_widths_.size() > 0 ? now[k] - last_widths_[k] : 0.0;
    if (moved != 0.0) {
      const double slope = (last_change_[k] - change[k]) / moved;
      if (slope > 0.0) step /= std::clamp(slope, kFlattest, kSteepest);
    }
    widths[joint] = std::clamp(widths[joint] * std::exp(std::clamp(step, -kLongest, kLongest)),
                               kNarrowest * nominal, kWidest * nominal);
  }
  last_widths_ = now;
  last_change_ = change;
  set_widths(widths);
}

/// Free bodies say themselves what load it is that rubs.
void TorqueFitter::take_load_of_base() {
  const bool rubs = std::ranges::any_of(
      added_, [](const Added& added) { return added.effect.id.effect == "load_friction"; });
  if (!rubs || base_values_.isZero(0.0)) return;
  for (Eigen::Index j = 0; j < joints_; ++j)
    context_.load.col(j) = case_->base[static_cast<std::size_t>(j)] * base_values_;
  candidates_ = make_candidates(context_);
}

void TorqueFitter::apply(const Eigen::VectorXd& change) {
  const Eigen::Index p = base_values_.size();
  base_values_ += change.head(p);
  Eigen::Vector2d tilt = case_->tilt_deg;
  for (Added& added : added_) {
    const Eigen::VectorXd own = change.segment(own_parameters() + added.first, added.values.size());
    if (added.kind == Kind::kGravity) {
      // From where it points: about the model's own, a tilt of 180 degrees is every way the same.
      added.values = tilt =
          tilt_between(parts_.base.rigid.gravity_m_s2, tilted(case_->rigid.gravity_m_s2, own));
    } else {
      added.values += own;
    }
    // A drive that leads its torque is none; the search asks whether its lag may be nothing.
    if (added.kind == Kind::kLag) added.values = added.values.cwiseMax(0.0).eval();
  }
  if (tilt != case_->tilt_deg) tilt_base(tilt);
  take_load_of_base();
  if (free_widths() > 0) move_widths(change.segment(p, free_widths()));
}

/// A base on a wall is far from one on the floor: the axes' directions are tried first.
void TorqueFitter::choose_gravity_start(Added& gravity) {
  const auto starts = gravity_starts();
  double best = std::numeric_limits<double>::infinity();
  int chosen = 0;
  for (int start = 0; start < kGravityStarts; ++start) {
    gravity.values = starts[static_cast<std::size_t>(start)];
    set_gravity_start(start);
    make_design();
    // What is left when all that is linear is fitted and the tilt stays.
    Normal linear = normal();
    const Eigen::Index at = own_parameters() + gravity.first;
    linear.H.middleCols(at, gravity.values.size()).setZero();
    linear.H.middleRows(at, gravity.values.size()).setZero();
    linear.g.segment(at, gravity.values.size()).setZero();
    const double cost = linear.squares - linear.g.dot(scaled_solve(linear.H, linear.g));
    if (cost < best) {
      best = cost;
      chosen = start;
    }
  }
  gravity.values = starts[static_cast<std::size_t>(chosen)];
  set_gravity_start(chosen);
}

TracedFit TorqueFitter::run() {
  const auto gravity = std::ranges::find(added_, Kind::kGravity, &Added::kind);
  if (gravity != added_.end()) choose_gravity_start(*gravity);
  bool converged = false;
  for (int k = 0; k < kMostSteps && !converged; ++k) converged = step() < kSettled;
  if (free_widths() > 0 && !converged) settle_on_best_widths();
  make_design();
  const bool finite = std::ranges::all_of(
      design_, [](const JointDesign& rows) { return rows.residual.allFinite(); });
  return read_back(finite);
}

}  // namespace kinescope::effects
