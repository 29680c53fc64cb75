// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/traced_sets.h"

#include <algorithm>
#include <filesystem>
#include <functional>
#include <utility>

#include "dynamics/data/torque_data.h"
#include "dynamics/experiments/reference_arms.h"
#include "kinematics/core/error.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/experiments/torque_robots.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using Path = fs::path;
using Maker = std::function<TracedSet(const Path&)>;

struct Listed {
  std::string name;
  std::string folder;  ///< below the shared data
  Maker make;
};

void use(TracedSet& set, const Motion& motion) {
  set.samples = motion.samples;
  set.options.model.filter = {motion.filter, motion.cutoff.cutoff_hz};
}

Motion filtered(const TorqueLog& log, double cutoff_hz) {
  MotionOptions options;
  options.cutoff_hz = cutoff_hz;
  return derive_motion(log, options);
}

TracedSet synthetic(const fs::path& folder, const std::string& truth) {
  TracedSet set{.name = folder.filename().string(), .reference = truth};
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

TracedSet ur10e(const fs::path& folder) {
  TracedSet set{
      .name = "ur10e",
      .reference = "viscous, Coulomb; cubic j1; load j2 j3; motor inertia; 20 ms delay j4-j6"};
  set.model = read_dynamic_urdf(folder / "ur10e.urdf");
  use(set, filtered(ur10e_steady_log(folder, "ident_12harm_50s.csv"), 7.0));
  return set;
}

/// Three runs at once.
TracedSet ur10e_runs(const fs::path& folder) {
  TracedSet set{.name = "ur10e_runs", .reference = "the same robot, more of it"};
  set.model = read_dynamic_urdf(folder / "ur10e.urdf");
  use(set, filtered(join({ur10e_steady_log(folder, "ident_12harm_40s.csv"),
                          ur10e_steady_log(folder, "ident_12harm_50s.csv"),
                          ur10e_steady_log(folder, "ident_15harm_50s_unloaded.csv")}),
                    7.0));
  return set;
}

/// What the traced model of the robot without a load leaves of the torque with it: the masses of
/// the model are zero, so that all that is found came with the load.
void use_beside(TracedSet& set, const Motion& unloaded, const Motion& loaded) {
  use(set, unloaded);
  const TorqueTrace without = trace_torque(set.model, set.samples, set.options);
  use(set, loaded);
  set.samples.torque -= predict_torque(without.corrected, set.samples, set.options.model.filter);
  set.model = without_masses(set.model.tree);
  set.options.model.base = TorqueBaseKind::kDeclared;
}

TracedSet ur10e_payload(const fs::path& folder) {
  TracedSet set{.name = "ur10e_payload", .reference = "2.805 kg (first look 2.75, 2.95)"};
  set.model = read_dynamic_urdf(folder / "ur10e.urdf");
  use_beside(set, filtered(ur10e_steady_log(folder, "ident_15harm_50s_unloaded.csv"), 7.0),
             filtered(ur10e_steady_log(folder, "ident_15harm_50s_loaded.csv"), 7.0));
  return set;
}

TracedSet tx40(const fs::path& folder) {
  TracedSet set{.name = "tx40",
                .reference = "friction v/c j1 8.05 7.14, j2 5.53 8.26; wrist j5 + j6"};
  set.model = read_dynamic_urdf(folder / "tx40_mdh_modified.urdf");
  use(set, filtered(rows_between(tx40_log(folder), 0.1, 7.5), 50.0));
  return set;
}

TracedSet panda(const fs::path& folder) {
  TracedSet set{.name = "panda", .reference = "joint 7: Coulomb, nMSE 82 -> 19 (v) -> 2.6 % (v+c)"};
  set.model = panda_kinematics();
  use(set, filtered(panda_log(folder), 10.0));
  return set;
}

TracedSet rokae(const fs::path& folder) {
  TracedSet set{.name = "rokae", .reference = "gravity along base x: 90 deg"};
  set.model = read_dynamic_urdf(folder / "AR5-5_07R-W4C4A2.urdf");
  use(set, filtered(rokae_log(folder), 4.0));
  return set;
}

TracedSet lwr4(const fs::path& folder) {
  TracedSet set{.name = "lwr4", .reference = "torque offsets of joints 5 to 7, 0.5 to 1 N m on 6"};
  set.model = read_dynamic_urdf(folder / "kuka_lwr4.urdf");
  use(set, filtered(lwr4_log(folder, 1), 8.0));
  return set;
}

TracedSet franka(const fs::path& folder, const std::string& name, const std::string& file,
                 int joint, const std::string& reference) {
  TracedSet set{.name = name, .reference = reference};
  set.model = lone_joint();
  use(set, filtered(franka_log(folder, file, joint), 10.0));
  return set;
}

TracedSet kinova(const fs::path& folder) {
  TracedSet set{.name = "kinova_joint7", .reference = "dip near 0.12 rad/s: 1.50 1.42 2.46 N m"};
  set.model = lone_joint();
  use(set, filtered(kinova_log(folder), 10.0));
  return set;
}

TracedSet feetech(const fs::path& folder) {
  TracedSet set{.name = "feetech", .reference = "viscous, Coulomb, load friction; temperature"};
  set.model = pendulum();
  const PendulumLog runs = pendulum_log(folder, "sts3215", 1.1682, 0.15);
  const Motion motion = filtered(runs.log, 8.0);
  use(set, motion);
  set.samples.torque_unit = "A";
  set.options.model.temperature_c = at_samples(runs.log, runs.temperature_c, motion.samples);
  return set;
}

std::vector<Listed> listed() {
  const auto simulated = [](const char* truth) -> Maker {
    return [truth](const Path& folder) { return synthetic(folder, truth); };
  };
  const auto slow_joint = [](const char* name, const char* file, int joint, const char* reference) {
    return Maker{[=](const Path& folder) { return franka(folder, name, file, joint, reference); }};
  };
  return {{"scara4_none", "synthetic_dynamics/scara4_none", simulated("nothing")},
          {"wam7_payload", "synthetic_dynamics/wam7_payload", simulated("0.25 kg at link7")},
          {"wam7_coulomb_viscous", "synthetic_dynamics/wam7_coulomb_viscous",
           simulated("Coulomb and viscous friction of all joints")},
          {"ur6_contact", "synthetic_dynamics/ur6_contact", simulated("seven contacts")},
          {"scara4_stribeck_ripple", "synthetic_dynamics/scara4_stribeck_ripple",
           simulated("Stribeck friction of all joints, ripple of joints 1 and 2")},
          {"ur10e", "dynamics/ur10e_innopolis", ur10e},
          {"ur10e_runs", "dynamics/ur10e_innopolis", ur10e_runs},
          {"ur10e_payload", "dynamics/ur10e_innopolis", ur10e_payload},
          {"tx40", "dynamics/tx40_staubli", tx40},
          {"panda", "dynamics/panda_gaz2019", panda},
          {"rokae", "dynamics/rokae_ar5", rokae},
          {"lwr4", "dynamics/kuka_lwr4", lwr4},
          {"franka_joint7", "dynamics/franka_fairino_friction",
           slow_joint("franka_joint7", "franka_case4_slow_joint7.csv.gz", 7,
                      "Coulomb + viscous 18 %, Dahl of 0.5 to 1 mrad 7.6 %")},
          {"franka_joint2", "dynamics/franka_fairino_friction",
           slow_joint("franka_joint2", "franka_case3_slow_joint2.csv.gz", 2,
                      "Dahl 18 %, with q and q^2 10 %")},
          {"kinova_joint7", "dynamics/kinova_gen3_joint7", kinova},
          {"feetech", "dynamics/feetech_pendulum", feetech}};
}

}  // namespace

std::vector<std::string> traced_set_names() {
  std::vector<std::string> out;
  for (const Listed& set : listed()) out.push_back(set.name);
  return out;
}

std::optional<TracedSet> traced_set(const std::string& name) {
  for (const Listed& set : listed()) {
    if (set.name != name) continue;
    if (const auto path = shared_data(set.folder)) return set.make(*path);
    return std::nullopt;
  }
  throw bad_request("set", name + " is none of the traced ones", "name one of the list");
}

}  // namespace kinescope
