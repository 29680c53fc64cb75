// SPDX-License-Identifier: Apache-2.0
//
// What a drive adds beside friction: its own inertia, springs, ripple, and all that changes as it
// runs warm.
#include <cmath>

#include <fmt/format.h>

#include "dynamics/effects/candidates.h"
#include "dynamics/effects/drive_laws.h"

namespace kinescope::effects {
namespace {

Candidate motor_inertia(const SharedContext& c, std::size_t j) {
  Candidate out;
  out.id = {"motor_inertia", c->joints[j]};
  out.words = fmt::format("the motor of {} has an inertia that the model lacks", c->joints[j]);
  out.check = "rotor inertia times the gear ratio squared in the data sheet of the drive";
  out.record = "accelerate the joint hard in many postures of the others";
  out.size_unit = fmt::format("{} s^2/{}", c->unit(j), c->angle(j));
  if (c->torque_unit == "Nm") out.size_unit = c->turns[j] != 0 ? "kg m^2" : "kg";
  out.parameters = {{"inertia", out.size_unit}};
  if (c->least_motor_inertia.size() > 0) {
    const double least = c->least_motor_inertia[static_cast<Eigen::Index>(j)];
    out.possible = [least](const Eigen::VectorXd& theta) { return theta[0] >= least; };
  }
  out.columns = [c, j](double) {
    return std::vector<EffectColumn>{
        {static_cast<int>(j),
         c->motion->at_instants(c->motion->samples().ddq.col(static_cast<Eigen::Index>(j)))}};
  };
  return out;
}

/// stiffness (q - rest): the rest is found by the second parameter, the torque at q = 0.
Candidate spring(const SharedContext& c, std::size_t j) {
  Candidate out;
  out.id = {"spring", c->joints[j]};
  out.words = fmt::format("a spring pulls at {}", c->joints[j]);
  out.check = "balancing springs, cable bundles and hoses at the joint";
  out.record = "hold or move the joint slowly all over its travel";
  out.size_unit = fmt::format("{}/{}", c->unit(j), c->angle(j));
  out.parameters = {{"stiffness", out.size_unit}, {"torque_at_zero", c->unit(j)}};
  out.size_weights = Eigen::Vector2d(1.0, 0.0);
  out.size = [](const Eigen::VectorXd& theta) { return theta[0]; };
  out.refines = {{"torque_offset", c->joints[j]}};
  out.columns = [c, j](double) {
    const auto column = static_cast<Eigen::Index>(j);
    return std::vector<EffectColumn>{
        {static_cast<int>(j), c->motion->at_instants(c->motion->samples().q.col(column))},
        {static_cast<int>(j), Eigen::VectorXd::Ones(c->instants())}};
  };
  return out;
}

Candidate ripple(const SharedContext& c, std::size_t j) {
  Candidate out;
  out.id = {"ripple", c->joints[j]};
  out.words = fmt::format("torque of {} ripples with its position", c->joints[j]);
  out.check = "cogging of the motor, teeth of the gear: compare the periods with poles and ratio";
  out.record = "move the joint slowly and evenly over a long way";
  out.size_unit = c->unit(j);
  out.parameters = {{"sine", out.size_unit}, {"cosine", out.size_unit}};
  out.size_weights = Eigen::Vector2d::Ones();
  out.scan = ripple_periods(*c, j);
  out.scan_name = c->turns[j] != 0 ? "periods a turn" : "periods a metre";
  out.columns = [c, j](double periods) {
    const double w = wave_number(c->turns[j] != 0, periods);
    return std::vector<EffectColumn>{
        {static_cast<int>(j), joint_column(*c, j, fmt::format("ripple sin {:.17g}", w),
                                           [&](const FinePath& p) { return wave_sine(p.q, w); })},
        {static_cast<int>(j),
         joint_column(*c, j, fmt::format("ripple cos {:.17g}", w),
                      [&](const FinePath& p) { return wave_cosine(p.q, w); })}};
  };
  return out;
}

/// The torque's zero goes with the shape itself, friction with its difference from the mean:
/// friction that does not drift is no matter of this effect.
std::vector<EffectColumn> drift_columns(const EffectContext& c, std::size_t j,
                                        const Eigen::VectorXd& shape, double mean) {
  const auto joint = static_cast<int>(j);
  const Eigen::VectorXd about = shape.array() - mean;
  const Eigen::VectorXd speed =
      c.motion->at_instants(c.motion->samples().dq.col(joint)) / c.travels[j].high_speed;
  return {{joint, shape},
          {joint, about.cwiseProduct(direction_column(c, j))},
          {joint, about.cwiseProduct(speed)}};
}

Candidate any_drift(const SharedContext& c, std::size_t j) {
  Candidate out;
  out.id = {"drift", c->joints[j]};
  out.refines = plain_friction(*c, j);
  out.refines.push_back({"torque_offset", c->joints[j]});
  out.size_unit = c->unit(j);
  out.parameters = {{"offset", out.size_unit},
                    {"coulomb", out.size_unit},
                    {"viscous_at_high_speed", out.size_unit}};
  out.size_weights = Eigen::Vector3d::Ones();
  return out;
}

Candidate drift(const SharedContext& c, std::size_t j) {
  Candidate out = any_drift(c, j);
  out.words = fmt::format("torque and friction of {} drift while it runs", c->joints[j]);
  out.check = "temperature of the joint; warm up before recording";
  out.record = "repeat one motion cold and warm";
  const LogSpan& log = c->log;
  out.scan = {0.1 * log.duration_s, 0.3 * log.duration_s, log.duration_s, 8.0 * log.duration_s};
  out.scan_name = "time constant";
  out.scan_unit = "s";
  // What is far from its end by then goes along a straight line.
  out.scan_words = [duration_s = log.duration_s](double constant_s) {
    return constant_s > duration_s ? std::string("longer than the log")
                                   : fmt::format("{:.3g} s", constant_s);
  };
  out.columns = [c, j](double constant_s) {
    const Settling settling{c->log.begin_s, c->log.duration_s, constant_s};
    return drift_columns(*c, j, settling.at(c->motion->at_instants(c->motion->time_s())),
                         settling.mean());
  };
  return out;
}

/// Over the range of temperatures of the log.
Candidate temperature_drift(const SharedContext& c, std::size_t j) {
  Candidate out = any_drift(c, j);
  out.id.place += " with temperature";
  out.words = fmt::format("torque and friction of {} change with its temperature", c->joints[j]);
  out.check = "lubrication of the joint; warm up before recording";
  out.record = "repeat one motion cold and warm, and then cold again";
  out.columns = [c, j](double) {
    const Eigen::VectorXd shape =
        (c->temperature_c.array() - c->log.lowest_c).matrix() / c->log.range_c;
    constexpr double kMiddle = 0.5;
    return drift_columns(*c, j, shape, kMiddle);
  };
  return out;
}

/// Both joints are turned by one more drive (a wrist): its friction and inertia act on their sum,
/// or difference.
Candidate coupled_drive(const SharedContext& c, std::size_t j, bool sum) {
  Candidate out;
  const char* sign = sum ? " + " : " - ";
  out.id = {"cross_talk", c->joints[j] + sign + c->joints[j + 1]};
  out.words = fmt::format("one drive turns with {}{}{}: the joints are coupled", c->joints[j], sign,
                          c->joints[j + 1]);
  out.check = "transmission of the wrist: a motor that also turns when the other joint moves";
  out.record = "move both joints together, then each alone";
  out.refines = plain_friction(*c, j);
  for (EffectId& id : plain_friction(*c, j + 1)) out.refines.push_back(std::move(id));
  out.size_unit = c->unit(j);
  out.parameters = {{"coulomb", c->unit(j)},
                    {"viscous_at_high_speed", c->unit(j)},
                    {"inertia", c->unit(j) + " s^2/" + c->angle(j)}};
  out.size_weights = Eigen::Vector3d(1.0, 1.0, 0.0);
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(c->joints.size()));
  weights[static_cast<Eigen::Index>(j)] = 1.0;
  weights[static_cast<Eigen::Index>(j) + 1] = sum ? 1.0 : -1.0;
  const int carrier = Carriers{static_cast<Eigen::Index>(c->joints.size())}.pair(j, sum);
  const double high = c->travels[j].high_speed;
  out.columns = [c, j, sum, weights, carrier, high](double) {
    const std::string name = fmt::format("pair {} {}", j, sum ? "sum" : "difference");
    const Eigen::VectorXd& way = c->cache->get(name, [&] {
      return c->motion->column(
          weights, [&](const FinePath& p) { return direction(p.dq, kCoupledWidth_rad_s); });
    });
    const TorqueSamples& samples = c->motion->samples();
    return std::vector<EffectColumn>{{carrier, way},
                                     {carrier, c->motion->at_instants(samples.dq * weights) / high},
                                     {carrier, c->motion->at_instants(samples.ddq * weights)}};
  };
  return out;
}

}  // namespace

void add_drives(const SharedContext& context, std::vector<Candidate>& out) {
  for (std::size_t j = 0; j < context->joints.size(); ++j) {
    for (const auto& make : {motor_inertia, spring, ripple, drift}) {
      out.push_back(make(context, j));
    }
    if (context->temperature_c.size() > 0) out.push_back(temperature_drift(context, j));
    if (j + 1 == context->joints.size() || context->turns[j] == 0 || context->turns[j + 1] == 0) {
      continue;
    }
    out.push_back(coupled_drive(context, j, true));
    out.push_back(coupled_drive(context, j, false));
  }
}

}  // namespace kinescope::effects
