// SPDX-License-Identifier: Apache-2.0
//
// Videos of random robots with undeclared effects, through the whole program, against their truth:
//   filmed [--seeds N] [--first-seed N] [--frames N] [--robot KIND] [--effect NAME|none]
//          [--strength X] [--scale X] [--camera no] [--keep FOLDER]
// One line a recording: structure, error of the markers at unseen postures, answer of the tracing.
// An effect counts as visible where it is larger than the smallest one that the tracing of the same
// recording without effects says it would have found.
// The seed chooses robot, motion, noise and the place of the effect; --strength is in weakest ones
// (tests/truth/injected_effect.h). --camera no: lens and centre are not declared. --keep leaves the
// recordings and their run folders there.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/urdf/urdf.h"
#include "tests/acceptance/truth_of_world.h"
#include "tests/experiments/trace_camera_worlds.h"
#include "tests/truth/film.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using truth::InjectedEffect;
using truth::RobotKind;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kFrameRate = 30.0;
constexpr const char* kNothing = "none";

struct Request {
  int seeds = 1;
  int first_seed = 0;
  int frames = 330;
  double strength = 10.0;
  double scale = 2.0;  ///< of the robot: smaller ones hide their tags
  std::vector<RobotKind> kinds{truth::kRobotKinds.begin(), truth::kRobotKinds.end()};
  std::vector<std::string> effects;
  bool camera = true;  ///< declared
  fs::path keep;
};

struct Outcome {
  bool structure = false;
  bool named = false;  ///< exactly what was injected, at its place; clean where that is nothing
  bool among = false;  ///< one of those that the answer says cannot be told apart
  bool visible = true;
};

/// Smallest size that would have been found, by effect and place.
using Floor = std::map<std::pair<std::string, std::string>, double>;

truth::EffectWorldOptions exact_world(RobotKind kind, int seed, const Request& request) {
  truth::EffectWorldOptions options;
  options.seed = 9000 + static_cast<std::uint64_t>(seed);
  options.kind = kind;
  options.frames = request.frames;
  options.frame_rate_hz = kFrameRate;
  options.sigma_px = 0.0;
  options.tag_size_m = 0.06;
  options.scale = request.scale;
  options.encoder_step_rad = 1e-4;
  return options;
}

std::optional<InjectedEffect> pick(const std::string& effect, double strength,
                                   const truth::EffectWorldOptions& options) {
  return one_of(truth::weakest_effects(effect, truth::robot_of(options)), strength,
                Rng::from_name("place of " + effect, options.seed));
}

std::string answer_of(const json& trace) {
  std::string out = trace.at("verdict").get<std::string>();
  for (const json& found : trace.at("accepted")) {
    out += fmt::format(", {} {} {:.4g}", found.at("effect").get<std::string>(),
                       found.at("place").get<std::string>(), found.at("size").get<double>());
  }
  return out;
}

bool is_exact(const json& trace, const std::optional<InjectedEffect>& injected) {
  const json& accepted = trace.at("accepted");
  if (!injected) return trace.at("verdict") == "clean";
  if (accepted.size() != 1 || trace.at("verdict") != "effects") return false;
  const std::string place = accepted[0].at("place");
  return accepted[0].at("effect") == injected->effect && place.starts_with(injected->place);
}

bool is_among(const json& trace, const std::optional<InjectedEffect>& injected) {
  if (!injected || trace.at("verdict") != "ambiguous") return false;
  for (const json& ambiguity : trace.at("ambiguous")) {
    for (const json& effect : ambiguity.at("effects")) {
      const std::string place = effect.at("place");
      if (effect.at("effect") == injected->effect && place.starts_with(injected->place))
        return true;
    }
  }
  return false;
}

Floor floor_of(const json& trace) {
  Floor out;
  for (const json& missing : trace.at("not_found")) {
    const json& size = missing.at("smallest_size");
    out[{missing.at("effect"), missing.at("place")}] =
        size.is_number() ? size.get<double>() : std::numeric_limits<double>::infinity();
  }
  return out;
}

bool is_visible(const Floor& floor, const InjectedEffect& injected) {
  for (const auto& [key, size] : floor) {
    if (key.first == injected.effect && key.second.starts_with(injected.place))
      return std::abs(injected.size) > size;
  }
  return true;
}

// A marker in the frame of the first one of the base, at joint values in the order of `names`.
Pose seen_from_base(const KinematicTree& tree, TagId marker, const std::vector<Joint>& names,
                    const Eigen::VectorXd& values) {
  Eigen::VectorXd own(values.size());
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const auto same = std::ranges::find(names, tree.joints[j].name, &Joint::name);
    own[static_cast<Eigen::Index>(j)] = values[same - names.begin()];
  }
  const std::vector<Pose> links = forward_kinematics(tree, own);
  const auto base = std::ranges::find(tree.markers, LinkId{0}, &Marker::link);
  const Marker& last = *tree.marker(marker);
  return (links[0] * base->T_link_marker).inverse() * links[last.link.index()] * last.T_link_marker;
}

// How far the robot's tip is off in the base's frame, root mean square over the recording, and what
// the run says of it (k = 2).
std::string tip_words(const truth::World& world, const KinematicTree& learned,
                      const fs::path& run) {
  const json result = json::parse(read_text_file(run / "result.json"));
  if (!result.contains("tip") || result.at("tip").is_null()) return "no tip";
  const json& tip = result.at("tip");
  const TagId marker{tip.at("marker").get<int>()};
  double shift = 0.0;
  double turn = 0.0;
  for (Eigen::Index f = 0; f < world.joint_values.rows(); ++f) {
    const Eigen::VectorXd values = world.joint_values.row(f).transpose();
    const Pose is = seen_from_base(world.tree, marker, world.tree.joints, values);
    const Pose said = seen_from_base(learned, marker, world.tree.joints, values);
    shift += (said.translation - is.translation).squaredNorm();
    turn += log_rotation(is.rotation.inverse() * said.rotation).squaredNorm();
  }
  const auto count = static_cast<double>(world.joint_values.rows());
  return fmt::format("tip off {:.3f} mm {:.4f} deg, said {:.3f} mm {:.4f} deg",
                     1e3 * std::sqrt(shift / count), std::sqrt(turn / count) / kDegree,
                     1e3 * tip.at("translation_expanded_m").get<double>(),
                     tip.at("rotation_expanded_rad").get<double>() / kDegree);
}

Outcome judge(const truth::World& world, const std::optional<InjectedEffect>& injected,
              const fs::path& folder, const std::string& name, Floor& floor) {
  RunOptions options;
  options.recording.folder = folder;
  options.output = folder / "run";
  const auto begin = std::chrono::steady_clock::now();
  ExitCode code = ExitCode::kDone;
  std::string words;
  try {
    code = run_command(options, {false, true, {}});
  } catch (const Error& error) {
    words = error.what();
    code = error.code();
  }
  const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
  fmt::print("{:32} [{}] ", name, injected ? describe(*injected) : kNothing);
  Outcome out;
  if (code != ExitCode::kDone) {
    fmt::print("exit {}: {}\n", static_cast<int>(code), words);
    return out;
  }
  const acceptance::TruthRobot truth = acceptance::truth_of(world);
  const KinematicTree learned = read_urdf(folder / "run" / "robot.urdf");
  const std::string difference = acceptance::structure_difference(truth, learned);
  const json trace = json::parse(read_text_file(folder / "run" / "trace.json"));
  out.structure = difference.empty();
  out.named = is_exact(trace, injected);
  out.among = is_among(trace, injected);
  if (!injected) floor = floor_of(trace);
  out.visible = !injected || is_visible(floor, *injected);
  if (!out.structure) {
    fmt::print("STRUCTURE {}\n", difference);
    return out;
  }
  const auto error = acceptance::compare_with_truth(truth, learned);
  fmt::print("{:.3f} mm {:+.3f} % {:.4f} deg; {}; {:.4f} -> {:.4f} px; {}{}; {:.1f} s\n",
             1e3 * error.marker_rms_m, 100.0 * error.scale, error.worst_direction_rad / kDegree,
             tip_words(world, learned, folder / "run"),
             trace.at("held_out_before").at("value").get<double>(),
             trace.at("held_out_after").at("value").get<double>(),
             out.named     ? ""
             : out.among   ? "among "
             : out.visible ? "NOT "
                           : "too small, ",
             answer_of(trace), time.count());
  return out;
}

Outcome film_and_judge(RobotKind kind, int seed, const std::string& effect, const Request& request,
                       Floor& floor) {
  truth::EffectWorldOptions options = exact_world(kind, seed, request);
  std::optional<InjectedEffect> injected;
  if (effect != kNothing) injected = pick(effect, request.strength, options);
  if (injected) options.effects = {*injected};
  const std::string name = fmt::format("{}_{}_{}", to_string(kind), seed, effect);
  const bool keeps = !request.keep.empty();
  const fs::path folder = (keeps ? request.keep : truth::temporary_path("filmed")) / name;
  fs::create_directories(folder);
  const truth::World world = truth::make_effect_world(options);
  truth::write_recording(folder, world, {.frame_rate_hz = kFrameRate, .seed = options.seed});
  if (!request.camera) fs::remove(folder / "camera.yaml");
  const Outcome out = judge(world, injected, folder, name, floor);
  std::fflush(stdout);
  if (!keeps) fs::remove_all(folder);
  return out;
}

// That the camera sees it, and no marker nearer to the camera before it.
bool is_clear(const truth::World& world, const std::vector<Pose>& links, const Marker& marker) {
  const auto in_camera = [&](const Marker& m) -> Eigen::Vector3d {
    return (world.T_camera_base * links[m.link.index()] * m.T_link_marker).translation;
  };
  const Eigen::Vector3d here = in_camera(marker);
  const auto pixel = project(world.camera, here);
  if (!pixel) return false;
  return std::ranges::none_of(world.tree.markers, [&](const Marker& other) {
    const Eigen::Vector3d there = in_camera(other);
    const auto covers = project(world.camera, there);
    return covers && there.z() < here.z() &&
           (*covers - *pixel).norm() < world.camera.fx * other.size_m / there.z();
  });
}

// A marker that another one hides for most of the time: no structure can be asked for.
std::optional<int> hidden_tag(const truth::World& world) {
  const auto frames = world.joint_values.rows();
  for (const Marker& marker : world.tree.markers) {
    Eigen::Index clear = 0;
    for (Eigen::Index f = 0; f < frames; ++f) {
      const auto links = forward_kinematics(world.tree, world.joint_values.row(f));
      clear += is_clear(world, links, marker) ? 1 : 0;
    }
    if (4 * clear < frames) return marker.id.value;
  }
  return std::nullopt;
}

bool can_have(RobotKind kind, int seed, const std::string& effect, const Request& request) {
  return effect == kNothing || pick(effect, 1.0, exact_world(kind, seed, request)).has_value();
}

void run(const Request& request) {
  int count = 0;
  int right = 0;
  int visible = 0;
  int named = 0;
  int among = 0;
  for (int seed = request.first_seed; seed < request.first_seed + request.seeds; ++seed) {
    for (const RobotKind kind : request.kinds) {
      if (const auto tag = hidden_tag(truth::make_effect_world(exact_world(kind, seed, request)))) {
        fmt::print("{}_{}: tag {} is hidden most of the time; not filmed\n", to_string(kind), seed,
                   *tag);
        continue;
      }
      Floor floor;
      for (const std::string& effect : request.effects) {
        if (!can_have(kind, seed, effect, request)) continue;
        const Outcome outcome = film_and_judge(kind, seed, effect, request, floor);
        ++count;
        right += outcome.structure ? 1 : 0;
        visible += outcome.visible ? 1 : 0;
        named += outcome.visible && outcome.named ? 1 : 0;
        among += outcome.visible && outcome.among ? 1 : 0;
      }
    }
  }
  fmt::print(
      "{} recordings: structure right in {}; answer exactly right in {} of {} visible, the effect "
      "among those that cannot be told apart in {} more\n",
      count, right, named, visible, among);
}

bool parse(int argc, char** argv, Request& request) {
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string key = argv[i];
    const std::string value = argv[i + 1];
    if (key == "--seeds") {
      request.seeds = std::atoi(value.c_str());
    } else if (key == "--first-seed") {
      request.first_seed = std::atoi(value.c_str());
    } else if (key == "--frames") {
      request.frames = std::atoi(value.c_str());
    } else if (key == "--strength") {
      request.strength = std::atof(value.c_str());
    } else if (key == "--scale") {
      request.scale = std::atof(value.c_str());
    } else if (key == "--effect") {
      request.effects.push_back(value);
    } else if (key == "--camera") {
      request.camera = value != "no";
    } else if (key == "--keep") {
      request.keep = value;
    } else if (key == "--robot") {
      std::erase_if(request.kinds, [&](RobotKind kind) { return to_string(kind) != value; });
    } else {
      return false;
    }
  }
  if (request.effects.empty()) {
    request.effects = truth::library_effects();
    request.effects.insert(request.effects.begin(), kNothing);
  }
  return argc % 2 == 1;
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  kinescope::Request request;
  if (!kinescope::parse(argc, argv, request)) {
    fmt::print(stderr,
               "filmed [--seeds N] [--first-seed N] [--frames N] [--robot KIND] "
               "[--effect NAME|none] [--strength X] [--scale X] [--camera no] [--keep FOLDER]\n");
    return 2;
  }
  kinescope::run(request);
  return 0;
}
