// SPDX-License-Identifier: Apache-2.0
//
// Torque residuals traced to their effects, on simulated sets with known truth and on measured
// robots: held-out error before and after, what was found, beside the figure of a first look.
// `trace_torque_real [SET...]`; default: all. The sets stay where they are.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>

#include <fmt/format.h>

#include "tests/experiments/traced_sets.h"

namespace kinescope {
namespace {

void run(const TracedSet& set) {
  const auto begin = std::chrono::steady_clock::now();
  const TorqueTrace out = trace_torque(set.model, set.samples, set.options);
  const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
  const Trace& trace = out.trace;
  fmt::print("\n{}: {}\n  {} samples; {} masses ({}); {:.1f} s\n", set.name, set.reference,
             set.samples.size(), to_string(out.base.kind), out.base.reason, time.count());
  fmt::print("  {}: {}\n", to_string(trace.verdict), trace.reason);
  fmt::print("  held out {:.4g} [{:.4g}, {:.4g}] -> {:.4g} [{:.4g}, {:.4g}] {}\n",
             trace.held_out_before.value, trace.held_out_before.interval.low,
             trace.held_out_before.interval.high, trace.held_out_after.value,
             trace.held_out_after.interval.low, trace.held_out_after.interval.high,
             trace.held_out_after.unit);
  for (const TracedEffect& e : trace.accepted) {
    fmt::print("    {:<18} {:<20} {:9.4g} [{:.4g}, {:.4g}] {}", e.id.effect, e.id.place, e.size,
               e.interval.low, e.interval.high, e.unit);
    if (!e.scan_name.empty()) fmt::print(" ({} {:.4g} {})", e.scan_name, e.scan, e.scan_unit);
    fmt::print("\n");
  }
  for (const Ambiguity& a : trace.ambiguities) {
    fmt::print("    cannot tell:");
    for (const EffectId& id : a.effects) fmt::print(" {}@{}", id.effect, id.place);
    fmt::print("\n");
  }
  if (std::getenv("TRACE_VERBOSE") != nullptr) {
    for (const TraceStep& step : trace.steps) {
      fmt::print("    step {} {}: {:.4g}\n", step.round, step.words, step.held_out.value);
    }
    std::vector<TestedCandidate> last;
    for (const TestedCandidate& c : trace.candidates) {
      if (c.round == trace.candidates.back().round) last.push_back(c);
    }
    std::ranges::sort(last, {}, &TestedCandidate::p_value);
    for (std::size_t k = 0; k < std::min<std::size_t>(12, last.size()); ++k) {
      fmt::print("    {:<16} {:<16} p {:.2g} F {:.3g} ({}, {}) size {:.3g} {}\n", last[k].id.effect,
                 last[k].id.place, last[k].p_value, last[k].statistic, last[k].parameters,
                 last[k].freedom, last[k].size, to_string(last[k].state));
    }
  }
  for (const Rest& rest : trace.rest) {
    fmt::print("    left: {} over {}, {:.2g} of the squares\n", rest.place, rest.covariate,
               rest.explained);
  }
  std::fflush(stdout);
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  const std::vector<std::string> wanted(argv + 1, argv + argc);
  for (const std::string& name : kinescope::traced_set_names()) {
    if (!wanted.empty() && std::ranges::find(wanted, name) == wanted.end()) continue;
    try {
      if (const auto set = kinescope::traced_set(name)) {
        kinescope::run(*set);
      } else {
        fmt::print("{}: not on this machine\n", name);
      }
    } catch (const std::exception& error) {
      fmt::print("\n{}: {}\n", name, error.what());
    }
  }
  return 0;
}
