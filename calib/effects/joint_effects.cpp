// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <string>
#include <tuple>

#include <fmt/format.h>

#include "calib/effects/camera_effects.h"
#include "calib/effects/joint_map.h"
#include "calib/effects/joint_shares.h"
#include "calib/effects/suspect.h"

namespace kinescope::effects {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
// Gear errors are looked for up to this many periods a turn, and down to three: below, it is the
// encoder's eccentricity.
constexpr double kFewestPeriods = 3.0;
constexpr double kMostPeriods = 250.0;

constexpr double kLargestCoupling = 1.5;

// Of one joint against the others; of all of them it is the clock's.
CameraEffect late_reading(const Suspect& s) {
  constexpr double kLatest = 1.0;  // s
  CameraEffect out = effect(s, "time_offset", fmt::format("{} is read late (or early)", s.name),
                            {{"offset", "s"}}, "s");
  out.candidate.possible = [](const Eigen::VectorXd& offset) {
    return std::abs(offset[0]) < kLatest;
  };
  out.candidate.signed_words = {s.name + " is read late", s.name + " is read early"};
  out.candidate.check =
      "filters and bus cycles of this drive; a log of commanded in place of measured values";
  out.candidate.record = fmt::format("move {} faster, and at changing speed", s.name);
  out.corrections = [s](double) {
    Correction late = turn(s, "time offset", "s", {});
    late.part = CorrectedPart::kClock;
    late.direction.setZero();
    return std::vector{late};
  };
  return out;
}

// A reading taken before the joint had come to rest where it was sent.
CameraEffect early_reading(const EffectWorld& world, const Suspect& s) {
  constexpr double kMost = 1.5;  // beyond its command by half as much again: it swings
  const std::vector<Eigen::VectorXd>& copies = world.frames.copies.at(s.joint);
  const std::vector<std::string>& names =
      world.tree.joints[static_cast<std::size_t>(s.joint)].copies;
  CameraEffect out = effect(
      s, "early_reading",
      fmt::format("{} stands a share of the way from its reading to another column of it", s.name),
      {{"share", ""}}, "");
  out.candidate.possible = [](const Eigen::VectorXd& share) { return std::abs(share[0]) < kMost; };
  for (std::size_t k = 0; k < copies.size(); ++k)
    out.candidate.scan.push_back(static_cast<double>(k));
  out.candidate.scan_listed = true;
  out.candidate.scan_name = "towards";
  out.candidate.scan_words = [names](double k) {
    return names[static_cast<std::size_t>(std::lround(k))];
  };
  out.candidate.check =
      "that joints are read after they have come to rest, and when the camera "
      "(or tracker) measures";
  out.candidate.record = fmt::format("wait longer at each posture before {} is read", s.name);
  out.corrections = [s, copies](double k) {
    return std::vector{turn(s, "share of the way", "",
                            copies[static_cast<std::size_t>(std::lround(k))] - s.value)};
  };
  return out;
}

// Between the edges of its steps, only the camera says where the joint is.
std::vector<Correction> places_in_steps(const EffectWorld& world, const Suspect& s,
                                        const UnsteadyReading& reading) {
  std::vector<Correction> out;
  for (const Doubt& doubt : reading.doubts) {
    Eigen::VectorXd share(s.value.size());
    for (Eigen::Index i = 0; i < share.size(); ++i)
      share[i] = doubt.share(world.frames.read_s(i, s.joint));
    if (share.isZero(0.0)) continue;
    out.push_back(turn(
        s, fmt::format("place in its step from {:.3f} s to {:.3f} s", doubt.first_s, doubt.last_s),
        s.unit, std::move(share)));
    out.back().is_nuisance = true;
    out.back().is_local = true;
    out.back().prior_sigma = doubt.sigma;
  }
  return out;
}

CameraEffect unsteady(const EffectWorld& world, const Suspect& s, const UnsteadyReading& reading) {
  const std::string parameter = reading.in_steps ? "step" : "standard deviation";
  CameraEffect out =
      effect(s, reading.in_steps ? "quantisation" : "reading_noise",
             fmt::format("{} is read {}", s.name, reading.in_steps ? "in steps" : "with noise"),
             {{parameter, s.unit}}, s.unit);
  out.candidate.possible = as_the_log_shows(reading.size);
  if (reading.in_steps) out.candidate.expected = Eigen::VectorXd::Constant(1, reading.size);
  // Every encoder has some.
  if (world.kind == MeasurementKind::kCorners) out.candidate.floor = kUsualShift;
  out.candidate.check = reading.in_steps
                            ? "digits that the log is written with, counts a turn of the encoder"
                            : "potentiometer, shielding and filter of this encoder";
  out.candidate.record = fmt::format("move {} more slowly, and log it at a higher rate", s.name);
  const Eigen::VectorXd share =
      (read_at(reading.times_s, reading.motion, read_times(world.frames, s.joint)) - s.value) /
      reading.size;
  out.corrections = [s, parameter, share](double) {
    return std::vector{turn(s, parameter, s.unit, share)};
  };
  if (!world.known && !reading.doubts.empty()) {
    out.nuisances = [places = places_in_steps(world, s, reading)](double) { return places; };
  }
  return out;
}

CameraEffect encoder_scale(const Suspect& s) {
  CameraEffect out = effect(s, "encoder_scale",
                            fmt::format("{} moves by more (or less) than its encoder says, in "
                                        "proportion",
                                        s.name),
                            {{"scale", ""}}, "");
  out.candidate.signed_words = {
      fmt::format("{} moves by more than its encoder says, in proportion", s.name),
      fmt::format("{} moves by less than its encoder says, in proportion", s.name)};
  out.candidate.check =
      "gear ratio, ticks a turn, belt, spindle pitch in the driver's configuration";
  // Where no other length is known, a page printed too large says the same.
  if (!s.turns) out.candidate.check += "; size of the printed markers (a black square's edge)";
  out.candidate.record = fmt::format("move {} over a larger range", s.name);
  out.corrections = [s](double) { return std::vector{turn(s, kScaleError, "", s.value)}; };
  return out;
}

std::vector<Correction> sines(const Suspect& s, const std::string& what, double periods) {
  const Eigen::ArrayXd angle = (s.turns ? periods : periods * kTurn) * s.value.array();
  return {turn(s, what + " sine", s.unit, angle.sin()),
          turn(s, what + " cosine", s.unit, angle.cos())};
}

// A wave twice a turn is a bent coupling (a universal joint, tan q' = tan q cos bend), with
// overtones that its size tells: Im -log(1 - w), w = (sine + i cosine) e^2iq.
std::vector<Correction> bent_sines(const Suspect& s, const std::string& what,
                                   const Eigen::Vector2d& bend) {
  constexpr double kStraight = 1e-6;  // below that the logarithm loses its digits
  const std::complex<double> size(bend[0], bend[1]);
  Eigen::VectorXd sine(s.value.size());
  Eigen::VectorXd cosine(s.value.size());
  for (Eigen::Index i = 0; i < s.value.size(); ++i) {
    const std::complex<double> turn = std::polar(1.0, 2.0 * s.value[i]);
    const std::complex<double> w = size * turn;
    const std::complex<double> share =
        std::abs(w) < kStraight ? turn : turn * (-std::log(1.0 - w) / w);
    sine[i] = share.imag();
    cosine[i] = share.real();
  }
  return {turn(s, what + " sine", s.unit, std::move(sine)),
          turn(s, what + " cosine", s.unit, std::move(cosine))};
}

CameraEffect eccentricity(const EffectWorld& world, const Suspect& s) {
  CameraEffect out =
      effect(s, "eccentricity",
             fmt::format("the encoder (or output gear) of {} runs out of centre", s.name),
             {{"sine", "rad"}, {"cosine", "rad"}}, "rad");
  out.candidate.scan = {1.0, kBendPeriods};
  out.candidate.scan_listed = true;
  out.candidate.scan_name = "periods";
  out.candidate.scan_unit = "per turn";
  out.candidate.check = "mounting of the encoder disc or magnet, run-out of the output gear";
  out.candidate.record = fmt::format("turn {} over a full turn, both ways", s.name);
  const auto known = world.bends.find(s.joint);
  const Eigen::Vector2d bend =
      known == world.bends.end() ? Eigen::Vector2d(0.0, 0.0) : known->second;
  out.corrections = [s, bend](double periods) {
    return periods == kBendPeriods ? bent_sines(s, "eccentricity", bend)
                                   : sines(s, "eccentricity", periods);
  };
  return out;
}

// Periods a turn (or a metre) whose waves the recording can tell from slow drifts and from noise.
std::vector<double> wave_numbers(const Suspect& s) {
  const double range = s.value.maxCoeff() - s.value.minCoeff();
  if (!(range > 0.0)) return {};
  const double turns = s.turns ? range / kTurn : range;
  const double step = s.step / (s.turns ? kTurn : 1.0);
  const double fewest = s.turns ? std::max(kFewestPeriods, 1.0 / turns) : 1.0 / turns;
  double most = s.turns ? kMostPeriods : kMostPeriods / range;
  if (step > 0.0) most = std::min(most, 0.5 / step);
  std::vector<double> out;
  // Samples do not tell more waves apart than there are; one wild value makes for millions.
  const double apart = 0.5 * std::max(0.0, most - fewest) / static_cast<double>(s.value.size());
  const double spacing = std::max(0.35 / turns, apart);
  for (int k = 0; fewest + k * spacing <= most; ++k) out.push_back(fewest + k * spacing);
  return out;
}

CameraEffect gear_error(const Suspect& s) {
  CameraEffect out =
      effect(s, "gear_error", fmt::format("the gear of {} runs unevenly, in waves", s.name),
             {{"sine", s.unit}, {"cosine", s.unit}}, s.unit);
  out.candidate.scan = wave_numbers(s);
  out.candidate.scan_name = "periods";
  out.candidate.scan_unit = s.turns ? "per turn" : "per m";
  out.candidate.check =
      "teeth, wave generator or spindle; the periods name the part that turns so often";
  out.candidate.record = fmt::format("move {} slowly over its range", s.name);
  out.corrections = [s](double periods) { return sines(s, "gear error", periods); };
  return out;
}

// At postures the last one tells from which side a joint came.
CameraEffect backlash(const EffectWorld& world, const Suspect& s) {
  CameraEffect out =
      effect(s, "backlash", fmt::format("{} has play", s.name), {{"width", s.unit}}, s.unit);
  // A link ahead of its drive has no play: its reading is late.
  out.candidate.possible = [limit = largest_size(s.unit)](const Eigen::VectorXd& width) {
    return width[0] > 0.0 && width[0] < limit;
  };
  const double range = s.value.maxCoeff() - s.value.minCoeff();
  double gap = range / 2000.0;
  while (gap < 0.3 * range) {
    out.candidate.scan.push_back(gap);
    gap *= 1.8;
  }
  out.candidate.scan_is_size = true;
  out.candidate.scan_name = "gap";
  out.candidate.scan_unit = s.unit;
  out.candidate.check = "gear mesh, keys, belt tension";
  out.candidate.record = fmt::format("move {} to the same places from both sides", s.name);
  const Eigen::VectorXd drive = world.log.value.col(s.joint);
  const auto known = world.play_starts.find(s.joint);
  const std::optional<double> start =
      known == world.play_starts.end() ? std::nullopt : std::optional(known->second);
  out.corrections = [s, drive, start, log_s = world.log.times_s,
                     frames_s = read_times(world.frames, s.joint)](double width) {
    Eigen::VectorXd state =
        start ? play_from(drive, width, *start).state : play_state(drive, width);
    return std::vector{turn(s, "backlash", s.unit, read_at(log_s, state, frames_s))};
  };
  if (!start) return out;
  // A robot that rests at first rests anywhere in its gap.
  out.nuisances = [s, drive, start = *start, log_s = world.log.times_s,
                   frames_s = read_times(world.frames, s.joint)](double width) {
    std::vector<Correction> further;
    Eigen::VectorXd share = read_at(log_s, play_from(drive, width, start).unmoved, frames_s);
    if (share.isZero(0.0)) return further;
    further.push_back(turn(s, std::string(kPlayStart), s.unit, std::move(share)));
    further.back().is_nuisance = true;
    return further;
  };
  return out;
}

// A sag whose largest load counts as 1, so that the parameter is the largest sag.
Correction sag(const Suspect& s, std::string name, const Eigen::VectorXd& load) {
  const double largest = load.cwiseAbs().maxCoeff();
  Correction out = turn(s, std::move(name), s.unit, Eigen::VectorXd::Zero(load.size()));
  if (largest < kNoArm) return out;
  out.share = load / largest;
  out.reference = largest;
  return out;
}

// Two unit vectors across an axis.
std::array<Eigen::Vector3d, 2> across(const Eigen::Vector3d& axis) {
  const Eigen::Quaterniond R = rotation_to_axis(axis);
  return {R * Eigen::Vector3d::UnitX(), R * Eigen::Vector3d::UnitY()};
}

// What a sag would be beside under a gravity that points a little elsewhere.
Correction turn_of_gravity(const EffectWorld& world, const Suspect& s, const Eigen::VectorXd& sags,
                           const Eigen::Vector3d& side, std::string name) {
  constexpr double kDoubt = 0.02;  // rad, of a direction that was declared or that one joint told
  const std::vector<Load> loads = gravity_loads(world.tree, world.loaded, s.joint, side);
  Eigen::VectorXd share = Eigen::VectorXd::Zero(s.value.size());
  for (std::size_t k = 0; k < loads.size(); ++k)
    share += sags[static_cast<Eigen::Index>(k)] * loads[k].arm_m;
  Correction out = turn(s, std::move(name), "rad", std::move(share));
  out.is_nuisance = true;
  out.prior_sigma = kDoubt;
  return out;
}

// Gravity stands beside a sag that depends on it, as two turns across it. `shares`: instants x
// parameters.
void doubt_gravity(const EffectWorld& world, const Suspect& s, const Eigen::VectorXd& sags,
                   const Eigen::MatrixXd& shares, CameraEffect& sag) {
  const Eigen::Vector3d gravity = *world.gravity_base;
  const auto sides = across(gravity);
  const std::vector turns{turn_of_gravity(world, s, sags, sides[0], "turn of gravity, x"),
                          turn_of_gravity(world, s, sags, sides[1], "turn of gravity, y")};
  sag.nuisances = [turns](double) { return turns; };
  sag.gravity_base = [gravity, sides](const Eigen::VectorXd& values) {
    return Eigen::Vector3d(gravity + values[0] * sides[0] + values[1] * sides[1]).normalized();
  };
  // Where gravity points along an axis, nearly, a turn takes much of the sag, or gives it.
  sag.size_beside = [shares, turns](const Eigen::VectorXd& values) {
    const Eigen::VectorXd beside = values[0] * turns[0].share + values[1] * turns[1].share;
    return [shares, beside](const Eigen::VectorXd& theta) {
      return (shares * theta + beside).cwiseAbs().maxCoeff();
    };
  };
}

// Gravity known: every link that it carries pulls from wherever its mass is.
CameraEffect compliance(const EffectWorld& world, const Suspect& s) {
  const std::vector<Load> loads =
      gravity_loads(world.tree, world.loaded, s.joint, world.gravity_base);
  std::vector<EffectParameter> parameters;
  for (const Load& load : loads) parameters.push_back({"sag by " + load.what, s.unit});
  CameraEffect out =
      effect(s, "compliance", fmt::format("{} gives way under its load, at most by this", s.name),
             std::move(parameters), s.unit);
  out.candidate.check = "stiffness of the gear and the link; weight of tool and payload";
  out.candidate.record = fmt::format(
      "the same readings of {} with {}; declare the direction of gravity in recording.yaml", s.name,
      s.turns ? "the arm stretched out and folded" : "different loads on it");
  std::vector<Correction> corrections;
  Eigen::MatrixXd shares(s.value.size(), static_cast<Eigen::Index>(loads.size()));
  for (std::size_t k = 0; k < loads.size(); ++k) {
    corrections.push_back(sag(s, "sag by " + loads[k].what, loads[k].arm_m));
    shares.col(static_cast<Eigen::Index>(k)) = corrections.back().share;
  }
  out.candidate.size = [shares](const Eigen::VectorXd& theta) {
    return (shares * theta).cwiseAbs().maxCoeff();
  };
  // Loads can be alike: large parts of either sign may stand for a small sag.
  out.candidate.possible = [size = out.candidate.size, limit = largest_size(s.unit)](
                               const Eigen::VectorXd& theta) { return size(theta) < limit; };
  out.corrections = [corrections](double) { return corrections; };
  if (const auto known = world.sags.find(s.joint); world.gravity_base && known != world.sags.end())
    doubt_gravity(world, s, known->second, shares, out);
  return out;
}

CameraEffect coupling(const EffectWorld& world, const Suspect& s) {
  CameraEffect out =
      effect(s, "coupling", fmt::format("another joint moves {} too", s.name), {{"ratio", ""}}, "");
  out.candidate.possible = [](const Eigen::VectorXd& ratio) {
    return std::abs(ratio[0]) < kLargestCoupling;
  };
  std::vector<std::string> names;
  for (const Joint& joint : world.tree.joints) names.push_back(joint.name);
  for (const int other : world.moving) {
    if (other != s.joint) out.candidate.scan.push_back(other);
  }
  out.candidate.scan_listed = true;
  out.candidate.scan_name = "moved by";
  out.candidate.scan_words = [names](double other) {
    return names[static_cast<std::size_t>(std::lround(other))];
  };
  out.candidate.check = "belts, cables or wrist gears that run past the joint";
  out.candidate.record = fmt::format("hold {} still and move the others one by one", s.name);
  out.corrections = [s, values = world.frames.value](double other) {
    return std::vector{turn(s, "coupling", "", values.col(std::lround(other)))};
  };
  return out;
}

CameraEffect helical(const Suspect& s) {
  CameraEffect out = effect(s, "helical",
                            s.turns ? fmt::format("{} shifts along its axis as it turns", s.name)
                                    : fmt::format("{} turns about its axis as it slides", s.name),
                            {{s.turns ? "pitch" : "twist", s.turns ? "m/turn" : "rad/m"}},
                            s.turns ? "m/turn" : "rad/m");
  out.candidate.check =
      s.turns ? "axial guidance of the bearing, thread" : "guide rails, spindle nut";
  out.candidate.record = fmt::format("move {} over a larger range", s.name);
  out.corrections = [s](double) {
    Correction along = turn(s, "pitch", s.turns ? "m/turn" : "rad/m",
                            s.turns ? Eigen::VectorXd(s.value / kTurn) : s.value);
    along.direction << s.axis.tail<3>(), s.axis.head<3>();
    return std::vector{along};
  };
  return out;
}

CameraEffect curved_slider(const Suspect& s) {
  CameraEffect out = effect(s, "curved_slider", fmt::format("{} runs on a curve", s.name),
                            {{"curvature across x", "1/m"},
                             {"curvature across y", "1/m"},
                             {"stretch by the guide's place", ""}},
                            "1/m");
  out.candidate.size_weights[2] = 0.0;
  out.candidate.contains = {{"encoder_scale", s.name}};
  out.candidate.check = "straightness of the guide, supports of the rail";
  out.candidate.record = fmt::format("move {} over its whole length", s.name);
  out.corrections = [s](double) {
    std::vector<Correction> corrections;
    const Eigen::Vector3d axis = s.axis.tail<3>();
    for (const Eigen::Vector3d& side : across(axis)) {
      // On a circle the carriage shifts by q^2 / 2R and turns by q / R towards its centre.
      Correction bend = turn(s, "curvature", "1/m", {});
      bend.twists.resize(s.value.size(), 6);
      for (Eigen::Index i = 0; i < s.value.size(); ++i) {
        const double q = s.value[i];
        Vector6d twist;
        twist << q * axis.cross(side), 0.5 * q * q * side;
        bend.twists.row(i) = twist.transpose();
      }
      corrections.push_back(std::move(bend));
    }
    // Where a straight slide's axis is nobody can see. Beside a curved guide the way is longer or
    // shorter, by the distance from it over its radius.
    corrections.push_back(turn(s, "stretch", "", s.value));
    return corrections;
  };
  return out;
}

// The axis tilts, about some place on it, by a e^(i n q) + b e^(-i n q) (complex numbers for the
// two directions across it, fixed in space); seen from the link, which turns on, by a e^(i (n-1) q)
// + b e^(-i (n+1) q). Of n = 1 the first part stands still in the link and is no error but a
// crooked link; n = 0 likewise is a crooked axis.
CameraEffect axis_wobble(const Suspect& s) {
  CameraEffect out =
      effect(s, "axis_wobble",
             fmt::format("the axis of {} wobbles: it tilts and runs out as it turns", s.name),
             {{"tilt x", "rad"}, {"tilt y", "rad"}, {"run-out x", "m"}, {"run-out y", "m"}}, "rad");
  // Where the bearing sits along the axis is not known: seen from elsewhere the tilt shifts, too.
  out.candidate.size_weights.tail<2>().setZero();
  out.candidate.scan = {-2.0, 1.0, -3.0};
  out.candidate.scan_listed = true;
  out.candidate.scan_name = "wobbles";
  out.candidate.scan_words = [](double turns) {
    return std::string(turns == -2.0 ? "once a turn" : "twice a turn");
  };
  out.candidate.check = "bearing seat, run-out of the shaft, loose bearing";
  out.candidate.record = fmt::format("turn {} over a full turn, both ways", s.name);
  out.corrections = [s](double turns) {
    const auto sides = across(s.axis.head<3>());
    const Eigen::ArrayXd angle = turns * s.value.array();
    std::vector<Correction> corrections;
    for (const auto& [what, unit, column] :
         {std::tuple{"tilt", "rad", 0}, std::tuple{"run-out", "m", 3}}) {
      Correction x = turn(s, fmt::format("wobble, {} x", what), unit, {});
      Correction y = turn(s, fmt::format("wobble, {} y", what), unit, {});
      for (Correction* part : {&x, &y}) part->twists.setZero(s.value.size(), 6);
      for (Eigen::Index i = 0; i < s.value.size(); ++i) {
        const double c = std::cos(angle[i]);
        const double d = std::sin(angle[i]);
        x.twists.row(i).segment<3>(column) = (c * sides[0] + d * sides[1]).transpose();
        y.twists.row(i).segment<3>(column) = (c * sides[1] - d * sides[0]).transpose();
      }
      corrections.push_back(std::move(x));
      corrections.push_back(std::move(y));
    }
    return corrections;
  };
  return out;
}

}  // namespace

std::map<int, UnsteadyReading> unsteady_readings(const JointMotion& motion,
                                                 const std::vector<int>& driven, bool postures) {
  std::map<int, UnsteadyReading> out;
  for (const int joint : driven) {
    const Eigen::VectorXd values = motion.value.col(joint);
    if (auto found = postures ? reading_in_steps(values) : unsteady_reading(motion.times_s, values))
      out.emplace(joint, std::move(*found));
  }
  return out;
}

std::vector<CameraEffect> joint_effects(const EffectWorld& world) {
  std::vector<CameraEffect> out;
  for (const int joint : world.driven) {
    const Suspect s = suspect(world, joint);
    if (!world.known && !(s.value.maxCoeff() > s.value.minCoeff())) continue;
    if (!world.postures && world.driven.size() > 1) out.push_back(late_reading(s));
    if (world.frames.copies.contains(joint)) out.push_back(early_reading(world, s));
    out.push_back(encoder_scale(s));
    if (s.turns) out.push_back(eccentricity(world, s));
    if (CameraEffect gear = gear_error(s); world.known || !gear.candidate.scan.empty()) {
      out.push_back(std::move(gear));
    }
    out.push_back(backlash(world, s));
    if (!world.postures) {
      if (const auto reading = world.unsteady.find(joint); reading != world.unsteady.end())
        out.push_back(unsteady(world, s, reading->second));
    }
    out.push_back(compliance(world, s));
    if (world.known || world.driven.size() > 1) out.push_back(coupling(world, s));
    out.push_back(helical(s));
    out.push_back(s.turns ? axis_wobble(s) : curved_slider(s));
    if (!world.known) out.push_back(joint_map(s));
  }
  return out;
}

}  // namespace kinescope::effects
