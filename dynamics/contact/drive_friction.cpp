// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/drive_friction.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

#include "dynamics/identify/weighted_fit.h"
#include "kinematics/core/error.h"
#include "kinematics/core/golden_section.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

/// Breakaway beyond the sliding friction, at least, as a share of it: twice what a UR5's base shows
/// when it starts (build/test/contact logs_ur5).
constexpr double kLeastBreakaway = 0.5;
/// Sliding samples in a direction from which its friction is taken for known.
constexpr Eigen::Index kFewestSliding = 100;
/// Samples that a fit looks at; beyond them every second, third, .. is taken.
constexpr Eigen::Index kMostRows = 6000;
/// Friction just after breakaway: its doubt, a share of the breakaway friction, and how it fades. A
/// UR5's base starts with a quarter more than it slides with, for a quarter of a second
/// (build/test/contact logs_ur5).
constexpr double kAfterBreakaway = 0.25;
constexpr double kAfterBreakaway_s = 0.25;
constexpr double kAfterBreakaway_rad = 0.01;  ///< or over that way, where it is slower
/// Over this time the model's errors are one and the same: ContactOptions::longest_window_s.
constexpr double kIndependent_s = 0.25;
/// Time over which the momentum's rate is taken.
constexpr double kRateWindow_s = 0.05;
constexpr double kHalf = 0.5;
/// Friction is known down to half the speed below which the joint slid for so long; where it slid
/// less than twice that, to half its median.
constexpr double kKnownAfter_s = 8.0 * kIndependent_s;
/// And up to this times what 99 % of the samples do not pass: a margin for the noise of speeds.
constexpr double kBeyond = 1.2;
/// Where the search for the speed begins, rad/s: the best of them, and from there to its
/// neighbours.
constexpr std::array kBendSpeeds{0.005, 0.01, 0.02, 0.04, 0.08, 0.16};
constexpr double kNeighbour = 2.0;
/// To 1 % of the speed: what remains is a thousandth of the friction.
constexpr int kSpeedSteps = 10;
constexpr double kOutlier = 4.0;      ///< sigmas
constexpr double kLinearShare = 0.2;  ///< speeds of linear joints, m/s to rad/s

struct MotionTerms {
  Eigen::MatrixXd drive, momentum, rate;  ///< samples x joints; drive before friction
  std::vector<Eigen::MatrixXd> mass;
};

MotionTerms terms_of(const RigidModel& model, const TorqueSamples& motion) {
  MomentumRecursion recursion(model);
  MotionTerms out{.drive = motion.torque, .momentum = motion.torque, .rate = {}, .mass = {}};
  for (Eigen::Index t = 0; t < motion.size(); ++t) {
    const MomentumTerms& terms =
        recursion.evaluate(motion.q.row(t).transpose(), motion.dq.row(t).transpose());
    out.drive.row(t) += (terms.velocity_torque - terms.gravity_torque).transpose();
    out.momentum.row(t) = terms.momentum.transpose();
    out.mass.push_back(terms.mass);
  }
  out.rate = windowed_rates(motion.t_s, out.momentum);
  return out;
}

/// Sliding samples of one joint.
struct Slid {
  Eigen::VectorXd dq, direction, residual;
  double length_s = 0.0;
};

/// By which fits to the same samples are compared.
struct FitScale {
  double sigma = 0.0;
  double independent = 1.0;  ///< samples
};

struct Fit {
  double cost = 0.0;   ///< deviance with a penalty for parameters (Schwarz 1978)
  double sigma = 0.0;  ///< of its own residual
  FitScale by;         ///< that the cost is meant by
  SlidingFriction friction;
};

/// Samples that count as one are those of the residual's integral time, and of kIndependent_s at
/// the most.
double independent_samples(const Eigen::VectorXd& residuals, double sigma, double length_s) {
  const Eigen::Index rows = residuals.size();
  // Outliers would hide how the others hang together.
  const Eigen::VectorXd bounded = (residuals / sigma).cwiseMax(-kOutlier).cwiseMin(kOutlier);
  const double power = bounded.squaredNorm() / static_cast<double>(rows);
  const double noise = 2.0 / std::sqrt(static_cast<double>(rows));
  const double longest =
      std::max(1.0, kIndependent_s * static_cast<double>(rows) / std::max(length_s, 1e-9));
  double together = 1.0;
  for (Eigen::Index lag = 1; lag < rows && together < longest && power > 0.0; ++lag) {
    const Eigen::Index n = rows - lag;
    const double correlation =
        bounded.head(n).dot(bounded.tail(n)) / (static_cast<double>(n) * power);
    if (correlation < noise) break;
    together += 2.0 * correlation;
  }
  return static_cast<double>(rows) / std::min(together, longest);
}

/// Twice Huber's loss, of residuals in sigmas.
double huber_deviance(const Eigen::VectorXd& residuals, double sigma) {
  constexpr double kBend = 1.345;
  double sum = 0.0;
  for (const double value : residuals) {
    const double size = std::abs(value) / sigma;
    sum += size < kBend ? size * size : kBend * (2.0 * size - kBend);
  }
  return sum;
}

/// `scale`: none: the fit's own.
std::optional<Fit> fit_friction(const Slid& slid, const SlidingFriction& shape,
                                const std::optional<FitScale>& scale) {
  const Eigen::Index rows = slid.dq.size();
  const bool both = shape.slides_forward && shape.slides_backward;
  const bool stribeck = shape.stribeck_speed > 0.0;
  Eigen::MatrixXd columns(rows, 2 + (both ? 1 : 0) + (stribeck ? 1 : 0));
  columns.col(0).setOnes();
  columns.col(1) = slid.dq;
  if (both) columns.col(2) = slid.direction;
  if (both && shape.rise_speed > 0.0)
    columns.col(2).array() *= (slid.dq.array().abs() / shape.rise_speed).tanh();
  if (stribeck) {
    columns.rightCols(1) =
        slid.direction.array() * (-(slid.dq.array() / shape.stribeck_speed).square()).exp();
  }
  identify::StackedSystem system;
  system.joints = {identify::compact_columns(columns)};
  system.parameters = columns.cols();
  system.torque = slid.residual;
  system.weights = Eigen::MatrixXd::Ones(rows, 1);
  identify::WeightedFitOptions robust;
  robust.loss = RobustLoss::kHuber;
  const identify::WeightedFit fit = weighted_fit(system, robust);
  // A log without noise has rounding.
  const double least = 1e-9 * (1e-9 + slid.residual.cwiseAbs().maxCoeff());
  const double sigma = std::max(least, fit.sigma[0]);
  const FitScale by =
      scale ? *scale
            : FitScale{sigma, independent_samples(fit.residuals.col(0), sigma, slid.length_s)};
  Fit out{.cost = 0.0, .sigma = sigma, .by = by, .friction = shape};
  out.friction.offset = fit.parameters[0];
  out.friction.viscous = fit.parameters[1];
  if (both) out.friction.coulomb = fit.parameters[2];
  if (stribeck) out.friction.stribeck = fit.parameters[columns.cols() - 1];
  // Friction that grows from standstill on is no breakaway.
  if (out.friction.stribeck < 0.0) return std::nullopt;
  const auto parameters = columns.cols() + (stribeck ? 1 : 0) + (shape.rise_speed > 0.0 ? 1 : 0);
  out.cost =
      huber_deviance(fit.residuals.col(0), by.sigma) * by.independent / static_cast<double>(rows) +
      std::log(std::max(2.0, by.independent)) * static_cast<double>(parameters);
  return out;
}

void set_interval(SlidingFriction& friction) {
  const bool both = friction.slides_forward && friction.slides_backward;
  if (both) {
    const double size = std::abs(friction.coulomb);
    const double half = size + std::max(friction.stribeck, kLeastBreakaway * size);
    friction.lowest = friction.offset - half;
    friction.highest = friction.offset + half;
    return;
  }
  // One direction does not tell friction from an offset: none of it, or all of it may turn round.
  const double size = std::abs(friction.offset);
  const double half = size + std::max(friction.stribeck, kLeastBreakaway * size);
  friction.lowest = -half;
  friction.highest = half;
}

double speed_quantile(const Slid& slid, double share) {
  std::vector<double> speeds(slid.dq.begin(), slid.dq.end());
  for (double& speed : speeds) speed = std::abs(speed);
  const auto at =
      speeds.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(speeds.size() - 1));
  std::ranges::nth_element(speeds, at);
  return *at;
}

/// Acceleration that is clear of the noise while a joint slides, where its inertia is not known;
/// else infinite.
Eigen::VectorXd clear_accelerations(const RigidModel& model, const Eigen::MatrixXd& accelerations,
                                    const Eigen::MatrixXi& states) {
  constexpr double kSigmas = 6.0;
  constexpr double kMedianOfNormal = 0.6745;
  Eigen::VectorXd out =
      Eigen::VectorXd::Constant(model.size(), std::numeric_limits<double>::infinity());
  if (!body_parameters(model).isZero(0.0)) return out;
  for (Eigen::Index j = 0; j < model.size(); ++j) {
    if (model.bodies[static_cast<std::size_t>(j)].motor_inertia != 0.0) continue;
    std::vector<double> sizes;
    for (Eigen::Index t = 0; t < states.rows(); ++t) {
      if (states(t, j) != 0) sizes.push_back(std::abs(accelerations(t, j)));
    }
    out[j] = kSigmas / kMedianOfNormal * median_of(std::move(sizes));
  }
  return out;
}

SlidingFriction friction_from(const Slid& slid, bool turns) {
  SlidingFriction shape;
  shape.slides_forward = (slid.direction.array() > 0.0).count() >= kFewestSliding;
  shape.slides_backward = (slid.direction.array() < 0.0).count() >= kFewestSliding;
  if (!shape.known()) return shape;
  std::optional<Fit> best = fit_friction(slid, shape, {});
  const FitScale scale = best->by;
  const auto try_speed = [&](double SlidingFriction::* own, double speed) {
    SlidingFriction with = shape;
    with.*own = speed;
    const std::optional<Fit> fit = fit_friction(slid, with, scale);
    if (fit && fit->cost < best->cost) best = fit;
    return fit ? -fit->cost : -std::numeric_limits<double>::infinity();
  };
  std::vector<double SlidingFriction::*> bends{&SlidingFriction::stribeck_speed};
  // Of one direction, all of it would be an offset.
  if (shape.slides_forward && shape.slides_backward) bends.push_back(&SlidingFriction::rise_speed);
  for (double SlidingFriction::* bend : bends) {
    for (const double speed : kBendSpeeds) try_speed(bend, turns ? speed : kLinearShare * speed);
  }
  for (double SlidingFriction::* bend : bends) {
    const double speed = best->friction.*bend;
    if (speed == 0.0) continue;
    const Maximum found =
        golden_section([&](double log_speed) { return try_speed(bend, std::exp(log_speed)); },
                       std::log(speed / kNeighbour), std::log(speed * kNeighbour), kSpeedSteps);
    try_speed(bend, std::exp(found.at));
  }
  best->friction.sigma = best->sigma;
  best->friction.slid_s = slid.length_s;
  best->friction.slowest_known =
      0.5 * speed_quantile(slid, std::min(0.5, kKnownAfter_s / slid.length_s));
  best->friction.fastest_known = kBeyond * speed_quantile(slid, 0.99);
  set_interval(best->friction);
  return best->friction;
}

/// What friction may be; one number where it is known.
struct FrictionInterval {
  double lowest = 0.0;
  double highest = 0.0;
};

/// `sliding`: what it takes where it slides; `speed`: smoothed; `direction`: 0 where the joint may
/// stick, or was not seen to slide.
FrictionInterval interval_of(const SlidingFriction& own, double sliding, double dq, double speed,
                             int direction) {
  const double viscous = own.viscous * dq;
  if (direction == 0) return {viscous + own.lowest, viscous + own.highest};
  const double size = std::abs(speed);
  if (size > own.fastest_known) {
    const double more = std::abs(own.viscous) * (size - own.fastest_known);
    return {sliding - more, sliding + more};
  }
  if (size >= own.slowest_known) return {sliding, sliding};
  return direction > 0 ? FrictionInterval{sliding, std::max(sliding, viscous + own.highest)}
                       : FrictionInterval{std::min(sliding, viscous + own.lowest), sliding};
}

/// Where friction rises with the speed it is as little known as that is.
FrictionInterval with_doubt_of_speed(FrictionInterval taken, const SlidingFriction& own,
                                     double speed, double doubt, int direction) {
  if (own.rise_speed == 0.0 || direction == 0) return taken;
  const auto risen = [&](double at) {
    return std::abs(own.coulomb) * std::tanh(at / own.rise_speed);
  };
  const double below = risen(speed) - risen(speed - doubt);
  const double above = risen(speed + doubt) - risen(speed);
  if (std::max(below, above) < own.sigma) return taken;
  return {taken.lowest - below, taken.highest + above};
}

/// Where the torque was not measured friction may be anything; what was cut off at a limit may have
/// been larger, and no less.
FrictionInterval with_missing(FrictionInterval taken, const TorqueSamples& motion, Eigen::Index t,
                              Eigen::Index joint) {
  constexpr double kAnything = std::numeric_limits<double>::infinity();
  const double torque = motion.torque(t, joint);
  const bool upper = torque == motion.torque.col(joint).maxCoeff();
  const bool lower = torque == motion.torque.col(joint).minCoeff();
  if (!lower) taken.lowest = -kAnything;
  if (!upper) taken.highest = kAnything;
  return taken;
}

struct JointPast {
  bool has_slid = false;
  double stuck_until_s = 0.0;
  double stuck_at = 0.0;
  double fade_way = 0.0;

  /// Of friction after breakaway, in units of what sliding leaves unexplained.
  [[nodiscard]] double doubt(const SlidingFriction& own, double t_s, double q) const {
    const double fades =
        std::min((t_s - stuck_until_s) / kAfterBreakaway_s, std::abs(q - stuck_at) / fade_way);
    return kAfterBreakaway * 0.5 * (own.highest - own.lowest) / own.sigma * std::exp(-fades);
  }
};

/// Slope of each column between the samples before and after, per s.
Eigen::MatrixXd rates_between_neighbours(const Eigen::VectorXd& t_s,
                                         const Eigen::MatrixXd& values) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(values.rows(), values.cols());
  const Eigen::Index last = values.rows() - 1;
  for (Eigen::Index k = 0; k <= last; ++k) {
    const Eigen::Index before = std::max<Eigen::Index>(k - 1, 0);
    const Eigen::Index after = std::min(k + 1, last);
    if (t_s[after] > t_s[before])
      out.row(k) = (values.row(after) - values.row(before)) / (t_s[after] - t_s[before]);
  }
  return out;
}

/// Of presliding as it is usual, chosen: beyond 5 degrees a joint is elastic, and does not stick.
constexpr double kLongestPresliding = 32.0;
/// Turns from which on most of them say how far a joint moves until it slides; chosen.
constexpr std::size_t kFewestTurns = 4;

/// One joint in all motions.
struct JointRecord {
  const std::vector<TorqueSamples>& motions;
  const std::vector<Eigen::MatrixXd>& residuals;
  const std::vector<Eigen::MatrixXd>& ways;
  Eigen::Index joint = 0;

  [[nodiscard]] Slid slid(double presliding) const {
    std::vector<std::array<double, 3>> rows;
    Slid out;
    for (std::size_t m = 0; m < motions.size(); ++m) {
      for (Eigen::Index t = 1; t < motions[m].size(); ++t) {
        const double gone = ways[m](t, joint);
        if (std::abs(gone) < presliding || motions[m].is_missing(t, joint)) continue;
        rows.push_back({motions[m].dq(t, joint), gone > 0.0 ? 1.0 : -1.0, residuals[m](t, joint)});
        out.length_s += motions[m].t_s[t] - motions[m].t_s[t - 1];
      }
    }
    const auto all = static_cast<Eigen::Index>(rows.size());
    const Eigen::Index step = all / kMostRows + 1;
    const Eigen::Index kept = (all + step - 1) / step;
    out.dq.resize(kept);
    out.direction.resize(kept);
    out.residual.resize(kept);
    for (Eigen::Index k = 0; k < kept; ++k) {
      const auto& row = rows[static_cast<std::size_t>(k * step)];
      out.dq[k] = row[0];
      out.direction[k] = row[1];
      out.residual[k] = row[2];
    }
    return out;
  }

  /// Just beyond the way after which it is taken to slide, most of its turns lack or have more
  /// torque than it slides with, and by more than the scatter of sliding.
  [[nodiscard]] bool slides_later(const SlidingFriction& friction, double presliding) const {
    std::vector<double> means;  // of every turn, along the motion
    for (std::size_t m = 0; m < motions.size(); ++m) {
      double sum = 0.0;
      double count = 0.0;
      for (Eigen::Index t = 0; t < motions[m].size(); ++t) {
        const double gone = ways[m](t, joint);
        const int direction = gone > 0.0 ? 1 : -1;
        const bool inside = std::abs(gone) >= presliding && std::abs(gone) < 2.0 * presliding &&
                            friction.known(direction) && !motions[m].is_missing(t, joint);
        if (inside) {
          sum += direction *
                 (residuals[m](t, joint) - friction.sliding(motions[m].dq(t, joint), direction));
          count += 1.0;
        } else if (count > 0.0) {
          means.push_back(sum / count);
          sum = count = 0.0;
        }
      }
      if (count > 0.0) means.push_back(sum / count);
    }
    if (means.size() < kFewestTurns) return false;
    return std::abs(median_of(std::move(means))) > friction.sigma;
  }
};

SlidingOptions options_of(const std::vector<SlidingFriction>& friction) {
  SlidingOptions out;
  out.presliding.resize(std::ssize(friction));
  for (Eigen::Index j = 0; j < out.presliding.size(); ++j)
    out.presliding[j] = friction[static_cast<std::size_t>(j)].presliding;
  return out;
}

/// Sliding friction of a joint at a sample, in a direction.
using SlidingTorque = std::function<double(Eigen::Index, Eigen::Index, int)>;

std::vector<BalanceSample> balance_of(const RigidModel& model,
                                      const std::vector<SlidingFriction>& friction,
                                      const TorqueSamples& motion, const MotionTerms& terms,
                                      const Eigen::MatrixXd& sigma, const SlidingTorque& sliding,
                                      bool knows_inertia) {
  const Eigen::Index n = model.size();
  const bool masses = !terms.mass.empty();
  const Eigen::MatrixXi states = sliding_states(model, motion.t_s, motion.q, options_of(friction));
  const Eigen::MatrixXd speeds = windowed_rates(motion.t_s, motion.q);
  const Eigen::MatrixXd accelerations = windowed_rates(motion.t_s, speeds);
  // A joint that breaks away gains its momentum at once: over a window it would seem pushed before.
  const Eigen::MatrixXd balanced = rates_between_neighbours(motion.t_s, terms.momentum);
  const Eigen::VectorXd clear =
      knows_inertia ? Eigen::VectorXd::Constant(n, std::numeric_limits<double>::infinity())
                    : clear_accelerations(model, accelerations, states);
  const double end_s = motion.t_s[motion.size() - 1];
  std::vector<JointPast> pasts;
  for (Eigen::Index j = 0; j < n; ++j) {
    const bool turns = model.bodies[static_cast<std::size_t>(j)].type != JointType::kPrismatic;
    pasts.push_back({.stuck_until_s = motion.t_s[0],
                     .stuck_at = motion.q(0, j),
                     .fade_way = kAfterBreakaway_rad * (turns ? 1.0 : kLinearShare)});
  }
  std::vector<BalanceSample> out;
  for (Eigen::Index t = 0; t < motion.size(); ++t) {
    BalanceSample sample{.stamp_s = motion.t_s[t],
                         .momentum = terms.momentum.row(t).transpose(),
                         .drive = terms.drive.row(t).transpose(),
                         .velocity = {},
                         .mass = {},
                         .sigma = sigma.size() > 0 ? sigma.row(t).transpose().eval()
                                                   : Eigen::VectorXd::Ones(n).eval(),
                         .sticks = Eigen::VectorXi::Zero(n)};
    if (masses) {
      sample.velocity = motion.dq.row(t).transpose();
      sample.mass = terms.mass[static_cast<std::size_t>(t)];
    }
    for (Eigen::Index j = 0; j < n; ++j) {
      const SlidingFriction& own = friction[static_cast<std::size_t>(j)];
      JointPast& past = pasts[static_cast<std::size_t>(j)];
      const int direction = own.known(states(t, j)) ? states(t, j) : 0;
      past.has_slid = past.has_slid || direction != 0;
      const double rate = terms.rate(t, j);
      FrictionInterval taken = with_doubt_of_speed(
          interval_of(own, sliding(t, j, direction), motion.dq(t, j), speeds(t, j), direction), own,
          speeds(t, j),
          std::abs(motion.dq(t, j) - speeds(t, j)) +
              kHalf * kRateWindow_s * std::abs(accelerations(t, j)),
          direction);
      const double wanted = sample.drive[j] - rate;
      if (motion.is_missing(t, j)) taken = with_missing(taken, motion, t, j);
      // Seen to one side only, an acceleration at the end is noise.
      const bool speeds_up = end_s - motion.t_s[t] > kRateWindow_s &&
                             std::abs(accelerations(t, j)) > clear[j] &&
                             accelerations(t, j) * (wanted - taken.highest) > 0.0 &&
                             accelerations(t, j) * (wanted - taken.lowest) > 0.0;
      // Without inertia, what the log begins with may be the end of a motion.
      const bool begins = !past.has_slid && std::isfinite(clear[j]);
      const bool anything = speeds_up || !own.known() || begins;
      if (taken.lowest == taken.highest && !anything) {
        sample.drive[j] -= taken.lowest;
        sample.sigma[j] =
            std::hypot(sample.sigma[j], past.doubt(own, motion.t_s[t], motion.q(t, j)));
        continue;
      }
      sample.sticks[j] = 1;
      const double nearest = std::clamp(wanted, taken.lowest, taken.highest);
      if (anything || nearest == wanted) {
        sample.drive[j] = balanced(t, j);
      } else {
        sample.drive[j] -= nearest;
      }
      if (direction != 0) continue;
      past.stuck_until_s = motion.t_s[t];
      past.stuck_at = motion.q(t, j);
    }
    out.push_back(std::move(sample));
  }
  return out;
}

/// What the prediction leaves: `base` of the torque, and of the motion what no low-pass shows.
MotionTerms terms_beyond(const PredictedTorque& predicted, const TorqueSamples& motion,
                         const Eigen::MatrixXd& base) {
  MotionTerms out{.drive = motion.torque - base,
                  .momentum = Eigen::MatrixXd::Zero(motion.size(), motion.joints()),
                  .rate = {},
                  .mass = predicted.inertia};
  for (Eigen::Index t = 0; t < std::ssize(out.mass); ++t) {
    const Eigen::VectorXd beyond = (motion.dq.row(t) - predicted.speed.row(t)).transpose();
    out.momentum.row(t) = (out.mass[static_cast<std::size_t>(t)] * beyond).transpose();
  }
  out.rate = windowed_rates(motion.t_s, out.momentum);
  return out;
}

Eigen::MatrixXd left_by(const PredictedTorque& predicted, const TorqueSamples& motion,
                        const Eigen::MatrixXd& base) {
  const MotionTerms terms = terms_beyond(predicted, motion, base);
  return terms.drive - terms.rate;
}

/// Part of the prediction that the accelerations of the low-pass make, samples x joints.
Eigen::MatrixXd inertial_torque(const Eigen::VectorXd& t_s, const PredictedTorque& predicted) {
  Eigen::MatrixXd out = rates_between_neighbours(t_s, predicted.speed);
  for (Eigen::Index t = 0; t < out.rows(); ++t)
    out.row(t) *= predicted.inertia[static_cast<std::size_t>(t)].transpose();
  return out;
}

/// A predicted sigma in units of what sliding leaves; where a model has no idea, so much doubt that
/// it hides all.
Eigen::VectorXd in_units_of(double unit, const Eigen::VectorXd& sigma) {
  constexpr double kMost = 1e3;
  Eigen::VectorXd out = sigma / unit;
  for (double& value : out) value = value < kMost ? value : kMost;
  return out;
}

}  // namespace

Eigen::MatrixXd windowed_rates(const Eigen::VectorXd& t_s, const Eigen::MatrixXd& values) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(values.rows(), values.cols());
  const Eigen::Index last = values.rows() - 1;
  Eigen::Index from = 0;
  Eigen::Index to = 0;
  for (Eigen::Index k = 0; k <= last; ++k) {
    while (from < k && t_s[k] - t_s[from] > 0.5 * kRateWindow_s + 1e-9) ++from;
    while (to < last && (to < k || t_s[to + 1] - t_s[k] <= 0.5 * kRateWindow_s + 1e-9)) ++to;
    const Eigen::Index a = std::min(from, std::max<Eigen::Index>(0, k - 1));
    const Eigen::Index b = std::max(to, std::min(last, k + 1));
    const Eigen::Index count = b - a + 1;
    const Eigen::VectorXd t = t_s.segment(a, count).array() - t_s.segment(a, count).mean();
    if (count > 1) out.row(k) = t.transpose() * values.middleRows(a, count) / t.squaredNorm();
  }
  return out;
}

double SlidingFriction::sliding(double dq, int direction) const {
  double size = rise_speed > 0.0 ? coulomb * std::tanh(std::abs(dq) / rise_speed) : coulomb;
  if (stribeck_speed > 0.0) {
    const double low = dq / stribeck_speed;
    size += stribeck * std::exp(-low * low);
  }
  return offset + viscous * dq + direction * size;
}

Eigen::MatrixXd drive_residual(const RigidModel& model, const TorqueSamples& motion) {
  const MotionTerms terms = terms_of(model, motion);
  return terms.drive - terms.rate;
}

std::vector<SlidingFriction> sliding_friction(const RigidModel& model,
                                              const std::vector<TorqueSamples>& motions) {
  std::vector<Eigen::MatrixXd> residuals;
  for (const TorqueSamples& motion : motions) residuals.push_back(drive_residual(model, motion));
  return sliding_friction(model, motions, residuals);
}

std::vector<SlidingFriction> sliding_friction(const RigidModel& model,
                                              const std::vector<TorqueSamples>& motions,
                                              const std::vector<Eigen::MatrixXd>& residuals) {
  KINESCOPE_CHECK(residuals.size() == motions.size(), "one residual a motion");
  std::vector<Eigen::MatrixXd> ways;
  for (const TorqueSamples& motion : motions)
    ways.push_back(ways_since_turns(model, motion.t_s, motion.q));
  std::vector<SlidingFriction> out;
  for (Eigen::Index j = 0; j < model.size(); ++j) {
    const bool turns = model.bodies[static_cast<std::size_t>(j)].type != JointType::kPrismatic;
    double presliding = presliding_of(model, j);
    const double longest = kLongestPresliding * presliding;
    const JointRecord record{motions, residuals, ways, j};
    SlidingFriction friction = friction_from(record.slid(presliding), turns);
    while (friction.known() && 2.0 * presliding <= longest &&
           record.slides_later(friction, presliding)) {
      presliding *= 2.0;
      friction = friction_from(record.slid(presliding), turns);
    }
    friction.presliding = presliding;
    out.push_back(friction);
  }
  return out;
}

double sliding_deviance(const std::vector<SlidingFriction>& friction, int parameters) {
  double out = 0.0;
  double independent = 2.0;
  for (const SlidingFriction& own : friction) {
    if (!own.known()) continue;
    const double stretches = own.slid_s / kIndependent_s;
    out += 2.0 * stretches * std::log(own.sigma);
    independent += stretches;
  }
  return out + parameters * std::log(independent);
}

std::vector<BalanceSample> sliding_balance(const RigidModel& model,
                                           const std::vector<SlidingFriction>& friction,
                                           const TorqueSamples& motion,
                                           const Eigen::MatrixXd& sigma) {
  KINESCOPE_CHECK(friction.size() == static_cast<std::size_t>(model.size()),
                  "one friction a joint");
  const MotionTerms terms = terms_of(model, motion);
  const auto sliding = [&](Eigen::Index t, Eigen::Index j, int direction) {
    return friction[static_cast<std::size_t>(j)].sliding(motion.dq(t, j), direction);
  };
  return balance_of(model, friction, motion, terms, sigma, sliding, false);
}

std::vector<PredictedFriction> predicted_friction(const RigidModel& model,
                                                  const std::vector<TorqueSamples>& motions,
                                                  const std::vector<PredictedTorque>& predicted) {
  KINESCOPE_CHECK(predicted.size() == motions.size(), "one prediction a motion");
  std::vector<Eigen::MatrixXd> measured;
  std::vector<Eigen::MatrixXd> whole;
  std::vector<Eigen::MatrixXd> unexplained;
  for (std::size_t m = 0; m < motions.size(); ++m) {
    measured.push_back(motions[m].torque);
    whole.push_back(left_by(predicted[m], motions[m], predicted[m].frictionless));
    unexplained.push_back(left_by(predicted[m], motions[m], predicted[m].mean));
  }
  const std::vector<SlidingFriction> wholes = sliding_friction(model, motions, whole);
  const std::vector<SlidingFriction> all = sliding_friction(model, motions, measured);
  const std::vector<SlidingFriction> corrections = sliding_friction(model, motions, unexplained);
  std::vector<PredictedFriction> out;
  for (std::size_t j = 0; j < wholes.size(); ++j) {
    const bool one_way = wholes[j].slides_forward != wholes[j].slides_backward;
    out.push_back({.whole = one_way ? all[j] : wholes[j],
                   .correction = corrections[j],
                   .may_be_all = one_way});
    out.back().whole.sigma = corrections[j].sigma;
  }
  return out;
}

std::vector<char> usable_inertia(const RigidModel& model, const std::vector<TorqueSamples>& motions,
                                 const std::vector<PredictedTorque>& predicted) {
  std::vector<Eigen::MatrixXd> with;
  std::vector<Eigen::MatrixXd> without;
  std::vector<Eigen::MatrixXd> massless;
  for (std::size_t m = 0; m < motions.size(); ++m) {
    with.push_back(left_by(predicted[m], motions[m], predicted[m].mean));
    without.emplace_back(motions[m].torque - predicted[m].mean);
    massless.emplace_back(without[m] + inertial_torque(motions[m].t_s, predicted[m]));
  }
  const std::vector<SlidingFriction> left_with = sliding_friction(model, motions, with);
  const std::vector<SlidingFriction> left_without = sliding_friction(model, motions, without);
  const std::vector<SlidingFriction> left_massless = sliding_friction(model, motions, massless);
  // Evidence for or against a row of as many numbers as joints (Schwarz 1978).
  const int row = static_cast<int>(model.size());
  std::vector<char> out;
  for (std::size_t j = 0; j < left_with.size(); ++j) {
    const bool worse =
        sliding_deviance({left_with[j]}, 0) > sliding_deviance({left_without[j]}, row);
    const bool shown =
        sliding_deviance({left_without[j]}, row) < sliding_deviance({left_massless[j]}, 0);
    out.push_back(worse && !shown ? 0 : 1);
  }
  return out;
}

PredictedTorque with_inertia_of(PredictedTorque predicted, const std::vector<char>& joints) {
  for (Eigen::MatrixXd& inertia : predicted.inertia) {
    for (std::size_t j = 0; j < joints.size(); ++j) {
      if (joints[j] == 0) inertia.row(static_cast<Eigen::Index>(j)).setZero();
    }
  }
  return predicted;
}

std::vector<BalanceSample> predicted_balance(const RigidModel& model,
                                             const std::vector<PredictedFriction>& friction,
                                             const TorqueSamples& motion,
                                             const PredictedTorque& predicted) {
  KINESCOPE_CHECK(friction.size() == static_cast<std::size_t>(model.size()),
                  "one friction a joint");
  Eigen::MatrixXd base = predicted.frictionless;
  Eigen::MatrixXd sigma = predicted.sigma;
  std::vector<SlidingFriction> whole;
  for (Eigen::Index j = 0; j < model.size(); ++j) {
    const PredictedFriction& own = friction[static_cast<std::size_t>(j)];
    if (own.may_be_all) base.col(j).setZero();
    sigma.col(j) = own.whole.known() ? in_units_of(own.whole.sigma, sigma.col(j))
                                     : Eigen::VectorXd::Ones(sigma.rows()).eval();
    whole.push_back(own.whole);
  }
  const MotionTerms terms = terms_beyond(predicted, motion, base);
  const auto sliding = [&](Eigen::Index t, Eigen::Index j, int direction) {
    return predicted.mean(t, j) - base(t, j) +
           friction[static_cast<std::size_t>(j)].correction.sliding(motion.dq(t, j), direction);
  };
  return balance_of(model, whole, motion, terms, sigma, sliding, true);
}

}  // namespace kinescope
