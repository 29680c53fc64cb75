// SPDX-License-Identifier: Apache-2.0
//
// All products of one torque log, gathered for its report.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/run_summary.h"
#include "dynamics/data/torque_data.h"
#include "dynamics/identify/consistent_model.h"
#include "dynamics/identify/payload.h"
#include "dynamics/identify/robust_torque.h"
#include "dynamics/models/comparison.h"
#include "dynamics/simulation/rollout.h"

namespace kinescope {

struct LearningCurve {
  TorqueModelKind kind = TorqueModelKind::kParametric;
  std::vector<LearningPoint> points;
};

/// What a joint's drive is found to take, in the torque's unit per SI.
struct DriveEstimate {
  std::string term;  ///< "viscous", "coulomb", "offset", "motor inertia"
  std::string joint;
  double value = 0.0;
  double sigma = 0.0;  ///< infinite where it cannot be told from other terms
};

/// What the learned torque of a joint consists of, root mean square over the samples.
struct TorquePart {
  double friction_rms = 0.0;
  double gravity_rms = 0.0;
  double inertia_rms = 0.0;
  std::vector<FrictionBin> profile;  ///< of the friction part
};

struct RobustSummary {
  std::vector<TorqueScore> scores;  ///< one a RobustMethod, on `test`; their `kind` says nothing
  std::vector<RobustJoint> joints;
  int folds = 0;
  bool by_trajectory = false;
  std::vector<TorquePart> parts;  ///< one a joint
};

struct PayloadSummary {
  std::string against;  ///< in words: the URDF's masses, or a log
  PayloadEstimate motion;
  std::optional<PayloadEstimate> at_rest;
  bool by_gains = false;  ///< torques are currents times declared gains: the mass scales with them
};

/// The traced model forward in time, on `test`.
struct RolloutSummary {
  Rollout found;
  bool seen_by_trace = false;  ///< tracing learned from this part of the log, too
};

struct TorqueSummary {
  std::string robot;
  std::string log;      ///< what was learned from, in words
  std::string version;  ///< of the program
  std::string command;  ///< how to reproduce
  std::vector<InputFile> inputs;
  std::vector<StageTime> times;

  std::vector<std::string> joints;
  std::vector<JointType> types;  ///< beside joints
  Eigen::Vector3d gravity_m_s2 = Eigen::Vector3d::Zero();
  bool gravity_declared = false;  ///< else down along z, or what the torques say
  /// Down along z, where the torques contradicted it before anything was fitted.
  std::optional<Eigen::Vector3d> default_gravity_m_s2;
  /// As tracing found it, where it found another one.
  std::optional<Eigen::Vector3d> traced_gravity_m_s2;
  bool has_traced_robot = false;  ///< robot_traced.urdf was written
  TorqueData data;    ///< of the log learned from; its samples are `train` and, without a log of
                      ///< its own, `test`
  std::string split;  ///< in words: what was held out
  /// Held out by lot: neighbours of every test sample were learned from.
  bool split_at_random = false;
  /// Where the motion of `test` leaves that of `train`, a sentence each (motion_words.h).
  std::vector<std::string> new_motion;
  TorqueSamples train;
  TorqueSamples test;

  std::vector<TorqueScore> scores;  ///< on `test`
  std::vector<LearningCurve> learning;
  Identification identification;  ///< on `train`
  ConsistentModel consistent;
  std::vector<DriveEstimate> drives;
  std::optional<RobustSummary> robust;    ///< none where it was not asked for
  std::optional<PayloadSummary> payload;  ///< none where it was not asked for
  int best = 0;                           ///< index into scores: what `prediction` is from
  TorquePrediction prediction;            ///< of `test`
  BandFactors bands;                      ///< of that model
  std::optional<Trace> trace;             ///< none where it was not asked for
  std::optional<RolloutSummary> rollout;  ///< none without a trace
  std::string saved_model;                ///< which one a file was written of; empty: none
  std::vector<std::string> warnings;
};

/// Mean over the joints whose torque varies; NaN where none does.
[[nodiscard]] double mean_nmse_percent(const TorqueScore& score);

/// dynamics.json: schema "kinescope.dynamics". Arrays beside `joints` hold one entry a joint.
/// Numbers that are not known are null. Torques in `unit`, everything else SI.
///
///   robot, version, unit, joints [name, type], gravity_m_s2, gravity_declared,
///   traced_gravity_m_s2 (null: as declared)
///   data      rows_read, rows_used, log_rate_hz, rate_hz, filter, source, cutoff_hz, training,
///             test, split, split_at_random, new_motion, inputs [name, sha256], findings [fault,
///             weight, channel, share, value, place, what, remedy]
///   models    [model, samples, inducing_points, nmse_percent, left_out_nmse_percent, rms,
///             coverage_90, coverage_95, extrapolated, band_residuals, bands_by_trajectory,
///             plainer_joints, constant_joints, failure]
///   best      name of the model with the smallest mean left_out_nmse_percent; null where it
///             predicts a joint of the test worse than a constant
///   learning  [model, points [samples, nmse_percent]]
///   parameters [name, value, sigma, sigma_white]; noise_sigma; correlation_samples
///   drives    [term, joint, value, sigma]
///   robust    null, or folds, by_trajectory, methods [method, nmse_percent, rms, coverage_90,
///             coverage_95], joints [bandwidth (q, dq, ddq in standard deviations), beyond, noise,
///             unseen_rms, down_weighted, friction_rms, gravity_rms, inertia_rms,
///             profile [velocity, friction, spread, samples]]
///   payload   null, or against, by_gains, link, motion and at_rest {mass_kg, sigma_kg, lower_kg,
///             upper_kg (95 %), freedom, centre_m, centre_sigma_m, disagreement,
///             joints [joint, mass_kg, sigma_kg]}
///   rollout   null, or tip, seen_by_trace, failure, horizons [horizon_s, windows, with_effects,
///             without_effects, held {joints (rad or m), tool_m}]: medians at the windows' ends
///   consistent  links [name, mass_kg, first_moment_kg_m, inertia_kg_m2 (Ixx Ixy Ixz Iyy Iyz Izz)],
///             joints [viscous, coulomb, motor_inertia], misfit
[[nodiscard]] nlohmann::json torque_json(const TorqueSummary& summary);

/// The sentences that a torque report opens with: how well, what limits it, what to record next.
struct TorqueVerdict {
  std::string found;
  std::string accurate;
  std::string limits;
  std::string payload;  ///< what it carries; empty where it was not asked for
  std::string rollout;  ///< how far the traced model gets by itself; empty without a trace
  std::string gravity;  ///< where it was taken to point and nobody said so; empty where declared
};
[[nodiscard]] TorqueVerdict torque_verdict(const TorqueSummary& summary);

/// What the numbers of a table of models do not say, a sentence each: that a split by lot flatters,
/// which samples chose the model to rely on, where the test's motion is new, who is worse than a
/// constant, who gave way to one or to the parametric model.
[[nodiscard]] std::vector<std::string> model_notes(const TorqueSummary& summary);

/// One self-contained page. Pure: the same summary gives the same bytes.
[[nodiscard]] std::string torque_report_html(const TorqueSummary& summary);

}  // namespace kinescope
