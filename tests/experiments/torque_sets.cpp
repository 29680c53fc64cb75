// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/torque_sets.h"

#include "dynamics/data/motion.h"
#include "dynamics/data/splits.h"
#include "dynamics/experiments/reference_arms.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/experiments/torque_robots.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

TorqueSamples samples_between(const TorqueSamples& samples, double from_s, double to_s) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index t = 0; t < samples.size(); ++t) {
    if (samples.t_s[t] >= from_s && samples.t_s[t] < to_s) rows.push_back(t);
  }
  return select_rows(samples, rows);
}

TorqueSamples filtered(const TorqueLog& log, double cutoff_hz) {
  MotionOptions options{.filter = LowPass::kButterworth, .source = MotionSource::kBest};
  options.cutoff_hz = cutoff_hz;
  return derive_motion(log, options).samples;
}

TorqueSet ur10e(const fs::path& folder) {
  const auto read = [&](const char* file) { return filtered(ur10e_log(folder, file), 7.0); };
  TorqueSet set{.name = "ur10e",
                .split = "12harm_50s -> 15harm_50s_unloaded, 7 Hz",
                .first_fit = "0.63 0.78 0.27 0.58 1.86 1.18"};
  set.model = read_dynamic_urdf(folder / "ur10e.urdf");
  // The authors' own cut of the start-up motion; of the other file, the same three seconds.
  set.train = samples_between(read("ident_12harm_50s.csv"), 3.8, 54.2);
  const TorqueSamples test = read("ident_15harm_50s_unloaded.csv");
  set.test = samples_between(test, 3.8, test.t_s[test.size() - 1] - 3.0);
  return set;
}

TorqueSet tx40(const fs::path& folder) {
  TorqueSet set{.name = "tx40",
                .split = "0.1 .. 5.5 s -> 5.5 .. 7.5 s, 50 Hz, with the wrist's coupled drive",
                .first_fit = "0.62 0.75 1.28 1.34 12.4 3.8"};
  set.model = read_dynamic_urdf(folder / "tx40_mdh_modified.urdf");
  const TorqueSamples all = filtered(tx40_log(folder), 50.0);
  set.train = samples_between(all, 0.1, 5.5);
  set.test = samples_between(all, 5.5, 7.5);
  Eigen::VectorXd wrist = Eigen::VectorXd::Zero(6);
  wrist.tail<2>().setOnes();
  set.options.drives.coupled_drives = {wrist};
  return set;
}

/// The first 65 % to learn from, the rest to be judged on.
void split(TorqueSet& set, const TorqueSamples& all) {
  const double cut = 0.65 * all.t_s[all.size() - 1];
  set.train = samples_between(all, 0.0, cut);
  set.test = samples_between(all, cut, 1e9);
}

TorqueSet panda(const fs::path& folder) {
  TorqueSet set{.name = "panda",
                .split = "first 65 % -> rest, 10 Hz",
                .first_fit =
                    "0.37 0.03 0.05 0.11 0.45 0.18 2.6 (with position harmonics 0.33 0.02 "
                    "0.04 0.08 0.37 0.10 2.3)"};
  set.options.drives.motor_inertia = false;  // the sensors sit behind the motors
  set.model = panda_kinematics();
  split(set, filtered(panda_log(folder), 10.0));
  return set;
}

TorqueSet rokae(const fs::path& folder) {
  TorqueSet set{.name = "rokae",
                .split = "first 65 % -> rest, 4 Hz, gravity along base x",
                .first_fit = "0.09 0.32 0.48 0.17 11 3.7 3.2"};
  set.options.drives.motor_inertia = false;  // the sensors sit behind the motors
  set.model = read_dynamic_urdf(folder / "AR5-5_07R-W4C4A2.urdf");
  set.model.gravity_m_s2 = {kUsualGravity_m_s2, 0.0, 0.0};
  split(set, filtered(rokae_log(folder), 4.0));
  return set;
}

TorqueSet lwr4(const fs::path& folder) {
  TorqueSet set{.name = "lwr4",
                .split = "measurements_1 -> measurements_2 (the same path), 8 Hz",
                .first_fit = "6.9 0.08 0.83 0.29 12 30 32"};
  set.options.drives.motor_inertia = false;  // the sensors sit behind the motors
  set.model = read_dynamic_urdf(folder / "kuka_lwr4.urdf");
  set.train = filtered(lwr4_log(folder, 1), 8.0);
  set.test = filtered(lwr4_log(folder, 2), 8.0);
  return set;
}

}  // namespace

const std::vector<NamedTorqueSet>& torque_sets() {
  static const std::vector<NamedTorqueSet> sets = {{"ur10e", "dynamics/ur10e_innopolis", ur10e},
                                                   {"tx40", "dynamics/tx40_staubli", tx40},
                                                   {"panda", "dynamics/panda_gaz2019", panda},
                                                   {"rokae", "dynamics/rokae_ar5", rokae},
                                                   {"lwr4", "dynamics/kuka_lwr4", lwr4}};
  return sets;
}

}  // namespace kinescope
