// SPDX-License-Identifier: Apache-2.0
//
// Torque effects of known size in logs of random robots: which name and joint the trace gives, and
// how large. `trace_torque [alone|pairs|clean|unknown|coverage|all] [ROBOTS [FIRST_SEED]]`;
// default: all 3. `coverage`: of the 95 % intervals of several effects together, where friction
// turns round within another width than the nominal one, dips at low speed, or has Dahl's state.
// Every case has a clean twin: the same robot, motion and noise without the effect.
#include "dynamics/effects/trace_torque.h"

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "tests/truth/torque_effects.h"

namespace kinescope {
namespace {

constexpr double kStrong = 2.0;  // times the strengths below

/// Strengths that are seen by eye in a plot of the residual, and no more.
double strength_of(const std::string& effect) {
  if (effect == "gravity_direction") return 3.0;  // deg
  if (effect == "torque_delay") return 0.01;      // s
  if (effect == "payload" || effect == "payload_change") return 0.15;
  if (effect == "contact") return 0.3;
  if (effect == "hysteresis" || effect == "load_friction") return 0.1;
  return 0.05;
}

struct Case {
  std::vector<TrueEffect> effects;
  std::uint64_t seed = 0;
};

struct Verdict {
  bool right = false;
  bool ambiguous = false;
  bool sized = true;
  std::string answer;
  std::string sizes;
  double error = 0.0;
  TraceVerdict verdict = TraceVerdict::kNotRun;
};

TorqueTrace trace_world(const EffectWorld& world) {
  MotionOptions motion;
  motion.cutoff_hz = tracing_cutoff_hz(derive_motion(world.log).cutoff);
  const Motion derived = derive_motion(world.log, motion);
  TorqueTraceOptions options;
  options.model.filter = {derived.filter, derived.cutoff.cutoff_hz};
  if (std::getenv("TRACE_VERBOSE") != nullptr) {
    fmt::print("    cut-off {:.2f} motion end {:.2f}\n", motion.cutoff_hz,
               derived.cutoff.motion_end_hz.maxCoeff());
  }
  return trace_torque(world.model, derived.samples, options);
}

bool same_place(const TracedEffect& found, const KnownEffect& truth) {
  if (truth.effect == "contact") return found.id.effect == "contact";
  return found.id == EffectId{truth.effect, truth.place};
}

bool in_ambiguity(const Trace& trace, const EffectId& id) {
  for (const Ambiguity& ambiguity : trace.ambiguities) {
    if (std::ranges::find(ambiguity.effects, id) != ambiguity.effects.end()) return true;
  }
  return false;
}

void judge_size(const TracedEffect& found, const KnownEffect& truth, Verdict& out) {
  constexpr double kNear = 0.1;
  if (truth.size == 0.0 || truth.effect == "contact") return;
  const double size = std::abs(found.size);
  const bool near = std::abs(size - truth.size) <= kNear * truth.size;
  const bool inside = found.interval.low <= truth.size && truth.size <= found.interval.high;
  if (!near && !inside) out.sized = false;
  out.sizes += fmt::format(" {} {:.3g} ({:.3g})", truth.effect, size, truth.size);
}

Verdict judge(const Case& c) {
  Rng rng = Rng::from_name("trace_torque", c.seed);
  EffectWorldOptions options;
  if (const char* noise = std::getenv("POSITION_NOISE"))
    options.position_noise_rad = std::atof(noise);
  const EffectWorld world = effect_world(c.effects, options, rng);
  const TorqueTrace traced = trace_world(world);
  const Trace& trace = traced.trace;
  Verdict out;
  out.verdict = trace.verdict;
  out.error = trace.held_out_after.value;
  std::size_t named = 0;
  for (const KnownEffect& truth : world.effects) {
    for (const TracedEffect& found : trace.accepted) {
      if (!same_place(found, truth)) continue;
      ++named;
      judge_size(found, truth, out);
      break;
    }
    out.ambiguous = out.ambiguous || in_ambiguity(trace, {truth.effect, truth.place});
  }
  const bool complete = named == world.effects.size() && trace.accepted.size() == named;
  out.right = complete && (trace.verdict == TraceVerdict::kEffects ||
                           (world.effects.empty() && trace.verdict == TraceVerdict::kClean));
  out.ambiguous = out.ambiguous && trace.verdict == TraceVerdict::kAmbiguous;
  out.answer = std::string(to_string(trace.verdict));
  if (traced.base.kind == TorqueBaseKind::kIdentified) out.answer += " (on identified masses)";
  for (const TracedEffect& e : trace.accepted) {
    out.answer += fmt::format(" {}@{} {:.3g} ({:.1e} of the squares, p {:.0e})", e.id.effect,
                              e.id.place, e.size, e.explained, e.p_value);
  }
  for (const Ambiguity& a : trace.ambiguities) {
    out.answer += " (";
    for (const EffectId& id : a.effects) out.answer += fmt::format(" {}@{}", id.effect, id.place);
    out.answer += " )";
  }
  for (const Rest& rest : trace.rest) {
    out.answer += fmt::format(" [{} over {}: {:.2g} of the squares]", rest.place, rest.covariate,
                              rest.explained);
  }
  return out;
}

TrueEffect effect_at(const std::string& name, std::uint64_t seed, double factor) {
  const int joints = EffectWorldOptions{}.joints;
  const auto joint = static_cast<int>(seed % static_cast<std::uint64_t>(joints));
  return {name, joint, (joint + 2) % joints, factor * strength_of(name)};
}

struct Count {
  int cases = 0, right = 0, ambiguous = 0, sized = 0;
  double worst_twin = 0.0;
};

void report(const std::string& name, const Count& count) {
  fmt::print(
      "{:<20} {:4d} right {:5.1f} %  ambiguous {:5.1f} %  sized {:5.1f} % of right  error over "
      "twin at most {:.3f}\n",
      name, count.cases, 100.0 * count.right / count.cases, 100.0 * count.ambiguous / count.cases,
      count.right > 0 ? 100.0 * count.sized / count.right : 0.0, count.worst_twin);
  std::fflush(stdout);
}

Count run(const std::vector<Case>& cases) {
  Count count;
  for (const Case& c : cases) {
    const Verdict verdict = judge(c);
    ++count.cases;
    count.right += verdict.right ? 1 : 0;
    count.ambiguous += !verdict.right && verdict.ambiguous ? 1 : 0;
    count.sized += verdict.right && verdict.sized ? 1 : 0;
    if (verdict.right && !c.effects.empty()) {
      count.worst_twin = std::max(count.worst_twin, verdict.error / judge({{}, c.seed}).error);
    }
    if (!verdict.right || !verdict.sized) {
      std::string truth;
      for (const TrueEffect& e : c.effects)
        truth += fmt::format(" {}@{} x{:.3g}", e.effect, e.joint + 1, e.strength);
      fmt::print("    seed {}{}: {}{}\n", c.seed, truth, verdict.answer, verdict.sizes);
    }
  }
  return count;
}

void add(Count& total, const Count& part) {
  total.cases += part.cases;
  total.right += part.right;
  total.ambiguous += part.ambiguous;
  total.sized += part.sized;
  total.worst_twin = std::max(total.worst_twin, part.worst_twin);
}

void alone(int robots, std::uint64_t first, const std::string& only) {
  Count total;
  for (const std::string& name : known_torque_effects()) {
    if (!only.empty() && name != only) continue;
    std::vector<Case> cases;
    for (int k = 0; k < robots; ++k) {
      const std::uint64_t seed = first + static_cast<std::uint64_t>(k);
      cases.push_back({{effect_at(name, seed, k % 2 == 0 ? 1.0 : kStrong)}, seed});
    }
    const Count count = run(cases);
    report(name, count);
    add(total, count);
  }
  report("alone, all", total);
}

void pairs(int robots, std::uint64_t first) {
  const std::vector<std::string> names = known_torque_effects();
  std::vector<Case> cases;
  for (std::size_t a = 0; a < names.size(); ++a) {
    for (int k = 0; k < robots; ++k) {
      const std::uint64_t seed = first + 1000 + 20 * a + static_cast<std::uint64_t>(k);
      const std::size_t b = (a + 1 + seed % (names.size() - 1)) % names.size();
      cases.push_back(
          {{effect_at(names[a], seed, kStrong), effect_at(names[b], seed / 3 + 1, kStrong)}, seed});
    }
  }
  report("pairs", run(cases));
}

void clean(int robots, std::uint64_t first) {
  std::vector<Case> cases;
  for (int k = 0; k < 20 * robots; ++k)
    cases.push_back({{}, first + 5000 + static_cast<std::uint64_t>(k)});
  report("clean", run(cases));
}

/// A cable that snags at a place: a step over the position. No effect of the library is that.
void unknown(int robots, std::uint64_t first) {
  int said = 0;
  for (int k = 0; k < 5 * robots; ++k) {
    const std::uint64_t seed = first + 8000 + static_cast<std::uint64_t>(k);
    TrueEffect effect = effect_at("viscous", seed, 3.0);
    effect.effect = "snag";
    const Verdict verdict = judge({{effect}, seed});
    said += verdict.verdict == TraceVerdict::kUnknown ? 1 : 0;
    fmt::print("    seed {} snag@{}: {}\n", seed, effect.joint + 1, verdict.answer);
  }
  fmt::print("unknown: said so in {} of {}\n", said, 5 * robots);
}

/// What a joint's friction really is.
const std::vector<std::vector<std::string>>& friction_laws() {
  static const std::vector<std::vector<std::string>> laws{{"coulomb", "viscous"},
                                                          {"coulomb", "viscous", "stribeck"},
                                                          {"hysteresis", "viscous"},
                                                          {"coulomb", "viscous", "ripple"}};
  return laws;
}

void coverage(int robots, std::uint64_t first) {
  constexpr double kWidest = 4.0;                      // of the turn, times the usual one
  std::map<std::string, std::pair<int, int>> covered;  // inside, named
  for (int k = 0; k < 10 * robots; ++k) {
    const std::uint64_t seed = first + 9000 + static_cast<std::uint64_t>(k);
    Rng rng = Rng::from_name("trace_torque", seed);
    EffectWorldOptions options;
    options.joints = 4;
    options.declared_coulomb = options.declared_viscous = 0.0;
    options.width_rad_s *= std::pow(kWidest, rng.uniform(-1.0, 1.0));
    std::vector<TrueEffect> effects;
    for (int joint = 0; joint < options.joints; ++joint) {
      const std::size_t law = static_cast<std::size_t>(joint + k) % friction_laws().size();
      for (const std::string& name : friction_laws()[law])
        effects.push_back({name, joint, 0, kStrong * strength_of(name)});
    }
    const EffectWorld world = effect_world(effects, options, rng);
    const Trace trace = trace_world(world).trace;
    for (const KnownEffect& truth : world.effects) {
      const auto found = std::ranges::find_if(
          trace.accepted, [&](const TracedEffect& e) { return same_place(e, truth); });
      if (found == trace.accepted.end() || truth.size == 0.0) continue;
      const bool inside = found->interval.low <= truth.size && truth.size <= found->interval.high;
      for (const std::string& name : {truth.effect, std::string("all effects")}) {
        covered[name].first += inside ? 1 : 0;
        ++covered[name].second;
      }
      if (!inside && std::getenv("TRACE_VERBOSE") != nullptr) {
        fmt::print("    seed {} {}@{}: {:.4g} ({:.4g} to {:.4g}), truth {:.4g}\n", seed,
                   truth.effect, truth.place, found->size, found->interval.low,
                   found->interval.high, truth.size);
      }
    }
  }
  for (const auto& [name, counts] : covered) {
    fmt::print("{:<20} {:4d} named, the 95 % interval holds the truth in {:5.1f} %\n", name,
               counts.second, 100.0 * counts.first / counts.second);
  }
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "all";
  const std::string only = argc > 4 ? argv[4] : "";
  const int robots = argc > 2 ? std::atoi(argv[2]) : 3;
  const auto first = static_cast<std::uint64_t>(argc > 3 ? std::atoi(argv[3]) : 1);
  const auto begin = std::chrono::steady_clock::now();
  if (what == "alone" || what == "all") kinescope::alone(robots, first, only);
  if (what == "pairs" || what == "all") kinescope::pairs(robots, first);
  if (what == "clean" || what == "all") kinescope::clean(robots, first);
  if (what == "unknown" || what == "all") kinescope::unknown(robots, first);
  if (what == "coverage" || what == "all") kinescope::coverage(robots, first);
  const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
  fmt::print("{:.0f} s\n", time.count());
  return 0;
}
