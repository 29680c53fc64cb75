// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/wam_control.h"

#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "dynamics/experiments/barrett.h"
#include "dynamics/experiments/logged_runs.h"
#include "dynamics/experiments/reference_arms.h"

namespace kinescope::experiments {
namespace {

constexpr const char* kBaseline = "PD, nominal gravity";

/// What Barrett's manual and drives of this size suggest; made up where it says nothing.
struct WamJoint {
  double lower, upper;  // rad
  double torque_nm;     // limit
  double motor_kgm2;    // joint side
  double coulomb_nm, viscous_nms, stribeck_nm, presliding_nm;
};
constexpr std::array<WamJoint, 7> kJoints = {{{-2.6, 2.6, 77.0, 0.15, 1.2, 0.9, 0.4, 0.5},
                                              {-1.9, 1.9, 160.0, 0.15, 1.5, 1.0, 0.4, 0.5},
                                              {-2.7, 2.7, 61.0, 0.10, 0.9, 0.5, 0.3, 0.3},
                                              {-0.8, 3.0, 30.0, 0.08, 0.6, 0.25, 0.3, 0.2},
                                              {-3.0, 1.2, 12.0, 0.012, 0.15, 0.05, 0.05, 0.05},
                                              {-1.5, 1.5, 12.0, 0.012, 0.15, 0.05, 0.05, 0.05},
                                              {-2.9, 2.9, 3.0, 0.003, 0.05, 0.02, 0.0, 0.02}}};
constexpr double kStribeck_rad_s = 0.1;
constexpr double kPresliding_rad = 0.01;
constexpr double kLoadShare = 0.02;  // of the shoulder's cable drives

TorqueEffect effect(const char* name, const std::string& joint, double value, double scan = 0.0) {
  TorqueEffect out;
  out.id = {name, joint};
  out.scan = scan;
  out.values = Eigen::VectorXd::Constant(1, value);
  return out;
}

std::vector<TorqueEffect> friction_effects(const DynamicModel& arm) {
  std::vector<TorqueEffect> out;
  const std::vector<JointId> joints = moving_joints(arm.tree);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const WamJoint& own = kJoints[j];
    const std::string& name = arm.tree.joints[joints[j].index()].name;
    out.push_back(effect("coulomb", name, own.coulomb_nm));
    out.push_back(effect("viscous", name, own.viscous_nms));
    if (own.stribeck_nm > 0.0)
      out.push_back(effect("stribeck", name, own.stribeck_nm, kStribeck_rad_s));
    out.push_back(effect("hysteresis", name, own.presliding_nm, kPresliding_rad));
    if (j < 2) out.push_back(effect("load_friction", name, kLoadShare));
  }
  return out;
}

/// Joints from `count` on become fixed.
DynamicModel with_drives(DynamicModel arm, int count) {
  const std::vector<JointId> joints = moving_joints(arm.tree);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    Joint& joint = arm.tree.joints[joints[j].index()];
    if (std::cmp_greater_equal(j, count)) {
      joint.type = JointType::kFixed;
      continue;
    }
    arm.joints[joints[j].index()].motor_inertia = kJoints[j].motor_kgm2;
    joint.limits = JointLimits{kJoints[j].lower, kJoints[j].upper};
  }
  return arm;
}

/// A data sheet: every mass off by its own factor.
DynamicModel believed(const WamControlOptions& options, Rng& rng) {
  DynamicModel out = with_drives(wam_arm(0.0), options.joints);
  for (InertialParameters& link : out.links) {
    link =
        InertialParameters::from_vector(link.vector() * std::exp(rng.normal(options.mass_error)));
  }
  return out;
}

ServoOptions servo_of(const WamControlOptions& options, ControlLaw law) {
  ServoOptions out;
  out.rate_hz = options.rate_hz;
  out.bandwidth_hz = options.bandwidth_hz;
  out.law = law;
  out.velocity_cutoff_hz = options.velocity_cutoff_hz;
  out.encoder_step = options.encoder_step_rad;
  out.torque_noise = options.noise_nm;
  out.torque_limit.resize(options.joints);
  for (Eigen::Index j = 0; j < options.joints; ++j) {
    out.torque_limit[j] = kJoints[static_cast<std::size_t>(j)].torque_nm;
  }
  return out;
}

struct Contender {
  std::string name;
  ControlLaw law = ControlLaw::kFeedForward;
  KnownRobot robot = {};
};

/// Everything that all runs have in common.
class Bench {
 public:
  Bench(const WamControlOptions& options, WamControlResult& result)
      : options_(options),
        world_(wam_world(options)),
        plants_{wam_plant(world_, false), wam_plant(world_, true)},
        result_(result) {
    for (int k = 0; k < options.tests; ++k) {
      tests_.push_back(
          wam_reference(world_.nominal, options.test_s, options.rate_hz, options.seed, k + 1));
    }
  }

  [[nodiscard]] const WamWorld& world() const { return world_; }
  [[nodiscard]] Contender nominal(ControlLaw law, std::string name) const {
    return {std::move(name), law, {.nominal = make_rigid_model(world_.nominal)}};
  }

  /// The log that is learned from.
  [[nodiscard]] ServoLog teach(bool loaded) const {
    const TorqueSamples path =
        wam_reference(world_.nominal, options_.learn_s, options_.rate_hz, options_.seed, 0);
    return follow(nominal(ControlLaw::kPdGravity, kBaseline), path, loaded, 0);
  }

  void judge(const Contender& contender, bool loaded) {
    WamRow row{contender.name, loaded, {}, {}, {}, {}};
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(options_.joints);
    Eigen::VectorXd feedback = squares;
    Eigen::VectorXd torque = squares;
    row.weight = row.largest_rad = squares;
    for (std::size_t k = 0; k < tests_.size(); ++k) {
      const ServoLog run = follow(contender, tests_[k], loaded, static_cast<int>(k) + 1);
      squares += run.tracking_error.cwiseAbs2();
      feedback += run.feedback.cwiseAbs2();
      torque += run.torque.cwiseAbs2();
      row.weight += run.weight / static_cast<double>(tests_.size());
      row.largest_rad = row.largest_rad.cwiseMax(run.largest_error);
      if (k == 0 && !loaded) {
        result_.traces.push_back(
            {contender.name, run.samples.t_s, run.samples.q - tests_.front().q});
      }
    }
    row.error_rad = (squares / static_cast<double>(tests_.size())).cwiseSqrt();
    row.feedback_share = feedback.cwiseQuotient(torque).cwiseSqrt();
    result_.rows.push_back(std::move(row));
  }

 private:
  [[nodiscard]] ServoLog follow(const Contender& contender, const TorqueSamples& path, bool loaded,
                                int number) const {
    Rng rng = Rng::from_name(fmt::format("wam control {} {}", loaded, number), options_.seed);
    return run_servo(plants_[loaded ? 1 : 0], path, contender.robot,
                     servo_of(options_, contender.law), rng);
  }

  const WamControlOptions& options_;
  WamWorld world_;
  std::array<Plant, 2> plants_;
  std::vector<TorqueSamples> tests_;
  WamControlResult& result_;
};

Contender learned(const Bench& bench, std::string name, LearnedTorque torque) {
  Contender out = bench.nominal(ControlLaw::kFeedForward, std::move(name));
  out.robot.learned = std::make_shared<const LearnedTorque>(std::move(torque));
  return out;
}

}  // namespace

WamWorld wam_world(const WamControlOptions& options) {
  Rng rng = Rng::from_name("wam world", options.seed);
  WamWorld out{
      believed(options, rng), with_drives(wam_arm(options.sensor_kg), options.joints), {}, {}};
  out.friction = friction_effects(out.truth);
  constexpr double kRadius_m = 0.03;  // of gyration
  out.payload =
      from_central({options.payload_kg,
                    {0.01, -0.01, 0.08},
                    options.payload_kg * kRadius_m * kRadius_m * Eigen::Matrix3d::Identity()});
  return out;
}

Plant wam_plant(const WamWorld& world, bool loaded) {
  std::vector<TorqueEffect> effects = world.friction;
  if (loaded) {
    TorqueEffect carried;
    carried.id = {"payload", make_rigid_model(world.truth).bodies.back().name};
    carried.values = world.payload.vector();
    effects.push_back(std::move(carried));
  }
  return sticking(make_plant(with_effects(world.truth, std::move(effects))));
}

TorqueSamples wam_reference(const DynamicModel& arm, double duration_s, double rate_hz,
                            std::uint64_t seed, int number) {
  Rng rng = Rng::from_name(fmt::format("wam reference {}", number), seed);
  SinusoidOptions options;
  options.rate_hz = rate_hz;
  options.samples = static_cast<int>(duration_s * rate_hz) + 1;
  options.sines = 10;
  options.lowest_hz = 0.05;
  options.highest_hz = 0.4;
  options.range_share = 0.5;
  return sinusoid_log(arm, options, rng);
}

WamControlResult run_wam_control(const WamControlOptions& options, int threads,
                                 const Progress& progress) {
  WamControlResult out;
  Bench bench(options, out);
  const DynamicModel& nominal = bench.world().nominal;
  const Contender baseline = bench.nominal(ControlLaw::kPdGravity, kBaseline);
  report_progress(progress, "nominal controllers", 0, 0);
  bench.judge(baseline, false);
  bench.judge(bench.nominal(ControlLaw::kFeedForward, "feed-forward, nominal"), false);
  const ServoLog log = bench.teach(false);
  report_progress(progress, "trace", 0, 0);
  const LearnedTorque effects = learn_effects(nominal, log, progress);
  for (const TorqueEffect& one : effects.traced->effects) {
    out.effects.push_back(fmt::format("{} at {}", one.id.effect, one.id.place));
  }
  Contender traced = learned(bench, "feed-forward, traced effects", effects);
  bench.judge(traced, false);
  for (const TorqueModelKind kind : options.kinds) {
    report_progress(progress, fmt::format("{} model", to_string(kind)), 0, 0);
    bench.judge(learned(bench, fmt::format("feed-forward, {}", to_string(kind)),
                        learn_model(kind, nominal, log, threads, progress)),
                false);
  }

  report_progress(progress, "payload", 0, 0);
  bench.judge(baseline, true);
  traced.name = "feed-forward, traced effects, payload unknown";
  bench.judge(traced, true);
  out.payload = estimate_payload(nominal, motion_of_run(bench.teach(true), nominal).samples,
                                 motion_of_run(log, nominal).samples);
  traced.name = "feed-forward, traced effects, payload identified";
  traced.robot.payload = InertialParameters::from_vector(out.payload.parameters);
  bench.judge(traced, true);
  for (const RigidBody& body : make_rigid_model(nominal).bodies) out.joints.push_back(body.joint);
  return out;
}

}  // namespace kinescope::experiments
