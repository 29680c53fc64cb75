// SPDX-License-Identifier: Apache-2.0
//
// What is wrong with masses and gravity: these act on many joints at once.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "dynamics/effects/candidates.h"
#include "dynamics/rigid/regressor.h"
#include "kinematics/model/inertial_parameters.h"

namespace kinescope::effects {
namespace {

/// A body whose origin no joint moves says nothing of its mass, but of its first moment.
bool shows_mass(const EffectContext& context, int body) {
  constexpr Eigen::Index kPlaces = 3;
  const TorqueSamples& samples = context.motion->samples();
  for (Eigen::Index k = 1; k <= kPlaces; ++k) {
    const Eigen::Index row = k * (samples.size() - 1) / (kPlaces + 1);
    // A unit each: the sample's own may be none.
    const Eigen::VectorXd ones = Eigen::VectorXd::Ones(samples.joints());
    const Eigen::MatrixXd Y = regressor(context.rigid, samples.q.row(row).transpose(), ones, ones);
    if (!Y.col(Eigen::Index{10} * body).isZero(1e-9)) return true;
  }
  return false;
}

/// All ten parameters: its mass and centre are what is asked for, its inertia must not be in the
/// way.
Candidate payload(const SharedContext& c, int tip, int body) {
  const Carriers carriers{static_cast<Eigen::Index>(c->joints.size())};
  Candidate out;
  const std::string& link = c->rigid.bodies[static_cast<std::size_t>(body)].name;
  out.id = {"payload", link};
  out.words = fmt::format("{} carries more mass than the model says (less: negative)", link);
  out.check = "tools, cables, sensors and loads at the link; its mass in the model";
  out.record = "tilt the link all ways under gravity, and repeat the motion without the load";
  const bool kilograms = c->torque_unit == "Nm";
  out.size_unit = kilograms ? "kg" : "A per N m x kg";
  constexpr const char* kUnits[] = {"kg", "kg m", "kg m^2"};
  for (int k = 0; k < 10; ++k) {
    const char* unit = kUnits[k == 0 ? 0 : k < 4 ? 1 : 2];
    out.parameters.push_back({std::string(kInertialNames[static_cast<std::size_t>(k)]), unit});
  }
  out.size_weights = Eigen::VectorXd::Unit(10, 0);
  out.size = [](const Eigen::VectorXd& theta) { return theta[0]; };
  if (!shows_mass(*c, body)) {
    out.words = fmt::format(
        "{} carries another mass, or elsewhere, than the model says: its first "
        "moment is off",
        link);
    out.size_unit = kilograms ? "kg m" : "A per N m x kg m";
    out.size_weights = Eigen::VectorXd::Zero(10);
    out.size_weights.segment<3>(1).setOnes();
    out.size = {};
  }
  out.columns = [c, carriers, tip](double) {
    std::vector<EffectColumn> columns;
    for (int k = 0; k < 10; ++k) columns.push_back({carriers.body(tip, k), {}});
    return columns;
  };
  return out;
}

/// Effects of a whole log that bodies are like. A load from an early instant on is nearly one of
/// the whole log, and would be a rival of all of them.
std::vector<EffectId> like_bodies(const EffectContext& context, const std::string& link) {
  std::vector<EffectId> out{{"payload", link}, {"gravity_direction", "base"}};
  for (const std::string& joint : context.joints) {
    for (const char* effect : {"torque_gain", "spring", "motor_inertia", "torque_offset"})
      out.push_back({effect, joint});
    for (const std::string& other : context.joints) {
      if (other != joint) out.push_back({"cross_talk", fmt::format("{} from {}", joint, other)});
    }
  }
  return out;
}

/// 0 before a time, 1 from then on, through the low-pass of the torque.
Eigen::VectorXd since(const EffectContext& context, double at_s) {
  return context.cache->get(fmt::format("since {:.17g}", at_s), [&] {
    return context.motion->column(
        0, [at_s](const FinePath& path) { return (path.time_s >= at_s).cast<double>().eval(); });
  });
}

/// The same load from an instant of the log on: what was picked up, or (negative) put down.
Candidate payload_change(const SharedContext& c, int tip, int body) {
  constexpr int kTimes = 40;  // chosen: two of them are never further apart than a motion is long
  Candidate out = payload(c, tip, body);
  out.id.effect = "payload_change";
  out.words =
      out.size
          ? fmt::format("{} carries more mass from an instant on (less: negative)", out.id.place)
          : fmt::format("the first moment of {} is another from an instant on", out.id.place);
  out.check = "what the robot picked up or put down; a tool that came loose";
  out.record = "the same motion with the load and without it";
  // A load of the whole log, or wrong masses, are none that came.
  out.refines = {{"payload", out.id.place}};
  out.contains = like_bodies(*c, out.id.place);
  const LogSpan& log = c->log;
  for (int k = 1; k < kTimes; ++k) out.scan.push_back(log.begin_s + log.duration_s * k / kTimes);
  // A step between two instants: any time between them says the same.
  out.scan_step =
      log.duration_s / static_cast<double>(std::max<Eigen::Index>(1, c->instants() - 1));
  out.scan_name = "at";
  out.scan_unit = "s";
  out.columns = [c, columns = out.columns](double at_s) {
    std::vector<EffectColumn> loaded = columns(0.0);
    const Eigen::VectorXd share = since(*c, at_s);
    for (EffectColumn& column : loaded) column.share = share;
    return loaded;
  };
  return out;
}

Candidate gravity_direction(const SharedContext& c) {
  const Carriers carriers{static_cast<Eigen::Index>(c->joints.size())};
  Candidate out;
  out.id = {"gravity_direction", "base"};
  out.words = "the base does not stand as the model says: gravity points elsewhere";
  out.check = "mounting of the base: on a wall, a ceiling, a slope";
  out.record = "measure the base with a spirit level";
  out.size_unit = "deg";
  out.parameters = {{"tilt_1", "deg"}, {"tilt_2", "deg"}};
  out.size_weights = Eigen::Vector2d::Ones();
  // A base on a wall is far from one on the floor: in a straight line, only its own direction says
  // what it does. The fit finds the tilt itself.
  for (int k = 0; k < kGravityStarts; ++k) out.scan.push_back(k);
  out.columns = [carriers](double scan) {
    const int start = std::clamp(static_cast<int>(std::lround(scan)), 0, kGravityStarts - 1);
    if (start == 0)
      return std::vector<EffectColumn>{{carriers.gravity(0), {}}, {carriers.gravity(1), {}}};
    const bool first = gravity_starts()[static_cast<std::size_t>(start)].x() != 0.0;
    return std::vector<EffectColumn>{{carriers.turned_gravity(start), {}},
                                     {carriers.gravity(first ? 1 : 0), {}}};
  };
  return out;
}

}  // namespace

std::vector<int> tips(const RigidModel& rigid) {
  std::vector<int> out;
  for (int b = 0; b < static_cast<int>(rigid.bodies.size()); ++b) {
    const bool carries = std::ranges::any_of(
        rigid.bodies, [b](const RigidBody& other) { return other.parent == b; });
    if (!carries) out.push_back(b);
  }
  return out;
}

void add_bodies(const SharedContext& context, std::vector<Candidate>& out) {
  const std::vector<int> bodies = tips(context->rigid);
  for (std::size_t t = 0; t < bodies.size(); ++t) {
    out.push_back(payload(context, static_cast<int>(t), bodies[t]));
    out.push_back(payload_change(context, static_cast<int>(t), bodies[t]));
  }
  if (context->rigid.gravity_m_s2.norm() > 0.0) out.push_back(gravity_direction(context));
}

}  // namespace kinescope::effects
