// SPDX-License-Identifier: Apache-2.0
//
// Undeclared effects in recordings at corner level, and what tracing makes of them:
//   trace_camera PART [--seeds N] [--frames N] [--sigma PX] [--robot KIND] [--effect NAME]
//                     [--strength X] [--floor PX] [--gravity] [--realistic] [--verbose]
// PART:
//   visible  how many standard deviations of the noise each effect is worth at the weakest
//            strength: what no method can see below about 5, and size to 10 % below 10
//   clean    recordings without effects: false alarms
//   single   every effect alone, at 1, 3 and 10 times the weakest strength
//   pairs    two effects at 3 times the weakest strength
//   unknown  effects of the test's own making at 10 times: the answer must be that none explains it
// Every figure is over five kinds of robots.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

#include <fmt/format.h>

#include "calib/effects/trace_calibration.h"
#include "tests/experiments/trace_camera_score.h"
#include "tests/experiments/trace_camera_worlds.h"

namespace kinescope {
namespace {

using truth::InjectedEffect;
using truth::kRobotKinds;
using truth::RobotKind;

constexpr double kSeen = 6.0;  // standard deviations: found in 97 of 100 at a false alarm of 1 %

struct Request {
  std::string part;
  int seeds = 2;
  TraceCase base;
  std::vector<RobotKind> kinds{kRobotKinds.begin(), kRobotKinds.end()};
  std::vector<std::string> effects;
  std::vector<double> strengths;
  bool verbose = false;

  [[nodiscard]] std::vector<TraceCase> cases() const {
    std::vector<TraceCase> out;
    for (const RobotKind kind : kinds) {
      for (int seed = 0; seed < seeds; ++seed) {
        out.push_back(base);
        out.back().kind = kind;
        out.back().seed = seed;
      }
    }
    return out;
  }
};

// The call that this experiment is about: a plain calibration, then what it lacks.
Trace trace_of(const TraceCase& of, const std::vector<InjectedEffect>& effects) {
  const truth::World world = world_with(of, effects);
  CalibrationStart start = start_of(world, of);
  const Calibration plain =
      calibrate(world.measurements, world.markers, world.log, start, {.folds = 0});
  start.tree = plain.tree;
  start.T_camera_base = plain.T_camera_base;
  start.time_offset_s = plain.time_offset_s;
  CalibrationTraceOptions options;
  options.trace.floor = of.floor_px;
  if (of.gravity_known) options.gravity_base = world_options(of).down;
  return trace_calibration(world.measurements, world.markers, world.log, start, options).trace;
}

// Traces of the recordings without effects, made once.
class CleanTwins {
 public:
  const Trace& of(const TraceCase& of) {
    const auto key = std::pair(of.kind, of.seed);
    const auto found = traces_.find(key);
    return found != traces_.end() ? found->second : traces_[key] = trace_of(of, {});
  }

 private:
  std::map<std::pair<RobotKind, int>, Trace> traces_;
};

std::string name_of(const TraceCase& of) {
  return fmt::format("{} {}", to_string(of.kind), of.seed);
}

void print_visible(const Request& request) {
  fmt::print("{:16}", "effect");
  for (const RobotKind kind : request.kinds) fmt::print(" {:>18}", to_string(kind));
  fmt::print("   (median, least)\n");
  for (const std::string& effect : request.effects) {
    fmt::print("{:16}", effect);
    for (const RobotKind kind : request.kinds) {
      std::vector<double> seen;
      for (const TraceCase& of : request.cases()) {
        if (of.kind != kind) continue;
        if (const auto injected = pick_effect(effect, 1.0, of))
          seen.push_back(visibility(*injected, of));
      }
      std::ranges::sort(seen);
      const std::string cell =
          seen.empty() ? "-" : fmt::format("{:.1f} {:7.1f}", seen[seen.size() / 2], seen.front());
      fmt::print(" {:>18}", cell);
      std::fflush(stdout);
    }
    fmt::print("\n");
  }
}

void print_clean(const Request& request) {
  std::map<std::string, int> verdicts;
  int count = 0;
  for (const TraceCase& of : request.cases()) {
    const Trace trace = trace_of(of, {});
    ++verdicts[std::string(to_string(trace.verdict))];
    ++count;
    if (request.verbose || trace.verdict != TraceVerdict::kClean)
      fmt::print("  {}: {}; {}\n", name_of(of), answer_of(trace), trace.reason);
    std::fflush(stdout);
  }
  fmt::print("clean recordings: {}\n", count);
  for (const auto& [verdict, times] : verdicts) {
    fmt::print("  {:16} {:4} {:6.2f} %\n", verdict, times, 100.0 * times / count);
  }
}

void print_one(const Request& request, const TraceCase& of,
               const std::vector<InjectedEffect>& injected, const TraceJudgement& judgement,
               double visible) {
  if (!request.verbose && judgement.exact) return;
  std::string words;
  for (const InjectedEffect& effect : injected)
    words += (words.empty() ? "" : " + ") + describe(effect);
  fmt::print("  {}: {} [{:.1f} sigma] -> {}; error {:.3f} of the twin's\n", name_of(of), words,
             visible, judgement.answer, judgement.ratio);
  std::fflush(stdout);
}

// Of one effect at one strength.
struct Row {
  TraceScore all;
  TraceScore seen;  ///< where the effect is worth kSeen and more
};

void print_table(const Request& request, double strength, const std::map<std::string, Row>& rows) {
  Row total;
  fmt::print("\n{:<16} {:61} | of those worth {:.0f} sigma and more\n{:16} {} | {}\n",
             fmt::format("{:g} x weakest", strength), "", kSeen, "", TraceScore::heading(),
             TraceScore::heading());
  const auto print_row = [](const std::string& name, const Row& row) {
    fmt::print("{:16} {} | {}\n", name, row.all.line(), row.seen.line());
  };
  for (const std::string& effect : request.effects) {
    if (!rows.contains(effect)) continue;
    print_row(effect, rows.at(effect));
    total.all.add(rows.at(effect).all);
    total.seen.add(rows.at(effect).seen);
  }
  print_row("all", total);
}

void print_single(const Request& request) {
  CleanTwins twins;
  for (const double strength : request.strengths) {
    std::map<std::string, Row> rows;
    Confusion confusion;
    for (const std::string& effect : request.effects) {
      for (const TraceCase& of : request.cases()) {
        const auto injected = pick_effect(effect, strength, of);
        if (!injected) continue;
        const Trace trace = trace_of(of, {*injected});
        const TraceJudgement judgement = judge_trace(trace, {*injected}, twins.of(of));
        const double visible = visibility(*injected, of);
        rows[effect].all.add(judgement);
        if (visible >= kSeen) rows[effect].seen.add(judgement);
        confusion.add(effect, judgement.first);
        print_one(request, of, {*injected}, judgement, visible);
      }
    }
    print_table(request, strength, rows);
    fmt::print("first answers:\n");
    confusion.print();
  }
}

// Effects follow each other round the list, so that each meets others with every seed.
void print_pairs(const Request& request) {
  CleanTwins twins;
  TraceScore all;
  TraceScore seen;
  for (const TraceCase& of : request.cases()) {
    for (std::size_t i = 0; i < request.effects.size(); ++i) {
      const std::size_t step = 1 + static_cast<std::size_t>(of.seed) % (request.effects.size() - 1);
      const std::string& other = request.effects[(i + step) % request.effects.size()];
      const auto a = pick_effect(request.effects[i], request.strengths.front(), of);
      const auto b = pick_effect(other, request.strengths.front(), of);
      if (!a || !b) continue;
      const std::vector<InjectedEffect> injected{*a, *b};
      const TraceJudgement judgement = judge_trace(trace_of(of, injected), injected, twins.of(of));
      const double visible = std::min(visibility(*a, of), visibility(*b, of));
      all.add(judgement);
      if (visible >= kSeen) seen.add(judgement);
      print_one(request, of, injected, judgement, visible);
    }
  }
  fmt::print("\npairs at {:g} x weakest {}\n", request.strengths.front(), TraceScore::heading());
  fmt::print("{:23} {}\n{:23} {}\n", "all", all.line(), "both seen", seen.line());
}

void print_unknown(const Request& request) {
  std::map<std::string, std::map<std::string, int>> verdicts;
  for (const std::string& effect : request.effects) {
    for (const TraceCase& of : request.cases()) {
      const auto injected = pick_effect(effect, request.strengths.back(), of);
      if (!injected) continue;
      const Trace trace = trace_of(of, {*injected});
      ++verdicts[effect][std::string(to_string(trace.verdict))];
      fmt::print("  {}: {} [{:.1f} sigma] -> {}", name_of(of), describe(*injected),
                 visibility(*injected, of), answer_of(trace));
      for (const Rest& rest : trace.rest)
        fmt::print("; {} over {} explains {:.0f} %", rest.place, rest.covariate,
                   100.0 * rest.explained);
      fmt::print("; error {:.3f} to {:.3f} px\n", trace.held_out_before.value,
                 trace.held_out_after.value);
      std::fflush(stdout);
    }
  }
  for (const auto& [effect, counts] : verdicts) {
    fmt::print("{:16}", effect);
    for (const auto& [verdict, count] : counts) fmt::print("  {} {}", verdict, count);
    fmt::print("\n");
  }
}

void set_defaults(Request& request) {
  const std::vector<std::string>& library = truth::library_effects();
  const std::vector<std::string>& own = truth::own_effects();
  if (request.effects.empty()) request.effects = request.part == "unknown" ? own : library;
  if (request.part == "visible" && request.effects == library)
    std::ranges::copy(own, std::back_inserter(request.effects));
  if (!request.strengths.empty()) return;
  request.strengths = {1.0, 3.0, 10.0};
  if (request.part == "pairs") request.strengths = {3.0};
}

bool parse(int argc, char** argv, Request& request) {
  if (argc < 2) return false;
  request.part = argv[1];
  for (int i = 2; i < argc; ++i) {
    const std::string key = argv[i];
    if (key == "--realistic" || key == "--verbose" || key == "--gravity") {
      request.base.realistic = request.base.realistic || key == "--realistic";
      request.base.gravity_known = request.base.gravity_known || key == "--gravity";
      request.verbose = request.verbose || key == "--verbose";
      continue;
    }
    if (i + 1 >= argc) return false;
    const std::string value = argv[++i];
    const auto is_other = [&](RobotKind kind) { return to_string(kind) != value; };
    if (key == "--seeds") {
      request.seeds = std::atoi(value.c_str());
    } else if (key == "--frames") {
      request.base.frames = std::atoi(value.c_str());
    } else if (key == "--sigma") {
      request.base.sigma_px = std::atof(value.c_str());
    } else if (key == "--floor") {
      request.base.floor_px = std::atof(value.c_str());
    } else if (key == "--effect") {
      request.effects.push_back(value);
    } else if (key == "--strength") {
      request.strengths.push_back(std::atof(value.c_str()));
    } else if (key == "--robot") {
      std::erase_if(request.kinds, is_other);
    } else {
      return false;
    }
  }
  set_defaults(request);
  return true;
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  using namespace kinescope;
  const std::map<std::string, void (*)(const Request&)> parts{{"visible", print_visible},
                                                              {"clean", print_clean},
                                                              {"single", print_single},
                                                              {"pairs", print_pairs},
                                                              {"unknown", print_unknown}};
  Request request;
  if (!parse(argc, argv, request) || !parts.contains(request.part)) {
    fmt::print(
        stderr,
        "trace_camera visible|clean|single|pairs|unknown [--seeds N] [--frames N] [--sigma "
        "PX] [--robot KIND] [--effect NAME] [--strength X] [--floor PX] [--gravity] [--realistic] "
        "[--verbose]\n");
    return 2;
  }
  parts.at(request.part)(request);
  return 0;
}
