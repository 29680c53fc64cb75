// SPDX-License-Identifier: Apache-2.0
//
// What a robot carries, from its torques: `payload [coverage [SEEDS]] [wam7] [ur10e]`.
// coverage  random arms with a random load at the hand, coloured noise, outliers, friction and
//           offsets that differ between the logs: how often the 95 % interval holds the truth.
// wam7      0.25 kg, the declared masses trusted; the Barrett report has 0.254 +- 0.009 kg.
// ur10e     2.805 kg, motor currents, two logs; drive gains from the literature.
#include "dynamics/identify/payload.h"

#include <cstdlib>
#include <functional>

#include <fmt/format.h>

#include "dynamics/data/torque_data.h"
#include "kinematics/core/error.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/truth/shared_data.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

void print(const std::string& how, const PayloadEstimate& e, double truth_kg) {
  fmt::print("{:<34} {:.4f} +- {:.4f} kg, 95 % {:.4f} to {:.4f}{}; centre", how, e.mass_kg,
             e.sigma_kg, e.lower_kg, e.upper_kg,
             e.lower_kg <= truth_kg && truth_kg <= e.upper_kg ? " holds the truth" : " MISSES");
  for (int k = 0; k < 3; ++k)
    fmt::print(" {:.1f}+-{:.1f}", 1e3 * e.centre_m[k], 1e3 * e.centre_sigma_m[k]);
  fmt::print(" mm; joints disagree x {:.2f}\n", e.disagreement);
  for (const MassOfJoint& joint : e.joints) {
    fmt::print("    joint {}: {:.4f} +- {:.4f} kg\n", joint.joint + 1, joint.mass_kg,
               joint.sigma_kg);
  }
}

struct Tally {
  int held = 0;
  int runs = 0;
  double error = 0.0;
  double sigma = 0.0;
  void add(const PayloadEstimate& e, double truth_kg) {
    held += e.lower_kg <= truth_kg && truth_kg <= e.upper_kg ? 1 : 0;
    ++runs;
    error += (e.mass_kg - truth_kg) * (e.mass_kg - truth_kg);
    sigma += e.sigma_kg * e.sigma_kg;
  }
  void print(const char* how) const {
    fmt::print(
        "{:<34} {:>4} of {:>4} hold the truth ({:.1f} %); rms error {:.4f} kg, claimed {:.4f}\n",
        how, held, runs, 100.0 * held / runs, std::sqrt(error / runs), std::sqrt(sigma / runs));
  }
};

struct World {
  DynamicModel bare;
  TorqueSamples unloaded, loaded;
  double mass_kg = 0.0;
};

World make_world(std::uint64_t seed) {
  Rng rng = Rng::from_name("payload coverage", seed);
  World out;
  out.bare = random_masses(random_robot({.joints = 5, .prismatic_share = 0.0}, rng).tree,
                           {.every_direction = false}, rng);
  DynamicModel full = out.bare;
  out.mass_kg = rng.uniform(0.2, 1.0);
  const RigidModel rigid = make_rigid_model(out.bare);
  std::size_t last = 0;
  for (std::size_t l = 0; l < full.links.size(); ++l) {
    if (out.bare.tree.links[l].name == rigid.bodies.back().name) last = l;
  }
  const Eigen::Vector3d centre(rng.uniform(-0.05, 0.05), rng.uniform(-0.05, 0.05), 0.1);
  full.links[last] +=
      from_central({.mass_kg = out.mass_kg,
                    .centre_m = centre,
                    .inertia_kgm2 = 4e-4 * out.mass_kg * Eigen::Matrix3d::Identity()});
  TorqueWorldOptions options{.samples = 4000,
                             .noise = 0.02,
                             .noise_memory = 0.8,
                             .common_noise = 0.3,
                             .outliers = 0.01,
                             .trajectories = 10};
  out.unloaded = torque_log_of(out.bare, options, rng);
  for (JointDynamics& joint : full.joints) joint.coulomb *= 1.2;  // load and warmth
  options.offsets = Eigen::VectorXd::Constant(out.unloaded.joints(), 0.05);
  out.loaded = torque_log_of(full, options, rng);
  return out;
}

void coverage(int seeds) {
  Tally model;
  Tally logs;
  Tally rest;
  Tally rest_logs;
  int refused = 0;
  for (int seed = 0; seed < seeds; ++seed) {
    const World world = make_world(static_cast<std::uint64_t>(seed));
    try {
      const PayloadEstimate one = estimate_payload(world.bare, world.loaded);
      const PayloadEstimate two = estimate_payload(world.bare, world.loaded, world.unloaded);
      RobustTorqueOptions few;
      few.samples = 400;
      few.threads = 1;
      const RobustTorque loaded = learn_robust_torque(world.bare, world.loaded, few);
      const RobustTorque unloaded = learn_robust_torque(world.bare, world.unloaded, few);
      model.add(one, world.mass_kg);
      logs.add(two, world.mass_kg);
      rest.add(payload_at_rest(world.bare, loaded, nullptr), world.mass_kg);
      rest_logs.add(payload_at_rest(world.bare, loaded, &unloaded), world.mass_kg);
    } catch (const Error& error) {
      fmt::print("seed {}: {}\n", seed, error.what());
      ++refused;
    }
  }
  fmt::print("coverage of the 95 % interval, {} random arms, {} refused\n", seeds, refused);
  model.print("all of the motion, masses known");
  logs.print("all of the motion, two logs");
  rest.print("at rest, masses known");
  rest_logs.print("at rest, two logs");
}

fs::path data_folder(const char* relative) {
  const auto folder = shared_data(relative);
  if (folder) return *folder;
  throw bad_input(relative, "is not on this machine", "set KINESCOPE_SHARED_DATA");
}

void wam7() {
  const fs::path folder = data_folder("synthetic_dynamics/wam7_payload");
  const DynamicModel model = read_dynamic_urdf(folder / "nominal.urdf");
  const TorqueData data = read_torque_data({folder / "log.csv.gz"}, wanted_joints(model.tree));
  constexpr double kTruth = 0.25;
  print("wam7, all of the motion", estimate_payload(model, data.samples), kTruth);
  print("wam7, at rest", payload_at_rest(model, learn_robust_torque(model, data.samples), nullptr),
        kTruth);
}

void ur10e() {
  const fs::path folder = data_folder("dynamics/ur10e_innopolis");
  const DynamicModel model = read_dynamic_urdf(folder / "ur10e.urdf");
  constexpr double kTruth = 2.805;
  const std::vector<std::pair<std::string, std::vector<double>>> gains = {
      {"literature", {14.87, 13.26, 11.13, 10.62, 11.03, 11.47}},
      {"authors'", {10.0, 10.6956, 8.4566, 9.0029, 9.48, 10.1232}}};
  for (const auto& [name, factors] : gains) {
    TorqueDataOptions options;
    for (int j = 1; j <= 6; ++j) {
      options.mapping.position.push_back(fmt::format("q{}", j));
      options.mapping.velocity.push_back(fmt::format("dq{}", j));
      options.mapping.torque.push_back(fmt::format("i{}", j));
    }
    options.mapping.torque_unit = {"A"};
    options.mapping.torque_factor = factors;
    const auto read = [&](const char* file) {
      return read_torque_data({folder / file}, wanted_joints(model.tree), options).samples;
    };
    const TorqueSamples loaded = read("ident_15harm_50s_loaded.csv");
    const TorqueSamples unloaded = read("ident_15harm_50s_unloaded.csv");
    print("ur10e, " + name + " gains, all", estimate_payload(model, loaded, unloaded), kTruth);
    const RobustTorque with = learn_robust_torque(model, loaded);
    const RobustTorque without = learn_robust_torque(model, unloaded);
    print("ur10e, " + name + " gains, at rest", payload_at_rest(model, with, &without), kTruth);
  }
}

int main_of(std::vector<std::string> words) {
  if (words.empty()) words = {"wam7", "ur10e", "coverage"};
  for (std::size_t k = 0; k < words.size(); ++k) {
    try {
      if (words[k] == "wam7") wam7();
      if (words[k] == "ur10e") ur10e();
      if (words[k] == "coverage") {
        coverage(k + 1 < words.size() ? std::atoi(words[k + 1].c_str()) : 200);
      }
    } catch (const Error& error) {
      fmt::print("{}: {}\n", words[k], error.what());
    }
  }
  return 0;
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  return kinescope::main_of(std::vector<std::string>(argv + 1, argv + argc));
}
