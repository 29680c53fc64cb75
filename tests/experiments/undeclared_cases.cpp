// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/undeclared_cases.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <span>

#include <fmt/format.h>

#include "calib/camera/camera_file.h"
#include "kinematics/core/file.h"
#include "tests/experiments/trace_camera_worlds.h"

namespace kinescope {
namespace {

using truth::EffectWorldOptions;
using truth::InjectedEffect;
using truth::World;

constexpr double kFrameRate = 30.0;
constexpr double kSigmaPx = 0.03;
constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kWeakest = 3.0;  // times what tracing is asked to see
constexpr double kStrongest = 100.0;

// Recordings of lower numbers were drawn from the first effects of the library and of the test's
// own, before there were others: they stay what they are.
struct Drawn {
  int below = 0;  ///< numbers of recordings
  std::size_t library = 0;
  std::size_t own = 0;
};
constexpr std::array kDrawn{Drawn{1000, 16, 3}, Drawn{3000, 20, 9}, Drawn{10000, 23, 9},
                            Drawn{14000, 25, 8}};
// For those below a growth of the robot was in no library.
constexpr int kGrowthWasOwn = 10000;
constexpr std::ptrdiff_t kGrowthWasAt = 8;

// Effects that a robot at rest before a tracker can have.
bool shows_at_postures(const std::string& effect) {
  static const std::set<std::string> names{
      "own_tanh",    "encoder_scale", "eccentricity", "gear_error", "compliance",
      "coupling",    "helical",       "axis_wobble",  "tag_slip",   "curved_slider",
      "camera_bump", "zero_jump",     "own_product"};
  return names.contains(effect);
}

std::optional<InjectedEffect> draw_effect(std::span<const std::string> names,
                                          const UndeclaredCase& of, Rng& rng) {
  const std::string& name =
      names[static_cast<std::size_t>(rng.index(static_cast<int>(names.size())))];
  const double strength = kWeakest * std::pow(kStrongest / kWeakest, rng.uniform());
  if (of.postures && !shows_at_postures(name)) return std::nullopt;
  return one_of(truth::weakest_effects(name, truth::robot_of(of.world)), strength, rng);
}

// One at each place, and one of each name: what lies on another is no test of telling them apart.
bool clashes(const InjectedEffect& effect, const std::vector<InjectedEffect>& others) {
  return std::ranges::any_of(others, [&](const InjectedEffect& other) {
    return other.effect == effect.effect || other.place == effect.place;
  });
}

void draw_effects(std::size_t count, UndeclaredCase& of, Rng& rng) {
  const bool own = of.kind == UndeclaredKind::kOwn;
  std::vector<std::string> known = own ? truth::own_effects() : truth::library_effects();
  if (own && of.number < kGrowthWasOwn)
    known.insert(known.begin() + kGrowthWasAt, "thermal_growth");
  std::span<const std::string> names = known;
  const auto drawn =
      std::ranges::find_if(kDrawn, [&](const Drawn& d) { return of.number < d.below; });
  if (drawn != kDrawn.end()) names = names.first(own ? drawn->own : drawn->library);
  while (of.world.effects.size() < count) {
    const auto effect = draw_effect(names, of, rng);
    if (effect && !clashes(*effect, of.world.effects)) of.world.effects.push_back(*effect);
  }
}

// Of a marker that moves: the distance of one at rest takes its size.
void forget_a_size(UndeclaredCase& of) {
  constexpr double kLeast = 1.3, kMost = 2.5;  // times the others, or one over it
  Rng rng = Rng::from_name("forgotten size", static_cast<std::uint64_t>(of.number));
  std::vector<InjectedEffect> places =
      truth::weakest_effects("tag_size", truth::robot_of(of.world));
  std::erase_if(places, [&](const InjectedEffect& effect) {
    return effect.place == "tags" || clashes(effect, of.world.effects);
  });
  if (places.empty()) return;
  InjectedEffect effect =
      places[static_cast<std::size_t>(rng.index(static_cast<int>(places.size())))];
  const double factor = kLeast * std::pow(kMost / kLeast, rng.uniform());
  effect.size = (rng.index(2) == 0 ? factor : 1.0 / factor) - 1.0;
  of.world.effects.push_back(std::move(effect));
  if (of.kind == UndeclaredKind::kClean) of.kind = UndeclaredKind::kSingle;
}

// Exchanged columns name each other's joints: the truth of the files as they are.
void exchange(std::string a, std::string b, World& world) {
  for (Joint& joint : world.tree.joints) {
    if (joint.name == a) {
      joint.name = joint.channel = b;
    } else if (joint.name == b) {
      joint.name = joint.channel = a;
    }
  }
}

std::string joints_csv(const UndeclaredCase& of, World& world, Damage damage) {
  Rng rng = Rng::from_name("damage", static_cast<std::uint64_t>(of.number));
  JointLog log = world.log;
  if (of.postures) {
    const truth::FilmedRobot robot = truth::robot_of(of.world);
    log.times_s = world.measurements.times_s;
    log.values.resize(static_cast<Eigen::Index>(log.times_s.size()), log.values.cols());
    for (Eigen::Index i = 0; i < log.values.rows(); ++i)
      log.values.row(i) = robot.encoders(log.times_s[static_cast<std::size_t>(i)]).transpose();
  }
  const auto rows = log.values.rows();
  if (of.idle_channel) {
    log.channels.insert(log.channels.begin() + 1, "temperature");
    Eigen::MatrixXd with(rows, log.values.cols() + 1);
    double drift = 30.0;
    for (Eigen::Index i = 0; i < rows; ++i) {
      drift += rng.normal(0.02);
      with.row(i) << log.values(i, 0), drift, log.values.rightCols(log.values.cols() - 1).row(i);
    }
    log.values = with;
  }
  const auto columns = log.values.cols();
  const auto column = static_cast<Eigen::Index>(rng.index(static_cast<int>(columns)));
  if (damage == Damage::kCorruptedRow)
    log.values(rng.index(static_cast<int>(rows)), column) = rng.uniform(10.0, 20.0);
  if (damage == Damage::kCorruptedRows) {
    constexpr Eigen::Index kOneIn = 100;
    const Eigen::MatrixXd truth = log.values;
    for (Eigen::Index k = 0; k < rows / kOneIn; ++k) {
      const Eigen::Index row = rng.index(static_cast<int>(rows));
      for (Eigen::Index c = 0; c < columns; ++c)
        log.values(row, c) = rng.uniform(truth.col(c).minCoeff(), truth.col(c).maxCoeff());
    }
  }
  if (damage == Damage::kDegrees) log.values.col(column) /= kDegree;
  std::vector<std::size_t> order(static_cast<std::size_t>(rows));
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  if (damage == Damage::kShuffledRows) {
    for (std::size_t i = order.size(); i-- > 1;)
      std::swap(order[i], order[static_cast<std::size_t>(rng.index(static_cast<int>(i) + 1))]);
  }
  if (damage == Damage::kSwappedColumns && columns > 1) {
    std::string& one = log.channels[static_cast<std::size_t>(column)];
    std::string& other = log.channels[static_cast<std::size_t>((column + 1) % columns)];
    exchange(one, other, world);
    std::swap(one, other);
  }
  if (damage == Damage::kExchangedHalfway && columns > 1) {
    const Eigen::Index other = (column + 1) % columns;
    const Eigen::MatrixXd behind = log.values.bottomRows(rows / 2);
    log.values.col(column).tail(rows / 2) = behind.col(other);
    log.values.col(other).tail(rows / 2) = behind.col(column);
  }
  const auto is_written = [&](Eigen::Index c) {
    return damage != Damage::kDroppedColumn || c != column;
  };
  std::string out = "t";
  for (Eigen::Index c = 0; c < columns; ++c)
    if (is_written(c)) out += "," + log.channels[static_cast<std::size_t>(c)];
  out += "\n";
  for (const std::size_t i : order) {
    out += fmt::format("{:.6f}", log.times_s[i]);
    for (Eigen::Index c = 0; c < columns; ++c)
      if (is_written(c)) out += fmt::format(",{:.8f}", log.values(static_cast<Eigen::Index>(i), c));
    out += "\n";
  }
  return out;
}

// When each frame came: never before the one before it.
std::vector<double> arrivals_s(const std::vector<double>& times_s, Rng& rng) {
  constexpr double kLate_s = 0.008;  // in the mean
  constexpr double kHeldUp = 0.01;   // of the frames, until the next ones are there, too
  constexpr double kHeldUp_s = 0.1;
  constexpr double kApart_s = 1e-4;
  std::vector<double> out;
  for (const double t : times_s) {
    double arrival = t - kLate_s * std::log(1.0 - rng.uniform());
    if (rng.uniform() < kHeldUp) arrival += kHeldUp_s;
    out.push_back(out.empty() ? arrival : std::max(arrival, out.back() + kApart_s));
  }
  return out;
}

std::string corners_csv(const World& world) {
  std::string out = "t,tag,corner,u,v\n";
  for (const TagObservation& seen : world.measurements.corners) {
    for (std::size_t c = 0; c < seen.corners_px.size(); ++c)
      out += fmt::format("{:.6f},{},{},{:.5f},{:.5f}\n",
                         world.measurements.times_s[static_cast<std::size_t>(seen.frame)],
                         seen.id.value, c, seen.corners_px[c].x(), seen.corners_px[c].y());
  }
  return out;
}

std::string poses_csv(const UndeclaredCase& of, const World& world) {
  Rng rng = Rng::from_name("tracker", static_cast<std::uint64_t>(of.number));
  std::string out = "t,body,x,y,z,qx,qy,qz,qw\n";
  for (const PoseTrack& track : world.measurements.poses.tracks) {
    for (const PoseSample& sample : track.samples) {
      Pose T = sample.T_camera_marker;
      T.translation += rng.normal3(kTrackerSigmaM);
      T.rotation = T.rotation * exp_rotation(rng.normal3(kTrackerSigmaRad));
      const Eigen::Quaterniond& q = T.rotation;
      out += fmt::format("{:.6f},{},{:.7f},{:.7f},{:.7f},{:.8f},{:.8f},{:.8f},{:.8f}\n",
                         world.measurements.times_s[static_cast<std::size_t>(sample.frame)],
                         track.id.value, T.translation.x(), T.translation.y(), T.translation.z(),
                         q.x(), q.y(), q.z(), q.w());
    }
  }
  return out;
}

}  // namespace

std::string_view to_string(UndeclaredKind kind) {
  switch (kind) {
    case UndeclaredKind::kClean:
      return "clean";
    case UndeclaredKind::kSingle:
      return "single";
    case UndeclaredKind::kPair:
      return "pair";
    case UndeclaredKind::kTriple:
      return "triple";
    case UndeclaredKind::kOwn:
      return "own";
  }
  return "";
}

UndeclaredCase undeclared_case(int number, Damage damage) {
  using enum UndeclaredKind;
  constexpr std::array kKinds{kClean, kSingle, kSingle, kSingle, kSingle,
                              kPair,  kSingle, kPair,   kTriple, kOwn};
  UndeclaredCase out;
  out.number = number;
  Rng rng = Rng::from_name("undeclared", static_cast<std::uint64_t>(number));
  out.kind = kKinds[static_cast<std::size_t>(number) % kKinds.size()];
  out.postures = rng.index(3) == 0;
  EffectWorldOptions& world = out.world;
  world.seed = 40000 + static_cast<std::uint64_t>(number);
  world.kind = truth::kAllRobotKinds[static_cast<std::size_t>(
      rng.index(static_cast<int>(truth::kAllRobotKinds.size())))];
  world.sigma_px = kSigmaPx;
  world.encoder_step_rad = 1e-5;
  world.amplitude_rad = rng.uniform(0.6, 1.4);
  world.scale = rng.uniform(0.7, 1.5);
  world.tag_size_m = rng.uniform(0.04, 0.07);
  world.log_rate_hz = rng.uniform(60.0, 250.0);
  world.rest_s = rng.index(2) == 0 ? rng.uniform(0.8, 2.0) : 0.0;
  world.frame_rate_hz = kFrameRate;
  world.frames = static_cast<int>(kFrameRate * rng.uniform(11.0, 35.0));
  if (out.postures) {
    // So far apart that nothing is left of the motion between them.
    world.poses = true;
    world.rest_s = 0.0;
    world.frames = 40 + rng.index(160);
    world.frame_rate_hz = 0.4;
    world.log_rate_hz = 50.0;
    world.clock_jitter = 0.0;
    world.sigma_px = 0.0;
  } else {
    out.idle_channel = rng.index(4) == 0;
  }
  switch (out.kind) {
    case kClean:
      break;
    case kSingle:
      draw_effects(1, out, rng);
      break;
    case kOwn:
      draw_effects(1, out, rng);
      if (!world.effects.front().effect.starts_with("own_")) out.kind = kSingle;
      break;
    case kPair:
      draw_effects(2, out, rng);
      break;
    case kTriple:
      draw_effects(3, out, rng);
      break;
  }
  if (damage == Damage::kForgottenSize && !out.postures) forget_a_size(out);
  return out;
}

World write_case(const UndeclaredCase& of, const std::filesystem::path& folder, Damage damage) {
  World world = truth::make_effect_world(of.world);
  if (damage == Damage::kLateFrames && !of.postures) {
    Rng rng = Rng::from_name("arrivals", static_cast<std::uint64_t>(of.number));
    world.measurements.times_s = arrivals_s(world.measurements.times_s, rng);
  }
  if (of.postures) {
    write_file_atomically(folder / "poses.csv", poses_csv(of, world));
  } else {
    write_file_atomically(folder / "corners.csv", corners_csv(world));
    write_file_atomically(folder / "camera.yaml", write_camera_info(world.camera));
    write_file_atomically(folder / "tags.yaml", fmt::format("family: tag36h11\ndefault_size: {}\n",
                                                            world.markers.default_size_m));
  }
  write_file_atomically(folder / "joints.csv", joints_csv(of, world, damage));
  return world;
}

}  // namespace kinescope
