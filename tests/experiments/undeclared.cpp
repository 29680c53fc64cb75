// SPDX-License-Identifier: Apache-2.0
//
// Recordings of random robots with undeclared effects, through the user's own command, against
// their truth. One line a recording, a table at the end; what went wrong is said in capitals:
//   REFUSED    exit code 4, though the robot is right and what is left is the noise
//   ABSURD     exit code 0, though the structure is wrong or far more than the noise is left
//   STRUCTURE  another robot
//   CRASH      no exit code of the program's own
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>

#include "kinematics/core/csv.h"
#include "kinematics/core/file.h"
#include "kinematics/urdf/urdf.h"
#include "tests/acceptance/truth_of_world.h"
#include "tests/experiments/command_line.h"
#include "tests/experiments/trace_camera_worlds.h"
#include "tests/experiments/undeclared_cases.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using truth::InjectedEffect;

// The program's own exit codes: app/commands.
constexpr int kDone = 0;
constexpr int kUndetermined = 4;
constexpr int kLastExitCode = 5;
// Held-out error over that of the noise alone, from where on a model is called right, and absurd.
constexpr double kRight = 1.3;
constexpr double kAbsurd = 10.0;
// Standard deviations of the noise from where on an effect is one that can be seen.
constexpr double kSeen = 6.0;

struct Request {
  int first = 0;
  int count = 30;
  std::string kind;
  bool postures = true;
  bool films = true;
  bool only_list = false;
  Damage damage = Damage::kNone;
  fs::path keep;
  fs::path program = KINESCOPE_PROGRAM;
};

struct Outcome {
  int exit_code = -1;
  bool crashed = false;
  bool structure = false;
  bool exact = false;   ///< every effect at its place, and nothing else
  bool one_of = false;  ///< not exact, but every effect is named or among those that say the same
  bool sized = false;   ///< every interval holds the truth, or the size is right to 10 %
  bool wrong_name = false;
  std::vector<double> visible;  ///< of each effect, in standard deviations of the noise
  int named = 0;                ///< effects that are there
  int covered = 0;              ///< of these, whose 95 % interval holds the truth
  double probability = 0.0;     ///< that is stated of the structure
  double error = 0.0;           ///< held out, over that of the noise
  double seconds = 0.0;
  std::string answer;
  [[nodiscard]] bool all_visible() const {
    return std::ranges::all_of(visible, [](double sigmas) { return sigmas >= kSeen; });
  }
  [[nodiscard]] bool refused() const {
    return exit_code == kUndetermined && structure && error > 0.0 && error < kRight;
  }
  [[nodiscard]] bool absurd() const {
    return exit_code == kDone && (!structure || error > kAbsurd);
  }
};

bool is_at(const json& found, const InjectedEffect& injected) {
  const std::string place = truth::place_in_library(injected);
  if (found.at("effect") != injected.effect || found.at("place") != place) return false;
  return injected.effect != "coupling" || found.at("at").at("words") == injected.with;
}

// The largest sag depends on where the robot was; what is drawn is that of a motion of its own.
std::vector<InjectedEffect> as_recorded(const truth::EffectWorldOptions& options) {
  std::vector<InjectedEffect> out = options.effects;
  for (InjectedEffect& effect : out) {
    if (effect.effect != "compliance") continue;
    truth::EffectWorldOptions alone = options;
    alone.effects = {effect};
    const truth::World world = truth::make_effect_world(alone);
    const truth::FilmedRobot robot = truth::robot_of(alone);
    const auto joint = std::ranges::find(robot.tree.joints, effect.place, &Joint::name);
    const auto at = joint - robot.tree.joints.begin();
    effect.size = 0.0;
    for (Eigen::Index i = 0; i < world.joint_values.rows(); ++i) {
      const double t_s = world.measurements.times_s[static_cast<std::size_t>(i)];
      effect.size =
          std::max(effect.size, std::abs(world.joint_values(i, at) - robot.encoders(t_s)[at]));
    }
  }
  return out;
}

// Signs are a convention of the place (which way an axis points); sizes are compared without.
bool is_covered(const json& found, const InjectedEffect& injected) {
  const double truth = std::abs(injected.size);
  const double a = found.at("interval")[0].get<double>();
  const double b = found.at("interval")[1].get<double>();
  const double low = a * b <= 0.0 ? 0.0 : std::min(std::abs(a), std::abs(b));
  return low <= truth && truth <= std::max(std::abs(a), std::abs(b));
}

bool is_sized(const json& found, const InjectedEffect& injected) {
  const double truth = std::abs(injected.size);
  const double size = std::abs(found.at("size").get<double>());
  return std::abs(size - truth) <= 0.1 * truth || is_covered(found, injected);
}

void judge_trace(const json& trace, const UndeclaredCase& of, Outcome& out) {
  const json& accepted = trace.at("accepted");
  const std::vector<InjectedEffect> injected = as_recorded(of.world);
  out.answer = trace.at("verdict").get<std::string>();
  for (const json& found : accepted)
    out.answer += fmt::format(", {} {} {:.4g}", found.at("effect").get<std::string>(),
                              found.at("place").get<std::string>(), found.at("size").get<double>());
  for (const json& rest : trace.at("unexplained"))
    out.answer += fmt::format(", rest at {} over {}", rest.at("place").get<std::string>(),
                              rest.at("depends_on").get<std::string>());
  out.error = trace.at("held_out_after").at("value").is_number()
                  ? trace.at("held_out_after").at("value").get<double>()
                  : 0.0;
  if (of.kind == UndeclaredKind::kClean) {
    out.exact = out.sized = trace.at("verdict") == "clean";
    out.wrong_name = !accepted.empty();
    return;
  }
  if (of.kind == UndeclaredKind::kOwn) {
    out.exact = out.sized = accepted.empty() && trace.at("verdict") == "unknown";
    out.wrong_name = !accepted.empty();
    return;
  }
  out.exact = accepted.size() == injected.size() && trace.at("verdict") == "effects";
  out.sized = true;
  for (const InjectedEffect& effect : injected) {
    const auto found = std::ranges::find_if(
        accepted, [&](const json& candidate) { return is_at(candidate, effect); });
    out.exact = out.exact && found != accepted.end();
    out.sized = out.sized && found != accepted.end() && is_sized(*found, effect);
    if (found == accepted.end()) continue;
    ++out.named;
    out.covered += is_covered(*found, effect) ? 1 : 0;
  }
  const auto is_told = [&](const json& found) {
    return std::ranges::any_of(injected, [&](const InjectedEffect& effect) {
      return found.at("effect") == effect.effect && found.at("place") == effect.place;
    });
  };
  out.one_of = trace.at("verdict") == "ambiguous" && accepted.size() == injected.size() &&
               std::ranges::all_of(accepted, [&](const json& found) {
                 return is_told(found) ||
                        std::ranges::any_of(trace.at("ambiguous"), [&](const json& ambiguity) {
                          const json& effects = ambiguity.at("effects");
                          return effects[0].at("effect") == found.at("effect") &&
                                 effects[0].at("place") == found.at("place") &&
                                 std::ranges::any_of(effects, is_told);
                        });
               });
  out.wrong_name = std::ranges::any_of(accepted, [&](const json& found) {
    return std::ranges::none_of(injected,
                                [&](const InjectedEffect& effect) { return is_at(found, effect); });
  });
}

// Of its channels; others drive nothing.
bool lacks_a_joint(const fs::path& joints_csv, const acceptance::TruthRobot& truth) {
  const std::vector<std::string> columns = read_csv(joints_csv).header;
  return std::ranges::any_of(truth.tree.joints, [&](const Joint& joint) {
    return joint.type != JointType::kFixed &&
           std::ranges::find(columns, joint.channel) == columns.end();
  });
}

Outcome run_case(const UndeclaredCase& of, const Request& request, const fs::path& folder) {
  fs::create_directories(folder);
  const truth::World world = write_case(of, folder, request.damage);
  const fs::path run = folder / "run";
  fs::remove_all(run);
  const auto begin = std::chrono::steady_clock::now();
  const int status =
      std::system(fmt::format("'{}' run '{}' --output '{}' > '{}' 2> '{}'",
                              request.program.string(), folder.string(), run.string(),
                              (folder / "out.txt").string(), (folder / "err.txt").string())
                      .c_str());
  Outcome out;
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  for (const InjectedEffect& effect : of.world.effects)
    out.visible.push_back(visibility(effect, of.world, of.world.sigma_px));
  out.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  out.crashed = out.exit_code < 0 || out.exit_code == 1 || out.exit_code > kLastExitCode;
  if (!fs::exists(run / "robot.urdf")) {
    std::string words = fs::exists(folder / "err.txt") ? read_text_file(folder / "err.txt") : "";
    while (!words.empty() && words.back() == '\n') words.pop_back();
    out.answer = words.substr(words.find_last_of('\n') + 1);
    return out;
  }
  const acceptance::TruthRobot truth = acceptance::truth_of(world);
  const std::string difference =
      acceptance::structure_difference(truth, read_urdf(run / "robot.urdf"));
  out.structure = difference.empty();
  if (request.damage == Damage::kDroppedColumn && lacks_a_joint(folder / "joints.csv", truth)) {
    // Of a joint without a column that is said; nothing more can be.
    out.structure =
        read_text_file(folder / "out.txt").find("no logged channel drives") != std::string::npos;
  }
  if (fs::exists(run / "structure.json")) {
    const json structure = json::parse(read_text_file(run / "structure.json"));
    out.probability = structure.value("probability", 0.0);
  }
  if (fs::exists(run / "trace.json"))
    judge_trace(json::parse(read_text_file(run / "trace.json")), of, out);
  // A corner's (point's) distance from where it is, in two (three) coordinates.
  out.error /= of.postures ? std::sqrt(3.0) * kTrackerSigmaM : std::sqrt(2.0) * of.world.sigma_px;
  if (!out.structure) out.answer = difference + "; " + out.answer;
  return out;
}

struct Count {
  int n = 0, exact = 0, sized = 0, wrong = 0, structure = 0, refused = 0, absurd = 0, crashed = 0;
  int visible = 0, exact_visible = 0, one_of = 0;
  double longest_s = 0.0;
  void add(const Outcome& o) {
    ++n;
    const bool right = o.exact && o.structure && o.exit_code == kDone;
    exact += right ? 1 : 0;
    visible += o.all_visible() ? 1 : 0;
    one_of += o.one_of ? 1 : 0;
    exact_visible += right && o.all_visible() ? 1 : 0;
    sized += o.exact && o.sized && o.structure && o.exit_code == kDone ? 1 : 0;
    wrong += o.wrong_name ? 1 : 0;
    structure += o.structure ? 1 : 0;
    refused += o.refused() ? 1 : 0;
    absurd += o.absurd() ? 1 : 0;
    crashed += o.crashed ? 1 : 0;
    longest_s = std::max(longest_s, o.seconds);
  }
};

// How often the structure is right where its stated probability lies in a range; and how often
// 95 % intervals of effects that are there hold the truth.
class Reliability {
 public:
  void add(const Outcome& o) {
    named_ += o.named;
    covered_ += o.covered;
    if (o.exit_code != kDone && o.exit_code != kUndetermined) return;
    const auto bin = std::ranges::upper_bound(kFrom, o.probability) - kFrom.begin() - 1;
    Bin& at = bins_[static_cast<std::size_t>(bin)];
    ++at.n;
    at.right += o.structure ? 1 : 0;
    at.stated += o.probability;
  }
  void print() const {
    fmt::print("stated probability of the structure: how many, mean stated, share right\n");
    for (std::size_t k = 0; k < bins_.size(); ++k) {
      const Bin& bin = bins_[k];
      if (bin.n == 0) continue;
      fmt::print("  from {:<8} {:4} {:9.6f} {:6.3f} ({} wrong)\n", kFrom[k], bin.n,
                 bin.stated / bin.n, static_cast<double>(bin.right) / bin.n, bin.n - bin.right);
    }
    fmt::print("95 % intervals of named effects that hold the truth: {} of {}\n", covered_, named_);
  }

 private:
  struct Bin {
    int n = 0, right = 0;
    double stated = 0.0;
  };
  static constexpr std::array kFrom = {0.0, 0.5, 0.9, 0.99, 0.999, 0.999999};
  std::array<Bin, kFrom.size()> bins_{};
  int named_ = 0, covered_ = 0;
};

std::string words_of(const UndeclaredCase& of) {
  std::string effects;
  for (const InjectedEffect& effect : of.world.effects)
    effects += (effects.empty() ? "" : " + ") + describe(effect);
  return fmt::format("{:4} {:6} {:8} {:4} f {}{}[{}]", of.number, to_string(of.kind),
                     to_string(of.world.kind), of.world.frames, of.postures ? "postures " : "",
                     of.world.rest_s > 0.0 ? "rests " : "", effects);
}

void print(const UndeclaredCase& of, const Outcome& out) {
  std::string flags;
  if (out.crashed) flags += " CRASH";
  if (out.refused()) flags += " REFUSED";
  if (out.absurd()) flags += " ABSURD";
  if (!out.structure) flags += " STRUCTURE";
  if (flags.empty() && !out.exact)
    flags = out.one_of ? " ONE OF" : out.wrong_name ? " WRONG" : " MISSED";
  if (flags.empty() && !out.sized) flags = " SIZE";
  std::string visible;
  for (const double sigmas : out.visible) visible += fmt::format(" {:.1f}", sigmas);
  fmt::print("{} visible{} exit {} err {:6.2f} p {:.6f} {:5.1f} s{} : {}\n", words_of(of), visible,
             out.exit_code, out.error, out.probability, out.seconds, flags, out.answer);
  std::fflush(stdout);
}

void print_table(const std::map<std::string, Count>& counts) {
  fmt::print("{:16} {:>4} {:>6} {:>10} {:>7} {:>6} {:>6} {:>9} {:>8} {:>7} {:>6} {:>8}\n", "", "n",
             "exact", "of visible", "one of", "sized", "wrong", "structure", "refused", "absurd",
             "crash", "longest");
  for (const auto& [name, c] : counts)
    fmt::print("{:16} {:4} {:6} {:>10} {:7} {:6} {:6} {:9} {:8} {:7} {:6} {:6.1f} s\n", name, c.n,
               c.exact, fmt::format("{}/{}", c.exact_visible, c.visible), c.one_of, c.sized,
               c.wrong, c.structure, c.refused, c.absurd, c.crashed, c.longest_s);
}

void run(const Request& request) {
  std::map<std::string, Count> counts;
  Reliability reliability;
  for (int number = request.first; number < request.first + request.count; ++number) {
    const UndeclaredCase of = undeclared_case(number, request.damage);
    if (!request.kind.empty() && to_string(of.kind) != request.kind) continue;
    if (of.postures ? !request.postures : !request.films) continue;
    if (request.only_list) {
      fmt::print("{}\n", words_of(of));
      continue;
    }
    const bool keeps = !request.keep.empty();
    const fs::path folder =
        (keeps ? request.keep : truth::temporary_path("undeclared")) / fmt::format("{:04}", number);
    const Outcome out = run_case(of, request, folder);
    print(of, out);
    counts[fmt::format("{}{}", to_string(of.kind), of.postures ? " postures" : "")].add(out);
    counts["~ all"].add(out);
    reliability.add(out);
    if (!keeps) fs::remove_all(folder);
  }
  if (request.only_list) return;
  print_table(counts);
  reliability.print();
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  using kinescope::Damage;
  CLI::App app("Undeclared effects through the user's own command.");
  kinescope::Request request;
  app.add_option("--first", request.first, "number of the first recording");
  app.add_option("--count", request.count, "how many");
  app.add_option("--kind", request.kind, "only these: clean, single, pair, triple, own");
  bool no_postures = false, no_films = false;
  app.add_flag("--no-postures", no_postures, "only those that move");
  app.add_flag("--only-postures", no_films, "only those at rest before a tracker");
  app.add_flag("--list", request.only_list, "say what they are, without running them");
  app.add_option("--damage", request.damage,
                 "what happens to joints.csv, or is forgotten in tags.yaml")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, Damage>{{"none", Damage::kNone},
                                        {"corrupted_row", Damage::kCorruptedRow},
                                        {"corrupted_rows", Damage::kCorruptedRows},
                                        {"degrees", Damage::kDegrees},
                                        {"shuffled_rows", Damage::kShuffledRows},
                                        {"dropped_column", Damage::kDroppedColumn},
                                        {"swapped_columns", Damage::kSwappedColumns},
                                        {"exchanged_halfway", Damage::kExchangedHalfway},
                                        {"forgotten_size", Damage::kForgottenSize},
                                        {"late_frames", Damage::kLateFrames}}));
  app.add_option("--keep", request.keep, "leave the recordings and their run folders there");
  app.add_option("--program", request.program, "kinescope of another build, to compare");
  return kinescope::run_experiment(app, argc, argv, [&] {
    request.postures = !no_postures;
    request.films = !no_films;
    kinescope::run(request);
  });
}
