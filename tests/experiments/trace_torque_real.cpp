// SPDX-License-Identifier: Apache-2.0
//
// Torque residuals traced to their effects, on simulated sets with known truth and on measured
// robots: held-out error before and after, what was found, beside the figure of a first look.
// `trace_torque_real [SET...]`; default: all. The sets stay where they are.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>

#include <fmt/format.h>

#include "dynamics/data/torque_data.h"
#include "dynamics/effects/trace_torque.h"
#include "dynamics/experiments/reference_arms.h"
#include "kinematics/core/error.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/experiments/torque_robots.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

struct RealSet {
  std::string name;
  std::string reference;  ///< what a first look found, or the truth
  DynamicModel model = {};
  TorqueSamples samples = {};
  TorqueTraceOptions options = {};
};

void use(RealSet& set, const Motion& motion) {
  set.samples = motion.samples;
  set.options.model.filter = {motion.filter, motion.cutoff.cutoff_hz};
}

Motion filtered(const TorqueLog& log, double cutoff_hz) {
  MotionOptions options;
  options.cutoff_hz = cutoff_hz;
  return derive_motion(log, options);
}

RealSet synthetic(const fs::path& folder, const std::string& truth) {
  RealSet set{.name = folder.filename().string(), .reference = truth};
  set.model = read_dynamic_urdf(folder / "nominal.urdf");
  set.model.gravity_m_s2 = {0.0, 0.0, -9.81};  // as the set's README says
  const std::vector<WantedJoint> joints = wanted_joints(set.model.tree);
  TorqueDataOptions options;
  options.motion.cutoff_hz =
      tracing_cutoff_hz(read_torque_data({folder / "log.csv.gz"}, joints).cutoff);
  const TorqueData data = read_torque_data({folder / "log.csv.gz"}, joints, options);
  set.samples = data.samples;
  set.options.model.filter = {data.filter, data.cutoff.cutoff_hz};
  return set;
}

RealSet ur10e(const fs::path& folder) {
  RealSet set{
      .name = "ur10e",
      .reference = "viscous, Coulomb; cubic j1; load j2 j3; motor inertia; 20 ms delay j4-j6"};
  set.model = read_dynamic_urdf(folder / "ur10e.urdf");
  use(set, filtered(ur10e_steady_log(folder, "ident_12harm_50s.csv"), 7.0));
  return set;
}

/// Three runs at once.
RealSet ur10e_runs(const fs::path& folder) {
  RealSet set{.name = "ur10e_runs", .reference = "the same robot, more of it"};
  set.model = read_dynamic_urdf(folder / "ur10e.urdf");
  use(set, filtered(join({ur10e_steady_log(folder, "ident_12harm_40s.csv"),
                          ur10e_steady_log(folder, "ident_12harm_50s.csv"),
                          ur10e_steady_log(folder, "ident_15harm_50s_unloaded.csv")}),
                    7.0));
  return set;
}

/// What the traced model of the robot without a load leaves of the torque with it: the masses of
/// the model are zero, so that all that is found came with the load.
void use_beside(RealSet& set, const Motion& unloaded, const Motion& loaded) {
  use(set, unloaded);
  const TorqueTrace without = trace_torque(set.model, set.samples, set.options);
  use(set, loaded);
  set.samples.torque -= predict_torque(without.corrected, set.samples, set.options.model.filter);
  set.model = without_masses(set.model.tree);
  set.options.model.base = TorqueBaseKind::kDeclared;
}

RealSet ur10e_payload(const fs::path& folder) {
  RealSet set{.name = "ur10e_payload", .reference = "2.805 kg (first look 2.75, 2.95)"};
  set.model = read_dynamic_urdf(folder / "ur10e.urdf");
  use_beside(set, filtered(ur10e_steady_log(folder, "ident_15harm_50s_unloaded.csv"), 7.0),
             filtered(ur10e_steady_log(folder, "ident_15harm_50s_loaded.csv"), 7.0));
  return set;
}

RealSet tx40(const fs::path& folder) {
  RealSet set{.name = "tx40",
              .reference = "friction v/c j1 8.05 7.14, j2 5.53 8.26; wrist j5 + j6"};
  set.model = read_dynamic_urdf(folder / "tx40_mdh_modified.urdf");
  use(set, filtered(rows_between(tx40_log(folder), 0.1, 7.5), 50.0));
  return set;
}

RealSet panda(const fs::path& folder) {
  RealSet set{.name = "panda", .reference = "joint 7: Coulomb, nMSE 82 -> 19 (v) -> 2.6 % (v+c)"};
  set.model = panda_kinematics();
  use(set, filtered(panda_log(folder), 10.0));
  return set;
}

RealSet rokae(const fs::path& folder) {
  RealSet set{.name = "rokae", .reference = "gravity along base x: 90 deg"};
  set.model = read_dynamic_urdf(folder / "AR5-5_07R-W4C4A2.urdf");
  use(set, filtered(rokae_log(folder), 4.0));
  return set;
}

RealSet lwr4(const fs::path& folder) {
  RealSet set{.name = "lwr4", .reference = "torque offsets of joints 5 to 7, 0.5 to 1 N m on 6"};
  set.model = read_dynamic_urdf(folder / "kuka_lwr4.urdf");
  use(set, filtered(lwr4_log(folder, 1), 8.0));
  return set;
}

RealSet franka(const fs::path& folder, const std::string& name, const std::string& file, int joint,
               const std::string& reference) {
  RealSet set{.name = name, .reference = reference};
  set.model = lone_joint();
  use(set, filtered(franka_log(folder, file, joint), 10.0));
  return set;
}

RealSet kinova(const fs::path& folder) {
  RealSet set{.name = "kinova_joint7", .reference = "dip near 0.12 rad/s: 1.50 1.42 2.46 N m"};
  set.model = lone_joint();
  use(set, filtered(kinova_log(folder), 10.0));
  return set;
}

RealSet feetech(const fs::path& folder) {
  RealSet set{.name = "feetech", .reference = "viscous, Coulomb, load friction; temperature"};
  set.model = pendulum();
  const PendulumLog runs = pendulum_log(folder, "sts3215", 1.1682, 0.15);
  const Motion motion = filtered(runs.log, 8.0);
  use(set, motion);
  set.samples.torque_unit = "A";
  set.options.model.temperature_c = at_samples(runs.log, runs.temperature_c, motion.samples);
  return set;
}

void run(const RealSet& set) {
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
  using Path = std::filesystem::path;
  using Maker = std::function<kinescope::RealSet(const Path&)>;
  const auto synthetic = [](const char* truth) -> Maker {
    return [truth](const Path& folder) { return kinescope::synthetic(folder, truth); };
  };
  const auto franka = [](const char* name, const char* file, int joint, const char* reference) {
    return Maker{[=](const Path& folder) {
      return kinescope::franka(folder, name, file, joint, reference);
    }};
  };
  const std::vector<std::tuple<std::string, std::string, Maker>> sets = {
      {"scara4_none", "synthetic_dynamics/scara4_none", synthetic("nothing")},
      {"wam7_payload", "synthetic_dynamics/wam7_payload", synthetic("0.25 kg at link7")},
      {"wam7_coulomb_viscous", "synthetic_dynamics/wam7_coulomb_viscous",
       synthetic("Coulomb and viscous friction of all joints")},
      {"ur6_contact", "synthetic_dynamics/ur6_contact", synthetic("seven contacts")},
      {"scara4_stribeck_ripple", "synthetic_dynamics/scara4_stribeck_ripple",
       synthetic("Stribeck friction of all joints, ripple of joints 1 and 2")},
      {"ur10e", "dynamics/ur10e_innopolis", kinescope::ur10e},
      {"ur10e_runs", "dynamics/ur10e_innopolis", kinescope::ur10e_runs},
      {"ur10e_payload", "dynamics/ur10e_innopolis", kinescope::ur10e_payload},
      {"tx40", "dynamics/tx40_staubli", kinescope::tx40},
      {"panda", "dynamics/panda_gaz2019", kinescope::panda},
      {"rokae", "dynamics/rokae_ar5", kinescope::rokae},
      {"lwr4", "dynamics/kuka_lwr4", kinescope::lwr4},
      {"franka_joint7", "dynamics/franka_fairino_friction",
       franka("franka_joint7", "franka_case4_slow_joint7.csv.gz", 7,
              "Coulomb + viscous 18 %, Dahl of 0.5 to 1 mrad 7.6 %")},
      {"franka_joint2", "dynamics/franka_fairino_friction",
       franka("franka_joint2", "franka_case3_slow_joint2.csv.gz", 2,
              "Dahl 18 %, with q and q^2 10 %")},
      {"kinova_joint7", "dynamics/kinova_gen3_joint7", kinescope::kinova},
      {"feetech", "dynamics/feetech_pendulum", kinescope::feetech}};
  const std::vector<std::string> wanted(argv + 1, argv + argc);
  for (const auto& [name, folder, make] : sets) {
    if (!wanted.empty() && std::ranges::find(wanted, name) == wanted.end()) continue;
    const auto path = kinescope::shared_data(folder);
    if (!path) {
      fmt::print("{}: not on this machine\n", name);
      continue;
    }
    try {
      kinescope::run(make(*path));
    } catch (const std::exception& error) {
      fmt::print("\n{}: {}\n", name, error.what());
    }
  }
  return 0;
}
