// SPDX-License-Identifier: Apache-2.0
//
// The library against a generator that makes every effect by other means: the model with the effect
// in it has the generator's torque, the size comes out, and nothing comes out where nothing is.
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include <gtest/gtest.h>

#include "dynamics/data/motion.h"
#include "dynamics/data/splits.h"
#include "dynamics/effects/trace_torque.h"
#include "dynamics/effects/traced_torque.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "kinematics/core/error.h"
#include "tests/truth/torque_effects.h"

namespace kinescope {
namespace {

// Of the effect's own rms torque that the fitted effect may leave: scans are tried at their coarse
// values only, and Dahl's first stretch is not known.
constexpr double kLeft = 0.35;
// Of the size: the noise is a tenth of a percent of the torque; scans again.
constexpr double kSizeTolerance = 0.05;
constexpr double kScannedSizeTolerance = 0.12;

/// Rows as logged, with the exact motion; no low-pass.
TorqueSamples exact_samples(const EffectWorld& world, double cutoff_hz = 25.0) {
  MotionOptions options;
  options.cutoff_hz = cutoff_hz;
  return derive_motion(world.log, options).samples;
}

TracedTorqueOptions declared_options(double cutoff_hz = 25.0) {
  TracedTorqueOptions options;
  options.base = TorqueBaseKind::kDeclared;
  options.filter = {LowPass::kSmoothingSpline, cutoff_hz};
  return options;
}

EffectWorldOptions quiet_world() {
  EffectWorldOptions options;
  options.joints = 3;
  options.prismatic_share = 0.0;
  options.duration_s = 16.0;
  options.noise = 1e-3;
  options.position_noise_rad = 1e-7;
  return options;
}

double rms(const Eigen::VectorXd& x) {
  return std::sqrt(x.squaredNorm() / static_cast<double>(x.size()));
}

const Candidate& candidate(const TracedFit& fit, const EffectId& id) {
  const auto found = std::ranges::find(fit.candidates, id, &Candidate::id);
  EXPECT_NE(found, fit.candidates.end()) << id.effect << " at " << id.place;
  return *found;
}

/// The value of the scan that leaves least, by trying all of them.
AddedEffect best(const TorqueTracedModel& model, const Candidate& candidate) {
  AddedEffect out{candidate.id, candidate.scan.empty() ? 0.0 : candidate.scan.front()};
  double least = 1e300;
  for (const double scan : candidate.scan) {
    const double left = model.fit({{candidate.id, scan}}).linear.residual.squaredNorm();
    if (left < least) {
      least = left;
      out.scan = scan;
    }
  }
  return out;
}

class EveryEffect : public testing::TestWithParam<std::string> {};

TEST_P(EveryEffect, ExplainsTheTorqueThatTheGeneratorMadeAndHasItsSize) {
  Rng rng = Rng::from_name("effects", 7);
  const double strength = GetParam() == "gravity_direction" ? 5.0
                          : GetParam() == "torque_delay"    ? 0.01
                          : GetParam() == "torque_lag"      ? 0.03
                                                            : 0.2;
  const EffectWorld world = effect_world({{GetParam(), 1, 2, strength}}, quiet_world(), rng);
  const TorqueTracedModel model(world.model, exact_samples(world), declared_options());
  const TracedFit without = model.fit({});
  const EffectId id{world.effects.front().effect, world.effects.front().place};
  const Candidate& known = candidate(without, id);
  const AddedEffect added = best(model, known);
  const TracedFit with = model.fit({added});
  ASSERT_TRUE(with.converged) << with.reason;
  const double before = model.residual_torque(without).norm();
  const double after = model.residual_torque(with).norm();
  EXPECT_LT(after, kLeft * before);
  const Eigen::VectorXd& values = with.values.front();
  const double size =
      values.size() == 1 ? values[0] : std::sqrt(known.size_weights.dot(values.cwiseAbs2()));
  const double truth = world.effects.front().size;
  if (truth != 0.0) {
    const double tolerance = known.scan.empty() ? kSizeTolerance : kScannedSizeTolerance;
    EXPECT_NEAR(size, truth, tolerance * truth);
  }
}

INSTANTIATE_TEST_SUITE_P(library, EveryEffect,
                         testing::Values("viscous", "coulomb", "asymmetric", "stribeck",
                                         "cubic_viscous", "load_friction", "position_friction",
                                         "hysteresis", "motor_inertia", "payload", "spring",
                                         "ripple", "torque_offset", "torque_gain", "cross_talk",
                                         "torque_delay", "torque_lag", "drift", "gravity_direction",
                                         "payload_change"),
                         [](const auto& tested) { return tested.param; });

// From a floor to a ceiling, where tilts of all directions are the same.
TEST(TorqueEffects, GravityIsFoundWhereverTheBaseIsMounted) {
  for (const double tilt_deg : {60.0, 120.0, 150.0, 175.0, 180.0}) {
    SCOPED_TRACE(tilt_deg);
    Rng rng = Rng::from_name("mounts");
    const EffectWorld world =
        effect_world({{"gravity_direction", 1, 2, tilt_deg}}, quiet_world(), rng);
    const TorqueTracedModel model(world.model, exact_samples(world), declared_options());
    const TracedFit with = model.fit({{{"gravity_direction", "base"}, 0.0}});
    ASSERT_TRUE(with.converged) << with.reason;
    EXPECT_NEAR(with.values.front().norm(), tilt_deg, 0.2);
    EXPECT_TRUE(with.linear.jacobian.allFinite());
    EXPECT_LT(model.residual_torque(with).norm(),
              kLeft * model.residual_torque(model.fit({})).norm());
  }
}

TEST(TorqueEffects, EveryFixedNameIsOfferedOnceAtEachPlace) {
  Rng rng = Rng::from_name("effects", 1);
  const EffectWorld world = effect_world({}, quiet_world(), rng);
  const TracedFit fit =
      TorqueTracedModel(world.model, exact_samples(world), declared_options()).fit({});
  std::vector<EffectId> ids;
  for (const Candidate& c : fit.candidates) ids.push_back(c.id);
  std::ranges::sort(ids);
  EXPECT_EQ(std::ranges::adjacent_find(ids), ids.end()) << "one candidate a name and place";
  for (const std::string& name : known_torque_effects()) {
    if (name == "contact") continue;  // found as spans
    EXPECT_TRUE(std::ranges::any_of(ids, [&](const EffectId& id) { return id.effect == name; }))
        << name;
  }
}

TEST(TorqueEffects, ColumnsAreTheDerivativesOfTheFitsPrediction) {
  Rng rng = Rng::from_name("effects", 2);
  const EffectWorld world = effect_world({{"payload", 0, 0, 0.2}}, quiet_world(), rng);
  const TorqueTracedModel model(world.model, exact_samples(world), declared_options());
  const TracedFit fit = model.fit({});
  for (const Candidate& c : fit.candidates) {
    if (c.id.place != "joint1" && c.id.effect != "payload") continue;
    const std::vector<EffectColumn> columns = c.columns(c.scan.empty() ? 0.0 : c.scan.front());
    ASSERT_EQ(columns.size(), c.parameters.size()) << c.id.effect;
    for (const EffectColumn& column : columns) {
      ASSERT_LT(column.carrier, fit.linear.carriers.cols()) << c.id.effect;
      EXPECT_TRUE(column.share.size() == 0 || column.share.size() == fit.linear.instants());
      EXPECT_TRUE(column.share.allFinite()) << c.id.effect;
    }
  }
}

TorqueTrace trace_of_lag(double constant_s, double noise, double cutoff_hz,
                         std::vector<TrueEffect> effects = {}) {
  Rng rng = Rng::from_name("effects", 4);
  EffectWorldOptions options = quiet_world();
  options.noise = noise;
  effects.push_back({"torque_lag", 1, 2, constant_s});
  const EffectWorld world = effect_world(effects, options, rng);
  TorqueTraceOptions trace;
  trace.model = declared_options(cutoff_hz);
  return trace_torque(world.model, exact_samples(world, cutoff_hz), trace);
}

TEST(TorqueEffects, ALowPassOfTheDriveIsNoDelay) {
  const TorqueTrace out = trace_of_lag(0.04, 1e-2, 25.0);
  ASSERT_EQ(out.trace.accepted.size(), 1U) << out.trace.reason;
  const TracedEffect& lag = out.trace.accepted.front();
  EXPECT_EQ(lag.id, (EffectId{"torque_lag", "joint2"}));
  EXPECT_NEAR(lag.size, 0.04, 0.001);
  EXPECT_TRUE(lag.interval.low < 0.04 && lag.interval.high > 0.04);
  EXPECT_TRUE(out.trace.ambiguities.empty()) << out.trace.reason;
}

TEST(TorqueEffects, ALowPassFarAboveTheMotionMayBeADelay) {
  const TorqueTrace out = trace_of_lag(0.01, 0.02, 6.0);
  ASSERT_EQ(out.trace.verdict, TraceVerdict::kAmbiguous) << out.trace.reason;
  ASSERT_EQ(out.trace.ambiguities.size(), 1U);
  std::vector<EffectId> named = out.trace.ambiguities.front().effects;
  std::ranges::sort(named);
  EXPECT_EQ(named, (std::vector<EffectId>{{"torque_delay", "joint2"}, {"torque_lag", "joint2"}}));
  // What is known stands before what is not.
  const Trace beside = trace_of_lag(0.01, 0.02, 6.0, {{"coulomb", 0, 0, 0.3}}).trace;
  ASSERT_EQ(beside.verdict, TraceVerdict::kAmbiguous) << beside.reason;
  EXPECT_LT(beside.reason.find("coulomb at joint1"), beside.reason.find("cannot tell"))
      << beside.reason;
}

TEST(TorqueEffects, ADriveHasNoLowPassSlowerThanItsMotion) {
  const TorqueTrace out = trace_of_lag(0.3, 1e-2, 25.0);
  EXPECT_FALSE(std::ranges::any_of(out.trace.accepted, [](const TracedEffect& effect) {
    return effect.id.effect == "torque_lag";
  })) << out.trace.reason;
  EXPECT_NE(out.trace.verdict, TraceVerdict::kClean);
}

TEST(TorqueEffects, ALowPassAndADelayStandInOneAnothersPlaceOnly) {
  Rng rng = Rng::from_name("effects", 4);
  const EffectWorld world = effect_world({{"torque_lag", 1, 2, 0.04}}, quiet_world(), rng);
  const TorqueTracedModel model(world.model, exact_samples(world), declared_options());
  for (const char* in : {"torque_delay", "torque_lag"}) {
    const TracedFit fit = model.fit({{{in, "joint2"}, 0.0}});
    for (const char* other : {"torque_delay", "torque_lag"}) {
      EXPECT_EQ(std::ranges::count(fit.candidates, EffectId{other, "joint2"}, &Candidate::id), 0)
          << other << " beside " << in;
      EXPECT_EQ(std::ranges::count(fit.candidates, EffectId{other, "joint1"}, &Candidate::id), 1);
    }
  }
}

TEST(TorqueEffects, ADriftThatGoesOnIsLongerThanTheLog) {
  Rng rng = Rng::from_name("effects", 3);
  const EffectWorld world = effect_world({}, quiet_world(), rng);
  const TorqueTracedModel model(world.model, exact_samples(world), declared_options());
  const TracedFit fit = model.fit({});
  const Candidate& drift = candidate(fit, {"drift", "joint2"});
  ASSERT_TRUE(drift.scan_words);
  EXPECT_EQ(drift.scan_words(drift.scan.back()), "longer than the log");
  EXPECT_EQ(drift.scan_words(1.5), "1.5 s");
}

TEST(TorqueEffects, ALowPassIsPredictedAndTakenOutAgain) {
  Rng rng = Rng::from_name("effects", 5);
  const EffectWorld world = effect_world({{"torque_lag", 0, 1, 0.04}}, quiet_world(), rng);
  const TorqueSamples samples = exact_samples(world);
  const TorqueTrace out = trace_torque(world.model, samples, {.model = declared_options()});
  const TorqueFilter filter = declared_options().filter;
  const Eigen::MatrixXd predicted = predict_torque(out.corrected, samples, filter);
  const TorqueSamples clean = compensate(out.corrected, samples, filter);
  CorrectedTorqueModel without = out.corrected;
  without.effects.clear();
  const Eigen::MatrixXd bodies = predict_torque(without, samples, filter);
  const Eigen::VectorXd lagged = samples.torque.col(0);
  const double before = rms(bodies.col(0) - lagged);
  EXPECT_LT(rms(predicted.col(0) - lagged), 0.1 * before);
  EXPECT_LT(rms(clean.torque.col(0) - bodies.col(0)), 0.2 * before);
}

bool is_of_a_vibration(const Rest& rest) {
  return rest.covariate.starts_with("phase of a vibration");
}

/// Phase of 6 Hz at each sample, rad.
Eigen::ArrayXd six_hertz(const EffectWorld& world) {
  return 2.0 * std::numbers::pi * 6.0 * world.log.t_s.array();
}

/// The torque of joint2 swings with 6 Hz.
EffectWorld shaken_world() {
  Rng rng = Rng::from_name("effects", 6);
  EffectWorldOptions options = quiet_world();
  options.noise = 0.01;
  EffectWorld world = effect_world({}, options, rng);
  world.log.torque.col(1).array() += 0.02 * rms(world.log.torque.col(1)) * six_hertz(world).sin();
  return world;
}

TEST(TorqueEffects, ALineInTheTorqueIsAVibrationOfItsFrequency) {
  const EffectWorld world = shaken_world();
  const TorqueTrace out =
      trace_torque(world.model, exact_samples(world, 12.0), {.model = declared_options(12.0)});
  EXPECT_EQ(out.trace.verdict, TraceVerdict::kUnknown) << out.trace.reason;
  ASSERT_EQ(out.trace.rest.size(), 1U);
  EXPECT_EQ(out.trace.rest.front().place, "joint2");
  EXPECT_EQ(out.trace.rest.front().covariate, "phase of a vibration of 6 Hz");
}

TEST(TorqueEffects, WhatSwingsWithAJointIsNoVibration) {
  const EffectWorld world = shaken_world();
  TorqueSamples samples = exact_samples(world, 12.0);
  samples.ddq.col(2).array() += 0.5 * rms(samples.ddq.col(2)) * six_hertz(world).cos();
  const TorqueTrace out = trace_torque(world.model, samples, {.model = declared_options(12.0)});
  EXPECT_FALSE(std::ranges::any_of(out.trace.rest, is_of_a_vibration)) << out.trace.reason;
}

TEST(TorqueEffects, NoiseOfAnyColourIsNoVibration) {
  for (const double memory : {0.0, 0.5, 0.9, 0.97}) {
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      SCOPED_TRACE(testing::Message() << memory << ", " << seed);
      Rng rng = Rng::from_name("colours", seed);
      EffectWorldOptions options = quiet_world();
      options.noise = 0.01;
      options.noise_memory = memory;
      const EffectWorld world = effect_world({}, options, rng);
      const TorqueTrace out =
          trace_torque(world.model, exact_samples(world, 12.0), {.model = declared_options(12.0)});
      EXPECT_FALSE(std::ranges::any_of(out.trace.rest, is_of_a_vibration)) << out.trace.reason;
    }
  }
}

TEST(TorqueEffects, ACleanLogOfADeclaredRobotIsClean) {
  Rng rng = Rng::from_name("effects", 3);
  EffectWorldOptions options = quiet_world();
  options.noise = 0.01;
  const EffectWorld world = effect_world({}, options, rng);
  TorqueTraceOptions trace;
  trace.model.filter = {LowPass::kSmoothingSpline, 12.0};
  const TorqueTrace out = trace_torque(world.model, exact_samples(world, 12.0), trace);
  EXPECT_EQ(out.base.kind, TorqueBaseKind::kDeclared) << out.base.reason;
  EXPECT_TRUE(out.trace.accepted.empty()) << out.trace.reason;
  EXPECT_TRUE(out.contacts.empty());
}

/// Viscous friction in a short log whose torque noise lasts: significant as a curve over the speed,
/// but not as one of all effects of the library (both seeds: `plain_causes` = 0 leaves the curve).
TEST(TorqueEffects, WhatIsLeftOverTheSpeedIsViscousFrictionWhereThatExplainsIt) {
  struct Weak {
    std::uint64_t seed;
    double strength;
  };
  for (const auto& [seed, strength] : {Weak{23, 0.05}, Weak{7, 0.1}}) {
    Rng rng = Rng::from_name("plain", seed);
    const EffectWorld world = effect_world({{"viscous", 1, 0, strength}},
                                           {.joints = 3,
                                            .prismatic_share = 0.0,
                                            .duration_s = 14.0,
                                            .highest_hz = 0.3,
                                            .noise = 0.03,
                                            .noise_memory = 0.99,
                                            .declared_coulomb = 0.0,
                                            .declared_viscous = 0.0},
                                           rng);
    MotionOptions motion;
    motion.cutoff_hz = tracing_cutoff_hz(derive_motion(world.log).cutoff);
    const Motion derived = derive_motion(world.log, motion);
    TorqueTraceOptions options;
    options.contacts = false;
    options.model.filter = {derived.filter, derived.cutoff.cutoff_hz};
    const Trace trace = trace_torque(world.model, derived.samples, options).trace;
    EXPECT_TRUE(trace.rest.empty()) << seed << ": " << trace.reason;
    ASSERT_EQ(trace.accepted.size(), 1U) << seed << ": " << trace.reason;
    EXPECT_EQ(trace.accepted.front().id, (EffectId{"viscous", "joint2"})) << seed;
    // Noise that is slower than the motion is none that the log could tell from what is lacking.
    EXPECT_TRUE(trace.left_over.front().lasts) << seed << ": " << trace.reason;
    options.trace.plain_causes = 0;
    EXPECT_FALSE(trace_torque(world.model, derived.samples, options).trace.rest.empty())
        << seed << ": no case of it any more";
  }
}

TEST(TorqueEffects, LessFrictionAtLowSpeedIsNoStribeckEffect) {
  Rng rng = Rng::from_name("effects", 12);
  const EffectWorld world = effect_world({}, quiet_world(), rng);
  const TracedFit fit =
      TorqueTracedModel(world.model, exact_samples(world), declared_options()).fit({});
  const Candidate& stribeck = candidate(fit, {"stribeck", "joint2"});
  ASSERT_TRUE(stribeck.possible);
  EXPECT_TRUE(stribeck.possible(Eigen::VectorXd::Constant(1, 0.3)));
  EXPECT_FALSE(stribeck.possible(Eigen::VectorXd::Constant(1, -13.2)));
  EXPECT_FALSE(candidate(fit, {"cubic_viscous", "joint2"}).possible) << "it may be sub-linear";
}

// A step over the position is in no library. A spring and three ripples come near to it.
TEST(TorqueEffects, ASnagIsNoSumOfRipples) {
  for (const std::uint64_t seed : {8044U, 8049U, 8052U}) {
    Rng rng = Rng::from_name("trace_torque", seed);
    const int joint = static_cast<int>(seed % 5);
    const EffectWorld world =
        effect_world({{.effect = "snag", .joint = joint, .strength = 0.15}}, {}, rng);
    MotionOptions motion;
    motion.cutoff_hz = tracing_cutoff_hz(derive_motion(world.log).cutoff);
    const Motion derived = derive_motion(world.log, motion);
    TorqueTraceOptions options;
    options.model.filter = {derived.filter, derived.cutoff.cutoff_hz};
    const Trace trace = trace_torque(world.model, derived.samples, options).trace;
    EXPECT_EQ(trace.verdict, TraceVerdict::kUnknown) << seed << ": " << trace.reason;
    ASSERT_FALSE(trace.rest.empty());
    EXPECT_EQ(trace.rest.front().covariate, "value of joint" + std::to_string(joint + 1));
  }
}

// A joint that rests at first with its bristles relaxed: taken for one that slid on before the log,
// the rest alone contradicted it, and a delay of the torque took its place.
TEST(TorqueEffects, HysteresisOfALogThatBeginsAtRest) {
  constexpr double kRest_s = 2.0;
  constexpr double kLength = 0.004;  // rad
  EffectWorldOptions quiet = quiet_world();
  quiet.declared_coulomb = quiet.declared_viscous = 0.0;
  Rng rng = Rng::from_name("effects", 11);
  EffectWorld world = effect_world({}, quiet, rng);
  TorqueLog& log = world.log;
  const RigidModel rigid = make_rigid_model(world.model);
  for (Eigen::Index t = 0; t < log.rows(); ++t) {
    const double u = std::max(0.0, log.t_s[t] - kRest_s);
    Eigen::VectorXd q(3), dq(3), ddq(3);
    for (Eigen::Index j = 0; j < 3; ++j) {
      const double w = 1.3 + 0.7 * static_cast<double>(j);
      q[j] = 0.3 * (1.0 - std::cos(w * u));
      dq[j] = 0.3 * w * std::sin(w * u);
      ddq[j] = u > 0.0 ? 0.3 * w * w * std::cos(w * u) : 0.0;
    }
    log.q.row(t) = q.transpose();
    log.torque.row(t) = inverse_dynamics(rigid, q, dq, ddq).transpose();
  }
  const double friction = 0.2 * log.torque.col(1).cwiseAbs().maxCoeff();
  double state = 0.0;
  for (Eigen::Index t = 0; t < log.rows(); ++t) {
    const double moved = t > 0 ? log.q(t, 1) - log.q(t - 1, 1) : 0.0;
    if (moved != 0.0)
      state += (1.0 - std::exp(-std::abs(moved) / kLength)) * (std::copysign(1.0, moved) - state);
    log.torque(t, 1) += friction * state;
  }
  for (double& torque : log.torque.reshaped()) torque += rng.normal(1e-3 * friction);
  TorqueTraceOptions options;
  options.contacts = false;
  options.model.filter = {LowPass::kSmoothingSpline, 25.0};
  const Trace trace = trace_torque(world.model, exact_samples(world), options).trace;
  ASSERT_EQ(trace.accepted.size(), 1U) << trace.reason;
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"hysteresis", "joint2"}));
  EXPECT_NEAR(trace.accepted.front().size, friction, 0.02 * friction);
}

// Each joint in turn, the others at rest: before a start and after a stop the low-pass has it creep
// the other way, and no width of friction says what that makes of the torque. It was told as a
// Stribeck excess of six times the friction, or as a curve over speed in place of all friction.
TEST(TorqueEffects, JointsThatMoveInTurnHaveFrictionOnly) {
  constexpr double kMove_s = 1.2, kDwell_s = 0.3, kRamp = 0.25;
  EffectWorldOptions quiet = quiet_world();
  quiet.declared_coulomb = quiet.declared_viscous = 0.0;
  Rng rng = Rng::from_name("effects", 12);
  EffectWorld world = effect_world({}, quiet, rng);
  TorqueLog& log = world.log;
  const RigidModel rigid = make_rigid_model(world.model);
  // Speed as a share of the fastest, smooth at both ends of its ramps.
  const auto ramp = [](double u) {
    return u <= 0.0 ? 0.0 : u >= 1.0 ? 1.0 : u * u * u * (10.0 + u * (6.0 * u - 15.0));
  };
  const auto speed = [&](double u) { return ramp(u / kRamp) * ramp((1.0 - u) / kRamp); };
  const double step_s = log.t_s[1] - log.t_s[0];
  Eigen::VectorXd q = Eigen::VectorXd::Zero(3);
  Eigen::MatrixXd dq = Eigen::MatrixXd::Zero(log.rows(), 3);
  for (Eigen::Index t = 0; t < log.rows(); ++t) {
    const double since = log.t_s[t] - log.t_s[0];
    const auto move = static_cast<int>(since / (kMove_s + kDwell_s));
    const double u = (since - move * (kMove_s + kDwell_s)) / kMove_s;
    dq(t, (move / 2) % 3) = (move % 2 == 0 ? 0.9 : -0.9) * speed(u);
    if (t > 0) q += 0.5 * step_s * (dq.row(t) + dq.row(t - 1)).transpose();
    log.q.row(t) = q.transpose();
  }
  const Eigen::Vector3d coulomb(1.5, 2.0, 0.5), viscous(1.0, 1.5, 0.4);
  for (Eigen::Index t = 0; t < log.rows(); ++t) {
    const Eigen::Index before = std::max<Eigen::Index>(t - 1, 0),
                       after = std::min(t + 1, log.rows() - 1);
    const Eigen::VectorXd ddq = (dq.row(after) - dq.row(before)).transpose() /
                                (step_s * static_cast<double>(after - before));
    const Eigen::VectorXd rate = dq.row(t).transpose();
    log.torque.row(t) = inverse_dynamics(rigid, log.q.row(t).transpose(), rate, ddq).transpose();
    for (Eigen::Index j = 0; j < 3; ++j)
      log.torque(t, j) +=
          coulomb[j] * std::tanh(rate[j] / 0.004) + viscous[j] * rate[j] + rng.normal(0.02);
  }
  for (double& reading : log.q.reshaped()) reading += rng.normal(1e-5);
  TorqueTraceOptions options;
  options.contacts = false;
  options.model.filter = {LowPass::kSmoothingSpline, 10.0};
  MotionOptions motion;
  motion.cutoff_hz = 10.0;
  const Trace trace = trace_torque(world.model, derive_motion(log, motion).samples, options).trace;
  for (const char* joint : {"joint1", "joint2", "joint3"}) {
    for (const char* effect : {"coulomb", "viscous"}) {
      const auto found =
          std::ranges::find(trace.accepted, EffectId{effect, joint}, &TracedEffect::id);
      EXPECT_NE(found, trace.accepted.end()) << effect << " " << joint << " " << trace.reason;
    }
    EXPECT_EQ(std::ranges::find(trace.accepted, EffectId{"stribeck", joint}, &TracedEffect::id),
              trace.accepted.end());
  }
  EXPECT_EQ(trace.accepted.size(), 6U);
}

// Of the samples as they are filtered, with `more` (instants x joints) on top of the torque.
Trace trace_with(const EffectWorld& world, const Eigen::MatrixXd& more, double cutoff_hz) {
  TorqueSamples samples = exact_samples(world, cutoff_hz);
  samples.torque += more;
  TorqueTraceOptions options;
  options.contacts = false;
  options.model = declared_options(cutoff_hz);
  return trace_torque(world.model, samples, options).trace;
}

// Loads are looked for at the last links: no test of the library sees one on another, and what it
// leaves was called noise.
TEST(TorqueEffects, ALoadPickedUpByAMiddleLinkIsNoNoise) {
  constexpr double kCutoff_hz = 12.0;
  Rng rng = Rng::from_name("noise", 1);
  EffectWorldOptions quiet = quiet_world();
  quiet.noise = 0.01;
  const EffectWorld world = effect_world({}, quiet, rng);
  const TorqueSamples samples = exact_samples(world, kCutoff_hz);
  DynamicModel loaded = world.model;
  InertialParameters& middle = loaded.links[loaded.tree.joints[1].child.index()];
  middle = InertialParameters::from_vector(1.5 * middle.vector());
  const auto torque_of = [&](const DynamicModel& model) {
    return inverse_dynamics_of_samples(make_rigid_model(model), samples.q, samples.dq, samples.ddq);
  };
  Eigen::MatrixXd more = torque_of(loaded) - torque_of(world.model);
  more.topRows(more.rows() / 2).setZero();
  const Trace trace = trace_with(world, more, kCutoff_hz);
  EXPECT_EQ(trace.verdict, TraceVerdict::kUnknown) << trace.reason;
  ASSERT_EQ(trace.left_over.size(), 3U);
  EXPECT_TRUE(trace.left_over.front().lasts);
  EXPECT_FALSE(trace.left_over.front().covariate.empty());
  EXPECT_NE(trace.reason.find("times its noise at joint"), std::string::npos) << trace.reason;
}

// White, and as a drive's low-pass of 8 Hz leaves it: the corner lies within the band.
TEST(TorqueEffects, NoiseIsNoiseWhateverItsSizeAndColour) {
  for (const auto& [noise, memory] :
       {std::pair{0.003, 0.0}, {0.03, 0.0}, {0.003, 0.8}, {0.03, 0.8}}) {
    SCOPED_TRACE(testing::Message() << noise << " " << memory);
    Rng rng = Rng::from_name("noise", 2);
    EffectWorldOptions quiet = quiet_world();
    quiet.noise = noise;
    quiet.noise_memory = memory;
    const EffectWorld world = effect_world({}, quiet, rng);
    const Trace trace =
        trace_with(world, Eigen::MatrixXd::Zero(world.log.rows(), world.log.q.cols()), 12.0);
    EXPECT_NE(trace.verdict, TraceVerdict::kUnknown) << trace.reason;
    ASSERT_EQ(trace.left_over.size(), 3U);
    EXPECT_FALSE(trace.left_over.front().lasts);
    EXPECT_GT(trace.left_over.back().times, 0.4) << "the noise itself is there";
    EXPECT_LT(trace.left_over.front().times, 1.2);
  }
}

// The rounding of a torque lasts as long as it stays on one step.
TEST(TorqueEffects, StepsOfTheLoggedTorqueAreNoise) {
  constexpr double kStep = 1.0;  // N m
  Rng rng = Rng::from_name("noise", 2);
  EffectWorldOptions quiet = quiet_world();
  quiet.noise = 0.01;
  EffectWorld world = effect_world({}, quiet, rng);
  world.log.torque = (world.log.torque.array() / kStep).round() * kStep;
  const TorqueSamples samples = exact_samples(world, 12.0);
  ASSERT_EQ(samples.torque_step.size(), 3);
  EXPECT_NEAR(samples.torque_step.minCoeff(), kStep, 1e-9);
  EXPECT_NEAR(samples.torque_step.maxCoeff(), kStep, 1e-9);
  TorqueTraceOptions options;
  options.contacts = false;
  options.model = declared_options(12.0);
  const auto most_left = [&](const TorqueSamples& of) {
    return trace_torque(world.model, of, options).trace.left_over.front();
  };
  const LeftOver known = most_left(samples);
  EXPECT_FALSE(known.lasts) << known.times;
  TorqueSamples not_known = samples;
  not_known.torque_step.resize(0);
  EXPECT_GT(most_left(not_known).times, 1.3 * known.times);
}

TEST(TorqueEffects, NoRotorHasLessThanNoInertia) {
  constexpr double kDeclared = 0.2;
  Rng rng = Rng::from_name("effects", 13);
  EffectWorld world = effect_world({}, quiet_world(), rng);
  for (JointDynamics& joint : world.model.joints) joint.motor_inertia = kDeclared;
  for (const TorqueBaseKind base : {TorqueBaseKind::kDeclared, TorqueBaseKind::kIdentified}) {
    TracedTorqueOptions options = declared_options();
    options.base = base;
    const TracedFit fit = TorqueTracedModel(world.model, exact_samples(world), options).fit({});
    const Candidate& rotor = candidate(fit, {"motor_inertia", "joint2"});
    ASSERT_TRUE(rotor.possible);
    const bool declared = base == TorqueBaseKind::kDeclared;
    EXPECT_TRUE(rotor.possible(Eigen::VectorXd::Constant(1, 0.1)));
    EXPECT_EQ(rotor.possible(Eigen::VectorXd::Constant(1, -0.1)), declared);
    EXPECT_FALSE(rotor.possible(Eigen::VectorXd::Constant(1, -1.01 * kDeclared)));
  }
}

// Through a low-pass that is slow beside the reversals no instant shows friction at rest.
TEST(TorqueEffects, StribeckIsLookedForWhereTheLogShowsHalfOfIt) {
  constexpr double kLeastShown = 0.4;  // a half, at another width of the turn
  Rng rng = Rng::from_name("effects", 14);
  const EffectWorld world = effect_world({}, quiet_world(), rng);
  std::size_t before = 100;
  for (const double cutoff_hz : {25.0, 3.0}) {
    const TorqueTracedModel model(world.model, exact_samples(world, cutoff_hz),
                                  declared_options(cutoff_hz));
    const TracedFit fit = model.fit({});
    const Candidate& stribeck = candidate(fit, {"stribeck", "joint2"});
    ASSERT_TRUE(stribeck.floor_at);
    std::size_t shown = 0;
    for (const double speed : stribeck.scan) {
      if (std::isinf(stribeck.floor_at(speed))) continue;
      ++shown;
      EXPECT_GT(stribeck.columns(speed).front().share.cwiseAbs().maxCoeff(), kLeastShown)
          << cutoff_hz << " " << speed;
    }
    EXPECT_LT(shown, before);
    before = shown;
  }
}

// One link is a tenth heavier than declared: gains, springs and a payload explain most of that, and
// pass.
TEST(TorqueEffects, AWrongMassIsNoGain) {
  Rng rng = Rng::from_name("effects", 21);
  EffectWorldOptions quiet = quiet_world();
  quiet.joints = 5;
  quiet.noise = 0.02;
  EffectWorld world = effect_world({}, quiet, rng);
  const LinkId link = world.model.tree.joints[2].child;
  InertialParameters& own = world.model.links[link.index()];
  own = InertialParameters::from_vector(0.9 * own.vector());
  TorqueTraceOptions options;
  options.contacts = false;
  options.model.filter = {LowPass::kSmoothingSpline, 25.0};
  const TorqueTrace found = trace_torque(world.model, exact_samples(world), options);
  EXPECT_EQ(found.base.kind, TorqueBaseKind::kIdentified) << found.base.reason;
  // Before any effect is found it is not clear.
  EXPECT_NE(found.base.reason.find("with the effects that were found"), std::string::npos)
      << found.base.reason;
  for (const TracedEffect& effect : found.trace.accepted) {
    EXPECT_NE(effect.id.effect, "torque_gain") << effect.id.place;
    EXPECT_NE(effect.id.effect, "payload") << effect.id.place;
  }
}

// Of one joint, a gain and all masses scaled alike are the same torque; friction is known as well
// as which of them it is.
TEST(TorqueEffects, AGainThatMayBeTheMassesIsOneOfTwo) {
  EffectWorldOptions options = quiet_world();
  options.joints = 1;
  const auto traced = [&](double declared) {
    Rng rng = Rng::from_name("effects", 22);
    EffectWorld world =
        effect_world({{"coulomb", 0, 0, 0.2}, {"viscous", 0, 0, 0.2}}, options, rng);
    for (InertialParameters& link : world.model.links)
      link = InertialParameters::from_vector(declared * link.vector());
    TorqueTraceOptions trace;
    trace.contacts = false;
    trace.model.filter = declared_options().filter;
    return trace_torque(world.model, exact_samples(world), trace).trace;
  };
  const Trace right = traced(1.0);
  EXPECT_EQ(right.verdict, TraceVerdict::kEffects) << right.reason;
  const Trace wrong = traced(0.8);
  EXPECT_EQ(wrong.verdict, TraceVerdict::kAmbiguous) << wrong.reason;
  ASSERT_EQ(wrong.ambiguities.size(), 1U);
  const std::vector<EffectId>& either = wrong.ambiguities.front().effects;
  EXPECT_EQ(either.front().effect, "torque_gain");
  EXPECT_EQ(either.back(), (EffectId{"masses", "links"}));
  // What is known stands before what is not.
  EXPECT_LT(wrong.reason.find("coulomb at joint1"), wrong.reason.find("cannot tell"))
      << wrong.reason;
  for (const TracedEffect& truth : right.accepted) {
    const auto found = std::ranges::find(wrong.accepted, truth.id, &TracedEffect::id);
    ASSERT_NE(found, wrong.accepted.end()) << truth.id.effect;
    EXPECT_LE(found->interval.low, truth.size) << truth.id.effect;
    EXPECT_GE(found->interval.high, truth.size) << truth.id.effect;
    EXPECT_GT(found->interval.high, 1.15 * found->interval.low) << truth.id.effect;
  }
}

TEST(TorqueEffects, MassesThatAreWrongAreNotTrusted) {
  Rng rng = Rng::from_name("effects", 4);
  EffectWorld world = effect_world({}, quiet_world(), rng);
  // Not by one factor: that would be what gains of all sensors do.
  double factor = 0.5;
  for (InertialParameters& link : world.model.links) {
    link = InertialParameters::from_vector(factor * link.vector());
    factor += 0.5;
  }
  TracedTorqueOptions options = declared_options();
  options.base = TorqueBaseKind::kAuto;
  const TorqueTracedModel model(world.model, exact_samples(world), options);
  EXPECT_EQ(model.base().kind, TorqueBaseKind::kIdentified) << model.base().reason;
}

// The load that rubs is that of the masses that are found, whatever was declared.
TEST(TorqueEffects, LoadFrictionIsAShareOfTheLoadThatIsFound) {
  constexpr double kTruth = 0.1;
  constexpr double kSigmas = 4.0;  // of two shares in eight logs: p = 0.001
  EffectWorldOptions options = quiet_world();
  options.noise = 0.01;
  for (const double declared : {0.0, 0.7, 1.0, 1.4}) {
    for (const std::uint64_t seed : {41U, 42U}) {
      SCOPED_TRACE(testing::Message() << declared << " of the masses, log " << seed);
      Rng rng = Rng::from_name("load", seed);
      EffectWorld world = effect_world(
          {{"load_friction", 1, 0, kTruth}, {"load_friction", 2, 0, kTruth}}, options, rng);
      for (InertialParameters& link : world.model.links)
        link = InertialParameters::from_vector(declared * link.vector());
      TracedTorqueOptions traced = declared_options();
      traced.base = TorqueBaseKind::kIdentified;
      const TorqueTracedModel model(world.model, exact_samples(world), traced);
      std::vector<AddedEffect> added;
      for (const char* joint : {"joint1", "joint2", "joint3"})
        for (const char* effect : {"coulomb", "viscous"}) added.push_back({{effect, joint}, 0.0});
      for (const char* joint : {"joint2", "joint3"})
        added.push_back({{"load_friction", joint}, 0.0});
      const TracedFit fit = model.fit(added);
      ASSERT_TRUE(fit.converged) << fit.reason;
      const Eigen::MatrixXd H =
          fit.linear.jacobian.transpose() * fit.linear.jacobian + fit.linear.prior;
      const Eigen::VectorXd variance = H.inverse().diagonal().tail(2);
      for (Eigen::Index k = 0; k < 2; ++k) {
        const double share = fit.values[fit.values.size() - 2 + static_cast<std::size_t>(k)][0];
        EXPECT_NEAR(share, kTruth, kSigmas * std::sqrt(variance[k]));
      }
    }
  }
}

// A drive whose gain is wrong says another mass than the others do: how well all of them are known
// together is then no matter of noise.
TEST(TorqueEffects, JointsThatDisagreeAboutAPayloadWidenItsInterval) {
  const auto payload_of = [](const std::vector<TrueEffect>& effects) {
    Rng rng = Rng::from_name("disagreement", 4);
    const EffectWorld world = effect_world(effects, quiet_world(), rng);
    TorqueTraceOptions options;
    options.model = declared_options();
    const TorqueTrace out = trace_torque(world.model, exact_samples(world), options);
    const auto found = std::ranges::find_if(
        out.trace.accepted, [](const TracedEffect& e) { return e.id.effect == "payload"; });
    EXPECT_NE(found, out.trace.accepted.end());
    return found == out.trace.accepted.end() ? TracedEffect{} : *found;
  };
  const TracedEffect alone = payload_of({{"payload", 2, 0, 0.3}});
  const TracedEffect beside = payload_of({{"payload", 2, 0, 0.3}, {"torque_gain", 0, 0, 0.1}});
  const auto width = [](const TracedEffect& e) {
    return (e.interval.high - e.interval.low) / e.size;
  };
  EXPECT_LT(width(alone), 0.05);
  // What one joint feels of it, over what that depends on.
  EXPECT_NE(alone.picture.covariate, "time");
  EXPECT_EQ(alone.picture.unit, "N m");
  EXPECT_GT(rms(alone.picture.before), 10.0 * rms(alone.picture.after));
  EXPECT_GT(width(beside), 3.0 * width(alone));
}

// A hinge says nothing of a mass on its axis: 0 kg would be no size.
TEST(TorqueEffects, APayloadOfAHingeIsItsFirstMoment) {
  Rng rng = Rng::from_name("effects", 7);
  EffectWorldOptions options = quiet_world();
  options.joints = 1;
  const EffectWorld world = effect_world({{"payload", 0, 0, 0.3}}, options, rng);
  const TorqueTracedModel model(world.model, exact_samples(world), declared_options());
  const EffectId id{"payload", world.effects.front().place};
  const Candidate known = candidate(model.fit({}), id);
  EXPECT_EQ(known.size_unit, "kg m");
  const TracedFit with = model.fit({{id, 0.0}});
  const Eigen::Vector3d axis = make_rigid_model(world.model).bodies.front().axis;
  const Eigen::Vector3d centre(0.03, -0.02, 0.06);
  const double truth = world.effects.front().size * (centre - axis * axis.dot(centre)).norm();
  const Eigen::VectorXd& values = with.values.front();
  EXPECT_NEAR(std::sqrt(known.size_weights.dot(values.cwiseAbs2())), truth, 0.02 * truth);
}

// Neither is it a payload of the whole log, nor masses, nor a contact that is left out.
TEST(TorqueEffects, ALoadThatIsPickedUpIsKnownWithItsInstant) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    SCOPED_TRACE(seed);
    Rng rng = Rng::from_name("picked up", seed);
    EffectWorldOptions options = quiet_world();
    options.noise = 0.01;
    const EffectWorld world = effect_world({{"payload_change", 0, 0, 0.3}}, options, rng);
    const TorqueSamples samples = exact_samples(world, 12.0);
    TorqueTraceOptions trace;
    trace.model.filter = {LowPass::kSmoothingSpline, 12.0};
    const TorqueTrace out = trace_torque(world.model, samples, trace);
    ASSERT_EQ(out.trace.accepted.size(), 1U) << out.trace.reason;
    const TracedEffect& load = out.trace.accepted.front();
    EXPECT_EQ(load.id, (EffectId{"payload_change", world.effects.front().place}));
    EXPECT_NEAR(load.scan, 0.4 * options.duration_s, 0.1);
    EXPECT_LE(load.interval.low, world.effects.front().size);
    EXPECT_GE(load.interval.high, world.effects.front().size);
    EXPECT_LT(load.held_out_after.value, 0.3 * load.held_out_before.value);
    EXPECT_TRUE(out.contacts.empty());
    // The robot that is written is the one that the log began with.
    EXPECT_EQ(out.corrected.in_model, std::vector<char>{0});
    EXPECT_EQ(out.corrected.model.links.back().mass_kg, world.model.links.back().mass_kg);
  }
}

TEST(TorqueEffects, FoundFrictionGoesIntoTheModelAndOutOfTheLog) {
  Rng rng = Rng::from_name("effects", 5);
  EffectWorldOptions options = quiet_world();
  options.noise = 0.005;
  const EffectWorld world =
      effect_world({{"coulomb", 1, 0, 0.2}, {"viscous", 1, 0, 0.2}}, options, rng);
  TorqueTraceOptions trace;
  trace.model.filter = {LowPass::kSmoothingSpline, 12.0};
  const TorqueSamples samples = exact_samples(world, 12.0);
  const TorqueTrace out = trace_torque(world.model, samples, trace);
  ASSERT_EQ(out.trace.accepted.size(), 2U) << out.trace.reason;
  const auto joint = moving_joints(world.model.tree)[1].index();
  double coulomb = 0.0;
  for (const KnownEffect& effect : world.effects) {
    if (effect.effect == "coulomb") coulomb = effect.size;
  }
  EXPECT_NEAR(out.corrected.model.joints[joint].coulomb,
              world.model.joints[joint].coulomb + coulomb, kSizeTolerance * coulomb);
  // What is left of the friction is far below what it was, between the ends of the log.
  const TorqueSamples clean = compensate(out.corrected, samples, trace.model.filter);
  const Eigen::MatrixXd rigid = inverse_dynamics_of_samples(make_rigid_model(world.model),
                                                            samples.q, samples.dq, samples.ddq);
  const double declared = world.model.joints[joint].coulomb;
  const Eigen::Index middle = samples.size() / 2;
  const Eigen::VectorXd left = (clean.torque.col(1) - rigid.col(1)).segment(middle / 2, middle);
  EXPECT_LT(rms(left), 1.5 * (declared + world.model.joints[joint].viscous *
                                             rms(samples.dq.col(1).segment(middle / 2, middle))));
  const Eigen::MatrixXd predicted = predict_torque(out.corrected, samples, trace.model.filter);
  const Eigen::VectorXd error =
      (samples.torque.col(1) - predicted.col(1)).segment(middle / 2, middle);
  EXPECT_LT(rms(error), 0.05 * coulomb);
}

TEST(TorqueEffects, IdentifiedMassesPredictWhatWasFitted) {
  Rng rng = Rng::from_name("effects", 10);
  EffectWorldOptions options = quiet_world();
  options.noise = 0.005;
  EffectWorld world = effect_world({}, options, rng);
  // A motor that the model declares: the fit of identified masses finds its own drives.
  for (JointDynamics& joint : world.model.joints) joint.motor_inertia = 1.0;
  TracedTorqueOptions traced;
  traced.base = TorqueBaseKind::kIdentified;
  const TorqueSamples samples = exact_samples(world);
  const TorqueTracedModel model(world.model, samples, traced);
  const Eigen::MatrixXd left = model.residual_torque(model.fit({}));
  CorrectedTorqueModel found;
  found.model = world.model;
  found.base = model.fitted({});
  found.travels = model.context().travels;
  found.log = model.context().log;
  const Eigen::MatrixXd predicted = model.motion().rows_at_instants(predict_torque(found, samples));
  const Eigen::MatrixXd fitted = model.motion().rows_at_instants(samples.torque) - left;
  constexpr double kShare = 1e-6;  // of the torque: normal equations
  EXPECT_LT((predicted - fitted).norm(), kShare * fitted.norm());
}

TEST(TorqueEffects, TorquesThatWereNotMeasuredDoNotCount) {
  Rng rng = Rng::from_name("effects", 15);
  const EffectWorld world = effect_world({{"coulomb", 1, 0, 0.2}}, quiet_world(), rng);
  const TorqueSamples sound = exact_samples(world);
  TorqueSamples broken = sound;
  const Eigen::Index from = sound.size() / 3;
  const Eigen::Index rows = sound.size() / 5;
  broken.torque.col(1).segment(from, rows).setConstant(100.0 * sound.torque.cwiseAbs().maxCoeff());
  broken.torque_missing = MissingTorque::Constant(sound.size(), sound.joints(), false);
  broken.torque_missing.col(1).segment(from, rows).setConstant(true);
  const auto coulomb = [&](const TorqueSamples& samples) {
    const TorqueTracedModel model(world.model, samples, declared_options());
    for (const Eigen::Index row : model.motion().kept()) EXPECT_TRUE(samples.is_measured(row));
    return model.fit({{{"coulomb", "joint2"}, 0.0}}).values.front()[0];
  };
  EXPECT_NEAR(coulomb(broken), coulomb(sound), 0.01 * coulomb(sound));
}

TEST(TorqueEffects, RepeatsOfAPathAreHeldOutTogether) {
  Rng rng = Rng::from_name("effects", 11);
  EffectWorldOptions options = quiet_world();
  options.noise = 0.005;
  const EffectWorld world = effect_world({}, options, rng);
  const TorqueSamples once = exact_samples(world);
  const Eigen::Index n = once.size();
  std::vector<Eigen::Index> rows;
  for (int k = 0; k < 2; ++k) {
    for (Eigen::Index row = 0; row < n; ++row) rows.push_back(row);
  }
  TorqueSamples twice = select_rows(once, rows);
  twice.trajectory.tail(n).setConstant(twice.trajectory[n - 1] + 1);
  const TorqueTracedModel model(world.model, twice);
  const TracedFit fit = model.fit({});
  // Instants of the two with the same posture are never in two folds.
  std::map<Eigen::Index, int> fold_at;
  for (std::size_t i = 0; i < model.motion().kept().size(); ++i) {
    const Eigen::Index phase = model.motion().kept()[i] % n;
    const auto [place, first] = fold_at.emplace(phase, fit.linear.fold[i]);
    EXPECT_TRUE(first || place->second == fit.linear.fold[i]) << phase;
  }
  EXPECT_LT(fold_at.size(), model.motion().kept().size());
}

TEST(TorqueEffects, APushIsFoundAndLeftOut) {
  Rng rng = Rng::from_name("effects", 6);
  EffectWorldOptions options = quiet_world();
  options.noise = 0.01;
  const EffectWorld world = effect_world({{"contact", 1, 0, 0.5}}, options, rng);
  TorqueTraceOptions trace;
  trace.model.filter = {LowPass::kSmoothingSpline, 12.0};
  const TorqueTrace out = trace_torque(world.model, exact_samples(world, 12.0), trace);
  std::string steps;
  for (const TraceStep& step : out.trace.steps) steps += step.words + "; ";
  ASSERT_EQ(out.contacts.size(), 1U) << out.trace.reason << ": " << steps;
  const double begin = 0.6 * options.duration_s;
  constexpr double kSmear_s = 0.15;
  EXPECT_NEAR(out.contacts.front().from_s, begin, kSmear_s);
  EXPECT_NEAR(out.contacts.front().to_s, begin + 0.4, kSmear_s);
  ASSERT_EQ(out.trace.accepted.size(), 1U);
  EXPECT_EQ(out.trace.accepted.front().id.effect, "contact");
}

TEST(ContactSpans, LieInOneTrajectoryOnItsOwnClock) {
  constexpr Eigen::Index kRows = 400;  // of each of two trajectories, 0.01 s apart
  TorqueSamples samples;
  samples.t_s.resize(2 * kRows);
  samples.trajectory.resize(2 * kRows);
  for (Eigen::Index i = 0; i < 2 * kRows; ++i) {
    samples.t_s[i] = 5.0 + 0.01 * static_cast<double>(i % kRows);
    samples.trajectory[i] = i < kRows ? 0 : 1;
  }
  samples.q = samples.dq = samples.ddq = samples.torque = Eigen::MatrixXd::Zero(2 * kRows, 1);
  const EffectMotion motion(samples, {.every_sample = true});
  Rng rng = Rng::from_name("effects", 9);
  Eigen::MatrixXd whitened(2 * kRows, 1);
  for (Eigen::Index i = 0; i < 2 * kRows; ++i) whitened(i, 0) = rng.normal();
  // One push in the second trajectory, and one that ends the first as another begins the second.
  whitened.middleRows(kRows + 200, 30).array() += 60.0;
  whitened.middleRows(kRows - 20, 40).array() += 60.0;
  const auto spans = find_contact_spans(motion, whitened, Eigen::VectorXd::Ones(1));
  ASSERT_EQ(spans.size(), 3U);
  EXPECT_EQ(spans[0].to.trajectory, 0);
  EXPECT_EQ(spans[1].from.trajectory, 1);
  EXPECT_NEAR(spans[1].from.t_s, 5.0, 1e-9);
  constexpr double kWindow_s = 0.1;
  EXPECT_EQ(spans[2].to.trajectory, 1);
  EXPECT_NEAR(spans[2].from.t_s, 7.0, kWindow_s);
  EXPECT_NEAR(spans[2].to.t_s, 7.3, kWindow_s);
}

TEST(TorqueEffects, LogsThatDoNotFitAreRefused) {
  Rng rng = Rng::from_name("effects", 8);
  const EffectWorld world = effect_world({}, quiet_world(), rng);
  TorqueSamples samples = exact_samples(world);
  samples.q.conservativeResize(Eigen::NoChange, 2);
  EXPECT_THROW(TorqueTracedModel(world.model, samples, {}), Error);
}

}  // namespace
}  // namespace kinescope
