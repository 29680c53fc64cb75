// SPDX-License-Identifier: Apache-2.0
//
// What a joint rubs. Armstrong-Helouvry, Dupont, Canudas de Wit 1994; pre-sliding: Dahl 1968.
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "dynamics/effects/candidates.h"
#include "dynamics/effects/drive_laws.h"

namespace kinescope::effects {
namespace {

constexpr double kFullTurn = 6.283185307179586;

/// A joint's effect whose parameters act on that joint alone.
Candidate joint_effect(const EffectContext& context, std::size_t joint, const std::string& name) {
  Candidate out;
  out.id = {name, context.joints[joint]};
  if (name != "viscous" && name != "coulomb") out.refines = plain_friction(context, joint);
  return out;
}

std::vector<EffectColumn> one_column(std::size_t joint, Eigen::VectorXd share) {
  return {{static_cast<int>(joint), std::move(share)}};
}

Candidate viscous(const SharedContext& c, std::size_t j) {
  Candidate out = joint_effect(*c, j, "viscous");
  out.is_usual = true;
  out.words = fmt::format("{} has viscous friction", c->joints[j]);
  out.check = "lubrication and seals of the joint; the drive's own damping";
  out.record = "move the joint at several speeds, both ways";
  out.size_unit = fmt::format("{} s/{}", c->unit(j), c->angle(j));
  out.parameters = {{"viscous", out.size_unit}};
  out.columns = [c, j](double) {
    return one_column(
        j, c->motion->at_instants(c->motion->samples().dq.col(static_cast<Eigen::Index>(j))));
  };
  return out;
}

Candidate coulomb(const SharedContext& c, std::size_t j) {
  Candidate out = joint_effect(*c, j, "coulomb");
  out.is_usual = true;
  out.words = fmt::format("{} has Coulomb friction", c->joints[j]);
  out.check = "gear, bearings and brake of the joint: preload, a brake that drags";
  out.record = "move the joint both ways at low speed";
  out.size_unit = c->unit(j);
  out.parameters = {{"coulomb", out.size_unit}};
  out.columns = [c, j](double) { return one_column(j, direction_column(*c, j)); };
  return out;
}

/// A difference of the constant part between the directions is an offset while the joint moves, and
/// is called that; what is told apart is a difference that grows with the speed.
Candidate asymmetric(const SharedContext& c, std::size_t j) {
  Candidate out = joint_effect(*c, j, "asymmetric");
  out.words = fmt::format("{} rubs more one way than the other", c->joints[j]);
  out.check = "preload of the gear, a cable or hose that drags one way";
  out.record = "move the joint at several speeds, both ways alike";
  out.size_unit = fmt::format("{} s/{}", c->unit(j), c->angle(j));
  out.parameters = {{"half_difference", out.size_unit}};
  out.columns = [c, j](double) {
    return one_column(
        j, joint_column(*c, j, "asymmetric", [](const FinePath& p) { return p.dq.abs().eval(); }));
  };
  return out;
}

Candidate stribeck(const SharedContext& c, std::size_t j) {
  Candidate out = joint_effect(*c, j, "stribeck");
  out.words = fmt::format("{} rubs more at low speed (Stribeck)", c->joints[j]);
  out.check = "lubrication of the joint: friction falls when the film of grease builds up";
  out.record = "move the joint slowly for a while, with many reversals";
  out.size_unit = c->unit(j);
  out.parameters = {{"excess_at_rest", out.size_unit}};
  out.scan = stribeck_speeds(c->travels[j]);
  // Where a speed that the log does not show explains most, another one is no better for it.
  if (c->least_stribeck_speed.size() > 0) {
    const double least = c->least_stribeck_speed[static_cast<Eigen::Index>(j)];
    if (std::isinf(least)) out.floor = least;
    out.floor_at = [least](double speed) {
      return speed < least ? std::numeric_limits<double>::infinity() : 0.0;
    };
  }
  out.scan_name = "Stribeck speed";
  out.scan_unit = c->angle(j) + "/s";
  out.columns = [c, j](double speed) {
    return one_column(
        j, turning_column(*c, j, fmt::format("stribeck {:.17g}", speed),
                          [&](const FinePath& p, double width) {
                            return (direction(p.dq, width) * stribeck_decay(p.dq, speed)).eval();
                          }));
  };
  return out;
}

/// A power of the speed beside the first: growing (drag), or taking away (grease that thins out).
Candidate cubic_viscous(const SharedContext& c, std::size_t j) {
  Candidate out = joint_effect(*c, j, "cubic_viscous");
  out.words = fmt::format("friction of {} is not proportional to its speed", c->joints[j]);
  out.check = "lubrication of the joint: grease that thins out with speed";
  out.record = "move the joint up to its highest speed";
  out.size_unit = c->unit(j);
  out.parameters = {{"at_high_speed", out.size_unit}};
  out.scan = {2.0, 3.0};
  out.scan_name = "power of the speed";
  const double high = c->travels[j].high_speed;
  out.columns = [c, j, high](double power) {
    return one_column(
        j, joint_column(*c, j, fmt::format("power {:.17g}", power),
                        [&](const FinePath& p) { return speed_power(p.dq, high, power); }));
  };
  return out;
}

Candidate load_friction(const SharedContext& c, std::size_t j) {
  Candidate out = joint_effect(*c, j, "load_friction");
  out.words = fmt::format("friction of {} grows with its load", c->joints[j]);
  out.check = "efficiency of the gear: losses in proportion to the torque it passes on";
  out.record = "move the joint both ways under little and under much load";
  out.size_unit = "";
  out.parameters = {{"share_of_load", ""}};
  out.columns = [c, j](double) {
    const auto column = static_cast<Eigen::Index>(j);
    return one_column(j, direction_column(*c, j).cwiseProduct(c->load.col(column).cwiseAbs()));
  };
  return out;
}

Candidate position_friction(const SharedContext& c, std::size_t j) {
  Candidate out = joint_effect(*c, j, "position_friction");
  out.words = fmt::format("friction of {} depends on its position", c->joints[j]);
  out.check = "alignment of the gear, cables and hoses along the joint's travel";
  out.record = "sweep the joint slowly over its whole travel, both ways";
  out.size_unit = c->unit(j);
  out.parameters = {{"cosine", out.size_unit}, {"sine", out.size_unit}};
  out.size_weights = Eigen::Vector2d::Ones();
  const double turn = c->turns[j] != 0 ? kFullTurn : c->travels[j].range;
  out.scan = {0.5, 1.0, 2.0, 3.0, 4.0};
  if (c->turns[j] == 0) {
    for (double& periods : out.scan) periods /= turn;
  }
  out.scan_name = c->turns[j] != 0 ? "periods a turn" : "periods a metre";
  out.columns = [c, j](double periods) {
    const double w = wave_number(c->turns[j] != 0, periods);
    const auto joint = static_cast<int>(j);
    return std::vector<EffectColumn>{
        {joint, turning_column(*c, j, fmt::format("position cos {:.17g}", w),
                               [&](const FinePath& p, double width) {
                                 return (direction(p.dq, width) * wave_cosine(p.q, w)).eval();
                               })},
        {joint, turning_column(*c, j, fmt::format("position sin {:.17g}", w),
                               [&](const FinePath& p, double width) {
                                 return (direction(p.dq, width) * wave_sine(p.q, w)).eval();
                               })}};
  };
  return out;
}

/// Dahl's state, between -1 and 1; within each step the joint turns one way. A joint that moves at
/// first slid on before the log; one that rests may have been left anywhere, in the middle at best.
Eigen::ArrayXd dahl_state(const FinePath& path, double length, double width) {
  Eigen::ArrayXd z(path.q.size());
  double state = path.q.size() > 0 ? direction(path.dq(0), width) : 0.0;
  for (Eigen::Index k = 0; k < path.q.size(); ++k) {
    if (k > 0) state = dahl_after(state, path.q(k) - path.q(k - 1), length);
    z(k) = state;
  }
  return z;
}

Candidate hysteresis(const SharedContext& c, std::size_t j) {
  Candidate out = joint_effect(*c, j, "hysteresis");
  out.words = fmt::format("{} sticks before it slides (hysteresis)", c->joints[j]);
  out.check = "elastic pre-sliding in gear, seals and cables after each reversal";
  out.record = "reverse the joint often, with small motions among large ones";
  out.size_unit = c->unit(j);
  out.parameters = {{"friction", out.size_unit}};
  const double range = c->travels[j].range;
  out.scan = ratios(2e-4 * range, 0.2 * range, 13);
  out.scan_name = "pre-sliding length";
  out.scan_unit = c->angle(j);
  out.columns = [c, j, width = c->widths[static_cast<Eigen::Index>(j)]](double length) {
    return one_column(
        j, joint_column(*c, j, fmt::format("dahl {:.17g} from {:.17g}", length, width),
                        [&](const FinePath& p) { return dahl_state(p, length, width); }));
  };
  return out;
}

}  // namespace

std::vector<EffectId> plain_friction(const EffectContext& context, std::size_t joint) {
  return {{"coulomb", context.joints[joint]}, {"viscous", context.joints[joint]}};
}

/// Of what the model declares and the effect adds together. A Stribeck excess is positive
/// (Armstrong-Helouvry, Dupont, Canudas de Wit 1994): less friction at low speed is sub-linear
/// viscous friction. Nor is it more than the drive ever gave: a joint that moved had overcome it,
/// and a speed below all that the log shows would make it anything.
void forbid_driving(const EffectContext& c, std::size_t j, Candidate& out) {
  if (c.least_coulomb.size() == 0) return;
  if (out.id.effect == "stribeck") {
    const double most =
        c.motion->samples().torque.col(static_cast<Eigen::Index>(j)).cwiseAbs().maxCoeff();
    out.possible = [most](const Eigen::VectorXd& theta) {
      return theta[0] > 0.0 && theta[0] <= most;
    };
  }
  const bool viscous = out.id.effect == "viscous";
  if (!viscous && out.id.effect != "coulomb") return;
  const double least = (viscous ? c.least_viscous : c.least_coulomb)[static_cast<Eigen::Index>(j)];
  out.possible = [least](const Eigen::VectorXd& theta) { return theta[0] >= least; };
}

void add_friction_of(const SharedContext& context, std::size_t joint, std::vector<Candidate>& out) {
  for (const auto& make : {viscous, coulomb, asymmetric, stribeck, cubic_viscous, load_friction,
                           position_friction, hysteresis}) {
    out.push_back(make(context, joint));
    forbid_driving(*context, joint, out.back());
  }
}

void add_friction(const SharedContext& context, std::vector<Candidate>& out) {
  for (std::size_t j = 0; j < context->joints.size(); ++j) add_friction_of(context, j, out);
}

}  // namespace kinescope::effects
