// SPDX-License-Identifier: Apache-2.0
//
// Takes   options of the simulated arm, and a seed.
// Gives   what Dang's report on a Barrett WAM shows for joint 4, on an arm whose truth is known.
// Units   rad, s, N m, kg.
// Method  Gaussian processes of (q, dq, ddq) of one joint while all others are held: trimmed and
//         Student's t (dynamics/gp/robust.h), cross-validation over a grid, support vectors.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dynamics/data/torque_samples.h"
#include "kinematics/core/progress.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope::experiments {

/// Seven joints with the geometry of Barrett's WAM (its manual's table); masses of about its size,
/// made up, and the force sensor at the wrist.
[[nodiscard]] DynamicModel wam_arm(double sensor_kg);
/// Of the sensor in the last link's frame, m; declared, as from a drawing.
[[nodiscard]] Eigen::Vector3d wam_sensor_centre();

struct BarrettOptions {
  int samples = 600;  ///< over all motions, to learn from
  double sensor_kg = 0.254;
  double noise_nm = 0.05;
  double outlier_share = 0.05;  ///< torques that are off by up to `outlier_nm`
  double outlier_nm = 4.0;
  double coulomb_nm = 0.6;
  double viscous_nms = 0.25;
  double breakaway_nm = 0.3;  ///< beyond Coulomb friction, at low speed (Stribeck)
  double stribeck_rad_s = 0.1;
  std::uint64_t seed = 1;
};

/// q4 = C1 + C2 sin(w t), all other joints held, at several C2 and w.
struct WamMotion {
  double middle_rad, amplitude_rad, rate_rad_s;
};
[[nodiscard]] const std::vector<WamMotion>& wam_motions();

inline constexpr Eigen::Index kWamJoint = 3;     ///< the one that moves
inline constexpr double kWamShoulder_rad = 0.6;  ///< joint 2; the others are held at 0

[[nodiscard]] double wam_friction(double dq, const BarrettOptions& options);
/// Torque of joint 4 without friction, N m.
[[nodiscard]] Eigen::VectorXd wam_torque(const DynamicModel& arm, const Eigen::VectorXd& q,
                                         const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq);

/// Joint 4 alone: one column. A trajectory each motion.
struct BarrettLog {
  TorqueSamples measured;
  Eigen::VectorXd clean;   ///< torque without noise and outliers
  std::vector<int> wrong;  ///< rows that are outliers
};
[[nodiscard]] BarrettLog barrett_log(const std::vector<WamMotion>& motions, int samples,
                                     const BarrettOptions& options);

/// One way to learn, judged in the sample, left out, and against the truth of another motion.
struct BarrettFit {
  std::string name;
  double in_sample_rms = 0.0;  ///< of what it was fitted to
  double left_out_rms = 0.0;   ///< leave-one-out, of the same samples; NaN: not known
  double unseen_rms = 0.0;     ///< against the clean torque of a motion that was not learned
  int samples = 0;
  Eigen::VectorXd at_log;  ///< mean at the log's samples
};

/// A place of the grid: length scales in standard deviations of the signals, and the noise's share
/// of the spread.
struct GridPoint {
  double length = 0.0;  ///< of position and acceleration
  double speed = 0.0;   ///< of the velocity, in which friction jumps
  double noise = 0.0;
  double chunk_rms = 0.0;  ///< left out in ten random chunks
  double block_rms = 0.0;  ///< left out in ten blocks of consecutive samples
};

struct GridChoice {
  GridPoint point;
  double claimed_rms = 0.0;  ///< by its own cross-validation
  double unseen_rms = 0.0;   ///< against the clean torque of the unseen motion
};

struct FrictionPoint {
  double dq = 0.0;
  double friction = 0.0;  ///< (F(q, dq) - F(q, -dq)) / 2 at the middle and zero acceleration
  double truth = 0.0;
};

struct GravityPoint {
  double q = 0.0;
  double even = 0.0;  ///< F_m(q) = (F(q, dq) + F(q, -dq)) / 2 at zero acceleration
  double truth = 0.0;
  double without_sensor = 0.0;  ///< of the model that the arm is believed to be
};

struct SensorMass {
  double kg = 0.0;
  double sigma_kg = 0.0;
  double lower_kg = 0.0;  ///< 95 %
  double upper_kg = 0.0;
};

struct BarrettResult {
  BarrettLog log;
  std::vector<BarrettFit> fits;  ///< all, trimmed, student, support vectors
  std::vector<GridPoint> grid;
  GridChoice by_chunks;
  GridChoice by_blocks;
  std::vector<FrictionPoint> friction;
  double gravity_dq = 0.0;  ///< the fixed velocity of F_m
  std::vector<GravityPoint> gravity;
  SensorMass sensor;
  int removed_wrong = 0;  ///< of the tenth that was taken out, those that are outliers
  int removed = 0;
};

[[nodiscard]] BarrettResult run_barrett(const BarrettOptions& options, int threads,
                                        const Progress& progress = {});

}  // namespace kinescope::experiments
