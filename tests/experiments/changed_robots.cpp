// SPDX-License-Identifier: Apache-2.0
//
// Pairs of recordings of one robot: `changed_robots [PAIRS [PROGRAM]]`. Camera, markers, motion,
// noise and clock are new in the second one; the robot is the same, or a joint's zero moved by 0.2
// deg, a link grew by 0.5 mm, a channel's ratio by 0.1 %. How often the intervals of what differs
// hold the truth, how often anything is called changed where nothing is, and how often what changed
// is named. White noise on exact corners, the structure known, ratios estimated. With PROGRAM, the
// path of kinescope: its `run` and `compare` on recordings written to files, the structure to be
// found, nothing declared.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "calib/bundle/calibrate.h"
#include "calib/quality/robot_difference.h"
#include "kinematics/core/rng.h"
#include "tests/truth/camera_world.h"
#include "tests/truth/filmed_robot.h"
#include "tests/truth/recorded_world.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

using truth::RobotKind;
using truth::World;
using truth::WorldOptions;

constexpr double kLevel = 0.05;
constexpr double kZero_rad = 0.2 * std::numbers::pi / 180.0;
constexpr double kLonger_m = 0.5e-3;
constexpr double kLargerRatio = 1e-3;

enum class Change { kNone, kZero, kLength, kRatio };

const char* in_words(Change change) {
  switch (change) {
    case Change::kNone:
      return "nothing changed";
    case Change::kZero:
      return "zero moved by 0.2 deg";
    case Change::kLength:
      return "link longer by 0.5 mm";
    case Change::kRatio:
      return "ratio larger by 0.1 %";
  }
  return "";
}

/// How often 95 % intervals hold the truth, and the mean square of error over sigma.
struct Coverage {
  int held = 0;
  int count = 0;
  double square = 0.0;

  void add(double error, double sigma) {
    held += std::abs(error) < 1.96 * sigma ? 1 : 0;
    square += std::pow(error / sigma, 2);
    ++count;
  }
  void print(const std::string& name) const {
    const double share = static_cast<double>(held) / count;
    fmt::print("  {:22} {:5.1f} % of {} hold the truth (+- {:.1f} %); rms of error/sigma {:.2f}\n",
               name, 100.0 * share, count, 100.0 * std::sqrt(share * (1.0 - share) / count),
               std::sqrt(square / count));
  }
};

struct Score {
  std::map<std::string, Coverage> by_word;  // the first word of a quantity
  int pairs = 0;
  int visible = 0;  // pairs whose change is five standard deviations of a number or more
  int alarms = 0;   // pairs in which something that did not change is called changed
  int named = 0;
  int inside = 0;  // of the named, whose interval holds the truth
};

struct Recorded {
  KinematicTree truth;
  Calibration calibration;
};

// A marker that others hide for most of the time makes no recording worth judging.
bool all_seen(const World& world) {
  return std::ranges::all_of(world.tree.markers, [&](const Marker& marker) {
    return 2 * std::ranges::count(world.measurements.corners, marker.id, &TagObservation::id) >
           static_cast<std::ptrdiff_t>(world.measurements.times_s.size());
  });
}

KinematicTree draw_robot(RobotKind kind, std::uint64_t seed) {
  truth::FilmedRobotOptions options;
  options.seed = seed;
  options.kind = kind;
  KinematicTree tree = truth::draw_filmed_robot(options).tree;
  for (Joint& joint : tree.joints) joint.channel = joint.name;
  return tree;
}

// The same robot, every joint's frame slid along and turned about its axis.
KinematicTree redescribed(KinematicTree robot, Rng rng) {
  std::vector<Pose> T_link_other(robot.links.size());
  for (Joint& joint : robot.joints) {
    Pose moved;
    moved.rotation = exp_rotation(rng.uniform(-3.0, 3.0) * joint.axis);
    moved.translation = rng.uniform(-0.2, 0.2) * joint.axis;
    joint.T_parent_joint =
        T_link_other[joint.parent.index()].inverse() * joint.T_parent_joint * moved;
    T_link_other[joint.child.index()] = moved;
  }
  return robot;
}

// `ratio`: of the channels' true ones over the logged. The first of the seed's views that shows all
// markers.
World filmed(const KinematicTree& robot, const std::vector<double>& ratio, std::uint64_t seed) {
  constexpr std::uint64_t kMostViews = 1000;
  for (std::uint64_t view = 0; view < kMostViews; ++view) {
    WorldOptions options;
    options.seed = kMostViews * seed + view;
    options.robot = redescribed(robot, Rng::from_name("redescribed", options.seed));
    options.frames = 300;
    options.sigma_px = 0.03;  // what refined corners have
    Rng clock = Rng::from_name("changed robots' clock", options.seed);
    options.time_offset_s = clock.uniform(-0.03, 0.03);
    World world = truth::make_world(options);
    if (!all_seen(world)) continue;
    for (std::size_t j = 0; j < ratio.size(); ++j)
      world.log.values.col(static_cast<Eigen::Index>(j)) /= ratio[j];
    return world;
  }
  throw std::runtime_error("no view shows all markers");
}

Recorded record(const KinematicTree& robot, const std::vector<double>& ratio, std::uint64_t seed) {
  const World world = filmed(robot, ratio, seed);
  CalibrateOptions how;
  how.folds = 0;
  how.estimate_scales = true;
  Recorded out{robot, calibrate(world.measurements, world.markers, world.log,
                                truth::perturbed_start(world, 0.01, 0.002, seed), how)};
  for (std::size_t j = 0; j < ratio.size(); ++j) out.truth.joints[j].scale = ratio[j];
  return out;
}

// The truth as a calibration without doubt.
Calibration exactly(const Recorded& recorded) {
  Calibration out;
  out.tree = recorded.truth;
  out.joints = recorded.calibration.joints;
  out.covariance.resize(0, 0);
  return out;
}

struct Pair {
  std::vector<QuantityDifference> found, truth;
};

Pair compared(const Recorded& first, const Recorded& second) {
  const std::vector<Calibration> runs{first.calibration, second.calibration};
  const std::vector<RobotMatch> matches{match_robots(runs[0].tree, runs[0].tree),
                                        match_robots(runs[0].tree, runs[1].tree)};
  const RobotLayout layout = robot_layout(runs, matches);
  const auto numbers = [&](const Calibration& run, std::size_t k) {
    return robot_numbers(layout, run, matches[k]);
  };
  Pair out{robot_differences(layout, numbers(runs[0], 0), numbers(runs[1], 1)),
           robot_differences(layout, numbers(exactly(first), 0), numbers(exactly(second), 1))};
  std::vector<QuantityDifference*> all;
  for (QuantityDifference& one : out.found) all.push_back(&one);
  judge_together(all, kLevel);
  return out;
}

// One joint of the robot, neither the first nor the last: frames hide what theirs would change.
void change_robot(Change change, std::size_t joint, KinematicTree& robot,
                  std::vector<double>& ratio) {
  Joint& changed = robot.joints[joint];
  const Pose zero = joint_motion(changed.type, changed.axis, kZero_rad);
  if (change == Change::kZero) changed.T_parent_joint = changed.T_parent_joint * zero;
  if (change == Change::kLength) {
    Eigen::Vector3d& place = changed.T_parent_joint.translation;
    place += kLonger_m * place.normalized();
  }
  if (change == Change::kRatio) ratio[joint] = 1.0 + kLargerRatio;
}

// A tenth of the change and more is one.
bool is_change(const QuantityDifference& truth) {
  return std::abs(truth.difference) > 0.1 * (truth.of.unit == "m"     ? kLonger_m
                                             : truth.of.unit == "rad" ? kZero_rad
                                                                      : kLargerRatio);
}

void judge(const Pair& pair, Score& score) {
  bool alarm = false, named = false, inside = true, visible = false;
  for (std::size_t i = 0; i < pair.found.size(); ++i) {
    const QuantityDifference& found = pair.found[i];
    const QuantityDifference& truth = pair.truth[i];
    if (!found.sigma) continue;
    const double error = found.difference - truth.difference;
    score.by_word[found.of.name.substr(0, found.of.name.find(' '))].add(error, *found.sigma);
    visible = visible || std::abs(truth.difference) > 5.0 * *found.sigma;
    if (!found.changed) continue;
    named = named || is_change(truth);
    alarm = alarm || std::abs(truth.difference) < 1e-9;
    if (is_change(truth)) inside = inside && std::abs(error) < 1.96 * *found.sigma;
  }
  ++score.pairs;
  score.visible += visible ? 1 : 0;
  score.alarms += alarm ? 1 : 0;
  score.named += named ? 1 : 0;
  score.inside += named && inside ? 1 : 0;
}

void print(Change change, const Score& score) {
  fmt::print("{}, {} pairs\n", in_words(change), score.pairs);
  Coverage all;
  for (const auto& [word, coverage] : score.by_word) {
    if (change == Change::kNone) coverage.print(word);
    all.held += coverage.held;
    all.count += coverage.count;
    all.square += coverage.square;
  }
  all.print("all");
  fmt::print("  something else called changed in {} of {} pairs ({:.1f} %; stated: at most {} %)\n",
             score.alarms, score.pairs, 100.0 * score.alarms / score.pairs, 100.0 * kLevel);
  if (change != Change::kNone) {
    fmt::print(
        "  named in {} pairs, of {} in which it is above five sigma; inside its interval in {}\n",
        score.named, score.visible, score.inside);
  }
  std::fflush(stdout);
}

RobotKind kind_of(std::uint64_t pair) {
  constexpr std::array kKinds{RobotKind::kArm6, RobotKind::kScara, RobotKind::kGantry,
                              RobotKind::kTree, RobotKind::kPlanar};
  return kKinds[pair % kKinds.size()];
}

// A robot, and the same one later.
struct Twice {
  KinematicTree first, second;
  std::vector<double> ratio;  // of the second's channels; the first's are 1
  std::string joint;          // that changed
};

Twice draw_pair(Change change, std::uint64_t pair) {
  Twice out{draw_robot(kind_of(pair), pair), {}, {}, {}};
  out.second = out.first;
  const std::vector<Joint>& joints = out.first.joints;
  out.ratio.assign(joints.size(), 1.0);
  std::size_t joint = 1 + pair % (joints.size() - 2);
  if (change == Change::kZero)
    while (joints[joint].type != JointType::kRevolute && joint + 2 < joints.size()) ++joint;
  change_robot(change, joint, out.second, out.ratio);
  out.joint = joints[joint].name;
  return out;
}

void by_library(Change change, int pairs) {
  Score score;
  for (int k = 0; k < pairs; ++k) {
    const auto pair = static_cast<std::uint64_t>(k);
    const Twice robots = draw_pair(change, pair);
    const std::vector<double> as_logged(robots.ratio.size(), 1.0);
    judge(compared(record(robots.first, as_logged, 2 * pair),
                   record(robots.second, robots.ratio, 2 * pair + 1)),
          score);
  }
  print(change, score);
}

// The user's commands, in a folder.
class Program {
 public:
  explicit Program(std::string path) : path_(std::move(path)) {}

  // False: no answer.
  bool run(const World& world, const std::string& name) const {
    truth::write_world(world, folder_ / name);
    return call(fmt::format("run {} -o {} --force", at(name), at(name + "_run"))) == 0;
  }
  [[nodiscard]] nlohmann::json compare(const std::string& first, const std::string& second) const {
    (void)call(fmt::format("compare {} {} --json", at(first + "_run"), at(second + "_run")));
    return nlohmann::json::parse(read_text_file(folder_ / "out.txt"), nullptr, false);
  }

 private:
  [[nodiscard]] std::string at(const std::string& name) const { return (folder_ / name).string(); }
  [[nodiscard]] int call(const std::string& words) const {
    const std::string line =
        fmt::format("{} {} --quiet > {} 2> {}", path_, words, at("out.txt"), at("err.txt"));
    return std::system(line.c_str());  // NOLINT(concurrency-mt-unsafe): one thread
  }

  std::string path_;
  std::filesystem::path folder_ = truth::temporary_path("changed_robots");
};

void by_program(const Program& program, Change change, int pairs) {
  int refused = 0, named = 0, alarms = 0, changed = 0, carries = 0, tried = 0;
  for (int k = 0; k < pairs; ++k) {
    const auto pair = static_cast<std::uint64_t>(k);
    const Twice robots = draw_pair(change, pair);
    const std::vector<double> as_logged(robots.ratio.size(), 1.0);
    const bool done = program.run(filmed(robots.first, as_logged, 2 * pair), "first") &&
                      program.run(filmed(robots.second, robots.ratio, 2 * pair + 1), "second");
    const nlohmann::json found = done ? program.compare("first", "second") : nlohmann::json();
    if (!found.is_object()) {
      ++refused;
      continue;
    }
    if (found.at("changed") == true) {
      ++changed;
      fmt::print("  pair {} ({}): {}\n", k, robots.joint, found.at("verdict").get<std::string>());
    }
    bool is_named = false;
    for (const auto& one : found.at("differences")[0].at("quantities"))
      is_named = is_named || (one.at("changed") == true && one.at("name").get<std::string>().find(
                                                               robots.joint) != std::string::npos);
    named += is_named ? 1 : 0;
    for (const auto& one : found.at("carried_over")) {
      if (!one.at("carries").is_boolean()) continue;
      ++tried;
      carries += one.at("carries") == true ? 1 : 0;
    }
  }
  alarms = change == Change::kNone ? changed : changed - named;
  fmt::print("{}, {} pairs through the program: {} without an answer of both runs\n",
             in_words(change), pairs, refused);
  fmt::print("  called changed {}, {} at the joint that did; nothing of it right {}\n", changed,
             change == Change::kNone ? 0 : named, alarms);
  fmt::print("  models that carry over: {} of {}\n", carries, tried);
  std::fflush(stdout);
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  using namespace kinescope;
  const int pairs = argc > 1 ? std::atoi(argv[1]) : 100;
  for (const Change change : {Change::kNone, Change::kZero, Change::kLength, Change::kRatio}) {
    if (argc > 2) {
      by_program(Program(argv[2]), change, pairs);
    } else {
      by_library(change, pairs);
    }
  }
  return 0;
}
